//! Changes of the front where nodes have several parents, as in a multi-triangulation.
//!
//! A change touches a handful of parents and a handful of children, each of which has a handful of parents of its own. So
//! each of these is looked at once: what becomes a boundary node or collapsible, or ceases to be, is noted in passing, and
//! whether a child's other parents are active is a bit in an array that stays in the nearest cache.

use vertex_tree::{Hierarchy, NodeId};

use super::{ACTIVE, Front, MANY, Record, mix};
use crate::in_play::Slot;

impl Front {
    /// Records that a boundary node has been unfolded. Calls `hold` with those of its parents that were collapsible, and
    /// appends the children that are boundary nodes now to `ready`.
    pub(crate) fn set_active_in_graph<T: Hierarchy>(
        &mut self,
        tree: &T,
        slot: Slot,
        mut hold: impl FnMut(Slot),
        ready: &mut Vec<Slot>,
    ) {
        let node = self.node(slot);
        for parent in tree.parents(node) {
            let parent = self.slot_of(parent);
            if parent != Slot::NONE {
                let record = self.record_mut(parent);
                if record.is_collapsible() {
                    hold(parent);
                }
                record.status += 1;
            }
        }
        self.active_bits[node.index() / 64] |= 1 << (node.0 % 64);
        let mut pairs = self.spare.pop().unwrap_or_default();
        let mut has_half = false;
        for (child, bounds, mut parents) in tree.children_and_parents(node) {
            // Each child is linked below its first parent alone: a spanning tree.
            if parents.next() == Some(node) {
                let waits_for = parents.filter(|&parent| !self.is_active(parent)).count() as u32;
                let pair = match pairs.last().filter(|_| has_half) {
                    Some(&pair) => {
                        self.pairs[pair as usize].0[1] =
                            Record { bounds, node: child, children: 0, status: 0 };
                        if let Some(slots) = &mut self.slots {
                            slots.set(child.0, Slot(2 * pair + 1));
                        }
                        pair
                    }
                    None => {
                        pairs.push(self.add_pair(slot, [Some((child, bounds)), None]));
                        pairs[pairs.len() - 1]
                    }
                };
                let child = Slot(2 * pair + u32::from(has_half));
                has_half = !has_half;
                self.record_mut(child).status = waits_for;
                if waits_for == 0 {
                    ready.push(child);
                }
            } else {
                let child = self.slot_of(child);
                let record = self.record_mut(child);
                // A child that waits for nothing, or is active, does not name this parent: the store is damaged.
                if child != Slot::NONE && !record.is_active() && !record.is_boundary() {
                    record.status -= 1;
                    if record.is_boundary() {
                        ready.push(child);
                    }
                }
            }
        }
        let (status, children) = match *pairs {
            [] => (ACTIVE, 0),
            [pair] => (ACTIVE, pair),
            _ => (ACTIVE | MANY, self.many.insert(std::mem::take(&mut pairs)) as u32 + 1),
        };
        if status & MANY == 0 {
            pairs.clear();
            self.spare.push(pairs);
        }
        let record = self.record_mut(slot);
        record.status = status;
        record.children = children;
        self.active += 1;
        self.hash = self.hash.wrapping_add(mix(tree.log_number(node)));
    }

    /// Records that a collapsible node has been folded. Calls `release` with those of its children that were in play, and
    /// appends the parents that are collapsible now to `ready`.
    pub(crate) fn set_folded_in_graph<T: Hierarchy>(
        &mut self,
        tree: &T,
        slot: Slot,
        mut release: impl FnMut(Slot),
        ready: &mut Vec<Slot>,
    ) {
        let record = self.record_mut(slot);
        let (node, status, children) = (record.node, record.status, record.children);
        record.status = 0;
        record.children = 0;
        self.active_bits[node.index() / 64] &= !(1 << (node.0 % 64));
        for child in tree.children(node) {
            let child = self.slot_of(child);
            if child != Slot::NONE {
                release(child);
                // What stays in play is linked below another parent, and waits for this one again.
                self.record_mut(child).status += 1;
            }
        }
        if status & MANY != 0 {
            let mut pairs = self.many.remove(children as usize - 1);
            pairs.drain(..).for_each(|pair| self.remove_pair(pair));
            self.spare.push(pairs);
        } else if children != 0 {
            self.remove_pair(children);
        }
        for parent in tree.parents(node) {
            let parent = self.slot_of(parent);
            if parent != Slot::NONE {
                let record = self.record_mut(parent);
                if !record.is_collapsible() {
                    record.status -= 1;
                }
                if record.is_collapsible() {
                    ready.push(parent);
                }
            }
        }
        self.active -= 1;
        self.hash = self.hash.wrapping_sub(mix(tree.log_number(node)));
    }

    #[inline(always)]
    fn is_active(&self, node: NodeId) -> bool {
        self.active_bits[node.index() / 64] & (1 << (node.0 % 64)) != 0
    }
}
