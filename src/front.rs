//! The active front: which nodes are unfolded, and the compact record that is kept of each node in play.
//!
//! A node is *in play* while all its structural parents are active (or it is a root): active nodes and boundary
//! nodes. For these the front keeps sphere and error, and the links that a top-down traversal follows, in a flat
//! array indexed by node number. The array is zeroed memory that the operating system provides when it is touched,
//! so nodes that were never in play cost address space only; and as backends number nodes depth-first, a traversal
//! reads it in sequence.

use vertex_tree::{Bounds, NodeId, VertexTree};

/// A node's record: half a cache line.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Record {
    bounds: Bounds,
    /// [`FOLDED`], [`ACTIVE_WITHOUT_CHILDREN`], or a node number plus [`FIRST_CHILD`].
    status: u32,
    /// Next child of the same first parent: a node number plus 1, or 0.
    next_sibling: u32,
    /// How many structural children are active.
    active_children: u32,
}

const FOLDED: u32 = 0;
const ACTIVE_WITHOUT_CHILDREN: u32 = 1;
const FIRST_CHILD: u32 = 2;

/// The nodes in play.
pub struct Front {
    records: Vec<Record>,
    active: usize,
    hash: u64,
}

/// What top-down traversal reads of a node in one go.
pub(crate) struct Visit {
    pub bounds: Bounds,
    pub active: bool,
    /// First child, if the node is active and has one.
    pub first_child: Option<NodeId>,
    pub next_sibling: Option<NodeId>,
}

impl Front {
    pub(crate) fn new(node_limit: u32) -> Self {
        Self { records: bytemuck::allocation::zeroed_vec(node_limit as usize), active: 0, hash: 0 }
    }

    /// Whether the node is unfolded.
    #[inline]
    #[must_use]
    pub fn is_active(&self, node: NodeId) -> bool {
        self.records[node.index()].status != FOLDED
    }

    /// Whether the node is unfolded and can be folded next: all its structural children are folded.
    #[inline]
    #[must_use]
    pub fn is_collapsible(&self, node: NodeId) -> bool {
        let record = &self.records[node.index()];
        record.status != FOLDED && record.active_children == 0
    }

    /// Whether the node is folded and can be unfolded next: all its structural parents are active.
    #[inline]
    #[must_use]
    pub fn is_boundary<T: VertexTree>(&self, tree: &T, node: NodeId) -> bool {
        !self.is_active(node) && tree.parents(node).all(|p| self.is_active(p))
    }

    /// Sphere and error of a node in play.
    #[inline]
    #[must_use]
    pub fn bounds(&self, node: NodeId) -> Bounds {
        self.records[node.index()].bounds
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

    #[inline(always)]
    pub(crate) fn visit(&self, node: NodeId) -> Visit {
        let record = &self.records[node.index()];
        Visit {
            bounds: record.bounds,
            active: record.status != FOLDED,
            first_child: (record.status >= FIRST_CHILD).then(|| NodeId(record.status - FIRST_CHILD)),
            next_sibling: record.next_sibling.checked_sub(1).map(NodeId),
        }
    }

    /// A root comes into play.
    pub(crate) fn add_root(&mut self, node: NodeId, bounds: Bounds) {
        self.records[node.index()].bounds = bounds;
    }

    /// Records that `node` has been unfolded, and that its children come into play.
    pub(crate) fn set_active<T: VertexTree>(&mut self, tree: &T, node: NodeId) {
        let mut first = ACTIVE_WITHOUT_CHILDREN;
        // Each child is linked below its first parent alone: a spanning tree, where the structure is a graph.
        for child in tree.children(node).filter(|&c| tree.parents(c).next() == Some(node)) {
            let next_sibling = if first == ACTIVE_WITHOUT_CHILDREN { 0 } else { first - FIRST_CHILD + 1 };
            let record = &mut self.records[child.index()];
            record.bounds = tree.bounds(child);
            record.next_sibling = next_sibling;
            first = child.0 + FIRST_CHILD;
        }
        self.records[node.index()].status = first;
        for parent in tree.parents(node) {
            self.records[parent.index()].active_children += 1;
        }
        self.active += 1;
        self.hash = self.hash.wrapping_add(mix(tree.log_number(node)));
    }

    /// Records that `node` has been folded.
    pub(crate) fn set_folded<T: VertexTree>(&mut self, tree: &T, node: NodeId) {
        self.records[node.index()].status = FOLDED;
        for parent in tree.parents(node) {
            self.records[parent.index()].active_children -= 1;
        }
        self.active -= 1;
        self.hash = self.hash.wrapping_sub(mix(tree.log_number(node)));
    }

    /// Calls `f` with every active node, parents before the children linked below them.
    pub fn for_each_active(&self, roots: &[NodeId], mut f: impl FnMut(NodeId)) {
        let mut stack = roots.to_vec();
        while let Some(node) = stack.pop() {
            let visit = self.visit(node);
            if visit.active {
                f(node);
            }
            stack.extend(visit.next_sibling);
            stack.extend(visit.first_child);
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
