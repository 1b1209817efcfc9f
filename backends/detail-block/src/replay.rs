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

use std::io;

use bytemuck::{Pod, Zeroable};
use vertex_tree::NONE;

use crate::error::Failure;
use crate::half_edges::{Adjacent, BOUNDARY, HalfEdge, adjacent, fan, next, prev, triangle_of};
use crate::nesting::Nesting;
use crate::step::Step;
use crate::storage::{Elements, Storage};
use crate::surface::Surface;

/// A collapse that was made.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Merge {
    pub removed: u32,
    pub kept: u32,
    /// The half-edges to the kept vertex and back: A and D.
    pub edge: [HalfEdge; 2],
    /// w x y z.
    pub adjacent: [HalfEdge; 4],
    /// The nodes at the kept and at the removed vertex, or [`NONE`].
    pub children: [u32; 2],
}

/// A vertex at the other end of an edge, and the half-edges there and back.
type Edge = (u32, [HalfEdge; 2]);

/// The manifold mesh on its way to its coarsest state.
pub(crate) struct Replay<'s, S: Storage> {
    surface: &'s mut Surface<S>,
    merges: S::Array<Merge>,
    around: Vec<HalfEdge>,
    edges_of_removed: Vec<Edge>,
    edges_of_kept: Vec<Edge>,
    /// The vertices around the kept one, ascending.
    ring_of_kept: Vec<u32>,
    fan: Vec<HalfEdge>,
}

/// What came of a replay: the collapses that were made, and how many vertices the log removes that stay.
pub(crate) struct Replayed<S: Storage> {
    pub merges: S::Array<Merge>,
    pub left_out: u64,
}

impl<'s, S: Storage> Replay<'s, S> {
    /// Replays the log of a mesh; a triangle that is removed loses its first corner. `nesting` is told of every collapse.
    pub fn run(
        surface: &'s mut Surface<S>,
        nesting: &mut Nesting<S>,
        storage: &S,
    ) -> Result<Replayed<S>, Failure> {
        let merges = storage.growing(surface.kept.len(), 2);
        let mut replay = Self {
            surface,
            merges,
            around: Vec::new(),
            edges_of_removed: Vec::new(),
            edges_of_kept: Vec::new(),
            ring_of_kept: Vec::new(),
            fan: Vec::new(),
        };
        let mut removed = Vec::new();
        for n in 0..replay.surface.kept.len() {
            storage.check_stop()?;
            let eps = replay.surface.eps.get(n)?;
            let kept = replay.surface.kept.get(n)?;
            // All that are at the removed vertex: the list changes where one is put off.
            removed.clear();
            let mut v = replay.surface.origins.get(n)?.first;
            while v != NONE {
                removed.push(v);
                v = replay.surface.vertices.get(v as usize)?.next;
            }
            for &v in &removed {
                replay.remove(v, kept, eps, nesting)?;
            }
        }
        let Self { surface, merges, .. } = replay;
        let mut left_out = 0;
        for v in 0..surface.vertices.len() {
            let vertex = surface.vertices.get(v)?;
            left_out += u64::from(vertex.out != BOUNDARY && vertex.stands_at != vertex.origin);
        }
        Ok(Replayed { merges, left_out })
    }

    /// Merges a vertex into one of those that `kept` has become, or puts it off.
    fn remove(&mut self, v: u32, kept: u32, eps: f32, nesting: &mut Nesting<S>) -> Result<(), Failure> {
        let vertex = self.surface.vertices.get(v as usize)?;
        if vertex.out == BOUNDARY {
            return Ok(());
        }
        let Some((u, [a, d])) = self.find_legal(v, kept)? else {
            let vertex = self.surface.vertices.get_mut(v as usize)?;
            (vertex.stands_at, vertex.next) = (kept, NONE);
            self.surface.append(kept, v)?;
            return Ok(());
        };
        let adjacent = adjacent(&mut self.surface.faces, a, d)?;
        let _ = fan(&mut self.surface.faces, adjacent, &mut self.fan)?;
        let far = self.far([a, d])?;
        let step = Step {
            removed: v,
            kept: u,
            children: [self.surface.vertices.get(u as usize)?.top, vertex.top],
            edge: [a, d],
            adjacent,
            fan: &self.fan,
            far,
            eps,
        };
        nesting.add(self.surface, &step)?;
        let children = step.children;
        self.collapse(v, u, [a, d], adjacent, children, far)?;
        Ok(())
    }

    /// The far corners p and q, or [`NONE`] where there is no triangle.
    fn far(&mut self, [a, d]: [HalfEdge; 2]) -> io::Result<[u32; 2]> {
        let mut far = |h| if h == BOUNDARY { Ok(NONE) } else { self.surface.faces.start(prev(h)) };
        Ok([far(a)?, far(d)?])
    }

    /// A vertex that `kept` has become and into which `v` may be merged, and the half-edges to it and back.
    fn find_legal(&mut self, v: u32, kept: u32) -> io::Result<Option<Edge>> {
        let mut edges = std::mem::take(&mut self.edges_of_removed);
        self.surface.edges_of(v, &mut self.around, &mut edges)?;
        let mut legal = None;
        for &(u, edge) in &edges {
            if self.surface.vertices.get(u as usize)?.stands_at == kept && self.is_legal(u, edge, &edges)? {
                legal = Some((u, edge));
                break;
            }
        }
        self.edges_of_removed = edges;
        Ok(legal)
    }

    fn is_legal(&mut self, u: u32, [a, d]: [HalfEdge; 2], around_v: &[Edge]) -> io::Result<bool> {
        let adjacent = adjacent(&mut self.surface.faces, a, d)?;
        let nothing_beside = |h: HalfEdge, side: bool| h != BOUNDARY && !side;
        let [first, second] = adjacent.sides();
        if nothing_beside(a, first) || nothing_beside(d, second) {
            return Ok(false);
        }
        let is_open = |edges: &[Edge]| edges.iter().any(|(_, pair)| pair.contains(&BOUNDARY));
        self.surface.edges_of(u, &mut self.around, &mut self.edges_of_kept)?;
        if a != BOUNDARY && d != BOUNDARY && is_open(around_v) && is_open(&self.edges_of_kept) {
            return Ok(false);
        }
        let ring = &mut self.ring_of_kept;
        ring.clear();
        ring.extend(self.edges_of_kept.iter().map(|&(w, _)| w));
        ring.sort_unstable();
        let [p, q] = self.far([a, d])?;
        let ring = &self.ring_of_kept;
        let mut seen = [0; 3];
        for &(w, _) in around_v {
            let at = ring.partition_point(|&x| x < w);
            let count = ring[at..].iter().take_while(|&&x| x == w).count();
            match [u, p, q].iter().position(|&x| x == w) {
                Some(which) => {
                    seen[which] += 1;
                    if seen[which] > 1 || (which > 0 && count != 1) {
                        return Ok(false);
                    }
                }
                None if count > 0 => return Ok(false),
                None => {}
            }
        }
        if p == NONE || q == NONE {
            return Ok(true);
        }
        let faces = &mut self.surface.faces;
        let mut closes = |around: &[Edge]| {
            for &(w, [h, _]) in around {
                if h != BOUNDARY && (w == p || w == q) {
                    let before = faces.start(prev(h))?;
                    if w == p && before == q || w == q && before == p {
                        return io::Result::Ok(true);
                    }
                }
            }
            Ok(false)
        };
        Ok(!(closes(around_v)? && closes(&self.edges_of_kept)?))
    }

    fn collapse(
        &mut self,
        v: u32,
        u: u32,
        edge: [HalfEdge; 2],
        adjacent: Adjacent,
        children: [u32; 2],
        far: [u32; 2],
    ) -> io::Result<()> {
        let node = self.merges.len() as u32;
        let Adjacent { w, x, y, z } = adjacent;
        let Surface { faces, vertices, .. } = &mut *self.surface;
        for &h in &self.fan {
            let (t, k) = triangle_of(h);
            faces.0.get_mut(t)?.start[k] = u;
        }
        faces.pair(w, x)?;
        faces.pair(y, z)?;
        let first_of = |h: HalfEdge, otherwise: HalfEdge| if h == BOUNDARY { next(otherwise) } else { h };
        let mut out = vertices.get(u as usize)?.out;
        // w starts at p and x at u; y at q and z at u.
        if far[0] != NONE {
            vertices.get_mut(far[0] as usize)?.out = first_of(w, x);
            out = first_of(x, w);
        }
        if far[1] != NONE {
            vertices.get_mut(far[1] as usize)?.out = first_of(y, z);
            out = first_of(z, y);
        }
        let kept = vertices.get_mut(u as usize)?;
        (kept.out, kept.top) = (out, node);
        vertices.get_mut(v as usize)?.out = BOUNDARY;
        for h in edge.into_iter().filter(|&h| h != BOUNDARY) {
            faces.0.get_mut(triangle_of(h).0)?.start[0] = NONE;
        }
        self.merges.push(Merge { removed: v, kept: u, edge, adjacent: [w, x, y, z], children })
    }
}
