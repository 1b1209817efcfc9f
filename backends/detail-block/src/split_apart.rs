//! From any triangles to a manifold half-edge mesh: what is not manifold is split apart.
//!
//! An edge is kept where it joins exactly two triangles that run along it in opposite directions and are not two sides
//! of the same three vertices. Any other edge of more than one triangle is cut: its half-edges become boundaries. Then
//! every fan of triangles around a vertex gets a vertex of its own. Triangles that name a vertex twice are never shown and
//! are left out.

use vertex_tree::{Mesh, NONE};

use crate::half_edges::{BOUNDARY, HalfEdge, HalfEdges, Triangle, next, prev};

/// A manifold mesh and where its vertices come from.
pub(crate) struct Manifold {
    /// Slot `t` is input triangle `t`, [`Triangle::NONE`] where that names a vertex twice.
    pub edges: HalfEdges,
    /// For each vertex, the input vertex. The first ones are the input vertices themselves.
    pub origin: Vec<u32>,
    /// For each vertex, a half-edge that starts there, or [`BOUNDARY`].
    pub out: Vec<HalfEdge>,
    /// Edges that were cut.
    pub cut_edges: u64,
    /// Triangles that were left out.
    pub degenerate: u64,
}

impl Manifold {
    pub fn new(mesh: &Mesh) -> Self {
        let mut edges = HalfEdges { triangles: Vec::with_capacity(mesh.triangles.len()) };
        let mut degenerate = 0;
        for &[a, b, c] in &mesh.triangles {
            if a == b || b == c || c == a {
                degenerate += 1;
                edges.triangles.push(Triangle::NONE);
            } else {
                edges.triangles.push(Triangle { start: [a, b, c], rev: [BOUNDARY; 3] });
            }
        }
        let cut_edges = pair_up(&mut edges);
        let mut manifold = Self {
            edges,
            origin: (0..mesh.positions.len() as u32).collect(),
            out: vec![BOUNDARY; mesh.positions.len()],
            cut_edges,
            degenerate,
        };
        manifold.separate_fans();
        manifold
    }

    fn separate_fans(&mut self) {
        let mut visited = vec![[false; 3]; self.edges.triangles.len()];
        let mut orbit = Vec::new();
        for t in 0..self.edges.triangles.len() {
            for k in 0..3 {
                let vertex = self.edges.triangles[t].start[k];
                if vertex == NONE || visited[t][k] {
                    continue;
                }
                let first = (4 * t + k) as HalfEdge;
                self.edges.orbit(first, &mut orbit);
                let own = if self.out[vertex as usize] == BOUNDARY {
                    self.out[vertex as usize] = first;
                    vertex
                } else {
                    let copy = self.origin.len() as u32;
                    self.origin.push(vertex);
                    self.out.push(first);
                    copy
                };
                for &h in &orbit {
                    visited[(h >> 2) as usize][(h & 3) as usize] = true;
                    self.edges.set_start(h, own);
                }
            }
        }
    }

    /// The edges from `v`: the vertex at the other end, and the half-edges to it and from it.
    pub fn edges_of(&self, v: u32, orbit: &mut Vec<HalfEdge>, found: &mut Vec<(u32, [HalfEdge; 2])>) {
        found.clear();
        let first = self.out[v as usize];
        if first == BOUNDARY {
            return;
        }
        let edges = &self.edges;
        edges.orbit(first, orbit);
        for &h in orbit.iter() {
            found.push((edges.end(h), [h, edges.rev(h)]));
            let into = prev(h);
            if edges.rev(into) == BOUNDARY {
                found.push((edges.start(into), [BOUNDARY, into]));
            }
        }
    }
}

/// Joins half-edges where they make a manifold edge, and says how many edges of several triangles are none.
fn pair_up(edges: &mut HalfEdges) -> u64 {
    let mut sorted: Vec<(u64, HalfEdge)> = Vec::with_capacity(3 * edges.triangles.len());
    for (t, triangle) in edges.triangles.iter().enumerate() {
        if triangle.start[0] == NONE {
            continue;
        }
        for k in 0..3 {
            let (a, b) = (triangle.start[k], triangle.start[(k + 1) % 3]);
            sorted.push((u64::from(a.min(b)) << 32 | u64::from(a.max(b)), (4 * t + k) as HalfEdge));
        }
    }
    sorted.sort_unstable();
    let mut cut = 0;
    for group in sorted.chunk_by(|a, b| a.0 == b.0) {
        match *group {
            [_] => {}
            [(_, h), (_, g)]
                if edges.start(h) != edges.start(g) && edges.end(next(h)) != edges.end(next(g)) =>
            {
                edges.pair(h, g);
            }
            _ => cut += 1,
        }
    }
    cut
}
