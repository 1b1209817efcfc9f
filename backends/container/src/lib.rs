//! What all files of the project have in common: they are made of sections, they say where a mesh lies in the world, and they
//! are written whole or not at all. What is in the sections is up to each format.
//!
//! # Sections
//!
//! As from version 2 of each format on. Little-endian throughout.
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
//! | `GEOR` | where the mesh lies in the world, see [`Georeference`] |
//! | `POSI` `TRIA` `COLL` | positions, triangles and collapses of a log |
//! | `ROOT` | roots of the hierarchy |
//! | `BASV` `BAST` `BASE` | vertices and triangles of the base mesh, or both in one |
//! | `PAGT` | where pages are, or how long |
//! | `PART` | which nodes are together in a page |
//! | `PAGE` | pages |
//! | `NODE` | what there is to know of each node without its page |
//! | `ATTR` `INPV` | reserved: further attributes of vertices; the input's numbers of vertices |

mod error;
mod file_error;
mod layout;
pub mod output;
mod placing;
mod section;
mod table;
pub mod temporary;
mod writer;

#[cfg(test)]
mod tests;

pub use error::SectionError;
pub use file_error::{FileError, read_at};
pub use layout::MOST;
pub use section::{BY_PAGE, Extra, Kind, NECESSARY, Section};
pub use table::Sections;
pub use vertex_tree::{DegreeMap, Georeference, Rounding};
pub use writer::{SectionWriter, file_length};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
