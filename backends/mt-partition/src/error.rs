//! What can go wrong with a file.

use std::io;
use std::path::PathBuf;

use collapse_log::LogError;
use container::SectionError;

/// A file could not be written, opened or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MtError {
    /// The operating system or the store said no.
    #[error("{file}: {length} bytes at offset {offset}: {source}")]
    Io {
        /// The file.
        file: String,
        /// Where.
        offset: u64,
        /// How many bytes.
        length: u64,
        /// Why.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{file}: not a partitioned multi-triangulation: it does not start with \"FFMTPART\"")]
    NotThis {
        /// The file.
        file: String,
    },
    /// The file was written by another version.
    #[error("{file}: offset 8: version {version}, expected 1 or 2")]
    Version {
        /// The file.
        file: String,
        /// As found.
        version: u32,
    },
    /// The header names a vertex attribute layout that this version does not know.
    #[error("{file}: offset 12: attribute stride {stride}, expected 0")]
    Attributes {
        /// The file.
        file: String,
        /// As found.
        stride: u32,
    },
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
    /// The file is shorter or longer than its header says.
    #[error("{file}: {actual} bytes, but its header asks for {expected}")]
    Length {
        /// The file.
        file: String,
        /// What the header says.
        expected: u64,
        /// What there is.
        actual: u64,
    },
    /// Bytes have changed since the file was written.
    #[error("{file}: offset {offset}: checksum of the {section} does not match")]
    Checksum {
        /// The file.
        file: String,
        /// Start of the damaged section.
        offset: u64,
        /// Its name.
        section: &'static str,
    },
    /// The sections of the file are not what they should be.
    #[error("{file}: {source}")]
    Sections {
        /// The file.
        file: String,
        /// What is wrong with them.
        source: SectionError,
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
    /// The memory allowed can not hold what a single change of the front needs.
    #[error("{allowed} bytes of memory are too few: a single change of the front needs {needed}")]
    Memory {
        /// The limit that was asked for.
        allowed: u64,
        /// The least that would do.
        needed: u64,
    },
}

impl MtError {
    /// What is wrong with the sections of a file, under the name that it has always had.
    pub(crate) fn of_sections(file: &str, error: SectionError) -> Self {
        let file = file.to_owned();
        match error {
            SectionError::Io { offset, length, source } => Self::Io { file, offset, length, source },
            SectionError::FileLength { expected, actual } => Self::Length { file, expected, actual },
            source => Self::Sections { file, source },
        }
    }
}
