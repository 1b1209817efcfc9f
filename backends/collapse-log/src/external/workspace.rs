use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// What the writer of a backend may take, for a log that may be larger than memory.
#[derive(Clone, Debug)]
pub struct Workspace<'a> {
    /// Where temporary files are made.
    pub folder: PathBuf,
    /// Bytes of memory, for everything that grows with the mesh. What a writer needs beside it, it says.
    pub memory: u64,
    /// Set by whoever wants it to end: the writer fails soon afterwards, and leaves nothing behind.
    pub stop: &'a AtomicBool,
}

impl<'a> Workspace<'a> {
    /// As much memory as serves, and temporary files beside `output`.
    #[must_use]
    pub fn beside(output: &Path, stop: &'a AtomicBool) -> Self {
        let folder = container::output::folder_of(output);
        Self { folder: folder.to_owned(), memory: u64::MAX, stop }
    }

    /// What to say where a temporary file has failed: that somebody wanted the work to stop, if so.
    #[must_use]
    pub fn error(&self, source: io::Error) -> WorkspaceError {
        if self.stop.load(Ordering::Relaxed) {
            WorkspaceError::Interrupted
        } else {
            WorkspaceError::Temporary { folder: self.folder.clone(), source }
        }
    }
}

/// Work in a workspace could not be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum WorkspaceError {
    /// A temporary file can not be written or read.
    #[error("temporary files in {}: {source}", folder.display())]
    Temporary {
        /// Where they are made.
        folder: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Somebody wanted it to end.
    #[error("interrupted")]
    Interrupted,
}

/// Fails if somebody wants the work to stop.
///
/// # Errors
/// One of no particular kind: whoever wanted it knows.
#[inline]
pub fn check_stop(stop: &AtomicBool) -> io::Result<()> {
    if stop.load(Ordering::Relaxed) { Err(io::Error::other("interrupted")) } else { Ok(()) }
}

/// Says that a temporary file has fewer records than were written.
#[must_use]
pub fn too_few() -> io::Error {
    io::ErrorKind::UnexpectedEof.into()
}
