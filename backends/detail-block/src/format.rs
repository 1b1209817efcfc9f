//! The XFM file (section 3 of the paper), little-endian throughout.
//!
//! ```text
//! offset  bytes  field
//!      0      8  magic "FFXFMESH"
//!      8      4  version, 2
//!     12      4  attribute stride: bytes of further vertex attributes, 0
//!     16      4  l, levels of a block, 1 to 5
//!     20      4  flags: 1 nodes are quantised, 2 bounds are nested over w x y z too; others 0
//!     24      8  V, initial vertices
//!     32      8  F, initial faces
//!     40      8  R, roots
//!     48      8  B, detail blocks
//!     56      8  N, nodes
//!     64      8  triangles of the fully refined mesh
//!     72      8  vertices of the input
//!     80      8  of it, vertices that were added to split non-manifold ones apart
//!     88      8  of it, non-manifold edges that were cut
//!     96      8  vertices that the log removes and that stay
//!    104      8  input triangles that name a vertex twice, left out
//!    112     12  lowest corner of the lattice of quantised positions, 3 f32
//!    124      4  step of the lattice, f32
//!    128      4  base of the quantised lengths: bits of an f32
//!    132      4  reserved, 0
//!    136      8  length of the file
//!    144      4  CRC-32 of bytes 0 to 143
//!    148      4  zeros
//!    152         table of sections, see `container`:
//!                GEOR  where the mesh lies in the world, if that is to be said
//!                BASV  24 V, initial vertices: position and normal, 3 f32 each
//!                BAST  24 F, initial faces: three initial vertices, and the reverses of the half-edges that start there
//!                ROOT  24 R, root list: number of the node, and its sphere and error as 5 f32, so that the blocks of roots
//!                      can be paged
//!                PAGE  detail blocks, in the order of their numbers, nothing between them
//!                PAGT  8 B, block index: offset of the block in the low 48 bits, its length in the high 16
//! ```
//!
//! Version 1, which is read too, has no table of sections: the header is followed by initial vertices, initial faces, root
//! list and block index, each with a CRC-32 behind it, and the blocks, with nothing between them.
//!
//! A detail block, with flag sets of `s = max(1, 2^l / 8)` bytes:
//!
//! ```text
//! offset  bytes  field
//!      0      s  flags: bit i says that the node at offset i is present; bit 2^l - 1 marks a leaf block
//!      s      4  parent: the node above the block's root, 2^32 - 1 for the block of a root
//!                not in leaf blocks:
//!   s + 4      4    number of the first child block; child blocks are numbered consecutively
//!   s + 8      s    which there are: bits 2 i and 2 i + 1 for the children of the i-th node of the lowest level, first the
//!                   child at the kept vertex
//!                nodes, those present, in breadth-first order: 52 or 30 bytes each (see `node`)
//!              4  CRC-32 of the block's number and all bytes before
//! ```
//!
//! Parents have lower numbers than their children, and blocks than their child blocks, so walks upwards end even in a
//! damaged file. Half-edge numbers: see `numbering`.

use std::io;

use container::Georeference;

use crate::numbering::Levels;
use crate::quantize::Scale;

/// The first bytes of an XFM file.
pub const MAGIC: [u8; 8] = *b"FFXFMESH";
/// The version that is written. The first is read too.
pub(crate) const VERSION: u32 = 2;
pub(crate) const HEADER_BYTES: u64 = 148;
/// Bytes of an initial vertex, an initial face, a root.
pub(crate) const RECORD_BYTES: u64 = 24;
pub(crate) const ENTRY_BYTES: u64 = 8;
/// Behind each block, and in version 1 behind everything else.
pub(crate) const SUM_BYTES: u64 = 4;
pub(crate) const FLAG_QUANTISED: u32 = 1;
pub(crate) const FLAG_NESTED: u32 = 2;
/// Bits of an offset in the block index.
pub(crate) const OFFSET_BITS: u32 = 48;

/// The header.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Header {
    /// As read; what is written is [`VERSION`].
    pub version: u32,
    pub levels: Levels,
    pub quantised: bool,
    /// Whether bounds are nested over w x y z.
    pub nested: bool,
    pub initial_vertices: u64,
    pub initial_faces: u64,
    pub roots: u64,
    pub blocks: u64,
    pub nodes: u64,
    pub triangles: u64,
    pub input_vertices: u64,
    pub added_vertices: u64,
    pub cut_edges: u64,
    pub left_out: u64,
    pub degenerate: u64,
    pub scale: Scale,
    pub length: u64,
}

impl Header {
    /// The scale, if nodes are quantised.
    pub fn quantisation(&self) -> Option<&Scale> {
        self.quantised.then_some(&self.scale)
    }

    pub fn node_bytes(&self) -> usize {
        if self.quantised { crate::node::QUANTISED_BYTES } else { crate::node::PLAIN_BYTES }
    }

    /// Bytes of initial vertices, initial faces, root list and block index.
    pub fn table_bytes(&self) -> [u64; 4] {
        let [vertices, faces, roots] =
            [self.initial_vertices, self.initial_faces, self.roots].map(|n| n * RECORD_BYTES);
        [vertices, faces, roots, self.blocks * ENTRY_BYTES]
    }

    /// Bytes of a block of so many nodes.
    pub fn block_bytes(&self, nodes: u32, is_leaf: bool) -> u64 {
        let flags = self.levels.flag_bytes() as u64;
        let children = if is_leaf { 0 } else { 4 + flags };
        flags + 4 + children + u64::from(nodes) * self.node_bytes() as u64 + SUM_BYTES
    }

    /// How many nodes a block of so many bytes has, and whether it is a leaf block; `None` if there is no such block.
    pub fn nodes_of(&self, bytes: u64) -> Option<(u32, bool)> {
        [true, false].into_iter().find_map(|is_leaf| {
            let nodes = bytes.checked_sub(self.block_bytes(0, is_leaf))?;
            let (count, rest) = (nodes / self.node_bytes() as u64, nodes % self.node_bytes() as u64);
            let fits = rest == 0 && (1..=u64::from(self.levels.full())).contains(&count);
            fits.then_some((count as u32, is_leaf))
        })
    }

    /// How long the file will be with so many bytes of blocks.
    pub fn file_length(&self, blocks: u64, georeference: &Georeference) -> io::Result<u64> {
        let [vertices, faces, roots, index] = self.table_bytes();
        container::file_length(HEADER_BYTES, georeference, &[], &[vertices, faces, roots, blocks, index])
    }

    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER_BYTES as usize);
        out.extend_from_slice(&MAGIC);
        let flags =
            if self.quantised { FLAG_QUANTISED } else { 0 } | if self.nested { FLAG_NESTED } else { 0 };
        for word in [VERSION, 0, self.levels.get(), flags] {
            out.extend_from_slice(&word.to_le_bytes());
        }
        let counts = [self.initial_vertices, self.initial_faces, self.roots, self.blocks, self.nodes];
        let told = [self.triangles, self.input_vertices, self.added_vertices, self.cut_edges];
        for count in counts.into_iter().chain(told).chain([self.left_out, self.degenerate]) {
            out.extend_from_slice(&count.to_le_bytes());
        }
        for x in self.scale.low.into_iter().chain([self.scale.step]) {
            out.extend_from_slice(&x.to_le_bytes());
        }
        out.extend_from_slice(&self.scale.base.to_le_bytes());
        out.extend_from_slice(&0_u32.to_le_bytes());
        out.extend_from_slice(&self.length.to_le_bytes());
        out.extend_from_slice(&crc32fast::hash(&out).to_le_bytes());
        out
    }
}

/// The checksum of a block.
pub(crate) fn block_sum(block: u32, bytes: &[u8]) -> u32 {
    let mut sum = crc32fast::Hasher::new();
    sum.update(&block.to_le_bytes());
    sum.update(bytes);
    sum.finalize()
}
