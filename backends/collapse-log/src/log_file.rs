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
//!     48         table of sections, see `container`:
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

mod error;
mod layout;
pub(crate) mod read;
mod write;

pub use self::error::LogFileError;
pub use self::layout::LogCounts;
pub use self::read::{log_file_version, read_log};
pub use self::write::{write_log, write_log_from};
