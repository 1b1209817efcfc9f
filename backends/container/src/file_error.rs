//! What can be wrong with a file of any format.

use std::io;
use std::path::Path;

use page_store::source::PageSource;

use crate::error::SectionError;

/// What can be wrong with a file before it is known what is in it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// Reading failed: the operating system or the store said no.
    #[error("{file}: reading {length} bytes at offset {offset}: {source}")]
    Read {
        /// The file or store.
        file: String,
        /// Where, in bytes from the start.
        offset: u64,
        /// How much.
        length: u64,
        /// Why.
        source: io::Error,
    },
    /// Writing failed.
    #[error("{file}: {source}")]
    Write {
        /// The file.
        file: String,
        /// Why.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{file}: {what}: it does not start with \"{magic}\"")]
    Foreign {
        /// The file or store.
        file: String,
        /// What it is not, in words.
        what: &'static str,
        /// How it should start.
        magic: &'static str,
    },
    /// The file was written by another version.
    #[error("{file}: offset 8: version {version}, expected {expected}")]
    Version {
        /// The file or store.
        file: String,
        /// As found.
        version: u32,
        /// Those that are read, in words.
        expected: &'static str,
    },
    /// The header names a vertex attribute layout that this version does not know.
    #[error("{file}: offset 12: attribute stride {stride}, expected 0")]
    Attributes {
        /// The file or store.
        file: String,
        /// As found.
        stride: u32,
    },
    /// The file is shorter or longer than its header says.
    #[error("{file}: {actual} bytes, but its header asks for {expected}")]
    Length {
        /// The file or store.
        file: String,
        /// What the header says.
        expected: u64,
        /// What there is.
        actual: u64,
    },
    /// Bytes have changed since the file was written.
    #[error("{file}: offset {offset}: checksum of the {section} does not match")]
    Checksum {
        /// The file or store.
        file: String,
        /// Start of the damaged section.
        offset: u64,
        /// Its name.
        section: &'static str,
    },
    /// The memory allowed for pages can not hold what a single change of the front needs.
    #[error("{file}: {allowed} bytes of page memory are too few: a single change needs {needed}")]
    Memory {
        /// The file or store.
        file: String,
        /// The limit that was asked for.
        allowed: u64,
        /// The least that would do.
        needed: u64,
    },
    /// The sections of the file are not what they should be.
    #[error("{file}: {source}")]
    Sections {
        /// The file or store.
        file: String,
        /// What is wrong with them.
        source: SectionError,
    },
}

impl FileError {
    /// Fails if fewer bytes are allowed for pages of a file than are needed.
    ///
    /// # Errors
    /// [`FileError::Memory`].
    pub fn check_memory(file: &str, allowed: u64, needed: u64) -> Result<(), Self> {
        if allowed < needed { Err(Self::Memory { file: file.to_owned(), allowed, needed }) } else { Ok(()) }
    }

    /// Writing a file failed.
    #[must_use]
    pub fn write(path: &Path, source: io::Error) -> Self {
        Self::Write { file: path.display().to_string(), source }
    }

    /// What is wrong with the sections of a file, under the name that it has always had.
    #[must_use]
    pub fn of_sections(file: &str, error: SectionError) -> Self {
        let file = file.to_owned();
        match error {
            SectionError::Io { offset, length, source } => Self::Read { file, offset, length, source },
            SectionError::FileLength { expected, actual } => Self::Length { file, expected, actual },
            source => Self::Sections { file, source },
        }
    }
}

/// Fills a buffer with the bytes of a store from an offset on.
///
/// # Errors
/// [`FileError::Read`].
pub fn read_at(source: &dyn PageSource, offset: u64, buffer: &mut [u8]) -> Result<(), FileError> {
    let length = buffer.len() as u64;
    source.read_at(offset, buffer).map_err(|error| FileError::Read {
        file: source.name().to_owned(),
        offset,
        length,
        source: error,
    })
}
