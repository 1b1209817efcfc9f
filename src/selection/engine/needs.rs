//! What a node needs beyond its parents, and unfolding that first.
//!
//! A node that the backend does not unfold because it needs another ([`Step::Needs`]) waits on a stack, the other on top of it,
//! with its ancestors on top of that, until what is on top can be unfolded.

use vertex_tree::{NodeId, Refine, Step, TreeError};

use super::changes::Steps;
use super::noted::{Noted, Pending, is_boundary};
use crate::in_play::{Kind, Slot};

impl<T: Refine<S>, S> Steps<'_, T, S> {
    /// Unfolds what waits on the stack, from the top.
    #[cold]
    pub(super) fn unfold_needed(&mut self) -> Result<(), TreeError> {
        while let Some(&Pending { slot, node, needed, .. }) = self.stack.last() {
            let slot = if slot == Slot::NONE { self.front.find(self.tree, node) } else { slot };
            if self.front.node(slot) == node && self.front.record(slot).is_active() {
                self.stack.pop();
                continue;
            }
            if !is_boundary(self.front, (slot, node)) {
                // A needed node below folded ones: its ancestors come first.
                let above = self.stack.len();
                let (front, tree) = (&*self.front, &*self.tree);
                let is_folded = |p: &NodeId| !front.record(front.find(tree, *p)).is_active();
                self.stack.extend(tree.parents(node).filter(is_folded).map(Pending::needed));
                if self.stack.len() == above {
                    // It is not in play, and nothing above it is folded: only a damaged store says both.
                    self.missing.push(node);
                    self.give_up(None);
                } else if (above..self.stack.len()).any(|at| self.waits(self.stack[at].node)) {
                    self.give_up(None);
                } else {
                    self.stack[above - 1].waits = true;
                }
                continue;
            }
            match self.tree.unfold_into(node, self.sink)? {
                Step::Done => {
                    self.stack.pop();
                    if needed && !self.wanted(slot) {
                        self.counts.forced += 1;
                    }
                    self.unfolded(slot);
                }
                step => self.wait_or_give_up((slot, node), step),
            }
        }
        Ok(())
    }

    /// The node on top of the stack has not been unfolded: what it needs goes on top of it, or it is left for later.
    pub(super) fn wait_or_give_up(&mut self, (slot, node): Noted, step: Step) {
        match step {
            Step::Needs(other) if !self.is_active(other) && !self.waits(other) => {
                if let Some(pending) = self.stack.last_mut() {
                    pending.waits = true;
                }
                self.stack.push(Pending::needed(other));
                return;
            }
            Step::NotResident => return self.give_up(Some(node)),
            Step::Blocked => self.blocked.push((slot, node)),
            Step::Done | Step::Needs(_) | Step::StillNeeded => self.missing.push(node),
        }
        self.give_up(None);
    }

    fn is_active(&self, node: NodeId) -> bool {
        self.front.record(self.front.find(self.tree, node)).is_active()
    }

    /// Whether a node waits for the one on top of the stack, directly or by way of others. To need it then is a cycle
    /// of dependencies, which can only come from a damaged store.
    fn waits(&self, node: NodeId) -> bool {
        // What lies below an entry that nobody needs only waits for its turn.
        let last = self.stack.iter().rposition(|pending| !pending.needed).unwrap_or(0);
        self.stack[last..].iter().any(|pending| pending.waits && pending.node == node)
    }

    /// The node on top of the stack can not be unfolded in this frame, and with it nothing that waits for it. `awaited` is
    /// the node whose page is missing, if that is why.
    fn give_up(&mut self, awaited: Option<NodeId>) {
        while let Some(Pending { slot, node, needed, .. }) = self.stack.pop() {
            let slot = if slot == Slot::NONE { self.front.find(self.tree, node) } else { slot };
            if is_boundary(self.front, (slot, node)) {
                match awaited {
                    None => self.refused(slot, Kind::Unfold),
                    // What is only needed stays what it is; what needs it asks again.
                    Some(_) if needed => {}
                    Some(awaited) => self.wait_for((slot, node), Kind::Unfold, awaited),
                }
            }
            if !needed {
                break;
            }
        }
    }
}
