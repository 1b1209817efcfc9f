//! The active front: which nodes are unfolded, and the compact record that is kept of each node in play.
//!
//! A node is *in play* while all its structural parents are active (or it is a root): active nodes and boundary
//! nodes. For these the front keeps sphere and error, and the links that a top-down traversal follows, in a flat
//! array indexed by node number. The array is zeroed memory that the operating system provides when it is touched,
//! so nodes that were never in play cost address space only; and as backends number nodes depth-first, a traversal
//! reads it in sequence.

use slab::Slab;
use vertex_tree::{Bounds, NodeId, VertexTree};

/// A node's record: half a cache line.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Record {
    bounds: Bounds,
    /// While active: the children linked below the node, as numbers plus 1, 0 for none. With [`MANY`], the first is
    /// an index into [`Front::many`] instead.
    children: [u32; 2],
    /// [`ACTIVE`], [`MANY`], and how many structural children are active.
    status: u32,
}

const ACTIVE: u32 = 1 << 31;
const MANY: u32 = 1 << 30;
const ACTIVE_CHILDREN: u32 = MANY - 1;

/// The nodes in play.
pub struct Front {
    records: Vec<Record>,
    /// Children of the nodes that have more than two, as they do in a multi-triangulation.
    many: Slab<Vec<NodeId>>,
    active: usize,
    hash: u64,
}

impl Front {
    pub(crate) fn new(node_limit: u32) -> Self {
        Self {
            records: bytemuck::allocation::zeroed_vec(node_limit as usize),
            many: Slab::new(),
            active: 0,
            hash: 0,
        }
    }

    /// Whether the node is unfolded.
    #[inline]
    #[must_use]
    pub fn is_active(&self, node: NodeId) -> bool {
        self.records[node.index()].status & ACTIVE != 0
    }

    /// Whether the node is unfolded and can be folded next: all its structural children are folded.
    #[inline]
    #[must_use]
    pub fn is_collapsible(&self, node: NodeId) -> bool {
        self.records[node.index()].status & (ACTIVE | ACTIVE_CHILDREN) == ACTIVE
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

    /// Sphere and error of a node in play, and whether it is active, in one access; appends the nodes linked below it
    /// to `below`.
    #[inline(always)]
    pub(crate) fn visit(&self, node: NodeId, below: &mut Vec<NodeId>) -> (&Bounds, bool) {
        let record = &self.records[node.index()];
        if record.status & MANY == 0 {
            for child in record.children {
                if child != 0 {
                    below.push(NodeId(child - 1));
                }
            }
        } else {
            below.extend_from_slice(&self.many[record.children[0] as usize]);
        }
        (&record.bounds, record.status & ACTIVE != 0)
    }

    /// A root comes into play.
    pub(crate) fn add_root(&mut self, node: NodeId, bounds: Bounds) {
        self.records[node.index()].bounds = bounds;
    }

    /// Records that `node` has been unfolded, and that its children come into play.
    pub(crate) fn set_active<T: VertexTree>(&mut self, tree: &T, node: NodeId) {
        // Each child is linked below its first parent alone: a spanning tree, where the structure is a graph.
        let mut children = [0; 2];
        let mut count = 0;
        for child in tree.children(node) {
            if tree.parents(child).next() != Some(node) {
                continue;
            }
            self.records[child.index()].bounds = tree.bounds(child);
            if let Some(place) = children.get_mut(count) {
                *place = child.0 + 1;
            }
            count += 1;
        }
        let record = &mut self.records[node.index()];
        record.status = ACTIVE;
        if count > children.len() {
            let linked = tree.children(node).filter(|&c| tree.parents(c).next() == Some(node)).collect();
            record.status |= MANY;
            children = [self.many.insert(linked) as u32, 0];
        }
        record.children = children;
        for parent in tree.parents(node) {
            self.records[parent.index()].status += 1;
        }
        self.active += 1;
        self.hash = self.hash.wrapping_add(mix(tree.log_number(node)));
    }

    /// Records that `node` has been folded.
    pub(crate) fn set_folded<T: VertexTree>(&mut self, tree: &T, node: NodeId) {
        let record = &mut self.records[node.index()];
        if record.status & MANY != 0 {
            self.many.remove(record.children[0] as usize);
        }
        record.status = 0;
        record.children = [0; 2];
        for parent in tree.parents(node) {
            self.records[parent.index()].status -= 1;
        }
        self.active -= 1;
        self.hash = self.hash.wrapping_sub(mix(tree.log_number(node)));
    }

    /// Calls `f` with every active node, parents before the children linked below them.
    pub fn for_each_active(&self, roots: &[NodeId], mut f: impl FnMut(NodeId)) {
        let mut stack = roots.to_vec();
        while let Some(node) = stack.pop() {
            if self.visit(node, &mut stack).1 {
                f(node);
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
