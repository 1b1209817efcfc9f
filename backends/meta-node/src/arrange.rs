//! The forest of a collapse log, numbered depth-first: which leaves are below a node, and which triangles it brings.
//!
//! Leaves are numbered in the order in which a walk in preorder meets them, the child with the kept vertex first, so
//! that every subtree is an interval of leaves and the vertex shown for a folded node is its first leaf (design of the
//! displayed mesh: [`StarMesh`](vertex_tree::StarMesh)). Arrays over nodes are in the order of the log here.
//!
//! Everything is linear in the log but for the search for the node that brings a triangle, which walks up the tree from
//! one of its corners; about 30 bytes a node and 16 a triangle are needed beside the log.

use vertex_tree::{CollapseLog, Forest, LogError, NONE};

/// The leaves below a node are `first..end`; those from `pivot` on are below the removed vertex.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Span {
    pub first: u32,
    pub pivot: u32,
    pub end: u32,
}

/// A log arranged.
pub(crate) struct Arrangement<'a> {
    pub log: &'a CollapseLog,
    pub forest: Forest,
    /// Of each node.
    pub spans: Vec<Span>,
    /// The roots in the order of their leaves.
    pub roots: Vec<u32>,
    /// The first leaves of the trees, and the vertices that no collapse touches.
    pub base_leaves: Vec<u32>,
    /// The input vertex of each leaf.
    pub vertex_of_leaf: Vec<u32>,
    /// Three leaves each, those that node `n` brings at `starts[n]..starts[n + 1]`; those of the base mesh last.
    pub triangles: Vec<[u32; 3]>,
    pub starts: Vec<u32>,
}

impl<'a> Arrangement<'a> {
    pub fn new(log: &'a CollapseLog) -> Result<Self, LogError> {
        let forest = log.forest()?;
        let count = log.collapses.len();
        // Leaves below each node, until their places are known. Children come before their parents in the log.
        let mut spans = vec![Span::default(); count];
        let below = |spans: &[Span], child: u32| if child == NONE { 1 } else { spans[child as usize].end };
        for n in 0..count {
            spans[n].end = below(&spans, forest.kept_child[n]) + below(&spans, forest.removed_child[n]);
        }
        let mut vertex_of_leaf = vec![NONE; log.mesh.positions.len()];
        let (mut roots, mut base_leaves, mut next) = (Vec::new(), Vec::new(), 0);
        for n in (0..count).rev() {
            let leaves = spans[n].end;
            if forest.parent[n] == NONE {
                // A tree takes the next free interval; the place of any other node is fixed by its parent.
                spans[n].first = next;
                roots.push(n as u32);
                base_leaves.push(next);
                next += leaves;
            }
            let Span { first, .. } = spans[n];
            let (kept, removed) = (forest.kept_child[n], forest.removed_child[n]);
            let pivot = first + below(&spans, kept);
            spans[n] = Span { first, pivot, end: first + leaves };
            let collapse = &log.collapses[n];
            for (child, vertex, at) in [(kept, collapse.kept, first), (removed, collapse.removed, pivot)] {
                if child == NONE {
                    vertex_of_leaf[at as usize] = vertex;
                } else {
                    spans[child as usize].first = at;
                }
            }
        }
        for (v, &root) in (0..).zip(&forest.root_of_vertex) {
            if root == NONE {
                vertex_of_leaf[next as usize] = v;
                base_leaves.push(next);
                next += 1;
            }
        }
        let mut arrangement = Self {
            log,
            forest,
            spans,
            roots,
            base_leaves,
            vertex_of_leaf,
            triangles: Vec::new(),
            starts: Vec::new(),
        };
        arrangement.sort_triangles();
        Ok(arrangement)
    }

    /// The triangles that a node brings when it unfolds.
    pub fn brought(&self, node: u32) -> &[[u32; 3]] {
        let node = node as usize;
        &self.triangles[self.starts[node] as usize..self.starts[node + 1] as usize]
    }

    /// The triangles that are shown while every node is folded.
    pub fn base_triangles(&self) -> &[[u32; 3]] {
        &self.triangles[self.starts[self.spans.len()] as usize..]
    }

    /// The place of a leaf.
    pub fn position(&self, leaf: u32) -> [f32; 3] {
        self.log.mesh.positions[self.vertex_of_leaf[leaf as usize] as usize]
    }

    /// The children of a node, that of the kept vertex first; [`NONE`] for a leaf.
    pub fn children(&self, node: u32) -> [u32; 2] {
        [self.forest.kept_child[node as usize], self.forest.removed_child[node as usize]]
    }

    /// Counting sort of the triangles by the node that brings them. Those with a doubled corner are never shown and are
    /// left out.
    fn sort_triangles(&mut self) {
        let count = self.spans.len();
        let mut leaf_of_vertex = vec![0_u32; self.vertex_of_leaf.len()];
        for (leaf, &v) in (0..).zip(&self.vertex_of_leaf) {
            leaf_of_vertex[v as usize] = leaf;
        }
        let mut above_leaf = vec![NONE; self.vertex_of_leaf.len()];
        for (n, span) in (0..).zip(&self.spans) {
            for (start, end) in [(span.first, span.pivot), (span.pivot, span.end)] {
                if end - start == 1 {
                    above_leaf[start as usize] = n;
                }
            }
        }
        let input = &self.log.mesh.triangles;
        let leaves = |corners: &[u32; 3]| corners.map(|v| leaf_of_vertex[v as usize]);
        let bringers: Vec<Option<u32>> =
            input.iter().map(|corners| self.bringer(leaves(corners), &above_leaf)).collect();
        let bucket = |bringer: u32| if bringer == NONE { count } else { bringer as usize };
        let mut starts = vec![0_u32; count + 2];
        for &bringer in bringers.iter().flatten() {
            starts[bucket(bringer) + 1] += 1;
        }
        for n in 0..=count {
            starts[n + 1] += starts[n];
        }
        let mut triangles = vec![[0; 3]; starts[count + 1] as usize];
        let mut next = starts.clone();
        for (corners, bringer) in input.iter().zip(&bringers) {
            if let Some(bringer) = *bringer {
                let at = &mut next[bucket(bringer)];
                triangles[*at as usize] = leaves(corners);
                *at += 1;
            }
        }
        starts.truncate(count + 1);
        (self.triangles, self.starts) = (triangles, starts);
    }

    /// The node at which two corners of a triangle merge first: the lower one of their lowest common ancestors.
    /// [`NONE`] if all corners stay apart; nothing if two are the same leaf.
    fn bringer(&self, mut leaves: [u32; 3], above_leaf: &[u32]) -> Option<u32> {
        leaves.sort_unstable();
        let [a, b, c] = leaves;
        if a == b || b == c {
            return None;
        }
        // One of the two lies below or at the other, if both exist: the one with fewer leaves.
        let leaves_below = |n: u32| match self.spans.get(n as usize) {
            Some(span) => span.end - span.first,
            None => u32::MAX,
        };
        let meet = |low: u32, high: u32| {
            let mut n = above_leaf[low as usize];
            while n != NONE && self.spans[n as usize].end <= high {
                n = self.forest.parent[n as usize];
            }
            n
        };
        let (ab, bc) = (meet(a, b), meet(b, c));
        Some(if leaves_below(ab) <= leaves_below(bc) { ab } else { bc })
    }
}
