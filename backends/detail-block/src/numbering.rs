//! Numbers of nodes and half-edges in the file: block and offset apart by shift and mask.
//!
//! A block of `l` levels is numbered as if it had `2^l` nodes, full or not (section 4 of the paper: a power of two, so that
//! shifts and masks take the place of division). Node `n` has six half-edges, those of the two triangles that it brings:
//!
//! ```text
//! node       block << l | offset              offset = place in the complete binary tree, breadth-first, 0 for its root
//! half-edge  node << 3 | side << 2 | k        side 0: the triangle of A B C, side 1: that of D E F (see `half_edges`)
//!            2^31 | face << 2 | k             of an initial face
//!            2^32 - 1                         none: a boundary
//! ```

use vertex_tree::NodeId;

use crate::half_edges::BOUNDARY;

/// Bit of the half-edges of initial faces.
pub(crate) const INITIAL: u32 = 1 << 31;
/// Node numbers are less than this, so that their half-edges stay below [`INITIAL`].
pub(crate) const MOST_NODES: u64 = 1 << 28;
/// Faces of the base mesh are fewer than this.
pub(crate) const MOST_FACES: u64 = 1 << 29;
/// Levels of a block are at least 1 and at most this.
pub(crate) const MOST_LEVELS: u32 = 5;

/// What a half-edge in the file belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    Boundary,
    /// An initial face, and which half-edge of it.
    Face(u32, u32),
    /// A node, which of its triangles, and which half-edge of that.
    Node(NodeId, usize, u32),
}

/// What a half-edge in the file belongs to.
#[inline(always)]
pub(crate) fn owner(h: u32) -> Owner {
    if h == BOUNDARY {
        Owner::Boundary
    } else if h & INITIAL != 0 {
        Owner::Face((h & !INITIAL) >> 2, h & 3)
    } else {
        Owner::Node(NodeId(h >> 3), (h >> 2 & 1) as usize, h & 3)
    }
}

/// Half-edge `k` of an initial face.
pub(crate) fn face_half_edge(face: u32, k: u32) -> u32 {
    INITIAL | face << 2 | k
}

/// Half-edge `k` of a triangle of a node.
pub(crate) fn node_half_edge(node: u32, side: u32, k: u32) -> u32 {
    node << 3 | side << 2 | k
}

/// How many levels blocks have, and what follows from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Levels(u32);

impl Levels {
    /// `None` if there can not be so many.
    pub fn new(levels: u32) -> Option<Self> {
        (1..=MOST_LEVELS).contains(&levels).then_some(Self(levels))
    }

    pub fn get(self) -> u32 {
        self.0
    }

    /// Nodes of a full block.
    pub fn full(self) -> u32 {
        (1 << self.0) - 1
    }

    /// Child blocks that a block can have.
    pub fn fan_out(self) -> u32 {
        1 << self.0
    }

    /// The offset of the first node of the lowest level, whose children are roots of child blocks.
    #[inline(always)]
    pub fn lowest(self) -> u32 {
        (1 << (self.0 - 1)) - 1
    }

    /// Bytes of a set of flags: one for each node and one more.
    pub fn flag_bytes(self) -> usize {
        (1_usize << self.0).div_ceil(8)
    }

    /// The bit that marks a block without children.
    pub fn leaf_bit(self) -> u32 {
        1 << self.full()
    }

    #[inline(always)]
    pub fn block(self, node: NodeId) -> u32 {
        node.0 >> self.0
    }

    #[inline(always)]
    pub fn offset(self, node: NodeId) -> u32 {
        node.0 & ((1 << self.0) - 1)
    }

    #[inline(always)]
    pub fn node(self, block: u32, offset: u32) -> NodeId {
        NodeId(block << self.0 | offset)
    }
}
