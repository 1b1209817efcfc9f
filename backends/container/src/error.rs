//! What can be wrong with the sections of a file.

use std::io;

use crate::layout::MOST;
use crate::section::Kind;

/// What can be wrong with the sections of a file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SectionError {
    /// The operating system or the store said no.
    #[error("reading {length} bytes at offset {offset}: {source}")]
    Io {
        /// Where.
        offset: u64,
        /// How many bytes.
        length: u64,
        /// Why.
        source: io::Error,
    },
    /// The file is shorter or longer than it says.
    #[error("{actual} bytes, but its sections ask for {expected}")]
    FileLength {
        /// What the file says; of a file that ends before its sections do, at least so much.
        expected: u64,
        /// What there is.
        actual: u64,
    },
    /// No file has so many sections, or so few.
    #[error("offset {offset}: {count} sections, expected 1 to {MOST}")]
    Count {
        /// Where the number stands.
        offset: u64,
        /// As found.
        count: u32,
    },
    /// The bytes of the table have changed since the file was written.
    #[error("offset {offset}: checksum of the table of sections does not match")]
    TableChecksum {
        /// Start of the table.
        offset: u64,
    },
    /// The bytes of a section have changed since the file was written.
    #[error("offset {offset}: checksum of section {kind} does not match")]
    Checksum {
        /// Start of the section.
        offset: u64,
        /// What it holds.
        kind: Kind,
    },
    /// There is something where nothing should be.
    #[error("offset {offset}: {value} where a section is filled up with zeros")]
    Padding {
        /// Where.
        offset: u64,
        /// As found.
        value: u8,
    },
    /// An entry of the table has a value that it can not have.
    #[error("offset {offset}: {field} of section {kind} is {value}, expected {expected}")]
    Entry {
        /// Start of the entry.
        offset: u64,
        /// What the section holds.
        kind: Kind,
        /// What the value is.
        field: &'static str,
        /// As found.
        value: u64,
        /// What it has to be.
        expected: u64,
    },
    /// Two sections have the same kind.
    #[error("offset {offset}: section {kind} is there twice")]
    Twice {
        /// Start of the second.
        offset: u64,
        /// What it holds.
        kind: Kind,
    },
    /// A section is not there.
    #[error("no section {kind}")]
    Missing {
        /// What it would hold.
        kind: Kind,
    },
    /// A later version has written something that can not be left out.
    #[error("offset {offset}: section {kind} is necessary, and not known")]
    Unknown {
        /// Start of the section.
        offset: u64,
        /// What it holds.
        kind: Kind,
    },
    /// A value of the georeference is none.
    #[error("offset {offset}: {field} of the georeference is {value}")]
    Georeference {
        /// Where it stands.
        offset: u64,
        /// What it is.
        field: &'static str,
        /// As found.
        value: String,
    },
}
