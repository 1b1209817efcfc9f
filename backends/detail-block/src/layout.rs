//! Nodes into blocks: step 4 of the paper's construction.
//!
//! The forest is cut into complete subtrees of `l` levels from the roots down. Blocks are numbered depth-first, but that the
//! child blocks of a block come one after the other: so a block names its children with one number and a set of flags
//! instead of `2^l` numbers, and two siblings, which are always wanted together, lie together in the file.
//!
//! No walk through the forest is needed for that, which would jump about in the order of the collapses. In that order
//! children come before their parents. So one pass from the last to the first collapse gives every node its level in its
//! block; one from the first to the last counts the blocks below every node; and one back again hands numbers down, as the
//! number of a block is that of the block above plus what comes between. A parent and its children are near each other in
//! their rounds, so each pass goes through a few places of the arrays at once, from one end to the other.

use bytemuck::{Pod, Zeroable};
use vertex_tree::NONE;

use crate::error::{Failure, XfmError};
use crate::numbering::{Levels, MOST_NODES};
use crate::replay::Merge;
use crate::storage::{Elements, Storage};

/// Where a node goes.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Planned {
    /// The number of the node.
    pub number: u32,
    /// Of the root of a block, the number of the node above, or [`NONE`].
    pub parent: u32,
    /// The first of the child blocks of its block that are below it.
    pub first_child: u32,
    /// The first child block of the first of these.
    next: u32,
    /// Its level in its block, 0 for the root.
    pub level: u32,
    /// How many child blocks of its block are below it.
    pub child_blocks: u32,
    /// How many blocks are below these.
    beyond: u32,
}

/// Which node goes where.
pub(crate) struct Layout<S: Storage> {
    pub nodes: S::Array<Planned>,
    /// From the last to the first: in ascending order of their numbers.
    pub roots: S::Array<u32>,
    pub blocks: u64,
    pub leaf_blocks: u64,
}

impl<S: Storage> Layout<S> {
    pub fn new(merges: &mut S::Array<Merge>, levels: Levels, storage: &S) -> Result<Self, Failure> {
        let blank = Planned {
            number: NONE,
            parent: NONE,
            first_child: NONE,
            next: NONE,
            level: 0,
            child_blocks: 0,
            beyond: 0,
        };
        let mut layout = Self {
            nodes: storage.array(merges.len(), blank, 25),
            roots: storage.growing(0, 1),
            blocks: 0,
            leaf_blocks: 0,
        };
        for n in (0..merges.len()).rev() {
            storage.check_stop()?;
            let level = (layout.nodes.get(n)?.level + 1) % levels.get();
            for child in children(&merges.get(n)?) {
                layout.nodes.get_mut(child)?.level = level;
            }
        }
        for n in 0..merges.len() {
            storage.check_stop()?;
            layout.count(n, &merges.get(n)?, levels)?;
        }
        for n in (0..merges.len()).rev() {
            storage.check_stop()?;
            layout.number(n, &merges.get(n)?, levels)?;
        }
        Ok(layout)
    }

    fn count(&mut self, n: usize, merge: &Merge, levels: Levels) -> Result<(), Failure> {
        let is_lowest = self.nodes.get(n)?.level + 1 == levels.get();
        let (mut child_blocks, mut beyond) = (0, 0);
        for child in children(merge) {
            let child = self.nodes.get(child)?;
            if is_lowest {
                child_blocks += 1;
                beyond += child.child_blocks + child.beyond;
            } else {
                child_blocks += child.child_blocks;
                beyond += child.beyond;
            }
        }
        let own = self.nodes.get_mut(n)?;
        (own.child_blocks, own.beyond) = (child_blocks, beyond);
        Ok(())
    }

    fn number(&mut self, n: usize, merge: &Merge, levels: Levels) -> Result<(), Failure> {
        let mut own = self.nodes.get(n)?;
        if own.number == NONE {
            self.roots.push(n as u32)?;
            let block = self.blocks;
            self.blocks += 1 + u64::from(own.child_blocks) + u64::from(own.beyond);
            let most = MOST_NODES >> levels.get();
            if self.blocks > most {
                return Err(XfmError::TooLarge { what: "detail blocks", count: self.blocks, most }.into());
            }
            own.number = levels.node(block as u32, 0).0;
            own.first_child = block as u32 + 1;
            own.next = own.first_child + own.child_blocks;
            *self.nodes.get_mut(n)? = own;
        }
        if own.level == 0 && own.child_blocks == 0 {
            self.leaf_blocks += 1;
        }
        let is_lowest = own.level + 1 == levels.get();
        let (mut first_child, mut next) = (own.first_child, own.next);
        for (side, child) in (1..).zip(merge.children).filter(|&(_, child)| child != NONE) {
            let child = self.nodes.get_mut(child as usize)?;
            if is_lowest {
                child.number = levels.node(first_child, 0).0;
                child.parent = own.number;
                (child.first_child, child.next) = (next, next + child.child_blocks);
                first_child += 1;
                next += child.child_blocks + child.beyond;
            } else {
                // The block's bits stay; the offset doubles.
                child.number = own.number + levels.offset(vertex_tree::NodeId(own.number)) + side;
                (child.first_child, child.next) = (first_child, next);
                first_child += child.child_blocks;
                next += child.beyond;
            }
        }
        Ok(())
    }
}

fn children(merge: &Merge) -> impl Iterator<Item = usize> {
    merge.children.into_iter().filter(|&child| child != NONE).map(|child| child as usize)
}
