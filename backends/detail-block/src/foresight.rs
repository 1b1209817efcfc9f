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

use crate::loader::{Loader, Run};
use crate::numbering::{Owner, owner};
use crate::paging::Paging;

/// What a tree foresees.
#[derive(Default)]
pub(crate) struct Foresight {
    /// Blocks named in this frame, some more than once, each with the frames until it is needed.
    named: Vec<(u32, u32)>,
    /// Those of the last frame, each with its earliest time.
    due: FxHashMap<u32, u32>,
    /// The same, nearest first: for making room the last one is taken off.
    order: Vec<(u32, u32)>,
    withdrawn: Vec<Run>,
}

/// Frames of foresight, at least.
const LEAST: u32 = 2;

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
}

impl Paging {
    /// For how many frames ahead it is worth to know what will be needed.
    pub fn look_ahead(&self) -> u32 {
        let [missed, _] = self.loader.as_ref().map_or([0; 2], Loader::waiting);
        self.store.frames(missed, LEAST)
    }

    /// A node is expected to change in so many frames.
    pub fn foresee(&mut self, node: NodeId, frames: u32) {
        let file = &self.file;
        let levels = file.levels();
        let number = levels.block(node);
        if self.is_active(node) || u64::from(number) >= file.header().blocks {
            return;
        }
        self.foresight.named.push((number, frames));
        for below in self.child_blocks(node).unwrap_or_default() {
            self.foresight.named.push((below, frames));
        }
        if !file.header().nested
            && let Some(adjacent) = self.node(node).map(|node| node.stored.adjacent)
        {
            for h in adjacent {
                if let Owner::Node(needed, ..) = owner(h) {
                    self.foresee_way(needed, frames);
                }
            }
        }
    }

    /// The first block that is missing on the way from a needed node up to an active one.
    fn foresee_way(&mut self, needed: NodeId, frames: u32) {
        let levels = self.file.levels();
        let mut at = needed.0;
        // Block numbers fall on the way up, so this ends.
        while at != vertex_tree::NONE && !self.is_active(NodeId(at)) {
            let number = levels.block(NodeId(at));
            match self.block(number) {
                Some(block) => at = block.parent,
                None => return self.foresight.named.push((number, frames)),
            }
        }
    }

    /// Takes back what was asked for ahead of time and has not been started. Says whether there was any.
    pub fn withdraw(&mut self) -> bool {
        let mut runs = std::mem::take(&mut self.foresight.withdrawn);
        if let Some(loader) = &mut self.loader {
            loader.withdraw(&mut runs);
        }
        let is_any = !runs.is_empty();
        for run in runs.drain(..) {
            self.withdrawn(run);
        }
        self.foresight.withdrawn = runs;
        is_any
    }

    /// A request has been taken back.
    pub fn withdrawn(&mut self, run: Run) {
        self.reserved -= self.bytes_of(run);
        for number in run.numbers() {
            self.pending.remove(&number);
        }
    }

    /// Asks for what has been named in this frame, instead of what was before.
    pub fn ask_for_foreseen(&mut self) {
        self.withdraw();
        let foresight = &mut self.foresight;
        // The earliest of each block.
        foresight.named.sort_unstable();
        foresight.named.dedup_by_key(|&mut (block, _)| block);
        foresight.due.clear();
        foresight.due.extend(foresight.named.iter().copied());
        foresight.order.clear();
        foresight.order.extend(foresight.named.drain(..).map(|(block, due)| (due, block)));
        foresight.order.sort_unstable();
        let mut at = 0;
        // Making room takes off the end.
        while let Some(&(due, first)) = self.foresight.order.get(at) {
            at += 1;
            if !self.is_missing(first) {
                continue;
            }
            // Siblings are named together and lie together.
            let sibling = self.foresight.order.get(at).is_some_and(|&next| next == (due, first + 1));
            let count = if sibling && self.is_missing(first + 1) { 2 } else { 1 };
            at += count as usize - 1;
            let run = Run { first, count };
            if !self.make_room(self.bytes_of(run), due) {
                return;
            }
            self.ask(run, None);
        }
    }

    /// Whether a block is neither there nor under way, and nothing is known to be wrong with it.
    fn is_missing(&self, number: u32) -> bool {
        self.block(number).is_none()
            && !self.pending.contains_key(&number)
            && !self.failures.contains_key(&number)
    }

    /// Appends the children of a node with their bounds, if all of them are there.
    pub fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        let levels = self.file.levels();
        let (number, offset) = (levels.block(node), levels.offset(node));
        let Some(block) = self.block(number) else { return false };
        if let Some(i) = offset.checked_sub(levels.lowest()) {
            let before = children.len();
            for child in [2 * i, 2 * i + 1].into_iter().filter_map(|place| block.child_block(place)) {
                let Some(below) = self.block(child) else {
                    children.truncate(before);
                    return false;
                };
                children.push((levels.node(child, 0), below.nodes[0].stored.bounds()));
            }
        } else {
            for below in [2 * offset + 1, 2 * offset + 2] {
                if let Some(index) = block.index_of(below) {
                    children.push((levels.node(number, below), block.nodes[index].stored.bounds()));
                }
            }
        }
        true
    }
}
