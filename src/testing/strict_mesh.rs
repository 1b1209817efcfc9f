//! A mesh sink that trusts nobody.

use std::collections::BTreeMap;

use vertex_tree::{MeshSink, TriangleId, VertexId};

/// Keeps the displayed triangles and holds the backend to the order of calls that [`MeshSink`] promises: what appears
/// was not there, what disappears or moves was, and no triangle ever has a corner where no vertex is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StrictMesh {
    /// The corners of each triangle.
    pub triangles: BTreeMap<TriangleId, [VertexId; 3]>,
    /// Position, and how many corners are there.
    pub vertices: BTreeMap<VertexId, ([f32; 3], usize)>,
}

impl StrictMesh {
    /// The triangles as the places of their corners, the least first, in order: the same for the same mesh, however it came about.
    #[must_use]
    pub fn shape(&self) -> Vec<[[u32; 3]; 3]> {
        let place = |vertex: VertexId| self.vertices[&vertex].0.map(f32::to_bits);
        let mut shape: Vec<_> = self
            .triangles
            .values()
            .map(|corners| {
                let mut places = corners.map(place);
                let least = (0..3).min_by_key(|&at| places[at]).unwrap_or(0);
                places.rotate_left(least);
                places
            })
            .collect();
        shape.sort_unstable();
        shape
    }

    fn arrive(&mut self, triangle: TriangleId, vertex: VertexId) {
        let there = self.vertices.get_mut(&vertex);
        let Some((_, corners)) = there else { panic!("triangle {triangle}: no vertex {vertex}") };
        *corners += 1;
    }

    fn leave(&mut self, vertex: VertexId) {
        self.vertices.get_mut(&vertex).unwrap().1 -= 1;
    }
}

impl MeshSink for StrictMesh {
    fn vertex_added(&mut self, vertex: VertexId, position: [f32; 3]) {
        assert!(self.vertices.insert(vertex, (position, 0)).is_none(), "vertex {vertex} was there");
    }

    fn vertex_removed(&mut self, vertex: VertexId) {
        let removed = self.vertices.remove(&vertex);
        let Some((_, corners)) = removed else { panic!("vertex {vertex} was not there") };
        assert_eq!(corners, 0, "corners of triangles are still at vertex {vertex}");
    }

    fn triangle_added(&mut self, triangle: TriangleId, corners: [VertexId; 3]) {
        for vertex in corners {
            self.arrive(triangle, vertex);
        }
        assert!(self.triangles.insert(triangle, corners).is_none(), "triangle {triangle} was there");
    }

    fn triangle_removed(&mut self, triangle: TriangleId) {
        let removed = self.triangles.remove(&triangle);
        let Some(corners) = removed else { panic!("triangle {triangle} was not there") };
        for vertex in corners {
            self.leave(vertex);
        }
    }

    fn corner_moved(&mut self, triangle: TriangleId, corner: usize, to: VertexId) {
        let corners = self.triangles.get_mut(&triangle);
        let Some(corners) = corners else { panic!("triangle {triangle} was not there") };
        let from = std::mem::replace(&mut corners[corner], to);
        self.leave(from);
        self.arrive(triangle, to);
    }
}
