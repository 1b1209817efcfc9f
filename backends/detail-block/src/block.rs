//! A detail block in memory.
//!
//! Blocks are inflated when they are loaded (section 4): the paper's 108 bytes a node, pointers to parent and children and
//! six half-edges among them, are 64 here. Links within a block follow from offsets, those between blocks go by number
//! through the directory, and the half-edges of a node's two triangles lie in the slots of the displayed mesh, which the
//! node names, as only active nodes have any.

use vertex_tree::{NONE, NodeId};

use crate::format::{Header, block_sum};
use crate::node::Stored;
use crate::numbering::{Owner, owner};

/// A node in memory: a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Node {
    pub stored: Stored,
    /// While active, the slots of the triangles beside w x and y z, or [`NONE`].
    pub slots: [u32; 2],
    /// [`ACTIVE`], and how many active nodes need this one's triangles.
    pub status: u32,
}

/// Bit of an active node's status.
pub(crate) const ACTIVE: u32 = 1 << 31;

impl Node {
    /// What no block's node is.
    pub const BLANK: Self = Self {
        stored: Stored {
            position: [0.0; 3],
            normal: [0.0; 3],
            radius: 0.0,
            sine: 0.0,
            adjacent: [NONE; 4],
            eps: 0.0,
        },
        slots: [NONE; 2],
        status: 0,
    };

    #[inline(always)]
    pub fn is_active(&self) -> bool {
        self.status & ACTIVE != 0
    }

    /// How many half-edges of active nodes' w x y z belong to this node's triangles.
    #[inline(always)]
    pub fn needed_by(&self) -> u32 {
        self.status & !ACTIVE
    }
}

/// A loaded block.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub number: u32,
    /// Presence, as stored.
    pub flags: u32,
    /// The node above, or [`NONE`].
    pub parent: u32,
    pub first_child: u32,
    /// Which child blocks there are, as stored.
    pub children: u32,
    /// How many of the nodes are active.
    pub active: u16,
    /// Whether it was loaded ahead of time and no change has made use of it yet.
    pub is_unused: bool,
    /// When it became a candidate for removal, in frames, and the last frame that made use of it.
    pub stamp: u64,
    pub used: u64,
    /// When it left play, 0 while it has not.
    pub left: u64,
}

/// A block as it comes from the file.
#[derive(Clone, Debug)]
pub(crate) struct Inflated {
    pub block: Block,
    pub nodes: Vec<Node>,
}

/// Bytes of memory that a block of so many nodes takes.
pub(crate) fn resident_bytes(nodes: u32) -> u64 {
    (size_of::<Block>() + nodes as usize * size_of::<Node>()) as u64
}

impl Block {
    /// Inflates a block from its bytes in the file. What is wrong with them is said as an error.
    pub fn decode(header: &Header, number: u32, bytes: &[u8]) -> Result<Inflated, &'static str> {
        let levels = header.levels;
        let (count, by_length) = header.nodes_of(bytes.len() as u64).ok_or("its length fits no block")?;
        let (body, sum) = bytes.split_at(bytes.len() - 4);
        let word = |at: usize| u32::from_le_bytes([body[at], body[at + 1], body[at + 2], body[at + 3]]);
        if block_sum(number, body) != u32::from_le_bytes([sum[0], sum[1], sum[2], sum[3]]) {
            return Err("checksum does not match");
        }
        let set = levels.flag_bytes();
        let flag_set = |at: usize| (0..set).fold(0, |flags, i| flags | u32::from(body[at + i]) << (8 * i));
        let flags = flag_set(0);
        let present = flags & (levels.leaf_bit() - 1);
        let is_leaf = flags & levels.leaf_bit() != 0;
        if is_leaf != by_length || present.count_ones() != count || flags & !present & !levels.leaf_bit() != 0
        {
            return Err("flags do not fit the length");
        }
        let has = |offset: u32| present & 1 << offset != 0;
        if !has(0) || (1..levels.full()).any(|offset| has(offset) && !has((offset - 1) / 2)) {
            return Err("a node without the one above it");
        }
        let parent = word(set);
        let above = levels.block(NodeId(parent));
        if parent != NONE && (above >= number || levels.offset(NodeId(parent)) < levels.lowest()) {
            return Err("its parent is no node of the lowest level of an earlier block");
        }
        let (mut first_child, mut children, mut at) = (NONE, 0, set + 4);
        if !is_leaf {
            (first_child, children) = (word(at), flag_set(at + 4));
            at += 4 + set;
            let last = u64::from(first_child) + u64::from(children.count_ones());
            if first_child <= number || last > header.blocks || children == 0 {
                return Err("its child blocks are not where they can be");
            }
            let all = if levels.fan_out() == 32 { u32::MAX } else { (1 << levels.fan_out()) - 1 };
            let above = |i: u32| levels.lowest() + i / 2;
            if children & !all != 0 || (0..levels.fan_out()).any(|i| children & 1 << i != 0 && !has(above(i)))
            {
                return Err("a child block without the node above it");
            }
        }
        let mut nodes = Vec::with_capacity(count as usize);
        for bytes in body[at..].chunks_exact(header.node_bytes()) {
            let stored = Stored::decode(header.quantisation(), bytes);
            if !stored.is_sane() {
                return Err("a node with numbers that are none");
            }
            if !stored.adjacent.iter().all(|&h| is_possible(header, h)) {
                return Err("a half-edge that can not be");
            }
            let [w, x, y, z] = stored.adjacent;
            if [w, x, y, z] == [NONE; 4] {
                return Err("a node without triangles");
            }
            nodes.push(Node { stored, slots: [NONE; 2], status: 0 });
        }
        let block = Self {
            number,
            flags: present,
            parent,
            first_child,
            children,
            active: 0,
            is_unused: false,
            stamp: 0,
            used: 0,
            left: 0,
        };
        Ok(Inflated { block, nodes })
    }

    /// How many nodes it has.
    #[inline(always)]
    pub fn count(&self) -> u32 {
        self.flags.count_ones()
    }

    /// Where the node at an offset is among its nodes, if it is present.
    #[inline(always)]
    pub fn index_of(&self, offset: u32) -> Option<usize> {
        index_of(self.flags, offset)
    }

    /// The number of the child block at a place among the possible ones.
    #[inline(always)]
    pub fn child_block(&self, place: u32) -> Option<u32> {
        let bit = 1 << place;
        (self.children & bit != 0).then(|| self.first_child + (self.children & (bit - 1)).count_ones())
    }
}

/// Where the node at an offset is among those that a block has, if it is present.
#[inline(always)]
pub(crate) fn index_of(flags: u32, offset: u32) -> Option<usize> {
    let bit = 1 << offset;
    (flags & bit != 0).then(|| (flags & (bit - 1)).count_ones() as usize)
}

/// Whether a half-edge number belongs to something that could be there.
fn is_possible(header: &Header, h: u32) -> bool {
    match owner(h) {
        Owner::Boundary => true,
        Owner::Face(face, k) => u64::from(face) < header.initial_faces && k < 3,
        Owner::Node(node, _, k) => {
            let levels = header.levels;
            u64::from(levels.block(node)) < header.blocks && levels.offset(node) < levels.full() && k < 3
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_is_a_cache_line() {
        assert_eq!(size_of::<Node>(), 64);
    }
}
