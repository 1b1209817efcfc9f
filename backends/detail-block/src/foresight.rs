//! Loading what is foreseen: the engine names nodes that are expected to change, and when.
//!
//! Of a node that is to be unfolded, its own block, its child blocks if it is on the lowest level, and where bounds are not
//! nested over them the blocks of what it needs. (Folding takes nothing that is not there.) At the end of each frame
//! what was asked for before and has not been started is taken back, and what is named now is asked for, the nearest in
//! time first and behind everything that a frame has missed.
//!
//! A block that is foreseen makes room last, the farthest first, and never for one that is needed later than itself: so
//! what is nearest in time is always there or under way, and nothing is read to make room for each other in turns.

use rustc_hash::FxHashMap;
use vertex_tree::{Bounds, NodeId};

use crate::blocks::Blocks;
use crate::numbering::{Owner, owner};

/// What a tree foresees.
#[derive(Default)]
pub(crate) struct Foresight {
    /// Blocks named in this frame, some more than once, each with the frames until it is needed.
    named: Vec<(u32, u32)>,
    /// Those of the last frame, each with its earliest time.
    due: FxHashMap<u32, u32>,
    /// The same, nearest first: for making room the last one is taken off.
    order: Vec<(u32, u32)>,
}

impl Foresight {
    /// Whether a block is foreseen.
    #[inline]
    pub fn holds(&self, block: u32) -> bool {
        !self.due.is_empty() && self.due.contains_key(&block)
    }

    /// The block that is needed last, if that is in more than so many frames. It is not foreseen any more.
    pub fn farthest(&mut self, than: u32) -> Option<u32> {
        self.order.pop_if(|&mut (due, _)| due > than).map(|(_, block)| {
            self.due.remove(&block);
            block
        })
    }

    /// A node is expected to change in so many frames.
    pub fn foresee(&mut self, node: NodeId, frames: u32, blocks: &Blocks) {
        let file = &blocks.file;
        let number = file.levels().block(node);
        if blocks.is_active(node) || u64::from(number) >= file.header().blocks {
            return;
        }
        self.named.push((number, frames));
        for below in blocks.child_blocks(node).unwrap_or_default() {
            self.named.push((below, frames));
        }
        if !file.header().nested
            && let Some(adjacent) = blocks.node(node).map(|node| node.stored.adjacent)
        {
            for h in adjacent {
                if let Owner::Node(needed, ..) = owner(h) {
                    self.named.extend(blocks.way_up(needed, |_| ()).map(|missing| (missing, frames)));
                }
            }
        }
    }

    /// A frame ends: what was named in it is what is foreseen.
    pub fn end_frame(&mut self) {
        // The earliest of each block.
        self.named.sort_unstable();
        self.named.dedup_by_key(|&mut (block, _)| block);
        self.due.clear();
        self.due.extend(self.named.iter().copied());
        self.order.clear();
        self.order.extend(self.named.drain(..).map(|(block, due)| (due, block)));
        self.order.sort_unstable();
    }

    /// Of what is foreseen, nearest first, the one at a place, with when it is needed; there are fewer once room has been made.
    pub fn at(&self, place: usize) -> Option<(u32, u32)> {
        self.order.get(place).copied()
    }
}

/// Appends the children of a node with their bounds, if all of them are there.
pub(crate) fn peek(blocks: &Blocks, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
    let levels = blocks.file.levels();
    let (number, offset) = (levels.block(node), levels.offset(node));
    let Some(block) = blocks.block(number) else { return false };
    if let Some(i) = offset.checked_sub(levels.lowest()) {
        let before = children.len();
        for child in [2 * i, 2 * i + 1].into_iter().filter_map(|place| block.child_block(place)) {
            let root = levels.node(child, 0);
            let Some(below) = blocks.node(root) else {
                children.truncate(before);
                return false;
            };
            children.push((root, below.stored.bounds()));
        }
    } else {
        for below in [2 * offset + 1, 2 * offset + 2] {
            let child = levels.node(number, below);
            children.extend(blocks.node(child).map(|node| (child, node.stored.bounds())));
        }
    }
    true
}
