//! The static part of the tree: nodes, leaves and triangles in depth-first order.
//!
//! Nodes are numbered in preorder, the child with the kept vertex first, and leaves in the order in which that walk
//! meets them. So
//!
//! * every subtree is an interval of nodes and an interval of leaves;
//! * the vertex shown for a folded node is the first leaf of its interval, as a collapse keeps the place of the kept
//!   vertex: vertices are numbered as leaves;
//! * the children of a node follow from the number of leaves on its left side;
//! * the triangles that a node brings when it unfolds, sorted by node, are an interval too.

use std::ops::Range;

use vertex_tree::{Bounds, CollapseLog, LogError, NONE, NodeId};

/// An inner node: one cache line that holds all that unfolding it asks for.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Node {
    /// The leaves below are `first..end`; those from `pivot` on are below the removed vertex, which is leaf `pivot`.
    pub first: u32,
    pub pivot: u32,
    pub end: u32,
    pub parent: u32,
    /// Where the triangles start that the node brings, and in the lowest [`COUNT_BITS`] how many they are, up to
    /// [`MANY`]: then they end where those of the next node start. Few bring more than two, and to look at the next
    /// node would be another cache line.
    triangles: u32,
    pub log_number: u32,
    /// Of the child with the kept vertex and of the other; meaningless where that is a leaf.
    pub child_bounds: [Bounds; 2],
}

const COUNT_BITS: u32 = 3;
const MANY: u32 = (1 << COUNT_BITS) - 1;
/// Triangles that the bits left over can number.
const MOST_TRIANGLES: usize = 1 << (32 - COUNT_BITS);

impl Node {
    const BLANK: Self = Self {
        first: 0,
        pivot: 0,
        end: 0,
        parent: NONE,
        triangles: 0,
        log_number: 0,
        child_bounds: [Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 }; 2],
    };
}

/// A collapse log arranged for refinement. Shared, unchanging: several trees can show it at once.
#[derive(Clone, Debug)]
pub struct Hierarchy {
    pub(crate) nodes: Vec<Node>,
    pub(crate) roots: Vec<NodeId>,
    /// Of each root.
    pub(crate) root_bounds: Vec<Bounds>,
    /// The vertices of the base mesh.
    pub(crate) base_vertices: Vec<u32>,
    /// Input vertex of each leaf, and its position.
    pub(crate) input_vertex: Vec<u32>,
    pub(crate) positions: Vec<[f32; 3]>,
    /// Three leaves each, sorted by the node that brings them; those of the base mesh last.
    pub(crate) corners: Vec<[u32; 3]>,
    pub(crate) input_triangle: Vec<u32>,
    /// How many triangles some node brings.
    pub(crate) refining: u32,
}

impl Hierarchy {
    /// Arranges a log.
    ///
    /// # Errors
    /// What [`CollapseLog::forest`] finds wrong with it.
    pub fn new(log: &CollapseLog) -> Result<Self, LogError> {
        let forest = log.forest()?;
        if log.mesh.triangles.len() >= MOST_TRIANGLES {
            return Err(LogError::TooManyTriangles {
                triangles: log.mesh.triangles.len(),
                most: MOST_TRIANGLES - 1,
            });
        }
        let count = log.collapses.len();
        let vertices = log.mesh.positions.len();

        // Leaves below each node. Children come before their parents in the log.
        let mut leaves = vec![0_u32; count];
        let below = |leaves: &[u32], child: u32| if child == NONE { 1 } else { leaves[child as usize] };
        for n in 0..count {
            leaves[n] = below(&leaves, forest.kept_child[n]) + below(&leaves, forest.removed_child[n]);
        }

        // Numbers, from the roots down: a subtree of m leaves has m - 1 nodes.
        let mut number = vec![0_u32; count];
        let mut nodes = vec![Node::BLANK; count];
        let mut root_bounds = Vec::new();
        let mut input_vertex = vec![0_u32; vertices];
        let mut roots = Vec::new();
        let mut base_vertices = Vec::new();
        let (mut next_node, mut next_leaf) = (0, 0);
        for n in (0..count).rev() {
            let c = &log.collapses[n];
            let (kept, removed) = (forest.kept_child[n], forest.removed_child[n]);
            let parent = forest.parent[n];
            // A root takes the next free interval; any other node's place was fixed by its parent.
            if parent == NONE {
                number[n] = next_node;
                nodes[next_node as usize].first = next_leaf;
                roots.push(NodeId(next_node));
                root_bounds.push(c.bounds);
                base_vertices.push(next_leaf);
                next_node += leaves[n] - 1;
                next_leaf += leaves[n];
            }
            let id = number[n];
            let first = nodes[id as usize].first;
            let left = below(&leaves, kept);
            let pivot = first + left;
            let node = &mut nodes[id as usize];
            node.pivot = pivot;
            node.end = first + leaves[n];
            node.log_number = n as u32;
            for (side, (child, vertex, child_id, child_first)) in
                [(kept, c.kept, id + 1, first), (removed, c.removed, id + left, pivot)]
                    .into_iter()
                    .enumerate()
            {
                if child == NONE {
                    input_vertex[child_first as usize] = vertex;
                } else {
                    number[child as usize] = child_id;
                    nodes[child_id as usize].first = child_first;
                    nodes[child_id as usize].parent = id;
                    nodes[id as usize].child_bounds[side] = log.collapses[child as usize].bounds;
                }
            }
        }
        for (v, &root) in (0..).zip(&forest.root_of_vertex) {
            if root == NONE {
                input_vertex[next_leaf as usize] = v;
                base_vertices.push(next_leaf);
                next_leaf += 1;
            }
        }
        debug_assert_eq!(next_leaf as usize, vertices);

        let mut hierarchy = Self {
            nodes,
            roots,
            root_bounds,
            base_vertices,
            positions: input_vertex.iter().map(|&v| log.mesh.positions[v as usize]).collect(),
            input_vertex,
            corners: Vec::new(),
            input_triangle: Vec::new(),
            refining: 0,
        };
        hierarchy.sort_triangles(&log.mesh.triangles);
        Ok(hierarchy)
    }

    /// Counting sort of the triangles by the node that brings them.
    fn sort_triangles(&mut self, triangles: &[[u32; 3]]) {
        let count = self.nodes.len();
        let mut leaf_of_vertex = vec![0_u32; self.input_vertex.len()];
        for (leaf, &v) in (0..).zip(&self.input_vertex) {
            leaf_of_vertex[v as usize] = leaf;
        }
        let mut above_leaf = vec![NONE; self.input_vertex.len()];
        for (id, node) in (0..).zip(&self.nodes) {
            for (start, end) in [(node.first, node.pivot), (node.pivot, node.end)] {
                if end - start == 1 {
                    above_leaf[start as usize] = id;
                }
            }
        }
        let owner: Vec<u32> = triangles
            .iter()
            .map(|corners| self.bringer(corners.map(|v| leaf_of_vertex[v as usize]), &above_leaf))
            .collect();
        // Base triangles count as brought by a node after the last. Triangles with a doubled corner are never
        // shown: they go behind them.
        let bucket = |t: usize| match owner[t] {
            NONE => count,
            n => n as usize,
        };
        let mut start = vec![0_u32; count + 2];
        for t in 0..triangles.len() {
            start[bucket(t) + 1] += 1;
        }
        for n in 0..=count {
            start[n + 1] += start[n];
        }
        for (node, bounds) in self.nodes.iter_mut().zip(start.windows(2)) {
            node.triangles = bounds[0] << COUNT_BITS | (bounds[1] - bounds[0]).min(MANY);
        }
        self.refining = start[count];
        self.corners = vec![[0; 3]; triangles.len()];
        self.input_triangle = vec![0; triangles.len()];
        for (t, corners) in triangles.iter().enumerate() {
            let at = &mut start[bucket(t)];
            self.corners[*at as usize] = corners.map(|v| leaf_of_vertex[v as usize]);
            self.input_triangle[*at as usize] = t as u32;
            *at += 1;
        }
    }

    /// The node at which two corners of a triangle merge first: the lower one of their lowest common ancestors.
    /// [`NONE`] if all corners stay apart, or if two are the same leaf.
    fn bringer(&self, mut leaves: [u32; 3], above_leaf: &[u32]) -> u32 {
        leaves.sort_unstable();
        let [a, b, c] = leaves;
        if a == b || b == c {
            return NONE;
        }
        // Of lca(a, b) and lca(b, c), one lies below or at the other, if both exist: the one with fewer leaves.
        let span = |n: u32| {
            if n == NONE { u32::MAX } else { self.nodes[n as usize].end - self.nodes[n as usize].first }
        };
        let (ab, bc) =
            (self.lowest_common_ancestor(a, b, above_leaf), self.lowest_common_ancestor(b, c, above_leaf));
        if span(ab) <= span(bc) { ab } else { bc }
    }

    fn lowest_common_ancestor(&self, low: u32, high: u32, above_leaf: &[u32]) -> u32 {
        let mut n = above_leaf[low as usize];
        while n != NONE && self.nodes[n as usize].end <= high {
            n = self.nodes[n as usize].parent;
        }
        n
    }

    /// Where the triangles that a node brings start.
    pub(crate) fn first_brought(&self, node: usize) -> u32 {
        self.nodes[node].triangles >> COUNT_BITS
    }

    /// The triangles that a node brings.
    pub(crate) fn brought(&self, node: usize) -> Range<u32> {
        let start = self.first_brought(node);
        let end = match self.nodes[node].triangles & MANY {
            MANY if node + 1 < self.nodes.len() => self.first_brought(node + 1),
            MANY => self.refining,
            count => start + count,
        };
        start..end
    }

    /// Number in the collapse log of a node of this backend.
    #[must_use]
    pub fn log_number(&self, node: NodeId) -> u32 {
        self.nodes[node.index()].log_number
    }
}
