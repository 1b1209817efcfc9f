//! What the engine foresees, made into requests.
//!
//! Each frame the engine names nodes that are expected to change and when. With a node its group is expected: what its
//! change needs beyond the node itself. What is not in memory of it is asked for in the order in which it is needed, behind
//! what refused changes wait for, and taken back if nobody names it any more. What is expected is kept, whatever the cache
//! mode, and for a while after it was last named: expectations come and go with the camera's shaking.

use std::collections::VecDeque;

use rustc_hash::{FxHashMap, FxHashSet};
use vertex_tree::LookAhead;

use super::room::Need;
use super::{Change, Paging};

/// Frames of foresight, at least.
const LEAST: u32 = 2;
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
    /// What is known of the store.
    pub store: LookAhead,
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
}

impl Paging {
    /// For how many frames ahead it is worth knowing what will be needed.
    pub fn look_ahead(&self) -> u32 {
        let Some(foresight) = &self.foresight else { return 0 };
        let [missed, _] = self.line.waiting();
        foresight.store.frames(missed, LEAST)
    }

    pub fn will_need(&mut self, node: u32, frames: u32) {
        if let Some(foresight) = &mut self.foresight {
            foresight.naming.push((node, frames));
        }
    }

    /// Takes note of what was named in this frame.
    pub(super) fn foresee(&mut self) {
        let Some(foresight) = &mut self.foresight else { return };
        let before = std::mem::take(&mut foresight.named);
        foresight.frame = self.frame;
        let mut naming = std::mem::take(&mut foresight.naming);
        for (node, frames) in naming.drain(..) {
            let due = self.frame + u64::from(frames);
            foresight.name(node, due);
            let change = if self.nodes[node as usize].is_active { Change::Fold } else { Change::Unfold };
            if let Some(record) = self.residents.get(node) {
                change.neighbours(record, |n| foresight.name(n, due));
            }
        }
        foresight.naming = naming;
        for node in before {
            if !foresight.is_named(node) {
                // From now on it goes when its turn comes.
                self.residents.touch(node);
                foresight.expiring.push_back((self.frame + KEPT, node));
            }
        }
        let Foresight { named, expected, .. } = foresight;
        named.sort_by_cached_key(|n| (expected.get(n).map(|e| e.due), *n));
        foresight.farthest = foresight.named.len();
        let mut gone = Vec::new();
        while foresight.expiring.front().is_some_and(|&(frame, _)| frame <= self.frame) {
            let Some((_, node)) = foresight.expiring.pop_front() else { break };
            let is_over = |e: &Expected| e.named + KEPT <= self.frame;
            if foresight.expected.get(&node).is_some_and(is_over) {
                foresight.expected.remove(&node);
                gone.push(node);
            }
        }
        for node in gone {
            self.mark(self.nodes[node as usize].partition);
        }
    }

    /// Asks for what is expected and not there, as far as there is room, and takes back what is not expected any more.
    pub(super) fn fetch_ahead(&mut self) {
        let Some(foresight) = &self.foresight else { return };
        let mut missing: Vec<(u64, u32, u32)> = Vec::new();
        for &node in &foresight.named {
            if !self.residents.contains(node) {
                let due = foresight.expected.get(&node).map_or(self.frame, |e| e.due);
                missing.push((due, self.unit_of(node), node));
            }
        }
        // By what is read, the earliest frame; then in order of these.
        missing.sort_unstable_by_key(|&(due, unit, node)| (unit, due, node));
        let mut units: Vec<(u64, u32, Vec<u32>)> = Vec::new();
        for (due, unit, node) in missing {
            match units.last_mut().filter(|last| last.1 == unit) {
                Some((_, _, nodes)) => nodes.push(node),
                None => units.push((due, unit, vec![node])),
            }
        }
        let mut idle: Vec<u32> =
            self.reads.iter().filter(|(_, r)| r.waiting.is_empty()).map(|(&u, _)| u).collect();
        idle.sort_unstable();
        for unit in idle {
            if !self.keeps_all && units.binary_search_by_key(&unit, |u| u.1).is_err() {
                self.withdraw(unit);
            }
        }
        units.sort_unstable_by_key(|&(due, unit, _)| (due, unit));
        for (due, unit, nodes) in units {
            if self.is_paused(unit) {
                continue;
            }
            if self.reserve(&nodes, Need::Foreseen(due)).is_err() {
                break;
            }
            if !self.ask(unit, due, None) {
                self.release_reserved(unit);
            }
        }
    }

    /// A change has used a node and its neighbours: what of these was fetched ahead has been worth it.
    pub(super) fn count_use(&mut self, node: u32, neighbours: &[u32]) {
        if self.foresight.as_ref().is_none_or(|f| f.unused.is_empty()) {
            return;
        }
        for n in std::iter::once(node).chain(neighbours.iter().copied()) {
            let unit = self.unit_of(n);
            let nodes = self.nodes_of(unit);
            let Some(foresight) = &mut self.foresight else { return };
            if foresight.unused.contains(&n) {
                // With it, all that came with it.
                nodes.for_each(|n| {
                    foresight.unused.remove(&n);
                });
                self.stats.ahead_used += 1;
            }
        }
    }
}
