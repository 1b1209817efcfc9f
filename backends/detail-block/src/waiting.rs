//! Changes that wait for blocks.
//!
//! A change that is refused is not asked for again before a block that it waits for has come, or the request has failed.
//! Meanwhile the blocks that it has made use of, and will again, are pinned: no other change makes room with them. Nobody
//! waits any more for a change that has been given up: then requests are taken back that nobody else waits for.

use std::ops::Range;

use rustc_hash::FxHashMap;
use vertex_tree::{NONE, NodeId};

use crate::paging::Paging;

/// What a change waits for, and what it needs beside that.
#[derive(Default)]
struct Wait {
    /// Of these blocks, those that are under way.
    blocks: Range<u32>,
    /// Blocks that it has pinned.
    pinned: Vec<u32>,
}

/// The changes that wait.
#[derive(Default)]
pub(crate) struct Waiting {
    waits: FxHashMap<NodeId, Wait>,
    /// By how many changes each block is pinned.
    pins: FxHashMap<u32, u32>,
    /// Changes for which nothing could be asked for: they ask again in the next frame.
    pub again: Vec<NodeId>,
}

impl Waiting {
    /// Whether a change that waits has made use of a block.
    pub fn pins(&self, block: u32) -> bool {
        self.pins.contains_key(&block)
    }

    fn pin(&mut self, block: u32) {
        *self.pins.entry(block).or_default() += 1;
    }

    fn unpin(&mut self, block: u32) {
        if let Some(pins) = self.pins.get_mut(&block) {
            *pins -= 1;
            if *pins == 0 {
                self.pins.remove(&block);
            }
        }
    }
}

impl Paging {
    /// A change waits for those of some blocks that are under way.
    pub fn wait(&mut self, node: NodeId, blocks: Range<u32>) {
        self.waiting.waits.insert(node, Wait { blocks, pinned: Vec::new() });
    }

    /// A change that waits has made use of its own block, of child blocks, and of those on the way up from a node that it
    /// needs, as far as they are loaded: they are pinned.
    pub fn pin_for(&mut self, node: NodeId, needed: Option<NodeId>) {
        if !self.waiting.waits.contains_key(&node) {
            return;
        }
        let levels = self.file.levels();
        let mut pinned = vec![levels.block(node)];
        pinned.extend(self.child_blocks(node).unwrap_or_default());
        let mut at = needed.map_or(NONE, |needed| needed.0);
        // Block numbers fall on the way up, so this ends.
        while at != NONE && !self.is_active(NodeId(at)) {
            let number = levels.block(NodeId(at));
            pinned.push(number);
            at = self.block(number).map_or(NONE, |block| block.parent);
        }
        pinned.retain(|&number| self.block(number).is_some());
        pinned.iter().for_each(|&number| self.waiting.pin(number));
        if let Some(wait) = self.waiting.waits.get_mut(&node) {
            wait.pinned = pinned;
        }
    }

    /// A change does not wait any more: it asks again, or is to.
    pub fn stop_waiting(&mut self, node: NodeId) {
        if self.waiting.waits.is_empty() {
            return;
        }
        let Some(Wait { blocks, pinned }) = self.waiting.waits.remove(&node) else { return };
        for number in pinned {
            self.waiting.unpin(number);
            self.use_block(number);
        }
        for number in blocks {
            if let Some(pending) = self.pending.get_mut(&number) {
                pending.waiting.retain(|&other| other != node);
            }
        }
    }

    /// A change that was refused is not wanted any more.
    pub fn give_up(&mut self, node: NodeId) {
        self.waiting.again.retain(|&other| other != node);
        let Some(blocks) = self.waiting.waits.get(&node).map(|wait| wait.blocks.clone()) else { return };
        self.stop_waiting(node);
        for number in blocks {
            let Self { loader: Some(loader), pending, .. } = self else { return };
            let is_unwanted =
                |number: u32| pending.get(&number).is_some_and(|pending| pending.waiting.is_empty());
            let run = loader.take_back(number, |run| run.numbers().all(is_unwanted));
            if let Some(run) = run {
                self.withdrawn(run);
            }
        }
    }
}
