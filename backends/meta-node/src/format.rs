//! The file, little-endian throughout.
//!
//! ```text
//! offset  bytes  field
//!      0      8  magic "FFMETAND"
//!      8      4  version, 2
//!     12      4  attribute stride: bytes of further vertex attributes, 0
//!     16      4  V, leaves: vertices of the input
//!     20      4  C, collapses: nodes
//!     24      4  T, triangles of the input
//!     28      4  of these, triangles with a doubled corner, which are never shown and not stored
//!     32      4  R, roots
//!     36      4  W, vertices of the base mesh: V - C
//!     40      4  U, triangles of the base mesh
//!     44      4  P, pages
//!     48      4  root pages, at most P; they are the first
//!     52      4  levels of a block
//!     56      4  bits of a node's number that are its slot on its page, at most 12
//!     60      4  words of the largest page, a place holder's size
//!     64      8  bytes of all pages
//!     72      4  0
//!     76      4  CRC-32 of bytes 0 to 75
//!     80         table of sections, see `container`:
//!                GEOR  where the mesh lies in the world, if that is to be said
//!                ROOT  28 R, roots: number, number in the log, centre, radius, error
//!                BASV  16 W, vertices of the base mesh: leaf, place
//!                BAST  12 U, triangles of the base mesh: three leaves
//!                PAGE  pages, one after the other: see `page.rs`
//!                PAGT  4 P, words of each page
//! ```
//!
//! Version 1, which is read too, has no table of sections: the header is followed by roots, base mesh, lengths of pages and
//! pages with nothing between them, and has the CRC-32 of all but the pages at offset 72.
//!
//! The lengths of the tables and of the file follow from the header and are checked before anything is allocated.

use container::{FileError, read_at};
use page_store::source::PageSource;
use vertex_tree::{Bounds, NodeId};

use crate::error::MetaNodeError;
use crate::page::{self, Limits};

/// What a file of meta-nodes starts with.
pub const MAGIC: [u8; 8] = *b"FFMETAND";
/// The version that is written. The first is read too.
pub(crate) const VERSION: u32 = 2;
pub(crate) const HEADER_BYTES: u64 = 80;
pub(crate) const ROOT_WORDS: usize = 7;
pub(crate) const VERTEX_WORDS: usize = 4;
pub(crate) const TRIANGLE_WORDS: usize = 3;

/// The header.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Header {
    /// As read; what is written is [`VERSION`].
    pub version: u32,
    pub leaves: u32,
    pub collapses: u32,
    pub triangles: u32,
    pub doubled: u32,
    pub roots: u32,
    pub base_vertices: u32,
    pub base_triangles: u32,
    pub pages: u32,
    pub root_pages: u32,
    pub levels: u32,
    pub slot_bits: u32,
    pub largest_words: u32,
    pub page_bytes: u64,
    /// In version 1.
    pub tables_checksum: u32,
}

impl Header {
    pub fn encode(&self) -> [u8; HEADER_BYTES as usize] {
        let mut bytes = [0; HEADER_BYTES as usize];
        bytes[..8].copy_from_slice(&MAGIC);
        let words = [
            VERSION,
            0,
            self.leaves,
            self.collapses,
            self.triangles,
            self.doubled,
            self.roots,
            self.base_vertices,
            self.base_triangles,
            self.pages,
            self.root_pages,
            self.levels,
            self.slot_bits,
            self.largest_words,
            self.page_bytes as u32,
            (self.page_bytes >> 32) as u32,
            0,
        ];
        for (at, word) in words.into_iter().enumerate() {
            bytes[8 + 4 * at..12 + 4 * at].copy_from_slice(&word.to_le_bytes());
        }
        let checksum = crc32fast::hash(&bytes[..76]);
        bytes[76..].copy_from_slice(&checksum.to_le_bytes());
        bytes
    }

    /// Words of the tables: roots, vertices and triangles of the base mesh, lengths of pages.
    pub fn tables_words(&self) -> [u64; 4] {
        [
            u64::from(self.roots) * ROOT_WORDS as u64,
            u64::from(self.base_vertices) * VERTEX_WORDS as u64,
            u64::from(self.base_triangles) * TRIANGLE_WORDS as u64,
            u64::from(self.pages),
        ]
    }

    pub fn limits(&self) -> Limits {
        Limits {
            pages: self.pages,
            root_pages: self.root_pages,
            slot_bits: self.slot_bits,
            leaves: self.leaves,
            collapses: self.collapses,
        }
    }

    /// Reads and checks the header of a store.
    pub fn read(source: &dyn PageSource) -> Result<Self, MetaNodeError> {
        let file = || source.name().to_owned();
        let actual = source.len();
        let mut bytes = [0; HEADER_BYTES as usize];
        if actual < HEADER_BYTES {
            let start = &mut bytes[..actual.min(8) as usize];
            read_at(source, 0, start)?;
            return Err(if *start == MAGIC {
                FileError::Length { file: file(), expected: HEADER_BYTES, actual }.into()
            } else {
                foreign(file())
            });
        }
        read_at(source, 0, &mut bytes)?;
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        if bytes[..8] != MAGIC {
            return Err(foreign(file()));
        }
        if !(1..=VERSION).contains(&word(8)) {
            return Err(FileError::Version { file: file(), version: word(8), expected: "1 to 2" }.into());
        }
        if crc32fast::hash(&bytes[..76]) != word(76) {
            return Err(FileError::Checksum { file: file(), offset: 0, section: "header" }.into());
        }
        if word(12) != 0 {
            return Err(FileError::Attributes { file: file(), stride: word(12) }.into());
        }
        let header = Self {
            version: word(8),
            leaves: word(16),
            collapses: word(20),
            triangles: word(24),
            doubled: word(28),
            roots: word(32),
            base_vertices: word(36),
            base_triangles: word(40),
            pages: word(44),
            root_pages: word(48),
            levels: word(52),
            slot_bits: word(56),
            largest_words: word(60),
            page_bytes: u64::from(word(64)) | u64::from(word(68)) << 32,
            tables_checksum: word(72),
        };
        header.check(&file)?;
        Ok(header)
    }

    /// Whether the numbers fit each other.
    fn check(&self, file: &impl Fn() -> String) -> Result<(), MetaNodeError> {
        let most = u64::from(u32::MAX);
        let limit = |count: u32| u64::from(count);
        // A value, where it stands, and the range that it must be in.
        for (offset, what, value, least, greatest) in [
            (20, "the number of collapses", self.collapses, 0, limit(self.leaves.saturating_sub(1))),
            (28, "the number of doubled triangles", self.doubled, 0, limit(self.triangles)),
            (32, "the number of roots", self.roots, u64::from(self.collapses > 0), limit(self.collapses)),
            (
                36,
                "the number of base vertices",
                self.base_vertices,
                limit(self.roots.max(self.leaves.min(1))),
                limit(self.leaves),
            ),
            (
                40,
                "the number of base triangles",
                self.base_triangles,
                0,
                limit(self.triangles.saturating_sub(self.doubled)),
            ),
            (44, "the number of pages", self.pages, u64::from(self.collapses > 0), limit(self.collapses)),
            (48, "the number of root pages", self.root_pages, u64::from(self.pages > 0), limit(self.pages)),
            (52, "the number of levels", self.levels, 1, page::MOST_LEVELS.into()),
            (56, "the number of slot bits", self.slot_bits, 0, page::MOST_LEVELS.into()),
            (60, "the size of the largest page", self.largest_words, 0, most / 4),
        ] {
            let value = u64::from(value);
            if value < least || value > greatest {
                return Err(MetaNodeError::Value { file: file(), offset, what, value });
            }
        }
        // Every vertex stays or is removed by a collapse, which there are fewer of.
        if self.leaves - self.collapses != self.base_vertices {
            let value = self.leaves.into();
            return Err(MetaNodeError::Value {
                file: file(),
                offset: 16,
                what: "the number of leaves",
                value,
            });
        }
        if self.version > 1 && self.tables_checksum != 0 {
            let value = self.tables_checksum.into();
            return Err(MetaNodeError::Value { file: file(), offset: 72, what: "a word without use", value });
        }
        let slots = u64::from(self.pages) << self.slot_bits;
        if slots > most {
            return Err(MetaNodeError::TooLarge { pages: self.pages.into(), slots: 1 << self.slot_bits });
        }
        Ok(())
    }
}

fn foreign(file: String) -> MetaNodeError {
    FileError::Foreign { file, what: "no file of meta-nodes", magic: "FFMETAND" }.into()
}

/// A root, as it is known without its page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Root {
    pub node: NodeId,
    pub log_number: u32,
    pub bounds: Bounds,
}
