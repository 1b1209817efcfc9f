//! The blocks in memory: the directory (section 4 of the paper).
//!
//! The directory says of each block where it is among the loaded ones, which nodes it has and where they are, so that the
//! way to a node does not lead through its block. A root of a block that is in play but removed leaves behind its sphere, error and parent: a [`Stub`].

use std::ops::Range;
use std::sync::Arc;

use rustc_hash::FxHashMap;
use slab::Slab;
use vertex_tree::{Bounds, NONE, NodeId};

use crate::block::{Block, Inflated, Node, index_of, resident_bytes};
use crate::file::XfmFile;
use crate::node_memory::{NodeMemory, Place};

/// What a removed block's root in play is still asked about.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stub {
    pub bounds: Bounds,
    pub parent: u32,
}

/// What the directory says of a block.
#[derive(Clone, Copy, Debug, Default)]
struct Entry {
    /// Which nodes it has, as stored: the root at least. None while it is not loaded.
    flags: u32,
    nodes: Place,
    /// Where it is among the loaded blocks.
    slot: u32,
}

/// The blocks in memory.
pub(crate) struct Blocks {
    pub file: Arc<XfmFile>,
    directory: Vec<Entry>,
    loaded: Slab<Block>,
    nodes: NodeMemory,
    /// What they take.
    pub bytes: u64,
    pub stubs: FxHashMap<u32, Stub>,
}

impl Blocks {
    pub fn new(file: Arc<XfmFile>) -> Self {
        Self {
            directory: vec![Entry::default(); file.header().blocks as usize],
            file,
            loaded: Slab::new(),
            nodes: NodeMemory::default(),
            bytes: 0,
            stubs: FxHashMap::default(),
        }
    }

    /// Bytes that are taken whatever is loaded.
    pub fn fixed_bytes(&self) -> u64 {
        self.file.fixed_bytes() + (size_of::<Entry>() * self.directory.len()) as u64
    }

    /// A block, if it is loaded.
    #[inline(always)]
    pub fn block(&self, number: u32) -> Option<&Block> {
        let entry = self.directory.get(number as usize)?;
        (entry.flags != 0).then(|| &self.loaded[entry.slot as usize])
    }

    #[inline(always)]
    pub fn block_mut(&mut self, number: u32) -> Option<&mut Block> {
        let entry = self.directory.get(number as usize)?;
        (entry.flags != 0).then(|| &mut self.loaded[entry.slot as usize])
    }

    pub fn iter(&self) -> impl Iterator<Item = &Block> {
        self.loaded.iter().map(|(_, block)| block)
    }

    /// A node, if its block is loaded and it is there.
    #[inline(always)]
    pub fn node(&self, node: NodeId) -> Option<&Node> {
        let (place, index) = self.place(node)?;
        Some(self.nodes.node(place, index))
    }

    #[inline(always)]
    pub fn node_mut(&mut self, node: NodeId) -> Option<&mut Node> {
        let (place, index) = self.place(node)?;
        Some(self.nodes.node_mut(place, index))
    }

    /// Where a node is: the nodes of its block, and which of these.
    #[inline(always)]
    fn place(&self, node: NodeId) -> Option<(Place, usize)> {
        let levels = self.file.levels();
        let entry = self.directory.get(levels.block(node) as usize)?;
        Some((entry.nodes, index_of(entry.flags, levels.offset(node))?))
    }

    #[inline(always)]
    pub fn is_active(&self, node: NodeId) -> bool {
        self.node(node).is_some_and(Node::is_active)
    }

    pub fn stub(&self, block: u32) -> Option<&Stub> {
        self.stubs.get(&block)
    }

    /// The child blocks of a node of the lowest level, empty for any other; `None` if its own block is not loaded.
    #[inline]
    pub fn child_blocks(&self, node: NodeId) -> Option<Range<u32>> {
        let levels = self.file.levels();
        let block = self.block(levels.block(node))?;
        let Some(i) = levels.offset(node).checked_sub(levels.lowest()) else { return Some(0..0) };
        let [left, right] = [block.child_block(2 * i), block.child_block(2 * i + 1)];
        Some(match (left, right) {
            (Some(first), Some(_)) => first..first + 2,
            (Some(only), None) | (None, Some(only)) => only..only + 1,
            (None, None) => 0..0,
        })
    }

    /// The first block that is not loaded on the way from a node up to an active one; before, those that are.
    pub fn way_up(&self, node: NodeId, mut loaded: impl FnMut(u32)) -> Option<u32> {
        let levels = self.file.levels();
        let mut at = node.0;
        // Block numbers fall on the way up, so this ends.
        while at != NONE && !self.is_active(NodeId(at)) {
            let number = levels.block(NodeId(at));
            let Some(block) = self.block(number) else { return Some(number) };
            loaded(number);
            at = block.parent;
        }
        None
    }

    /// The block of the sibling of a block's root, if there is one and the block above is loaded.
    pub fn sibling(&self, number: u32) -> Option<u32> {
        let parent = self.block(number)?.parent;
        if parent == NONE {
            return None;
        }
        self.child_blocks(NodeId(parent))?.find(|&other| other != number)
    }

    /// Whether a block may be removed: none of its nodes is active, and the sibling of its root is folded too.
    pub fn is_candidate(&self, number: u32) -> bool {
        let is_folded = |number| self.block(number).is_none_or(|block| block.active == 0);
        self.block(number).is_some() && is_folded(number) && self.sibling(number).is_none_or(is_folded)
    }

    /// Whether the root of a block hangs below an active node: it may be unfolded next.
    pub fn is_in_play(&self, number: u32) -> bool {
        let parent = self.block(number).map_or(NONE, |block| block.parent);
        parent != NONE && self.is_active(NodeId(parent))
    }

    pub fn insert(&mut self, Inflated { block, nodes }: Inflated) {
        self.stubs.remove(&block.number);
        self.bytes += resident_bytes(block.count());
        let (number, flags, nodes) = (block.number, block.flags, self.nodes.insert(&nodes));
        let slot = self.loaded.insert(block) as u32;
        self.directory[number as usize] = Entry { flags, nodes, slot };
    }

    /// Removes a block that is loaded.
    pub fn remove(&mut self, number: u32) -> Block {
        let Entry { nodes, slot, .. } = std::mem::take(&mut self.directory[number as usize]);
        let block = self.loaded.remove(slot as usize);
        self.bytes -= resident_bytes(block.count());
        if block.parent != NONE && self.is_active(NodeId(block.parent)) {
            let stub = Stub { bounds: self.nodes.node(nodes, 0).stored.bounds(), parent: block.parent };
            self.stubs.insert(number, stub);
        }
        self.nodes.remove(nodes);
        block
    }

    /// Whether a block that has come, its loaded neighbours and the list of roots agree about who is above whom.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn check_links(&self, Inflated { block, nodes }: &Inflated) -> Result<(), &'static str> {
        let levels = self.file.levels();
        let number = block.number;
        let root = levels.node(number, 0);
        let listed = self.file.roots().binary_search_by_key(&root, |&(root, _)| root).ok();
        if listed.is_some() != (block.parent == NONE) {
            return Err("it is a root's and not in the root list, or the reverse");
        }
        if listed.is_some_and(|i| self.file.roots()[i].1 != nodes[0].stored.bounds()) {
            return Err("the root list has another sphere");
        }
        if block.parent != NONE
            && let Some(above) = self.child_blocks(NodeId(block.parent))
            && (!above.contains(&number) || self.node(NodeId(block.parent)).is_none())
        {
            return Err("its parent does not know it");
        }
        let below = (0..levels.fan_out()).filter_map(|place| Some((place, block.child_block(place)?)));
        for (place, child) in below {
            let parent = levels.node(number, levels.lowest() + place / 2);
            if self.block(child).is_some_and(|child| child.parent != parent.0) {
                return Err("a child block does not know it");
            }
        }
        Ok(())
    }
}
