//! What a section is.

use std::fmt;

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

/// Where a section is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Section {
    /// What it holds.
    pub kind: Kind,
    /// [`NECESSARY`], [`BY_PAGE`].
    pub flags: u32,
    /// Where it starts, in bytes.
    pub offset: u64,
    /// Bytes.
    pub length: u64,
    /// CRC-32 of its bytes, or 0 if it is checked by page.
    pub checksum: u32,
}

impl Section {
    /// Where it ends, in bytes.
    #[must_use]
    pub fn end(&self) -> u64 {
        self.offset + self.length
    }
}

/// A small section that is in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Extra {
    /// What it holds.
    pub kind: Kind,
    /// [`NECESSARY`], or 0.
    pub flags: u32,
    /// All of it.
    pub bytes: Vec<u8>,
}
