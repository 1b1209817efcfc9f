//! The cut: which nodes are in it, and what the cache mode keeps of the others.

use super::{Change, Paging};
use crate::cache::{CacheMode, Passed};
use crate::record::Record;

impl Paging {
    /// An arc of the node comes into the cut.
    #[inline]
    pub(super) fn enter(&mut self, node: u32) {
        let state = &mut self.nodes[node as usize];
        state.links += 1;
        if state.links == 1 {
            self.partitions[state.partition as usize].in_cut += 1;
        }
    }

    /// An arc of the node leaves the cut.
    #[inline]
    pub(super) fn leave(&mut self, node: u32) {
        let state = &mut self.nodes[node as usize];
        if state.links == 0 {
            return;
        }
        state.links -= 1;
        if state.links == 0 {
            let partition = state.partition;
            self.partitions[partition as usize].in_cut -= 1;
            self.residents.touch(node);
            self.mark(partition);
        }
    }

    pub(super) fn mark(&mut self, partition: u32) {
        if self.keeps_all {
            return;
        }
        if !std::mem::replace(&mut self.partitions[partition as usize].is_dirty, true) {
            self.dirty.push(partition);
        }
    }

    /// A change has brought an arc of the node into the cut.
    #[inline]
    fn note(&mut self, node: u32, change: Change) {
        let partition = self.nodes[node as usize].partition;
        let state = &mut self.partitions[partition as usize];
        match change {
            Change::Unfold => state.came_down = true,
            Change::Fold => state.came_up = true,
        }
        self.mark(partition);
    }

    pub fn is_active(&self, node: u32) -> bool {
        self.nodes[node as usize].is_active
    }

    /// A node in memory has been unfolded, and so have `above` before, or folded: arcs come into the cut and leave it.
    pub fn changed(&mut self, node: u32, change: Change, above: &[u32], below: &[u32], arcs: u32) {
        let (gain, loss) = match change {
            Change::Unfold => (below, above),
            Change::Fold => (above, below),
        };
        for &n in gain {
            self.enter(n);
            self.note(n, change);
        }
        for &n in loss {
            self.leave(n);
        }
        let state = &mut self.nodes[node as usize];
        state.is_active = change == Change::Unfold;
        // A root without triangles is shown by nothing; it is in play all the same.
        if std::mem::replace(&mut state.links, arcs.max(1)) == 0 {
            self.partitions[state.partition as usize].in_cut += 1;
        }
        self.note(node, change);
        self.count_use(node, gain);
    }

    fn layer(&self, node: u32) -> u32 {
        self.residents.get(node).map_or(0, Record::layer)
    }

    /// Lets go of what the cache mode does not keep, in the partitions where anything has changed.
    pub(super) fn clean(&mut self) {
        let mut dirty = std::mem::take(&mut self.dirty);
        let mut postponed = Vec::new();
        for partition in dirty.drain(..) {
            self.partitions[partition as usize].is_dirty = false;
            let nodes =
                self.file.partitions[partition as usize]..self.file.partitions[partition as usize + 1];
            let state = self.partitions[partition as usize];
            if self.mode == CacheMode::PCc && state.in_cut > 0 {
                continue;
            }
            let is_in_cut = |n: u32| self.nodes[n as usize].links > 0 && self.residents.contains(n);
            let cut = if self.mode == CacheMode::PC && state.in_cut > 0 {
                let layers = nodes.clone().filter(|&n| is_in_cut(n)).map(|n| self.layer(n));
                [layers.clone().min().unwrap_or(0), layers.max().unwrap_or(0)]
            } else {
                [0; 2]
            };
            let mut is_postponed = false;
            for node in nodes {
                if !self.residents.contains(node) || self.nodes[node as usize].links > 0 {
                    continue;
                }
                let is_kept = state.in_cut > 0 && {
                    let (layer, is_active) = (self.layer(node), self.is_active(node));
                    state.keeps(self.mode, cut, Passed { layer, is_active })
                };
                if is_kept || self.foresight.as_ref().is_some_and(|f| f.keeps(node)) {
                    continue;
                }
                if self.residents.is_free(node, self.frame) {
                    self.let_go(node);
                } else {
                    is_postponed = true;
                }
            }
            if is_postponed {
                postponed.push(partition);
            }
        }
        self.dirty = dirty;
        for partition in postponed {
            self.mark(partition);
        }
    }
}
