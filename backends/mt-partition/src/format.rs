//! The file, little-endian throughout (Holst & Schumann 2007, section 4.1 and figure 2).
//!
//! ```text
//! offset  bytes  field
//!      0      8  magic "FFMTPART"
//!      8      4  version, 2
//!     12      4  attribute stride: bytes of further vertex attributes, 0
//!     16      8  input vertices, less than 2^32 - 1
//!     24      8  input triangles, less than 2^32 - 1
//!     32      8  collapses in the log, less than 2^32 - 1
//!     40      8  N, nodes, at most one a collapse
//!     48      8  P, partitions, at most one a node
//!     56      8  R, roots: nodes whose ingoing arcs all come from the source
//!     64      8  triangles on arcs
//!     72      8  arcs
//!     80      8  triangles on arcs before the reduction
//!     88      8  arcs before the reduction
//!     96      8  S, bytes of the source
//!    104      8  largest change: bytes of the nodes that one change of the front needs at once, as stored
//!    112      8  most nodes in such a change
//!    120      8  requested triangles an arc, f64
//!    128      8  mean growth of a node's radius by the reduction, f64
//!    136      8  largest growth of a node's radius, f64
//!    144      4  requested nodes a partition
//!    148      4  order of the partitioning queue: 0 increasing, 1 decreasing
//!    152      4  CRC-32 of bytes 0 to 151
//!    156      4  zeros
//!    160         table of sections, see `container`:
//!                GEOR  where the mesh lies in the world, if that is to be said
//!                ROOT  24 R, roots, in ascending order: node u32, centre 3 f32, radius f32, eps f32
//!                PART  4 P, partitions: first node u32; a partition ends where the next one starts
//!                BASE  S, the source: a record whose outgoing arcs hold the base mesh
//!                PAGE  the nodes' records (see `record`), in order of their numbers, each with its own CRC-32
//!                NODE  8 N, nodes: bytes of the record u32, number in the collapse log u32
//! ```
//!
//! Version 1, which is read too, has no table of sections: the header is followed by roots, partitions and nodes, each with a
//! CRC-32 behind it, source and records, with nothing between them.
//!
//! Nodes of a partition have consecutive numbers, so a partition is one read; so is a single node. The length of the file
//! follows from the tables and is checked, and so is that of the tables, before anything is allocated.

/// What a file of this format starts with.
pub const MAGIC: [u8; 8] = *b"FFMTPART";
/// The version that is written. The first is read too.
pub(crate) const VERSION: u32 = 2;
pub(crate) const HEADER: usize = 156;
pub(crate) const ROOT: u64 = 24;
pub(crate) const PARTITION: u64 = 4;
pub(crate) const NODE: u64 = 8;
/// Behind the tables of version 1.
pub(crate) const CHECKSUM: u64 = 4;

/// The numbers in the header.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Header {
    /// As read; what is written is [`VERSION`].
    pub version: u32,
    pub vertices: u64,
    pub triangles: u64,
    pub collapses: u64,
    pub nodes: u64,
    pub partitions: u64,
    pub roots: u64,
    pub stored: u64,
    pub arcs: u64,
    pub unreduced_stored: u64,
    pub unreduced_arcs: u64,
    pub source_bytes: u64,
    pub change_bytes: u64,
    pub change_nodes: u64,
    pub patch: f64,
    pub inflation: [f64; 2],
    pub partition_limit: u32,
    pub decreasing: u32,
}

impl Header {
    fn counts(&self) -> [u64; 13] {
        [
            self.vertices,
            self.triangles,
            self.collapses,
            self.nodes,
            self.partitions,
            self.roots,
            self.stored,
            self.arcs,
            self.unreduced_stored,
            self.unreduced_arcs,
            self.source_bytes,
            self.change_bytes,
            self.change_nodes,
        ]
    }

    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER);
        out.extend_from_slice(&MAGIC);
        out.extend_from_slice(&VERSION.to_le_bytes());
        out.extend_from_slice(&0_u32.to_le_bytes());
        for count in self.counts() {
            out.extend_from_slice(&count.to_le_bytes());
        }
        for value in [self.patch, self.inflation[0], self.inflation[1]] {
            out.extend_from_slice(&value.to_bits().to_le_bytes());
        }
        out.extend_from_slice(&self.partition_limit.to_le_bytes());
        out.extend_from_slice(&self.decreasing.to_le_bytes());
        out.extend_from_slice(&crc32fast::hash(&out).to_le_bytes());
        out
    }

    /// The numbers, without a look at whether they make sense.
    pub fn decode(bytes: &[u8; HEADER]) -> Self {
        let long = |at: usize| {
            let mut word = [0; 8];
            word.copy_from_slice(&bytes[at..at + 8]);
            u64::from_le_bytes(word)
        };
        let short = |at: usize| {
            let mut word = [0; 4];
            word.copy_from_slice(&bytes[at..at + 4]);
            u32::from_le_bytes(word)
        };
        Self {
            version: short(8),
            vertices: long(16),
            triangles: long(24),
            collapses: long(32),
            nodes: long(40),
            partitions: long(48),
            roots: long(56),
            stored: long(64),
            arcs: long(72),
            unreduced_stored: long(80),
            unreduced_arcs: long(88),
            source_bytes: long(96),
            change_bytes: long(104),
            change_nodes: long(112),
            patch: f64::from_bits(long(120)),
            inflation: [128, 136].map(|at| f64::from_bits(long(at))),
            partition_limit: short(144),
            decreasing: short(148),
        }
    }

    /// Bytes of roots, partitions and nodes. The counts are below 2^32: nothing overflows.
    pub fn table_bytes(&self) -> [u64; 3] {
        [ROOT * self.roots, PARTITION * self.partitions, NODE * self.nodes]
    }
}
