//! The displayed mesh: half-edges in slots, vertex splits and half-edge collapses.

use vertex_tree::{MeshSink, NONE};

use crate::half_edges::{Adjacent, BOUNDARY, HalfEdge, HalfEdges, Triangle, next, prev, triangle_of};

/// The displayed triangles. Those of the base mesh are in the first slots, which never get others.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shown {
    pub edges: HalfEdges,
    unused_triangles: Vec<u32>,
    unused_vertices: Vec<u32>,
    vertices: u32,
    fan: Vec<HalfEdge>,
}

impl Shown {
    /// The base mesh, reported to a sink.
    pub fn new<M: MeshSink>(vertices: &[[[f32; 3]; 2]], faces: &HalfEdges, mesh: &mut M) -> Self {
        for (vertex, &[position, _]) in (0..).zip(vertices) {
            mesh.vertex_added(vertex, position);
        }
        for (face, triangle) in (0..).zip(&faces.triangles) {
            mesh.triangle_added(face, triangle.start);
        }
        Self { edges: faces.clone(), vertices: vertices.len() as u32, ..Self::default() }
    }

    /// A vertex splits: `adjacent` is around it. Returns the slots of the new triangles, [`NONE`] for none. `None`, and
    /// nothing has changed, if w x y z do not lie as they should.
    #[inline]
    pub fn split<M: MeshSink>(
        &mut self,
        adjacent: Adjacent,
        position: [f32; 3],
        mesh: &mut M,
    ) -> Option<[u32; 2]> {
        let (u, [p, q]) = self.edges.around(adjacent)?;
        if p == q || !self.edges.fan(adjacent, &mut self.fan) {
            return None;
        }
        let v = self.unused_vertices.pop().unwrap_or_else(|| {
            self.vertices += 1;
            self.vertices - 1
        });
        mesh.vertex_added(v, position);
        for &h in &self.fan {
            self.edges.set_start(h, v);
            let (t, k) = triangle_of(h);
            mesh.corner_moved(t as u32, k, v);
        }
        let [first, second] = adjacent.sides();
        let Adjacent { w, x, y, z } = adjacent;
        let a = if first { self.add([v, u, p], mesh) } else { BOUNDARY };
        let d = if second { self.add([u, v, q], mesh) } else { BOUNDARY };
        self.edges.pair(a, d);
        for (h, to, from) in [(a, w, x), (d, y, z)] {
            if h != BOUNDARY {
                self.edges.pair(next(h), to);
                self.edges.pair(prev(h), from);
            }
        }
        Some([a, d].map(|h| if h == BOUNDARY { NONE } else { h >> 2 }))
    }

    /// The half-edge collapse that takes back a split which made the triangles in these slots.
    #[inline]
    pub fn merge<M: MeshSink>(&mut self, slots: [u32; 2], mesh: &mut M) {
        let [a, d] = slots.map(|slot| if slot == NONE { BOUNDARY } else { slot << 2 });
        let (v, u) = match a {
            BOUNDARY => (self.edges.end(d), self.edges.start(d)),
            a => (self.edges.start(a), self.edges.end(a)),
        };
        let adjacent = self.edges.adjacent(a, d);
        let Adjacent { w, x, y, z } = adjacent;
        let fits = self.edges.fan(adjacent, &mut self.fan);
        debug_assert!(fits, "what has been split is around one vertex");
        for slot in slots.into_iter().filter(|&slot| slot != NONE) {
            self.edges.triangles[slot as usize] = Triangle::NONE;
            self.unused_triangles.push(slot);
            mesh.triangle_removed(slot);
        }
        for &h in &self.fan {
            self.edges.set_start(h, u);
            let (t, k) = triangle_of(h);
            mesh.corner_moved(t as u32, k, u);
        }
        self.edges.pair(w, x);
        self.edges.pair(y, z);
        mesh.vertex_removed(v);
        self.unused_vertices.push(v);
    }

    /// A triangle appears, joined to nothing yet; returns its first half-edge.
    #[inline(always)]
    fn add<M: MeshSink>(&mut self, start: [u32; 3], mesh: &mut M) -> HalfEdge {
        let triangle = Triangle { start, rev: [BOUNDARY; 3] };
        let slot = match self.unused_triangles.pop() {
            Some(slot) => {
                self.edges.triangles[slot as usize] = triangle;
                slot
            }
            None => {
                self.edges.triangles.push(triangle);
                self.edges.triangles.len() as u32 - 1
            }
        };
        mesh.triangle_added(slot, start);
        slot << 2
    }

    /// Checks the half-edges: reverses in pairs between the same two vertices, triangles with three corners, every vertex
    /// with one fan of triangles, closed or open at one place, and no triangle there twice.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    pub fn assert_well_formed(&self, displayed: u64) {
        let edges = &self.edges;
        let mut corners = vec![0_u32; self.vertices as usize];
        let mut of_vertex = vec![BOUNDARY; self.vertices as usize];
        let mut shown = Vec::new();
        for (t, triangle) in (0_u32..).zip(&edges.triangles) {
            let start = triangle.start;
            if start[0] == NONE {
                assert_eq!(*triangle, Triangle::NONE, "slot {t} is half empty");
                continue;
            }
            let [a, b, c] = start;
            assert!(a != b && b != c && c != a, "triangle {t} is degenerate: {start:?}");
            for h in [4 * t, 4 * t + 1, 4 * t + 2] {
                corners[edges.start(h) as usize] += 1;
                of_vertex[edges.start(h) as usize] = h;
                let back = edges.rev(h);
                if back != BOUNDARY {
                    assert_eq!(edges.rev(back), h, "half-edge {h}: its reverse {back} has another");
                    assert_eq!(
                        (edges.start(back), edges.end(back)),
                        (edges.end(h), edges.start(h)),
                        "half-edge {h}: its reverse {back} runs elsewhere"
                    );
                }
            }
            let mut sorted = start;
            sorted.sort_unstable();
            shown.push(sorted);
        }
        assert_eq!(shown.len() as u64, displayed, "triangles displayed");
        shown.sort_unstable();
        if let Some(twice) = shown.windows(2).find(|pair| pair[0] == pair[1]) {
            panic!("the triangle {:?} is there twice", twice[0]);
        }
        let mut orbit = Vec::new();
        for (v, (&h, &count)) in of_vertex.iter().zip(&corners).enumerate() {
            if h != BOUNDARY {
                edges.orbit(h, &mut orbit);
                assert_eq!(orbit.len() as u32, count, "the triangles around vertex {v} are several fans");
            }
        }
        let unused = self.unused_vertices.iter();
        assert!(unused.clone().all(|&v| of_vertex[v as usize] == BOUNDARY), "an unused vertex is used");
        let used = of_vertex.iter().filter(|&&h| h != BOUNDARY).count();
        assert_eq!(used + unused.len(), self.vertices as usize, "a vertex without triangles is displayed");
        assert_eq!(shown.len() + self.unused_triangles.len(), edges.triangles.len(), "slots are lost");
    }
}
