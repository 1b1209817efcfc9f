//! The active front: which nodes are unfolded, and the compact record that is kept of each node in play.
//!
//! A node is *in play* while its first structural parent is active (or it is a root): active nodes and boundary nodes,
//! and where nodes have several parents, also those that wait for another of them. For these the front keeps sphere and error, and the links that a top-down traversal follows, in records that
//! come and go with them. The records of two siblings share a cache line, and all of them lie together however sparse
//! the nodes in play are among all nodes: what a frame reads fits the caches if the front does, not the hierarchy.

use slab::Slab;
use vertex_tree::{Bounds, NONE, NodeId, VertexTree};

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
    /// [`ACTIVE`], [`MANY`], and in the other bits, of an active node, how many structural children are active, of a
    /// folded one, how many structural parents are not: a boundary node has none.
    status: u32,
}

impl Record {
    const BLANK: Self = Self {
        bounds: Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 },
        node: NodeId(NONE),
        children: 0,
        status: 0,
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
}

/// The records of two siblings, in a cache line.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Pair(pub [Record; 2]);

const ACTIVE: u32 = 1 << 31;
const MANY: u32 = 1 << 30;
const COUNT: u32 = MANY - 1;

/// The nodes in play.
pub struct Front {
    /// For each node in play, where its record is: twice its pair, plus 1 if it is the second. Pair 0 belongs to no
    /// node and stands for those that are not in play.
    slots: Vec<u32>,
    pairs: Vec<Pair>,
    /// Pairs to use again, last in, first out.
    free: Vec<u32>,
    /// Pairs of the children of nodes that have more than two, as they do in a multi-triangulation.
    many: Slab<Vec<u32>>,
    roots: Vec<u32>,
    active: usize,
    hash: u64,
}

impl Front {
    pub(crate) fn new(node_limit: u32) -> Self {
        Self {
            slots: vec![0; node_limit as usize],
            // Nodes that are not in play are no boundary nodes.
            pairs: vec![Pair([Record { status: 1, ..Record::BLANK }; 2])],
            free: Vec::new(),
            many: Slab::new(),
            roots: Vec::new(),
            active: 0,
            hash: 0,
        }
    }

    #[inline(always)]
    fn record(&self, node: NodeId) -> &Record {
        let slot = self.slots[node.index()] as usize;
        &self.pairs[slot / 2].0[slot % 2]
    }

    #[inline(always)]
    fn record_mut(&mut self, node: NodeId) -> &mut Record {
        let slot = self.slots[node.index()] as usize;
        &mut self.pairs[slot / 2].0[slot % 2]
    }

    /// Whether the node is unfolded.
    #[inline]
    #[must_use]
    pub fn is_active(&self, node: NodeId) -> bool {
        self.record(node).is_active()
    }

    /// Whether the node is unfolded and can be folded next: all its structural children are folded.
    #[inline]
    #[must_use]
    pub fn is_collapsible(&self, node: NodeId) -> bool {
        self.record(node).is_collapsible()
    }

    /// Whether the node is folded and can be unfolded next: all its structural parents are active.
    #[inline]
    #[must_use]
    pub fn is_boundary(&self, node: NodeId) -> bool {
        self.record(node).is_boundary()
    }

    /// Reads what changing these nodes will read, for all of them at once: see [`VertexTree::prepare`].
    pub(crate) fn prepare(&self, nodes: &[NodeId]) {
        std::hint::black_box(nodes.iter().fold(0, |sum, &node| sum ^ self.record(node).status));
    }

    /// Sphere and error of a node in play.
    #[inline]
    #[must_use]
    pub fn bounds(&self, node: NodeId) -> Bounds {
        self.record(node).bounds
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

    /// Appends the pairs of the nodes linked below a node to `below`.
    #[inline(always)]
    pub(crate) fn descend(&self, record: &Record, below: &mut Vec<u32>) {
        if record.children == 0 {
        } else if record.status & MANY == 0 {
            below.push(record.children);
        } else {
            below.extend_from_slice(&self.many[record.children as usize - 1]);
        }
    }

    /// Makes records for two nodes, or one.
    fn add_pair(&mut self, nodes: [Option<(NodeId, Bounds)>; 2]) -> u32 {
        let pair = self.free.pop().unwrap_or_else(|| {
            self.pairs.push(Pair([Record::BLANK; 2]));
            self.pairs.len() as u32 - 1
        });
        for (side, node) in nodes.into_iter().enumerate() {
            let record =
                node.map_or(Record::BLANK, |(node, bounds)| Record { bounds, node, ..Record::BLANK });
            self.pairs[pair as usize].0[side] = record;
            if let Some((node, _)) = node {
                self.slots[node.index()] = 2 * pair + side as u32;
            }
        }
        pair
    }

    fn remove_pair(&mut self, pair: u32) {
        for record in self.pairs[pair as usize].0 {
            if record.node.0 != NONE {
                self.slots[record.node.index()] = 0;
            }
        }
        self.pairs[pair as usize] = Pair([Record::BLANK; 2]);
        self.free.push(pair);
    }

    /// Roots come into play.
    pub(crate) fn add_roots(&mut self, roots: &[(NodeId, Bounds)]) {
        for two in roots.chunks(2) {
            let pair = self.add_pair([Some(two[0]), two.get(1).copied()]);
            self.roots.push(pair);
        }
    }

    /// Records that `node` has been unfolded, and that its children come into play.
    pub(crate) fn set_active<T: VertexTree>(&mut self, tree: &T, node: NodeId) {
        // Each child is linked below its first parent alone: a spanning tree, where the structure is a graph.
        let mut linked = tree
            .children_and_bounds(node)
            .filter(|&(child, _)| T::IS_TREE || tree.parents(child).next() == Some(node));
        let mut status = ACTIVE;
        let mut children = match linked.next() {
            None => 0,
            Some(first) => self.add_pair([Some(first), linked.next()]),
        };
        if let Some(mut next) = linked.next() {
            let mut pairs = vec![children];
            loop {
                let after = linked.next();
                pairs.push(self.add_pair([Some(next), after]));
                let Some(following) = after.and_then(|_| linked.next()) else { break };
                next = following;
            }
            status |= MANY;
            children = self.many.insert(pairs) as u32 + 1;
        }
        drop(linked);
        if !T::IS_TREE {
            for child in tree.children(node) {
                if tree.parents(child).next() == Some(node) {
                    let waits_for = |p: &NodeId| *p != node && !self.is_active(*p);
                    self.record_mut(child).status = tree.parents(child).filter(waits_for).count() as u32;
                } else if self.slots[child.index()] != 0 {
                    self.record_mut(child).status -= 1;
                }
            }
        }
        let record = self.record_mut(node);
        record.status = status;
        record.children = children;
        for parent in tree.parents(node) {
            self.record_mut(parent).status += 1;
        }
        self.active += 1;
        self.hash = self.hash.wrapping_add(mix(tree.log_number(node)));
    }

    /// Records that `node` has been folded.
    pub(crate) fn set_folded<T: VertexTree>(&mut self, tree: &T, node: NodeId) {
        let record = self.record_mut(node);
        let (status, children) = (record.status, record.children);
        record.status = 0;
        record.children = 0;
        if status & MANY != 0 {
            for pair in self.many.remove(children as usize - 1) {
                self.remove_pair(pair);
            }
        } else if children != 0 {
            self.remove_pair(children);
        }
        if !T::IS_TREE {
            // What is still in play is linked below another parent, and waits for this one again.
            for child in tree.children(node) {
                if self.slots[child.index()] != 0 {
                    self.record_mut(child).status += 1;
                }
            }
        }
        for parent in tree.parents(node) {
            self.record_mut(parent).status -= 1;
        }
        self.active -= 1;
        self.hash = self.hash.wrapping_sub(mix(tree.log_number(node)));
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
