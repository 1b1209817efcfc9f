//! From a collapse log to an XFM file: the paper's seven steps (section 3.5).
//!
//! 1 and 2, the merge tree and the coarsest mesh: [`replay`](crate::replay) on the [`surface`](crate::surface) of the
//! [renumbered](crate::renumber) mesh, with bounds from [`nesting`](crate::nesting). 4, the numbers of nodes and half-edges:
//! [`layout`](crate::layout). 3 and 5 to 7, writing initial mesh, root list, block index and blocks:
//! [`writing`](crate::writing). What all of this works on is in memory or in temporary files ([`storage`](crate::storage)).

use std::path::Path;
use std::sync::atomic::Ordering;

use collapse_log::external::{Workspace, WorkspaceError};
use collapse_log::{CollapseLog, LogSource};

use crate::arrange::Arranged;
use crate::error::XfmError;
use crate::options::{BuildOptions, WriteReport};
use crate::storage::{Disk, Memory, Storage};

/// Builds a file in memory: written to a temporary name, synced, then renamed.
///
/// # Errors
/// If the log does not fit its mesh, an option is out of range, the hierarchy is too large for the format, or writing
/// fails. Nothing is left behind then.
pub fn write(path: &Path, log: &CollapseLog, options: &BuildOptions) -> Result<WriteReport, XfmError> {
    write_on(path, log, options, &Memory, Path::new(""))
}

/// Builds a file from a log that may be larger than memory. The file is the same whatever the memory.
///
/// # Errors
/// As for [`write()`], and [`XfmError::Source`] and [`XfmError::Workspace`]. Nothing is left behind.
pub fn write_within(
    path: &Path,
    log: &dyn LogSource,
    options: &BuildOptions,
    workspace: &Workspace<'_>,
) -> Result<WriteReport, XfmError> {
    let counts = log.counts();
    let outcome = if needed_bytes(counts.vertices, counts.triangles) <= workspace.memory {
        write_on(path, log, options, &Memory, &workspace.folder)
    } else {
        write_on(path, log, options, &Disk::new(workspace), &workspace.folder)
    };
    outcome.map_err(|error| {
        if workspace.stop.load(Ordering::Relaxed) { WorkspaceError::Interrupted.into() } else { error }
    })
}

/// Bytes of memory with which a file of so many vertices and triangles is built without temporary files.
#[must_use]
pub fn needed_bytes(vertices: u64, triangles: u64) -> u64 {
    170 * vertices + 60 * triangles
}

/// Bytes of temporary files that are needed at the worst moment to build a file of so many vertices and triangles with
/// less memory: by the sizes of its arrays 172 a vertex and 44 a triangle, during the replay; not measured. Vertices that are split apart come on top.
#[must_use]
pub fn needed_disk_bytes(vertices: u64, triangles: u64) -> u64 {
    180 * vertices + 50 * triangles
}

fn write_on<S: Storage>(
    path: &Path,
    log: &dyn LogSource,
    options: &BuildOptions,
    storage: &S,
    folder: &Path,
) -> Result<WriteReport, XfmError> {
    let written = Arranged::new(log, options, storage, |_| Ok(()));
    written.and_then(|mut arranged| arranged.write(path, storage)).map_err(|f| f.into_error(folder, path))
}
