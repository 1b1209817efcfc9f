//! The collapses of a log, made again on a manifold half-edge mesh: steps 1 and 2 of the paper's construction.
//!
//! The log's collapses were made on the input as it is. Split apart, an input vertex may be several, and a collapse of the
//! log then is one of each of them that has an edge to one that the kept vertex has become. It is made if it is a legal
//! half-edge collapse of the manifold mesh:
//!
//! * one edge joins the two vertices, and their common neighbours are the far corners of the triangles at that edge alone
//!   (the link condition: Dey, Edelsbrunner, Guha & Nekhayev 1999);
//! * if both are on a boundary, so is the edge;
//! * beside each triangle that vanishes one remains, and no triangle comes about twice.
//!
//! Any other is put off: its vertex stays where it is, but counts as one of those that the kept vertex has become, so that
//! the log's later collapses of the kept vertex are tried for it too, and those into the kept vertex may go to it. Each is
//! judged by the mesh as it then is. So every state from the input to the base mesh is manifold, and unfolded wholly
//! the input is there, triangle for triangle. A vertex for which none is ever legal stays for good, and what was merged into
//! it hangs below a root of its own. Virtual edges of `--merge-components` are no edges: they join nothing here.
//!
//! # What a split needs
//!
//! A node can be unfolded if its parent is active and the nodes that bring the faces of w x y z are (or those are initial
//! faces). Then, whatever else is unfolded, rev w = x and rev y = z: an edge comes about once, at a collapse, and ends
//! with the collapse that removes a triangle beside it. Call the collapse that makes the edge (w, x) `n`, and
//! let `m` be one that ends it: `m` removes the triangle of w or of x, so `n` needs `m`. What splits (w, x) is `n` alone, so
//! with `m` active and `n` folded the edge is there. The same holds for (w, B) and (x, C) when `n` folds: what
//! splits them needs the triangle of B or C, and that is `n`'s.
//!
//! The far corners p and q are different vertices then. Were they one, some collapse `m` after `n`, folded now, would have
//! merged them. By the link condition the kept vertex u, a neighbour of both, is the far corner of a triangle that `m`
//! removes, between the edges u p and u q. These are (w, x) and (y, z) or edges that took their place, so by the
//! chain of what ended them `n` needs `m`. A vertex split between two different edges of a vertex keeps a mesh manifold,
//! without doubled triangles and without degenerate ones. So every set of active nodes that is closed under tree and needs
//! shows such a mesh.

use rustc_hash::FxHashMap;
use vertex_tree::{CollapseLog, NONE};

use crate::half_edges::{Adjacent, BOUNDARY, HalfEdge, next, prev};
use crate::nesting::Nesting;
use crate::split_apart::Manifold;

/// A collapse that was made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Merge {
    pub removed: u32,
    pub kept: u32,
    /// Half-edges of input triangles.
    pub adjacent: Adjacent,
    pub parent: u32,
    /// The nodes at the kept and at the removed vertex, or [`NONE`].
    pub children: [u32; 2],
}

/// The manifold mesh in its coarsest state and the collapses that led there.
pub(crate) struct Replay {
    pub manifold: Manifold,
    pub merges: Vec<Merge>,
    /// For each input triangle, the collapse that removed it, or [`NONE`].
    pub owner: Vec<u32>,
    /// Of a removed triangle, 4 for the one of D E F, plus which half-edge is A or D.
    pub place: Vec<u8>,
    /// Vertices that the log removes and that stay.
    pub left_out: u64,
    /// For each vertex, the input vertex at which it is in the log by now.
    stands_at: Vec<u32>,
    /// For an input vertex, the vertices beside itself that are there in the log by now.
    others: FxHashMap<u32, Vec<u32>>,
    /// For each vertex, the node at which it stands in the end, or [`NONE`].
    top: Vec<u32>,
    marks: Vec<(u32, u32)>,
    stamp: u32,
    orbit: Vec<HalfEdge>,
    edges_of_removed: Vec<(u32, [HalfEdge; 2])>,
    edges_of_kept: Vec<(u32, [HalfEdge; 2])>,
    fan: Vec<HalfEdge>,
}

impl Replay {
    /// Replays a log. `nesting` is told of every collapse.
    pub fn new<E>(
        log: &CollapseLog,
        manifold: Manifold,
        nesting: &mut Nesting,
        mut add: impl FnMut(&mut Nesting, &Step<'_>) -> Result<(), E>,
    ) -> Result<Self, E> {
        let (vertices, triangles) = (manifold.origin.len(), log.mesh.triangles.len());
        let manifold_origin = manifold.origin.clone();
        let mut others: FxHashMap<u32, Vec<u32>> = FxHashMap::default();
        for (copy, &origin) in (0..).zip(&manifold.origin) {
            if copy != origin {
                others.entry(origin).or_default().push(copy);
            }
        }
        let mut replay = Self {
            manifold,
            merges: Vec::with_capacity(log.collapses.len()),
            owner: vec![NONE; triangles],
            place: vec![0; triangles],
            left_out: 0,
            stands_at: manifold_origin,
            others,
            top: vec![NONE; vertices],
            marks: vec![(0, 0); vertices],
            stamp: 0,
            orbit: Vec::new(),
            edges_of_removed: Vec::new(),
            edges_of_kept: Vec::new(),
            fan: Vec::new(),
        };
        let mut removed = Vec::new();
        for collapse in &log.collapses {
            removed.clear();
            removed.push(collapse.removed);
            removed.append(&mut replay.others.remove(&collapse.removed).unwrap_or_default());
            for &v in &removed {
                if replay.manifold.out[v as usize] == BOUNDARY {
                    continue;
                }
                match replay.find_legal(v, collapse.kept) {
                    None => {
                        replay.stands_at[v as usize] = collapse.kept;
                        replay.others.entry(collapse.kept).or_default().push(v);
                    }
                    Some((u, [a, d])) => {
                        let adjacent = replay.manifold.edges.adjacent(a, d);
                        let _ = replay.manifold.edges.fan(adjacent, &mut replay.fan);
                        let step = Step {
                            removed: v,
                            kept: u,
                            children: [replay.top[u as usize], replay.top[v as usize]],
                            edge: [a, d],
                            adjacent,
                            fan: &replay.fan,
                            far: replay.far([a, d]),
                            eps: collapse.bounds.eps,
                        };
                        add(nesting, &step)?;
                        replay.collapse(v, u, [a, d], adjacent);
                    }
                }
            }
        }
        let is_left =
            |v: usize| replay.manifold.out[v] != BOUNDARY && replay.stands_at[v] != replay.manifold.origin[v];
        replay.left_out = (0..vertices).filter(|&v| is_left(v)).count() as u64;
        Ok(replay)
    }

    /// The roots, from the last to the first.
    pub fn roots(&self) -> impl Iterator<Item = u32> + '_ {
        (0..self.merges.len() as u32).rev().filter(|&n| self.merges[n as usize].parent == NONE)
    }

    /// The far corners p and q, or [`NONE`] where there is no triangle.
    fn far(&self, [a, d]: [HalfEdge; 2]) -> [u32; 2] {
        [a, d].map(|h| if h == BOUNDARY { NONE } else { self.manifold.edges.start(prev(h)) })
    }

    /// A vertex that `kept` has become and into which `v` may be merged, and the half-edges to it and back.
    fn find_legal(&mut self, v: u32, kept: u32) -> Option<(u32, [HalfEdge; 2])> {
        let mut edges = std::mem::take(&mut self.edges_of_removed);
        self.manifold.edges_of(v, &mut self.orbit, &mut edges);
        let candidates = edges.iter().filter(|&&(u, _)| self.stands_at[u as usize] == kept);
        let found = candidates.copied().collect::<Vec<_>>();
        let legal = found.into_iter().find(|&(u, edge)| self.is_legal(u, edge, &edges));
        self.edges_of_removed = edges;
        legal
    }

    fn is_legal(&mut self, u: u32, [a, d]: [HalfEdge; 2], around_v: &[(u32, [HalfEdge; 2])]) -> bool {
        let edges = &self.manifold.edges;
        let adjacent = edges.adjacent(a, d);
        let nothing_beside = |h: HalfEdge, side: bool| h != BOUNDARY && !side;
        let [first, second] = adjacent.sides();
        if nothing_beside(a, first) || nothing_beside(d, second) {
            return false;
        }
        let is_open = |edges: &[(u32, [HalfEdge; 2])]| edges.iter().any(|(_, pair)| pair.contains(&BOUNDARY));
        self.manifold.edges_of(u, &mut self.orbit, &mut self.edges_of_kept);
        if a != BOUNDARY && d != BOUNDARY && is_open(around_v) && is_open(&self.edges_of_kept) {
            return false;
        }
        self.stamp += 1;
        for &(w, _) in &self.edges_of_kept {
            let mark = &mut self.marks[w as usize];
            *mark = (self.stamp, if mark.0 == self.stamp { mark.1 + 1 } else { 1 });
        }
        let [p, q] = self.far([a, d]);
        let mut seen = [0; 3];
        for &(w, _) in around_v {
            let (stamp, count) = self.marks[w as usize];
            match [u, p, q].iter().position(|&x| x == w) {
                Some(which) => {
                    seen[which] += 1;
                    if seen[which] > 1 || (which > 0 && count != 1) {
                        return false;
                    }
                }
                None if stamp == self.stamp => return false,
                None => {}
            }
        }
        let edges = &self.manifold.edges;
        let closes = |around: &[(u32, [HalfEdge; 2])]| {
            around.iter().any(|&(w, [h, _])| {
                h != BOUNDARY && (w == p && edges.start(prev(h)) == q || w == q && edges.start(prev(h)) == p)
            })
        };
        p == NONE || q == NONE || !(closes(around_v) && closes(&self.edges_of_kept))
    }

    fn collapse(&mut self, v: u32, u: u32, edge: [HalfEdge; 2], adjacent: Adjacent) {
        let node = self.merges.len() as u32;
        let Adjacent { w, x, y, z } = adjacent;
        let far = self.far(edge);
        let edges = &mut self.manifold.edges;
        for &h in &self.fan {
            edges.set_start(h, u);
        }
        edges.pair(w, x);
        edges.pair(y, z);
        let out = &mut self.manifold.out;
        let first_of = |h: HalfEdge, otherwise: HalfEdge| if h == BOUNDARY { next(otherwise) } else { h };
        // w starts at p and x at u; y at q and z at u.
        if far[0] != NONE {
            out[far[0] as usize] = first_of(w, x);
            out[u as usize] = first_of(x, w);
        }
        if far[1] != NONE {
            out[far[1] as usize] = first_of(y, z);
            out[u as usize] = first_of(z, y);
        }
        out[v as usize] = BOUNDARY;
        for (side, h) in (0..).zip(edge) {
            if h != BOUNDARY {
                self.owner[(h >> 2) as usize] = node;
                self.place[(h >> 2) as usize] = side << 2 | (h & 3) as u8;
            }
        }
        let children = [self.top[u as usize], self.top[v as usize]];
        for child in children.into_iter().filter(|&child| child != NONE) {
            self.merges[child as usize].parent = node;
        }
        self.top[u as usize] = node;
        self.merges.push(Merge { removed: v, kept: u, adjacent, parent: NONE, children });
    }
}

/// A collapse about to be made, for the nesting of bounds.
pub(crate) struct Step<'a> {
    pub removed: u32,
    pub kept: u32,
    pub children: [u32; 2],
    /// The half-edges to the kept vertex and back.
    pub edge: [HalfEdge; 2],
    pub adjacent: Adjacent,
    /// The half-edges that start at the removed vertex in triangles that remain.
    pub fan: &'a [HalfEdge],
    pub far: [u32; 2],
    pub eps: f32,
}
