//! Changes that were refused for want of a page, until it has come or they are not wanted any more.
//!
//! Over a store that can not keep up, hundreds of changes are refused in every frame. To ask the backend again for what is
//! still under way would cost as much as the first time, and lead to nothing. So such a change is set aside: no strategy
//! watches it, and the backend is not asked. In every frame it is tested whether it is still wanted, and it counts as a
//! miss. When what it waits for is among the arrivals, it takes its turn again; when it is not wanted any more, the backend
//! is told so.

use vertex_tree::{NodeId, Refine};

use super::changes::Steps;
use super::noted::Noted;
use crate::in_play::Kind;
use crate::refine::Watch;
use crate::waiting::{Change, Waiting};

/// How far ahead records are read into the cache.
const AHEAD: usize = 8;

impl<T: Refine<S>, S> Steps<'_, T, S> {
    /// Sets a change aside that the backend has refused for want of the page of `awaited`.
    pub(super) fn wait_for(&mut self, (slot, node): Noted, kind: Kind, awaited: NodeId) {
        self.missing.push(awaited);
        self.unwatch(slot);
        if !self.front.is_waiting(slot) {
            self.front.set_waiting(slot, true);
            self.waiting.changes.push(Change { slot, node, kind, awaited });
        }
    }

    /// At the start of a frame: puts those changes on the lists for which something has come, counts the others as misses,
    /// and lets go of what is not wanted any more. Empties `arrived`.
    pub(super) fn resume(&mut self, arrived: &mut Vec<NodeId>) {
        let Waiting { changes, given_up } = &mut *self.waiting;
        if changes.is_empty() {
            arrived.clear();
            return;
        }
        arrived.sort_unstable();
        let mut kept = 0;
        for at in 0..changes.len() {
            if let Some(later) = changes.get(at + AHEAD) {
                self.front.prefetch(later.slot);
            }
            let change = changes[at];
            let Change { slot, node, kind, awaited } = change;
            let record = self.front.record(slot);
            // A node that has changed meanwhile may be waiting to change back: that is another entry.
            if !change.is_valid(self.front) {
                given_up.push(awaited);
                continue;
            }
            let bounds = record.bounds;
            let is_possible = match kind {
                Kind::Unfold => record.is_boundary(),
                Kind::Fold => record.is_collapsible(),
            };
            self.tests += 1;
            let is_wanted = is_possible && self.frame.unfold(slot, &bounds) == (kind == Kind::Unfold);
            if is_wanted && arrived.binary_search(&awaited).is_err() {
                self.missing.push(awaited);
                changes[kept] = change;
                kept += 1;
                continue;
            }
            self.front.set_waiting(slot, false);
            if is_wanted {
                match kind {
                    Kind::Unfold => self.unfolding.push((slot, node)),
                    Kind::Fold => self.folding.push((slot, node)),
                }
                continue;
            }
            given_up.push(awaited);
            if is_possible {
                self.finder.unwatch(slot);
                self.finder.watch(self.frame, slot, kind, bounds);
            }
        }
        changes.truncate(kept);
        arrived.clear();
        if !given_up.is_empty() {
            given_up.sort_unstable();
            given_up.dedup();
            // Others may wait for the same.
            self.missing.sort_unstable();
            for node in given_up.drain(..).filter(|node| self.missing.binary_search(node).is_err()) {
                self.tree.give_up(node);
            }
        }
    }
}
