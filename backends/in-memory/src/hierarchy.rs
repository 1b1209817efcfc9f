//! The static part of the tree: what unfolding and folding a node asks for, where fronts find it together.
//!
//! Leaves are numbered depth-first, the side of the kept vertex before the other, so every subtree is an interval of
//! leaves, and the vertex shown for a folded node is the first leaf of its interval, as a collapse keeps the place of the
//! kept vertex: see [`StarMesh`](star_mesh::StarMesh).
//!
//! Nodes are numbered by octaves of their error, from large to small, and depth-first within an octave. The nodes that a
//! front can reach next have errors that are close in number wherever they are close in space: what a frame changes lies
//! in few pages of memory. In depth-first order every node of a front would be in a page of its own, with all that lies
//! below it between, and translating addresses would take longer than anything else.
//!
//! What belongs to a node, its removed vertex and the triangles that it brings, is sorted like the nodes.

use collapse_log::{CollapseLog, Forest, LogError};
use star_mesh::LeafTriangle;
use vertex_tree::{Bounds, NONE, NodeId};

/// An inner node: one cache line that holds all that unfolding it asks for.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Node {
    /// The leaf of the kept vertex, which is the first one below the node, and that of the removed vertex, from which on
    /// leaves are on its side.
    pub kept: u32,
    pub removed: u32,
    /// The child with the kept vertex and the other; [`NONE`] for a leaf.
    pub children: [u32; 2],
    /// Where the triangles start that the node brings, and in the lowest [`COUNT_BITS`] how many they are, up to
    /// [`MANY`]: then they end where those of the next node start. Few bring more than two, and to look at the next
    /// node would be another cache line.
    triangles: u32,
    pub log_number: u32,
    /// Of the children; meaningless for a leaf.
    pub child_bounds: [Bounds; 2],
}

const COUNT_BITS: u32 = 3;
const MANY: u32 = (1 << COUNT_BITS) - 1;
/// Triangles that the bits left over can number.
const MOST_TRIANGLES: usize = 1 << (32 - COUNT_BITS);

/// A collapse log arranged for refinement. Shared, unchanging: several trees can show it at once.
#[derive(Clone, Debug)]
pub struct InMemoryHierarchy {
    pub(crate) nodes: Vec<Node>,
    /// For each node, its parent, or [`NONE`] for a root.
    pub(crate) parents: Vec<u32>,
    pub(crate) roots: Vec<NodeId>,
    /// Of each root.
    pub(crate) root_bounds: Vec<Bounds>,
    /// Where the removed vertex of each node is.
    pub(crate) positions: Vec<[f32; 3]>,
    /// The vertices of the base mesh: leaf and position.
    pub(crate) base_vertices: Vec<(u32, [f32; 3])>,
    /// Input vertex of each leaf.
    pub(crate) input_vertex: Vec<u32>,
    /// The triangles, known by their numbers in the input, sorted by the node that brings them; those of the base mesh
    /// last.
    pub(crate) triangles: Vec<LeafTriangle>,
    /// How many triangles some node brings.
    pub(crate) refining: u32,
    /// World coordinates of what all positions are relative to.
    pub(crate) origin: [f64; 3],
}

/// Leaves of a log, depth-first.
struct Leaves {
    /// For each collapse, the first leaf below it, that of its removed vertex, and the end of the leaves below it.
    kept: Vec<u32>,
    removed: Vec<u32>,
    end: Vec<u32>,
    of_vertex: Vec<u32>,
}

impl Leaves {
    fn new(log: &CollapseLog, forest: &Forest) -> Self {
        let (count, vertices) = (log.collapses.len(), log.mesh.positions.len());
        // How many are below each node. Children come before their parents in the log.
        let mut below = vec![0_u32; count];
        let leaves = |below: &[u32], child: u32| if child == NONE { 1 } else { below[child as usize] };
        for n in 0..count {
            below[n] = leaves(&below, forest.kept_child[n]) + leaves(&below, forest.removed_child[n]);
        }
        // Intervals, from the roots down. A root takes the next free one, any other node's was fixed by its parent.
        let mut all = Self {
            kept: vec![NONE; count],
            removed: below.clone(),
            end: below.clone(),
            of_vertex: vec![NONE; vertices],
        };
        let mut next = 0;
        for n in (0..count).rev() {
            if forest.parent[n] == NONE {
                all.kept[n] = next;
                next += below[n];
            }
            let first = all.kept[n];
            let removed = first + leaves(&below, forest.kept_child[n]);
            all.removed[n] = removed;
            all.end[n] = first + below[n];
            let c = &log.collapses[n];
            for (child, vertex, at) in
                [(forest.kept_child[n], c.kept, first), (forest.removed_child[n], c.removed, removed)]
            {
                match child {
                    NONE => all.of_vertex[vertex as usize] = at,
                    child => all.kept[child as usize] = at,
                }
            }
        }
        for leaf in all.of_vertex.iter_mut().filter(|leaf| **leaf == NONE) {
            *leaf = next;
            next += 1;
        }
        debug_assert_eq!(next as usize, vertices);
        all
    }
}

/// Collapses in the order in which their nodes are numbered: by octaves of the error, then depth-first.
fn order(log: &CollapseLog, leaves: &Leaves) -> Vec<u32> {
    // The exponent of a positive number is the top of its bits. Nodes without any error are the last ones.
    let octave = |eps: f32| u64::from(!(eps.to_bits() >> 23) & 0x1ff);
    // Of those with the same first leaf the larger one, which is above, comes first.
    let key = |n: u32| {
        let (kept, end) = (leaves.kept[n as usize], leaves.end[n as usize]);
        (octave(log.collapses[n as usize].bounds.eps) << 32 | u64::from(kept), u32::MAX - end)
    };
    let mut order: Vec<(u64, u32, u32)> =
        (0..log.collapses.len() as u32).map(|n| (key(n).0, key(n).1, n)).collect();
    order.sort_unstable();
    order.into_iter().map(|(.., n)| n).collect()
}

impl InMemoryHierarchy {
    /// Arranges a log.
    ///
    /// # Errors
    /// What [`CollapseLog::forest`] finds wrong with it, and [`LogError::TooManyTriangles`].
    pub fn new(log: &CollapseLog) -> Result<Self, LogError> {
        let forest = log.forest()?;
        if log.mesh.triangles.len() >= MOST_TRIANGLES {
            return Err(LogError::TooManyTriangles {
                triangles: log.mesh.triangles.len(),
                most: MOST_TRIANGLES - 1,
            });
        }
        let leaves = Leaves::new(log, &forest);
        let order = order(log, &leaves);
        let mut number = vec![NONE; order.len()];
        for (id, &n) in (0..).zip(&order) {
            number[n as usize] = id;
        }
        let numbered = |n: u32| if n == NONE { NONE } else { number[n as usize] };
        let bounds = |n: u32| {
            let nowhere = Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 };
            log.collapses.get(n as usize).map_or(nowhere, |collapse| collapse.bounds)
        };
        let node = |&n: &u32| {
            let children = [forest.kept_child[n as usize], forest.removed_child[n as usize]];
            Node {
                kept: leaves.kept[n as usize],
                removed: leaves.removed[n as usize],
                children: children.map(numbered),
                triangles: 0,
                log_number: n,
                child_bounds: children.map(bounds),
            }
        };
        let nodes: Vec<Node> = order.iter().map(node).collect();
        let roots: Vec<u32> = (0..)
            .zip(&order)
            .filter(|&(_, &n)| forest.parent[n as usize] == NONE)
            .map(|(id, _)| id)
            .collect();
        let position = |vertex: u32| log.mesh.positions[vertex as usize];
        let mut input_vertex = vec![0; leaves.of_vertex.len()];
        for (vertex, &leaf) in (0..).zip(&leaves.of_vertex) {
            input_vertex[leaf as usize] = vertex;
        }
        let lone = (0..).zip(&forest.root_of_vertex).filter(|&(_, &root)| root == NONE);
        let base = roots.iter().map(|&id| nodes[id as usize].kept);
        let base = base.chain(lone.map(|(vertex, _): (u32, _)| leaves.of_vertex[vertex as usize]));
        let mut hierarchy = Self {
            origin: log.mesh.georeference.origin,
            parents: order.iter().map(|&n| numbered(forest.parent[n as usize])).collect(),
            root_bounds: roots.iter().map(|&id| bounds(nodes[id as usize].log_number)).collect(),
            base_vertices: base.map(|leaf| (leaf, position(input_vertex[leaf as usize]))).collect(),
            roots: roots.into_iter().map(NodeId).collect(),
            positions: order.iter().map(|&n| position(log.collapses[n as usize].removed)).collect(),
            nodes,
            input_vertex,
            triangles: Vec::new(),
            refining: 0,
        };
        hierarchy.sort_triangles(&log.mesh.triangles, &leaves, &order);
        Ok(hierarchy)
    }

    /// Counting sort of the triangles by the node that brings them.
    fn sort_triangles(&mut self, triangles: &[[u32; 3]], leaves: &Leaves, order: &[u32]) {
        let count = self.nodes.len();
        let mut above_leaf = vec![NONE; self.input_vertex.len()];
        for (id, node) in (0..).zip(&self.nodes) {
            for (child, leaf) in node.children.into_iter().zip([node.kept, node.removed]) {
                if child == NONE {
                    above_leaf[leaf as usize] = id;
                }
            }
        }
        let ends: Vec<u32> = order.iter().map(|&n| leaves.end[n as usize]).collect();
        let leaves = |corners: [u32; 3]| corners.map(|v| leaves.of_vertex[v as usize]);
        let owner: Vec<u32> =
            triangles.iter().map(|&corners| self.bringer(leaves(corners), &above_leaf, &ends)).collect();
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
        self.triangles = vec![LeafTriangle::new([0; 3], 0, 0); triangles.len()];
        for (t, &corners) in (0..).zip(triangles) {
            let corners = leaves(corners);
            let at = &mut start[bucket(t as usize)];
            let is_far = |&leaf: &u32| match self.nodes.get(owner[t as usize] as usize) {
                Some(node) => !(node.kept..ends[owner[t as usize] as usize]).contains(&leaf),
                None => false,
            };
            let far = corners.iter().position(is_far).unwrap_or(0) as u32;
            self.triangles[*at as usize] = LeafTriangle::new(corners, far, t);
            *at += 1;
        }
    }

    /// The node at which two corners of a triangle merge first: the lower one of their lowest common ancestors.
    /// [`NONE`] if all corners stay apart, or if two are the same leaf.
    fn bringer(&self, mut leaves: [u32; 3], above_leaf: &[u32], ends: &[u32]) -> u32 {
        leaves.sort_unstable();
        let [a, b, c] = leaves;
        if a == b || b == c {
            return NONE;
        }
        let lowest_common_ancestor = |low: u32, high: u32| {
            let mut n = above_leaf[low as usize];
            while n != NONE && ends[n as usize] <= high {
                n = self.parents[n as usize];
            }
            n
        };
        // Of lca(a, b) and lca(b, c), one lies below or at the other, if both exist: the one with fewer leaves.
        let span = |n: u32| if n == NONE { u32::MAX } else { ends[n as usize] - self.nodes[n as usize].kept };
        let (ab, bc) = (lowest_common_ancestor(a, b), lowest_common_ancestor(b, c));
        if span(ab) <= span(bc) { ab } else { bc }
    }

    /// Where the triangles that a node brings start.
    pub(crate) fn first_brought(&self, node: usize) -> u32 {
        self.nodes[node].triangles >> COUNT_BITS
    }

    /// The triangles that a node brings.
    #[inline(always)]
    pub(crate) fn brought(&self, node: usize) -> &[LeafTriangle] {
        let start = self.first_brought(node);
        let end = match self.nodes[node].triangles & MANY {
            MANY if node + 1 < self.nodes.len() => self.first_brought(node + 1),
            MANY => self.refining,
            count => start + count,
        };
        &self.triangles[start as usize..end as usize]
    }

    /// Number in the collapse log of a node of this backend.
    #[must_use]
    pub fn log_number(&self, node: NodeId) -> u32 {
        self.nodes[node.index()].log_number
    }
}
