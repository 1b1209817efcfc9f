//! Whether the front's records are what they should be.

use vertex_tree::{Hierarchy, NONE, NodeId, SparseTable};

use super::{ACTIVE, COUNT, Front, MANY, Record, mix};
use crate::in_play::Slot;

impl Front {
    /// Checks that every pair of records is linked once or free, that each node in play has the record that the backend's
    /// structure asks for, and that all counts agree.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub(crate) fn assert_well_formed<T: Hierarchy>(&self, tree: &T) {
        let mut known = vec![false; self.pairs.len()];
        known[0] = true;
        for &pair in &self.free {
            assert!(!std::mem::replace(&mut known[pair as usize], true), "pair {pair} is free twice");
        }
        for pair in std::iter::once(&0).chain(&self.free) {
            for record in self.pair(*pair) {
                assert!(record.node.0 == NONE && record.status == 1, "pair {pair} holds {:?}", record.node);
            }
        }
        let roots: Vec<NodeId> = self.roots().map(|root| self.node(root)).collect();
        assert_eq!(roots, tree.roots(), "the roots in play");
        let mut rooted: Vec<_> = self.roots().map(|root| (self.node(root), root)).collect();
        rooted.sort_unstable();
        assert_eq!(rooted, self.root_slots, "where the roots are");

        let (mut in_play, mut active, mut many, mut hash) = (0, 0, 0, 0_u64);
        let mut stack: Vec<(Slot, u32)> = self.roots.iter().map(|&pair| (Slot::NONE, pair)).collect();
        while let Some((above, pair)) = stack.pop() {
            assert!(!std::mem::replace(&mut known[pair as usize], true), "pair {pair} is linked twice");
            assert_eq!(self.above[pair as usize], above, "what is above pair {pair}");
            for (side, record) in (0..).zip(self.pair(pair)) {
                if record.node.0 == NONE {
                    assert_eq!((side, record.status), (1, 1), "half of pair {pair} is empty");
                    continue;
                }
                let slot = Slot(2 * pair + side);
                in_play += 1;
                self.assert_record(tree, slot, record);
                if record.is_active() {
                    active += 1;
                    many += usize::from(record.status & MANY != 0);
                    hash = hash.wrapping_add(mix(tree.log_number(record.node)));
                    stack.extend(self.below(record).iter().map(|&pair| (slot, pair)));
                }
            }
        }
        if let Some(pair) = known.iter().position(|known| !known) {
            panic!("pair {pair} is neither linked nor free: it holds {:?}", self.pairs[pair].0[0].node);
        }
        assert_eq!(active, self.active, "active nodes");
        assert_eq!(hash, self.hash, "hash of the active nodes");
        assert_eq!(many, self.many.len(), "lists of pairs in use");
        assert!(self.spare.iter().all(Vec::is_empty), "lists of pairs to use again");
        if !T::IS_TREE {
            let slots = self.slots.as_ref().map(SparseTable::used);
            assert_eq!(slots, Some(in_play), "nodes with a slot");
            let bits: u32 = self.active_bits.iter().map(|bits| bits.count_ones()).sum();
            assert_eq!(bits as usize, active, "nodes whose bit says that they are active");
        }
    }

    /// Checks what a record says of the nodes around its own.
    #[track_caller]
    fn assert_record<T: Hierarchy>(&self, tree: &T, slot: Slot, record: &Record) {
        let node = record.node;
        let is_active = |node: NodeId| {
            let slot = self.slot_of(node);
            slot != Slot::NONE && self.record(slot).is_active()
        };
        if !T::IS_TREE {
            assert_eq!(self.slot_of(node), slot, "the slot of {node:?}");
            let bit = self.active_bits[node.index() / 64] >> (node.0 % 64) & 1 == 1;
            assert_eq!(bit, record.is_active(), "the bit of {node:?}");
        }
        // What a backend does not have in memory it may know nothing of.
        let count = (record.status & COUNT) as usize;
        if !record.is_active() {
            let parents: Vec<NodeId> = tree.parents(node).collect();
            let folded = if T::IS_TREE { 0 } else { parents.iter().filter(|&&p| !is_active(p)).count() };
            assert!(
                count == folded || parents.is_empty(),
                "{node:?} is folded: {folded} of its parents, not {count}"
            );
            assert!(record.status & (ACTIVE | MANY) == 0 && record.children == 0, "{node:?} is folded");
            return;
        }
        let linked: Vec<NodeId> = self.slots_in(self.below(record)).map(|child| self.node(child)).collect();
        let children: Vec<NodeId> = tree.children(node).collect();
        if children.is_empty() {
            return;
        }
        // In a graph, a child may be linked below another parent.
        let is_linked = |child: &NodeId| T::IS_TREE || linked.contains(child);
        let expected: Vec<NodeId> = children.iter().copied().filter(is_linked).collect();
        assert_eq!(linked, expected, "what is linked below {node:?}");
        let active = match T::IS_TREE {
            true => self.slots_in(self.below(record)).filter(|&c| self.record(c).is_active()).count(),
            false => children.iter().filter(|&&child| is_active(child)).count(),
        };
        assert_eq!(count, active, "{node:?} is active: its active children");
    }
}
