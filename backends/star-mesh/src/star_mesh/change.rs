use vertex_tree::{NONE, VertexId};

use crate::leaf_triangle::LeafTriangle;

/// A change of status that the mesh has yet to follow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Change {
    /// The leaves of the kept and the removed vertex.
    pub leaves: [u32; 2],
    /// Where the removed vertex is; `None` where it goes.
    pub position: Option<[f32; 3]>,
    /// Which of the coming triangles come with it.
    brought: [u32; 2],
    /// The vertices of its leaves, as far as they are shown.
    pub vertices: [VertexId; 2],
    /// The leaves shown for the far corners of the first two triangles that come.
    pub far: [u32; 2],
}

impl Change {
    pub fn new(leaves: [u32; 2], position: Option<[f32; 3]>, brought: [u32; 2]) -> Self {
        Self { leaves, position, brought, vertices: [NONE; 2], far: [NONE; 2] }
    }

    #[inline(always)]
    pub fn brought(self, coming: &[LeafTriangle]) -> &[LeafTriangle] {
        &coming[self.brought[0] as usize..self.brought[1] as usize]
    }
}
