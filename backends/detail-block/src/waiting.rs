//! Changes that wait for blocks.
//!
//! A change that is refused is not asked for again before a block that it waits for has come, or the request has failed.
//! Meanwhile the blocks that it has made use of, and will again, are pinned: no other change makes room with them. Nobody
//! waits any more for a change that has been given up: then requests are taken back that nobody else waits for.

use std::ops::Range;

use rustc_hash::FxHashMap;
use vertex_tree::NodeId;

use crate::blocks::Blocks;

/// What a change waits for, and what it needs beside that.
#[derive(Default)]
pub(crate) struct Wait {
    /// Of these blocks, those that are under way.
    pub blocks: Range<u32>,
    /// Blocks that it has pinned.
    pub pinned: Vec<u32>,
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

    /// A change waits for those of some blocks that are under way.
    pub fn wait(&mut self, node: NodeId, blocks: Range<u32>) {
        self.waits.insert(node, Wait { blocks, pinned: Vec::new() });
    }

    /// What a change waits for.
    pub fn waits_for(&self, node: NodeId) -> Option<Range<u32>> {
        self.waits.get(&node).map(|wait| wait.blocks.clone())
    }

    /// A change that waits has made use of its own block, of child blocks, and of those on the way up from a node that it
    /// needs, as far as they are loaded: they are pinned.
    pub fn pin_for(&mut self, node: NodeId, needed: Option<NodeId>, blocks: &Blocks) {
        let Some(wait) = self.waits.get_mut(&node) else { return };
        let mut pinned = vec![blocks.file.levels().block(node)];
        pinned.extend(blocks.child_blocks(node).unwrap_or_default());
        if let Some(needed) = needed {
            blocks.way_up(needed, |number| pinned.push(number));
        }
        pinned.retain(|&number| blocks.block(number).is_some());
        for &number in &pinned {
            *self.pins.entry(number).or_default() += 1;
        }
        wait.pinned = pinned;
    }

    /// A change does not wait any more: what it has pinned is free.
    pub fn stop(&mut self, node: NodeId) -> Option<Wait> {
        if self.waits.is_empty() {
            return None;
        }
        let wait = self.waits.remove(&node)?;
        for number in &wait.pinned {
            if let Some(pins) = self.pins.get_mut(number) {
                *pins -= 1;
                if *pins == 0 {
                    self.pins.remove(number);
                }
            }
        }
        Some(wait)
    }
}
