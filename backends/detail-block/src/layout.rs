//! Nodes into blocks: step 4 of the paper's construction.
//!
//! The forest is cut into complete subtrees of `l` levels from the roots down. Blocks are numbered depth-first, but that the
//! child blocks of a block come one after the other: so a block names its children with one number and a set of flags
//! instead of `2^l` numbers, and two siblings, which are always wanted together, lie together in the file.

use vertex_tree::NONE;

use crate::error::XfmError;
use crate::numbering::{Levels, MOST_NODES};
use crate::replay::Replay;

/// A block to be written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Planned {
    /// The collapse that is its root.
    pub root: u32,
    /// The number of the node above, or [`NONE`].
    pub parent: u32,
    pub first_child: u32,
    /// As stored.
    pub children: u32,
    pub flags: u32,
}

/// Which node goes where.
pub(crate) struct Layout {
    pub levels: Levels,
    pub blocks: Vec<Planned>,
    /// For each collapse, the number of its node.
    pub node_of: Vec<u32>,
    pub leaf_blocks: u64,
}

impl Layout {
    pub fn new(replay: &Replay, levels: Levels) -> Result<Self, XfmError> {
        let mut layout =
            Self { levels, blocks: Vec::new(), node_of: vec![NONE; replay.merges.len()], leaf_blocks: 0 };
        let mut places = Vec::new();
        let mut stack = Vec::new();
        for root in replay.roots() {
            stack.push(layout.add(root, NONE)?);
            while let Some(block) = stack.pop() {
                layout.places(replay, layout.blocks[block as usize].root, &mut places);
                let mut flags = 0;
                for (offset, &node) in (0..).zip(&places).filter(|&(_, &node)| node != NONE) {
                    flags |= 1 << offset;
                    layout.node_of[node as usize] = levels.node(block, offset).0;
                }
                let (first_child, mut children) = (layout.blocks.len() as u32, 0);
                let lowest = (levels.lowest()..).zip(&places[levels.lowest() as usize..]);
                for (offset, &node) in lowest.filter(|&(_, &node)| node != NONE) {
                    for (side, child) in (0..).zip(replay.merges[node as usize].children) {
                        if child != NONE {
                            children |= 1 << (2 * (offset - levels.lowest()) + side);
                            layout.add(child, levels.node(block, offset).0)?;
                        }
                    }
                }
                if children == 0 {
                    flags |= levels.leaf_bit();
                    layout.leaf_blocks += 1;
                }
                let last = layout.blocks.len() as u32;
                stack.extend((first_child..last).rev());
                let planned = &mut layout.blocks[block as usize];
                (planned.flags, planned.children) = (flags, children);
                planned.first_child = if children == 0 { NONE } else { first_child };
            }
        }
        Ok(layout)
    }

    fn add(&mut self, root: u32, parent: u32) -> Result<u32, XfmError> {
        let number = self.blocks.len() as u64;
        let most = MOST_NODES >> self.levels.get();
        if number >= most {
            return Err(XfmError::TooLarge { what: "detail blocks", count: number + 1, most });
        }
        self.blocks.push(Planned { root, parent, first_child: NONE, children: 0, flags: 0 });
        Ok(number as u32)
    }

    /// The collapses of a block by offset, [`NONE`] where there is none.
    pub fn places(&self, replay: &Replay, root: u32, places: &mut Vec<u32>) {
        places.clear();
        places.resize(self.levels.full() as usize, NONE);
        places[0] = root;
        for offset in 0..self.levels.lowest() as usize {
            if places[offset] != NONE {
                let [kept, removed] = replay.merges[places[offset] as usize].children;
                (places[2 * offset + 1], places[2 * offset + 2]) = (kept, removed);
            }
        }
    }
}
