//! What can be wrong with a file, and with building one.

use std::io;
use std::path::Path;

use collapse_log::LogError;
use collapse_log::external::WorkspaceError;
use container::FileError;
use page_store::ThreadError;
use vertex_tree::TreeError;

/// An XFM file could not be written or is not what it should be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XfmError {
    /// What can be wrong with a file of any format.
    #[error(transparent)]
    File(#[from] FileError),
    /// Temporary files, or somebody wanted it to end.
    #[error(transparent)]
    Workspace(#[from] WorkspaceError),
    /// The log that a file was to be built from does not fit its mesh.
    #[error("the collapse log does not fit its mesh: {0}")]
    Log(#[from] LogError),
    /// A build option is out of range.
    #[error("{levels} levels a block, expected 1 to {most}")]
    Levels {
        /// As asked for.
        levels: u32,
        /// The most there can be.
        most: u32,
    },
    /// The hierarchy is larger than the format's numbers reach.
    #[error("{count} {what}, but the format has numbers for {most} only")]
    TooLarge {
        /// What there are too many of.
        what: &'static str,
        /// How many.
        count: u64,
        /// How many there can be.
        most: u64,
    },
    /// A radius or an error is too large to be stored.
    #[error("the radius or error {length} of a node is too large to be stored")]
    Length {
        /// As computed.
        length: f32,
    },
    /// The log that a file was to be built from can not be read.
    #[error("reading the collapse log: {source}")]
    Source {
        /// Why.
        source: io::Error,
    },
    /// The thread that reads could not be started.
    #[error(transparent)]
    Thread(#[from] ThreadError),
    /// A field of the header or of a table has a value that it can not have.
    #[error("{file}: offset {offset}: {field} is {value}, {expected}")]
    Field {
        /// The file or store.
        file: String,
        /// Where the field is.
        offset: u64,
        /// What it is called.
        field: &'static str,
        /// As found.
        value: u64,
        /// What was expected.
        expected: &'static str,
    },
    /// A detail block does not hold what it should, though it may be intact.
    #[error("{file}: offset {offset}: block {block} is damaged: {reason}")]
    Block {
        /// The file or store.
        file: String,
        /// Start of the block.
        offset: u64,
        /// Its number.
        block: u32,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A node refers to what is not there, or does not fit what it refers to.
    #[error("{file}: offset {offset}: node {node}: {reason}")]
    Node {
        /// The file or store.
        file: String,
        /// Start of its block.
        offset: u64,
        /// Its number.
        node: u32,
        /// What is wrong with it.
        reason: &'static str,
    },
}

/// What goes wrong in a construction, before it is known what is called how.
#[derive(Debug)]
pub(crate) enum Failure {
    /// With a temporary file.
    Temporary(io::Error),
    /// With the log.
    Source(io::Error),
    /// With what is written.
    Output(io::Error),
    Other(XfmError),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Temporary(error)
    }
}

impl From<XfmError> for Failure {
    fn from(error: XfmError) -> Self {
        Self::Other(error)
    }
}

impl From<LogError> for Failure {
    fn from(error: LogError) -> Self {
        Self::Other(error.into())
    }
}

impl Failure {
    /// The error for temporary files in a folder and a file to be written.
    pub fn into_error(self, folder: &Path, file: &Path) -> XfmError {
        match self {
            Self::Temporary(source) => WorkspaceError::Temporary { folder: folder.to_owned(), source }.into(),
            Self::Source(source) => XfmError::Source { source },
            Self::Output(source) => FileError::write(file, source).into(),
            Self::Other(error) => error,
        }
    }
}

/// An error of the file as one of the tree.
pub(crate) fn tree_error(error: XfmError) -> TreeError {
    match error {
        XfmError::File(FileError::Read { file, offset, length, source }) => {
            TreeError::Read { file, offset, length: length as usize, source }
        }
        XfmError::Block { file, offset, reason, .. } | XfmError::Node { file, offset, reason, .. } => {
            TreeError::Damaged { file, offset, reason }
        }
        other => TreeError::Store(other.into()),
    }
}
