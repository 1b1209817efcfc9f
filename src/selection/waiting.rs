//! The changes that were refused for want of a page: see `engine::waiting` for what becomes of them.

use vertex_tree::NodeId;

use crate::front::Front;
use crate::in_play::{Kind, Slot};

/// A change that waits.
#[derive(Clone, Copy)]
pub(crate) struct Change {
    pub slot: Slot,
    pub node: NodeId,
    pub kind: Kind,
    /// The node for which the backend had no page: this one or another that it needs.
    pub awaited: NodeId,
}

impl Change {
    /// Whether the node is in its slot still, its change set aside, and not changed since.
    #[inline(always)]
    pub fn is_valid(&self, front: &Front) -> bool {
        let record = front.record(self.slot);
        record.node == self.node && record.is_waiting() && record.is_active() == (self.kind == Kind::Fold)
    }
}

/// The changes that wait.
#[derive(Default)]
pub(crate) struct Waiting {
    /// In the order in which they were refused: at the end of a frame, those that waited then. What the front knows nothing of any more is dropped when it is come upon.
    pub changes: Vec<Change>,
    /// Nodes whose pages nobody waits for any more. Kept for its allocation.
    pub given_up: Vec<NodeId>,
}

impl Waiting {
    /// Those that wait still: the front knows of them, and nothing that has happened in the frame has made them impossible.
    pub fn valid(&self, front: &Front) -> impl Iterator<Item = (Slot, Kind)> {
        let is_possible = |change: &&Change| {
            let record = front.record(change.slot);
            change.is_valid(front) && (record.is_boundary() || record.is_collapsible())
        };
        self.changes.iter().filter(is_possible).map(|change| (change.slot, change.kind))
    }
}
