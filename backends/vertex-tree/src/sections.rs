//! The sections of a file, which all formats have in common from version 2 on. Little-endian throughout.
//!
//! ```text
//! offset  bytes  field
//!      0      H  header: magic, version, the format's own numbers, CRC-32 of all that
//!             p  zeros, up to the next multiple of 8
//!             4  n, sections, 1 to 64
//!             4  CRC-32 of n and of the entries
//!          32 n  entries in the order of the file:
//!                  0  4  kind, four characters
//!                  4  4  flags: 1 necessary, 2 checked by page; others 0
//!                  8  8  offset
//!                 16  8  length in bytes, at most 2^62
//!                 24  4  CRC-32 of the section; 0 if it is checked by page
//!                 28  4  0
//!                sections, each after zeros up to the next multiple of 8; the file ends where the last one does
//! ```
//!
//! Where a section starts follows from those before it, so that there is no overlap, no gap and nothing out of range once the
//! table has been found to be right; nothing of it is believed before its checksum. A reader skips sections that it does
//! not know, unless they are flagged as necessary. A section that is checked by page consists of pieces with checksums of their
//! own. Kinds mean the same in all formats; each occurs once at most.
//!
//! | kind | what it holds |
//! |---|---|
//! | `GEOR` | where the mesh lies in the world, see [`Georeference`](crate::Georeference) |
//! | `POSI` `TRIA` `COLL` | positions, triangles and collapses of a log |
//! | `ROOT` | roots of the hierarchy |
//! | `BASV` `BAST` `BASE` | vertices and triangles of the base mesh, or both in one |
//! | `PAGT` | where pages are, or how long |
//! | `PART` | which nodes are together in a page |
//! | `PAGE` | pages |
//! | `NODE` | what there is to know of each node without its page |
//! | `ATTR` `INPV` | reserved: further attributes of vertices; the input's numbers of vertices |

mod georeference;
mod table;
mod writer;

use std::fmt;
use std::io;

pub use self::table::{Section, Sections};
pub use self::writer::{Extra, SectionWriter, file_length};

/// What a section holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Kind(pub [u8; 4]);

impl Kind {
    /// Where the mesh lies in the world.
    pub const GEOREFERENCE: Self = Self(*b"GEOR");
    /// Positions of a log.
    pub const POSITIONS: Self = Self(*b"POSI");
    /// Triangles of a log.
    pub const TRIANGLES: Self = Self(*b"TRIA");
    /// Collapses of a log.
    pub const COLLAPSES: Self = Self(*b"COLL");
    /// Roots of the hierarchy.
    pub const ROOTS: Self = Self(*b"ROOT");
    /// Vertices of the base mesh.
    pub const BASE_VERTICES: Self = Self(*b"BASV");
    /// Triangles of the base mesh.
    pub const BASE_TRIANGLES: Self = Self(*b"BAST");
    /// The base mesh in one piece.
    pub const BASE: Self = Self(*b"BASE");
    /// Where pages are, or how long.
    pub const PAGE_TABLE: Self = Self(*b"PAGT");
    /// Which nodes are together in a page.
    pub const PARTITIONS: Self = Self(*b"PART");
    /// What there is to know of each node without its page.
    pub const NODES: Self = Self(*b"NODE");
    /// Pages.
    pub const PAGES: Self = Self(*b"PAGE");
    /// Reserved: further attributes of vertices.
    pub const ATTRIBUTES: Self = Self(*b"ATTR");
    /// Reserved: the input's numbers of vertices.
    pub const INPUT_VERTICES: Self = Self(*b"INPV");
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{}\"", self.0.escape_ascii())
    }
}

/// A reader that does not know the section can not read the file.
pub const NECESSARY: u32 = 1;
/// The section's pieces have checksums of their own.
pub const BY_PAGE: u32 = 2;
/// Sections in a file.
pub const MOST: usize = 64;
const ENTRY: usize = 32;
/// Bytes before the entries.
const START: usize = 8;

fn aligned(at: u64) -> u64 {
    at.next_multiple_of(8)
}

/// Where the table of so many sections ends after a header of so many bytes.
fn table_end(header: u64, sections: usize) -> u64 {
    aligned(header) + (START + sections * ENTRY) as u64
}

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
