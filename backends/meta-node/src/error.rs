//! What can be wrong with a file of meta-nodes, or with what is asked of it.

use collapse_log::LogError;
use collapse_log::external::WorkspaceError;
use container::FileError;
use page_store::ThreadError;

/// A file could not be written, opened or checked, or a tree could not be made of it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MetaNodeError {
    /// What can be wrong with a file of any format.
    #[error(transparent)]
    File(#[from] FileError),
    /// Temporary files, or somebody wanted it to end.
    #[error(transparent)]
    Workspace(#[from] WorkspaceError),
    /// The collapse log does not fit its mesh.
    #[error(transparent)]
    Log(#[from] LogError),
    /// More levels a block than the format has room for, or none.
    #[error("{levels} levels a block; 1 to {most} are possible")]
    Levels {
        /// As asked for.
        levels: u32,
        /// The most.
        most: u32,
    },
    /// The hierarchy has more pages and slots than can be numbered in 32 bits.
    #[error("{pages} pages of {slots} slots are more than can be numbered")]
    TooLarge {
        /// How many pages.
        pages: u64,
        /// How many slots each has.
        slots: u64,
    },
    /// A number in the header or in a table is out of range.
    #[error("{file}: offset {offset}: {what} is {value}")]
    Value {
        /// The file.
        file: String,
        /// Where it stands.
        offset: u64,
        /// Its name.
        what: &'static str,
        /// As found.
        value: u64,
    },
    /// A page does not hold what it should.
    #[error("{file}: page {page} at offset {offset} is damaged: {reason}")]
    Page {
        /// The file.
        file: String,
        /// Number of the page.
        page: u32,
        /// Where it starts, in bytes.
        offset: u64,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The thread that reads could not be started.
    #[error(transparent)]
    Thread(#[from] ThreadError),
}
