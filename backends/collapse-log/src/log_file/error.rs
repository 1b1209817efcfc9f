use std::io;
use std::path::{Path, PathBuf};

use container::SectionError;

use super::layout::VERSION;
use crate::log::LogError;

/// A collapse log could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogFileError {
    /// The operating system said no.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{}: not a collapse log: the file does not start with \"FFCOLLOG\"", file.display())]
    NotALog {
        /// The file.
        file: PathBuf,
    },
    /// The file was written by another version.
    #[error("{}: offset 8: version {version}, expected {VERSION}", file.display())]
    Version {
        /// The file.
        file: PathBuf,
        /// As found.
        version: u32,
    },
    /// The header names a vertex attribute layout that this version does not know.
    #[error("{}: offset 12: attribute stride {stride}, expected 0", file.display())]
    Attributes {
        /// The file.
        file: PathBuf,
        /// As found.
        stride: u32,
    },
    /// A count in the header is out of range.
    #[error("{}: offset {offset}: count {count} out of range", file.display())]
    Count {
        /// The file.
        file: PathBuf,
        /// Where the count stands.
        offset: u64,
        /// As found.
        count: u64,
    },
    /// The file is shorter or longer than its header says.
    #[error("{}: {actual} bytes, but its header asks for {expected}", file.display())]
    Length {
        /// The file.
        file: PathBuf,
        /// What the header says.
        expected: u64,
        /// What there is.
        actual: u64,
    },
    /// Bytes have changed since the file was written.
    #[error("{}: offset {offset}: checksum of the {section} does not match", file.display())]
    Checksum {
        /// The file.
        file: PathBuf,
        /// Start of the damaged section.
        offset: u64,
        /// Its name.
        section: &'static str,
    },
    /// The sections of the file are not what they should be.
    #[error("{}: {source}", file.display())]
    Sections {
        /// The file.
        file: PathBuf,
        /// What is wrong with them.
        source: SectionError,
    },
    /// The numbers are intact, but they do not make a log.
    #[error("{}: {source}", file.display())]
    Log {
        /// The file.
        file: PathBuf,
        /// What does not fit.
        source: LogError,
    },
}

impl LogFileError {
    /// What is wrong with the sections of a file, under the name that it has always had.
    pub(super) fn of_sections(file: &Path, error: SectionError) -> Self {
        let file = file.to_owned();
        match error {
            SectionError::Io { source, .. } => Self::Io { file, source },
            SectionError::FileLength { expected, actual } => Self::Length { file, expected, actual },
            source => Self::Sections { file, source },
        }
    }
}
