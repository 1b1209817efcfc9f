//! What all stages of a build need, and what can go wrong in them.

use std::io;
use std::sync::atomic::AtomicBool;

use collapse_log::external::{Scratch, check_stop};
use collapse_log::{LogError, LogSource};

/// What can go wrong.
pub(super) enum Failure {
    Log(LogError),
    /// With a temporary file, unless somebody wanted it to end.
    Temporary(io::Error),
    /// With the file that is being written.
    Output(io::Error),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Temporary(error)
    }
}

impl From<LogError> for Failure {
    fn from(error: LogError) -> Self {
        Self::Log(error)
    }
}

/// What all stages need.
#[derive(Clone, Copy)]
pub(super) struct Work<'a> {
    pub log: &'a dyn LogSource,
    pub scratch: &'a Scratch,
    /// Bytes that everything may take together.
    pub memory: usize,
    pub stop: &'a AtomicBool,
}

impl Work<'_> {
    /// Fails if somebody wants it to end.
    pub fn check(&self) -> io::Result<()> {
        check_stop(self.stop)
    }
}
