//! An indexed triangle mesh.

use vertex_tree::Georeference;

/// Triangles over shared vertices: the input of the simplification, and what a fully refined front shows again.
///
/// Nothing is promised of the topology: holes, several components, non-manifold edges, doubled and zero-area
/// triangles all occur in real input. Every index is less than `positions.len()` and every coordinate is finite.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions, relative to the origin of [`georeference`](Self::georeference).
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices of each triangle, counter-clockwise seen from its front.
    pub triangles: Vec<[u32; 3]>,
    /// Where the mesh lies in the world.
    pub georeference: Georeference,
}

impl Mesh {
    /// The corners of the axis-aligned bounding box of the vertices, or `None` for a mesh without vertices.
    #[must_use]
    pub fn bounding_box(&self) -> Option<([f32; 3], [f32; 3])> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold((first, first), |(mut lo, mut hi), p| {
            for axis in 0..3 {
                lo[axis] = lo[axis].min(p[axis]);
                hi[axis] = hi[axis].max(p[axis]);
            }
            (lo, hi)
        }))
    }

    /// The corners of the [bounding box](Self::bounding_box) in world coordinates.
    #[must_use]
    pub fn world_box(&self) -> Option<([f64; 3], [f64; 3])> {
        let (lo, hi) = self.bounding_box()?;
        Some((self.georeference.world(lo), self.georeference.world(hi)))
    }

    /// Length of the diagonal of the bounding box; 0 for a mesh without vertices.
    #[must_use]
    pub fn extent(&self) -> f64 {
        let Some((lo, hi)) = self.bounding_box() else { return 0.0 };
        (0..3).map(|axis| f64::from(hi[axis]) - f64::from(lo[axis])).map(|x| x * x).sum::<f64>().sqrt()
    }
}
