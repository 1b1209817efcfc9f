//! The numbers of the format.

pub const MAGIC: [u8; 8] = *b"FFCOLLOG";
/// The version that is written. The first is read too.
pub const VERSION: u32 = 2;
pub const HEADER_BYTES: u64 = 44;
pub const VERTEX_BYTES: usize = 12;
pub const TRIANGLE_BYTES: usize = 12;
pub const COLLAPSE_BYTES: usize = 28;
/// Records are converted this many at a time.
pub const CHUNK: usize = 4096;

/// How many records a log has of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LogCounts {
    /// Vertices.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Collapses.
    pub collapses: u64,
}
