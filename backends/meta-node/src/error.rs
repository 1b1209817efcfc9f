//! What can be wrong with a file of meta-nodes, or with what is asked of it.

use std::io;
use std::path::PathBuf;

use collapse_log::LogError;
use container::SectionError;

/// A file could not be written, opened or checked, or a tree could not be made of it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MetaNodeError {
    /// The operating system said no.
    #[error("{file}: reading or writing {length} bytes at offset {offset}: {source}")]
    Io {
        /// The file.
        file: String,
        /// Where, in bytes from the start.
        offset: u64,
        /// How much.
        length: u64,
        /// Why.
        source: io::Error,
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
    /// The file is something else.
    #[error("{file}: no file of meta-nodes: it does not start with \"FFMETAND\"")]
    Foreign {
        /// The file.
        file: String,
    },
    /// The file was written by another version.
    #[error("{file}: offset 8: version {version}, expected 1 to {expected}")]
    Version {
        /// The file.
        file: String,
        /// As found.
        version: u32,
        /// The latest that this crate reads.
        expected: u32,
    },
    /// The header names a vertex attribute layout that this version does not know.
    #[error("{file}: offset 12: attribute stride {stride}, expected 0")]
    Attributes {
        /// The file.
        file: String,
        /// As found.
        stride: u32,
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
    /// The memory allowed has no room for the place holders that a tree needs at least.
    #[error("{given} bytes of page memory; {least} are needed for {holders} place holders")]
    Memory {
        /// As asked for.
        given: u64,
        /// The least.
        least: u64,
        /// That is so many place holders.
        holders: u32,
    },
    /// The thread that reads could not be started.
    #[error("no thread for reading: {0}")]
    Thread(io::Error),
}

impl MetaNodeError {
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
