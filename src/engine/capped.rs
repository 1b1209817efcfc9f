//! Carrying out changes within a cap on work, the most urgent first.
//!
//! Parents are never less urgent than their children, so what is left over at the end is less urgent than all that was made. It
//! is pressed, so that it is found again in the next frame, and counted as carried.

use std::collections::BinaryHeap;
use std::time::Instant;

use vertex_tree::{MeshSink, NodeId, TreeError, VertexTree};

use super::changes::{Counts, Steps, is_boundary, is_collapsible};
use crate::budget::{FOLDING_SHARE, WorkCap};
use crate::front::Slot;
use crate::queue::Kind;
use crate::refine::Watch;

/// A change that waits for its turn where work is capped. The most urgent one is the greatest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Urgent {
    /// Bits of a number that is not negative, which are in the same order.
    urgency: u64,
    slot: Slot,
    node: NodeId,
}

impl<T: VertexTree, M: MeshSink, F: Watch> Steps<'_, T, M, F> {
    /// Folds and unfolds, and whatever follows, within a cap. `start` is when the work began.
    pub(super) fn apply_within(
        &mut self,
        cap: WorkCap,
        start: Instant,
        [folds, unfolds]: &mut [BinaryHeap<Urgent>; 2],
    ) -> Result<(), TreeError> {
        let is_spent = |counts: &Counts, share: f64| match cap {
            WorkCap::None => false,
            WorkCap::Changes(most) => (counts.folds + counts.unfolds) as f64 >= most as f64 * share,
            WorkCap::Time(most) => start.elapsed() >= most.mul_f64(share),
        };
        let mut result = Ok(());
        // Folds that must not wait, unfolds, and folds again with what is left.
        for (kind, share) in [(Kind::Fold, FOLDING_SHARE), (Kind::Unfold, 1.0), (Kind::Fold, 1.0)] {
            let heap = if kind == Kind::Fold { &mut *folds } else { &mut *unfolds };
            loop {
                // At first all that was found, later what follows from a change.
                self.await_turn(kind, heap);
                if result.is_err() || is_spent(&self.counts, share) {
                    break;
                }
                let Some(Urgent { slot, node, .. }) = heap.pop() else { break };
                result = match kind {
                    Kind::Fold => self.fold((slot, node)),
                    Kind::Unfold => self.unfold((slot, node)),
                };
            }
        }
        for (kind, heap) in [(Kind::Fold, folds), (Kind::Unfold, unfolds)] {
            for Urgent { slot, node, .. } in heap.drain() {
                let is_still = if kind == Kind::Fold { is_collapsible } else { is_boundary };
                if is_still(self.front, (slot, node)) {
                    self.counts.carried += 1;
                    self.refused(slot, kind);
                }
            }
        }
        result.and_then(|()| self.let_go())
    }

    /// Moves the changes found so far to a heap.
    fn await_turn(&mut self, kind: Kind, heap: &mut BinaryHeap<Urgent>) {
        let list = if kind == Kind::Fold { &mut *self.folding } else { &mut *self.unfolding };
        heap.extend(list.drain(..).map(|(slot, node)| {
            let urgency = self.frame.criterion.urgency(self.frame.views, &self.front.record(slot).bounds);
            // Of what is to be folded, the least wanted first.
            let urgency = if kind == Kind::Fold { 1.0 - urgency.min(1.0) } else { urgency };
            Urgent { urgency: urgency.max(0.0).to_bits(), slot, node }
        }));
    }
}
