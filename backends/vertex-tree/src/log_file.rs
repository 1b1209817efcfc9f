//! The collapse log as a file, little-endian throughout.
//!
//! ```text
//! offset  bytes  field
//!      0      8  magic "FFCOLLOG"
//!      8      4  version, 2
//!     12      4  attribute stride: bytes of further vertex attributes, 0
//!     16      8  V, number of vertices, at most 2^32 - 2
//!     24      8  T, number of triangles, at most 2^32 - 2
//!     32      8  C, number of collapses, less than V (0 if V is 0)
//!     40      4  CRC-32 of bytes 0 to 39
//!     44      4  zeros
//!     48         table of sections, see `sections`:
//!                GEOR  where the mesh lies in the world, if that is to be said
//!                POSI  12 V, x y z as f32
//!                TRIA  12 T, three vertex numbers as u32
//!                COLL  28 C, in order: removed u32, kept u32, centre 3 f32, radius f32, eps f32
//! ```
//!
//! Version 1, which is read too, has no table: the header is followed by positions, triangles and collapses with nothing
//! between them, and at last by their checksums.
//!
//! The length of the file follows from the header and is checked before anything is allocated.

mod read;
mod write;

use std::io;
use std::path::{Path, PathBuf};

pub(crate) use self::read::{Opened, collapse, compare_checksums, open};
pub use self::read::{log_file_version, read_log};
pub use self::write::{LogCounts, write_log, write_log_from};
use crate::LogError;
use crate::sections::SectionError;

const MAGIC: [u8; 8] = *b"FFCOLLOG";
/// The version that is written. The first is read too.
const VERSION: u32 = 2;
const HEADER_BYTES: u64 = 44;
const VERTEX_BYTES: usize = 12;
const TRIANGLE_BYTES: usize = 12;
const COLLAPSE_BYTES: usize = 28;
/// Records are converted this many at a time.
const CHUNK: usize = 4096;

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
    fn of_sections(file: &Path, error: SectionError) -> Self {
        let file = file.to_owned();
        match error {
            SectionError::Io { source, .. } => Self::Io { file, source },
            SectionError::FileLength { expected, actual } => Self::Length { file, expected, actual },
            source => Self::Sections { file, source },
        }
    }
}
