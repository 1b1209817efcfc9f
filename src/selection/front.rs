//! The active front: which nodes are unfolded, and the compact record that is kept of each node in play.
//!
//! A node is *in play* while its first structural parent is active (or it is a root): active nodes and boundary nodes,
//! and where nodes have several parents, also those that wait for another of them. For these the front keeps sphere and
//! error, and the links that a top-down traversal follows, in records that come and go with them. The records of two
//! siblings share a cache line, and all of them lie together however sparse the nodes in play are among all nodes: what a
//! frame reads fits the caches if the front does, not the hierarchy.
//!
//! A node in play is known by the [`Slot`] of its record. The engine, the strategies and the event queue index their own
//! arrays by it too, so all of them are as large as the front.

mod graph;
mod well_formed;

use slab::Slab;
use vertex_tree::{Bounds, Hierarchy, NONE, NodeId, SparseTable, prefetch};

use crate::in_play::{Kind, Slot};

/// A node's record: half a cache line.
#[derive(Clone, Copy)]
#[repr(C)]
pub(crate) struct Record {
    pub bounds: Bounds,
    /// [`NONE`] where a pair has only one node.
    pub node: NodeId,
    /// While active: the pair of the children linked below the node, 0 for none. With [`MANY`], an index into
    /// [`Front::many`] instead.
    children: u32,
    /// [`ACTIVE`], [`MANY`], [`WAITING`], and in the other bits, of an active node, how many structural children are active, of a
    /// folded one, how many structural parents are not: a boundary node has none.
    status: u32,
}

impl Record {
    /// Where there is no node: neither a boundary node nor collapsible.
    const BLANK: Self = Self {
        bounds: Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 },
        node: NodeId(NONE),
        children: 0,
        status: 1,
    };

    #[inline(always)]
    pub fn is_active(&self) -> bool {
        self.status & ACTIVE != 0
    }

    #[inline(always)]
    pub fn is_collapsible(&self) -> bool {
        self.status & (ACTIVE | COUNT) == ACTIVE
    }

    #[inline(always)]
    pub fn is_boundary(&self) -> bool {
        self.status & (ACTIVE | COUNT) == 0
    }

    /// Whether a change of the node's status is set aside until a page has come.
    #[inline(always)]
    pub fn is_waiting(&self) -> bool {
        self.status & WAITING != 0
    }
}

/// The records of two siblings, in a cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Pair(pub [Record; 2]);

const ACTIVE: u32 = 1 << 31;
const MANY: u32 = 1 << 30;
const WAITING: u32 = 1 << 29;
const COUNT: u32 = WAITING - 1;

/// The nodes in play.
pub struct Front {
    /// Pair 0 has no nodes: its slots stand for those that are not in play.
    pairs: Vec<Pair>,
    /// For each pair, the slot of the parent that it is linked below; [`Slot::NONE`] for roots.
    above: Vec<Slot>,
    /// Pairs to use again, last in, first out.
    free: Vec<u32>,
    /// Pairs of the children of nodes that have more than two, as they do in a multi-triangulation.
    many: Slab<Vec<u32>>,
    /// Lists of such pairs that are not in use, for their allocations.
    spare: Vec<Vec<u32>>,
    /// The pairs of the roots, and where each root is, in order of nodes.
    roots: Vec<u32>,
    root_slots: Vec<(NodeId, Slot)>,
    /// For each node in play, its slot. Kept only for graphs: in a tree, what is linked says it all.
    slots: Option<SparseTable<Slot>>,
    /// A bit for each node that is active. Kept only for graphs.
    active_bits: Vec<u64>,
    active: usize,
    hash: u64,
}

impl Front {
    /// With the roots in play.
    pub(crate) fn new<T: Hierarchy>(tree: &T) -> Self {
        let mut front = Self {
            pairs: vec![Pair([Record::BLANK; 2])],
            above: vec![Slot::NONE],
            free: Vec::new(),
            many: Slab::new(),
            spare: Vec::new(),
            roots: Vec::new(),
            root_slots: Vec::new(),
            slots: (!T::IS_TREE).then(|| SparseTable::new(tree.node_limit())),
            active_bits: if T::IS_TREE {
                Vec::new()
            } else {
                vec![0; tree.node_limit().div_ceil(64) as usize]
            },
            active: 0,
            hash: 0,
        };
        let roots: Vec<_> = tree.roots().iter().map(|&root| (root, tree.bounds(root))).collect();
        for two in roots.chunks(2) {
            let pair = front.add_pair(Slot::NONE, [Some(two[0]), two.get(1).copied()]);
            front.roots.push(pair);
            let slots = (2 * pair..).map(Slot);
            front.root_slots.extend(two.iter().zip(slots).map(|(&(root, _), slot)| (root, slot)));
        }
        front.root_slots.sort_unstable();
        front
    }

    #[inline(always)]
    pub(crate) fn record(&self, slot: Slot) -> &Record {
        &self.pairs[slot.pair()].0[slot.index() % 2]
    }

    #[inline(always)]
    fn record_mut(&mut self, slot: Slot) -> &mut Record {
        &mut self.pairs[slot.pair()].0[slot.index() % 2]
    }

    /// The node whose record a slot holds.
    #[inline(always)]
    pub(crate) fn node(&self, slot: Slot) -> NodeId {
        self.record(slot).node
    }

    /// Sphere and error of the node in a slot.
    #[inline(always)]
    pub(crate) fn bounds(&self, slot: Slot) -> Bounds {
        self.record(slot).bounds
    }

    #[inline(always)]
    pub(crate) fn is_waiting(&self, slot: Slot) -> bool {
        self.record(slot).is_waiting()
    }

    /// Sets a change of a node aside, or not any more. When the node has changed, or has come into play again, it is not.
    #[inline(always)]
    pub(crate) fn set_waiting(&mut self, slot: Slot, is_waiting: bool) {
        let record = self.record_mut(slot);
        record.status = if is_waiting { record.status | WAITING } else { record.status & !WAITING };
    }

    /// Starts to read a record into the cache, and the place that says what is above.
    #[inline(always)]
    pub(crate) fn prefetch(&self, slot: Slot) {
        prefetch(&self.pairs, slot.pair());
        prefetch(&self.above, slot.pair());
    }

    /// Starts to read the records of what is above a node and below it.
    #[inline(always)]
    pub(crate) fn prefetch_linked(&self, slot: Slot) {
        prefetch(&self.pairs, self.above[slot.pair()].pair());
        let record = self.record(slot);
        if record.status & MANY == 0 {
            prefetch(&self.pairs, record.children as usize);
        }
    }

    /// How many nodes are unfolded.
    #[must_use]
    pub fn active_nodes(&self) -> usize {
        self.active
    }

    /// A hash of the set of active nodes that does not depend on order: the sum of a mixed 64-bit value of each
    /// one's number in the collapse log.
    #[must_use]
    pub fn cut_hash(&self) -> u64 {
        self.hash
    }

    /// The pairs of the roots.
    pub(crate) fn root_pairs(&self) -> &[u32] {
        &self.roots
    }

    #[inline(always)]
    pub(crate) fn pair(&self, pair: u32) -> &[Record; 2] {
        &self.pairs[pair as usize].0
    }

    /// The pairs of the nodes linked below a node.
    #[inline(always)]
    pub(crate) fn below<'a>(&'a self, record: &'a Record) -> &'a [u32] {
        if record.children == 0 {
            &[]
        } else if record.status & MANY == 0 {
            std::slice::from_ref(&record.children)
        } else {
            &self.many[record.children as usize - 1]
        }
    }

    /// Appends the pairs of the nodes linked below a node to `below`, which will be looked at soon. One pair is the rule, and
    /// not worth a call.
    #[inline(always)]
    pub(crate) fn descend(&self, record: &Record, below: &mut Vec<u32>) {
        if record.children == 0 {
        } else if record.status & MANY == 0 {
            prefetch(&self.pairs, record.children as usize);
            below.push(record.children);
        } else {
            below.extend_from_slice(self.below(record));
        }
    }

    /// The nodes linked below a node if they are just two, as they mostly are in a tree.
    #[inline(always)]
    pub(crate) fn two_below(&self, slot: Slot) -> Option<[Slot; 2]> {
        let record = self.record(slot);
        let children = [Slot(2 * record.children), Slot(2 * record.children + 1)];
        (record.status & MANY == 0 && self.node(children[1]).0 != NONE).then_some(children)
    }

    /// One more than the largest slot.
    pub(crate) fn slots(&self) -> usize {
        2 * self.pairs.len()
    }

    /// The nodes in play in some pairs.
    fn slots_in<'a>(&'a self, pairs: &'a [u32]) -> impl Iterator<Item = Slot> + 'a {
        let slots = pairs.iter().flat_map(|&pair| [Slot(2 * pair), Slot(2 * pair + 1)]);
        slots.filter(|&slot| self.node(slot).0 != NONE)
    }

    /// The roots.
    pub(crate) fn roots(&self) -> impl Iterator<Item = Slot> + '_ {
        self.slots_in(&self.roots)
    }

    /// Where the structural children of an active node are, those in play.
    #[inline(always)]
    pub(crate) fn children<'a, T: Hierarchy>(
        &'a self,
        tree: &'a T,
        slot: Slot,
    ) -> impl Iterator<Item = Slot> + 'a {
        let linked = if T::IS_TREE { self.below(self.record(slot)) } else { &[] };
        let others = (!T::IS_TREE).then(|| tree.children(self.node(slot)));
        let others = others.into_iter().flatten().map(|child| self.slot_of(child));
        self.slots_in(linked).chain(others.filter(|&slot| slot != Slot::NONE))
    }

    /// Where the structural parents of a node in play are, those in play.
    #[inline(always)]
    pub(crate) fn parents<'a, T: Hierarchy>(
        &'a self,
        tree: &'a T,
        slot: Slot,
    ) -> impl Iterator<Item = Slot> + 'a {
        let linked = T::IS_TREE.then(|| self.above[slot.pair()]);
        let others = (!T::IS_TREE).then(|| tree.parents(self.node(slot)));
        let others = others.into_iter().flatten().map(|parent| self.slot_of(parent));
        linked.into_iter().chain(others).filter(|&slot| slot != Slot::NONE)
    }

    /// Where a node of a graph is.
    #[inline(always)]
    fn slot_of(&self, node: NodeId) -> Slot {
        self.slots.as_ref().map_or(Slot::NONE, |slots| slots.get(node.0))
    }

    /// Where a node is; [`Slot::NONE`] if it is not in play. In a tree this follows the links from the node's root down.
    pub(crate) fn find<T: Hierarchy>(&self, tree: &T, node: NodeId) -> Slot {
        if !T::IS_TREE {
            return self.slot_of(node);
        }
        let parent = |node: &NodeId| tree.parents(*node).next();
        let mut path: Vec<NodeId> = std::iter::successors(Some(node), parent).collect();
        let root =
            path.pop().and_then(|root| self.root_slots.binary_search_by_key(&root, |&(node, _)| node).ok());
        let Some(root) = root else { return Slot::NONE };
        let start = Some(self.root_slots[root].1);
        let down = |slot: Option<Slot>, &node: &NodeId| {
            self.slots_in(self.below(self.record(slot?))).find(|&slot| self.node(slot) == node)
        };
        path.iter().rev().fold(start, down).unwrap_or(Slot::NONE)
    }

    /// Makes records for two nodes, or one, linked below the node in slot `above`.
    #[inline(always)]
    fn add_pair(&mut self, above: Slot, nodes: [Option<(NodeId, Bounds)>; 2]) -> u32 {
        let record = |node: Option<(NodeId, Bounds)>| match node {
            Some((node, bounds)) => Record { bounds, node, children: 0, status: 0 },
            None => Record::BLANK,
        };
        let two = Pair(nodes.map(record));
        let pair = match self.free.pop() {
            Some(pair) => {
                self.pairs[pair as usize] = two;
                self.above[pair as usize] = above;
                pair
            }
            None => {
                self.pairs.push(two);
                self.above.push(above);
                self.pairs.len() as u32 - 1
            }
        };
        if let Some(slots) = &mut self.slots {
            for (slot, (node, _)) in (2 * pair..).zip(nodes.into_iter().flatten()) {
                slots.set(node.0, Slot(slot));
            }
        }
        pair
    }

    #[inline(always)]
    fn remove_pair(&mut self, pair: u32) {
        if let Some(slots) = &mut self.slots {
            for record in self.pairs[pair as usize].0 {
                if record.node.0 != NONE {
                    slots.set(record.node.0, Slot::NONE);
                }
            }
        }
        self.pairs[pair as usize] = Pair([Record::BLANK; 2]);
        self.free.push(pair);
    }

    /// Records that a boundary node of a tree has been unfolded, and that its children come into play.
    #[inline(always)]
    pub(crate) fn set_active<T: Hierarchy>(&mut self, tree: &T, slot: Slot) {
        let node = self.node(slot);
        let mut linked = tree.children_and_bounds(node);
        let mut status = ACTIVE;
        let mut children = match linked.next() {
            None => 0,
            Some(first) => self.add_pair(slot, [Some(first), linked.next()]),
        };
        if let Some(mut next) = linked.next() {
            let mut pairs = vec![children];
            loop {
                let after = linked.next();
                pairs.push(self.add_pair(slot, [Some(next), after]));
                let Some(following) = after.and_then(|_| linked.next()) else { break };
                next = following;
            }
            status |= MANY;
            children = self.many.insert(pairs) as u32 + 1;
        }
        drop(linked);
        let record = self.record_mut(slot);
        record.status = status;
        record.children = children;
        self.count_at_parent(slot, 1);
        self.active += 1;
        self.hash = self.hash.wrapping_add(mix(tree.log_number(node)));
    }

    /// Records that a collapsible node of a tree has been folded.
    #[inline(always)]
    pub(crate) fn set_folded<T: Hierarchy>(&mut self, tree: &T, slot: Slot) {
        let record = self.record_mut(slot);
        let (node, status, children) = (record.node, record.status, record.children);
        record.status = 0;
        record.children = 0;
        if status & MANY != 0 {
            for pair in self.many.remove(children as usize - 1) {
                self.remove_pair(pair);
            }
        } else if children != 0 {
            self.remove_pair(children);
        }
        self.count_at_parent(slot, -1);
        self.active -= 1;
        self.hash = self.hash.wrapping_sub(mix(tree.log_number(node)));
    }

    /// An active child more, or one less.
    #[inline(always)]
    fn count_at_parent(&mut self, slot: Slot, change: i32) {
        let above = self.above[slot.pair()];
        if above != Slot::NONE {
            let record = self.record_mut(above);
            record.status = record.status.wrapping_add_signed(change);
        }
    }

    /// Calls `f` with every boundary node and every collapsible node whose change is not set aside.
    pub(crate) fn for_each_watched(&self, mut f: impl FnMut(Slot, Kind, &Bounds)) {
        for (pair, Pair(records)) in (0..).zip(&self.pairs) {
            for (side, record) in (0..).zip(records) {
                let kind = if record.is_active() { Kind::Fold } else { Kind::Unfold };
                if (record.is_boundary() || record.is_collapsible()) && !record.is_waiting() {
                    f(Slot(2 * pair + side), kind, &record.bounds);
                }
            }
        }
    }

    /// Calls `f` with every active node, parents before the children linked below them.
    pub fn for_each_active(&self, mut f: impl FnMut(NodeId)) {
        let mut stack = self.roots.clone();
        while let Some(pair) = stack.pop() {
            for record in self.pair(pair) {
                if record.is_active() {
                    f(record.node);
                    self.descend(record, &mut stack);
                }
            }
        }
    }
}

/// Mixes a number to 64 well-spread bits (the finaliser of splitmix64, Steele et al. 2014).
#[must_use]
pub fn mix(number: u32) -> u64 {
    let mut z = u64::from(number).wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests;
