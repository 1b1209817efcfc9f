//! What the engine foresees, made into requests.
//!
//! Each frame the engine names nodes that are expected to change and when. With a node its group is expected: what its
//! change needs beyond the node itself. What is not in memory of it is asked for in the order in which it is needed, behind
//! what refused changes wait for, and taken back if nobody names it any more. What is expected is kept, whatever the cache
//! mode, and for a while after it was last named: expectations come and go with the camera's shaking.

use std::collections::VecDeque;

use super::change::Change;
use super::nodes::Nodes;
use rustc_hash::{FxHashMap, FxHashSet};

/// For how many frames something that was named is kept.
const KEPT: u64 = 60;

#[derive(Clone, Copy, Debug)]
struct Expected {
    /// When it will be needed.
    due: u64,
    /// When it was last named.
    named: u64,
}

#[derive(Debug, Default)]
pub(super) struct Foresight {
    frame: u64,
    /// What has been named since the last frame, and in how many frames it will change.
    naming: Vec<(u32, u32)>,
    expected: FxHashMap<u32, Expected>,
    /// What was named in this frame with all that belongs to it, the nearest first.
    named: Vec<u32>,
    /// Those of it that nothing has been let go of yet.
    farthest: usize,
    /// When to look whether something is still expected.
    expiring: VecDeque<(u64, u32)>,
    /// What was fetched ahead and no change has used yet.
    pub unused: FxHashSet<u32>,
}

impl Foresight {
    /// Whether the node will be needed, as far as the engine sees now.
    pub fn is_named(&self, node: u32) -> bool {
        self.expected.get(&node).is_some_and(|e| e.named == self.frame)
    }

    /// Whether the node is kept.
    pub fn keeps(&self, node: u32) -> bool {
        self.expected.contains_key(&node)
    }

    /// The farthest of what is expected, in `earliest` or later; each once in a frame.
    pub fn next_farthest(&mut self, earliest: u64) -> Option<u32> {
        let node = *self.named[..self.farthest].last()?;
        if self.expected.get(&node).is_some_and(|e| e.due < earliest) {
            return None;
        }
        self.farthest -= 1;
        Some(node)
    }

    /// A node is expected to change in so many frames.
    pub fn will_need(&mut self, node: u32, frames: u32) {
        self.naming.push((node, frames));
    }

    fn name(&mut self, node: u32, due: u64) {
        let frame = self.frame;
        let expected = self.expected.entry(node).or_insert(Expected { due, named: 0 });
        if expected.named == frame {
            expected.due = expected.due.min(due);
        } else {
            *expected = Expected { due, named: frame };
            self.named.push(node);
        }
    }

    /// A frame ends: takes note of what was named in it.
    pub fn end_frame(&mut self, frame: u64, nodes: &mut Nodes) {
        let before = std::mem::take(&mut self.named);
        self.frame = frame;
        let mut naming = std::mem::take(&mut self.naming);
        for (node, frames) in naming.drain(..) {
            let due = frame + u64::from(frames);
            self.name(node, due);
            let change = if nodes.is_active(node) { Change::Fold } else { Change::Unfold };
            if let Some(record) = nodes.residents.get(node) {
                change.neighbours(record, |n| self.name(n, due));
            }
        }
        self.naming = naming;
        for node in before {
            if !self.is_named(node) {
                // From now on it goes when its turn comes.
                nodes.residents.touch(node);
                self.expiring.push_back((frame + KEPT, node));
            }
        }
        let Self { named, expected, .. } = self;
        named.sort_by_cached_key(|n| (expected.get(n).map(|e| e.due), *n));
        self.farthest = self.named.len();
        while self.expiring.front().is_some_and(|&(until, _)| until <= frame) {
            let Some((_, node)) = self.expiring.pop_front() else { break };
            let is_over = |e: &Expected| e.named + KEPT <= frame;
            if self.expected.get(&node).is_some_and(is_over) {
                self.expected.remove(&node);
                nodes.mark_of(node);
            }
        }
    }

    /// What was named in the frame that has ended and is not in memory: when it is needed, what is read to get it, in the order of
    /// that, and which nodes.
    pub fn missing(&self, nodes: &Nodes) -> Vec<(u64, u32, Vec<u32>)> {
        let mut missing: Vec<(u64, u32, u32)> = Vec::new();
        for &node in &self.named {
            if !nodes.residents.contains(node) {
                let due = self.expected.get(&node).map_or(self.frame, |e| e.due);
                missing.push((due, nodes.unit_of(node), node));
            }
        }
        missing.sort_unstable_by_key(|&(due, unit, node)| (unit, due, node));
        let mut units: Vec<(u64, u32, Vec<u32>)> = Vec::new();
        for (due, unit, node) in missing {
            match units.last_mut().filter(|last| last.1 == unit) {
                Some((_, _, nodes)) => nodes.push(node),
                None => units.push((due, unit, vec![node])),
            }
        }
        units
    }

    /// A change has used a node: if it was fetched ahead, that has been worth it, with all that came with it. Says whether
    /// it was.
    pub fn used(&mut self, node: u32, nodes: &Nodes) -> bool {
        if !self.unused.contains(&node) {
            return false;
        }
        for other in nodes.nodes_of(nodes.unit_of(node)) {
            self.unused.remove(&other);
        }
        true
    }
}
