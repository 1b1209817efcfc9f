//! Nodes whose turn to change comes later.

use vertex_tree::NodeId;

use crate::front::Front;
use crate::in_play::Slot;

/// A node in play and the slot that it was in when this was noted. By the time its turn comes it may have gone out of
/// play and another node may have come to the slot.
pub(super) type Noted = (Slot, NodeId);

/// A node waiting on the stack for its turn.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Pending {
    /// Where the node is, if it is known to be in play.
    pub slot: Slot,
    pub node: NodeId,
    /// Whether an entry below waits for this one: a dependency, not something that a view wants.
    pub needed: bool,
    /// Whether this entry waits for those above.
    pub waits: bool,
}

impl Pending {
    pub fn wanted((slot, node): Noted) -> Self {
        Self { slot, node, needed: false, waits: false }
    }

    pub fn needed(node: NodeId) -> Self {
        Self { slot: Slot::NONE, node, needed: true, waits: false }
    }
}

/// Looks up the nodes in some slots, before anything changes.
pub(super) fn note(front: &Front, slots: &[Slot], noted: &mut Vec<Noted>) {
    noted.clear();
    for slots in slots.chunks(32) {
        slots.iter().for_each(|&slot| front.prefetch(slot));
        noted.extend(slots.iter().map(|&slot| (slot, front.node(slot))));
    }
}

/// Whether a node that was noted is still in its slot and collapsible.
#[inline(always)]
pub(super) fn is_collapsible(front: &Front, (slot, node): Noted) -> bool {
    let record = front.record(slot);
    record.node == node && record.is_collapsible()
}

/// Whether a node that was noted is still in its slot and a boundary node.
#[inline(always)]
pub(super) fn is_boundary(front: &Front, (slot, node): Noted) -> bool {
    let record = front.record(slot);
    record.node == node && record.is_boundary()
}
