//! What can go wrong with a file.

use collapse_log::LogError;
use collapse_log::external::WorkspaceError;
use container::FileError;
use page_store::ThreadError;

/// A file could not be written, opened or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MtError {
    /// What can be wrong with a file of any format.
    #[error(transparent)]
    File(#[from] FileError),
    /// Temporary files, or somebody wanted it to end.
    #[error(transparent)]
    Workspace(#[from] WorkspaceError),
    /// The thread that reads could not be started.
    #[error(transparent)]
    Thread(#[from] ThreadError),
    /// A number is out of range.
    #[error("{file}: offset {offset}: {what} {value} out of range")]
    Range {
        /// The file.
        file: String,
        /// Start of the section or node that holds the number.
        offset: u64,
        /// What the number is.
        what: &'static str,
        /// As found.
        value: u64,
    },
    /// Two nodes contradict each other.
    #[error("{file}: node {node} at offset {offset}: {what} {other}")]
    Contradiction {
        /// The file.
        file: String,
        /// Start of the node.
        offset: u64,
        /// Its number.
        node: u32,
        /// What does not fit.
        what: &'static str,
        /// The other node.
        other: u32,
    },
    /// The collapse log does not fit its mesh.
    #[error(transparent)]
    Log(#[from] LogError),
    /// There is more than the format can number.
    #[error("{what}: {value} is more than the format can hold")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How much.
        value: u64,
    },
}
