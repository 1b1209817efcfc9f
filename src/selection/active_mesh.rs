//! The displayed mesh as a renderer keeps it: a vertex buffer, an index buffer, and what changed in them.
//!
//! Both buffers are indexed by the slots that the backend hands out, so a change is a write. Slots are used again, and
//! both buffers have holes: the index buffer holds triangles without an area there, so that one draw call over all of it
//! shows the mesh. Per frame a renderer uploads the entries named by [`ActiveMesh::changed_triangles`] and
//! [`ActiveMesh::changed_vertices`], then calls [`ActiveMesh::clear_changes`].

use vertex_tree::{MeshSink, NONE, TriangleId, VertexId, prefetch};

/// A slot of one of the buffers is named at most once among the changes.
#[derive(Clone, Debug, Default)]
struct Changes {
    /// The named ones are the first `count`. There is a place for every slot.
    slots: Vec<u32>,
    count: usize,
    /// A bit a slot: whether it is named. Small enough to stay in the nearest cache.
    is_named: Vec<u64>,
}

impl Changes {
    #[inline]
    fn note(&mut self, slot: u32) {
        let (word, bit) = (slot as usize / 64, 1 << (slot % 64));
        if self.is_named.len() <= word {
            self.is_named.resize(2 * word + 2, 0);
            self.slots.resize(64 * self.is_named.len(), 0);
        }
        // Written whether it is named already or not: only the count depends on that, so there is no branch.
        let is_new = self.is_named[word] & bit == 0;
        self.is_named[word] |= bit;
        if let Some(place) = self.slots.get_mut(self.count) {
            *place = slot;
        }
        self.count += usize::from(is_new);
    }

    fn named(&self) -> &[u32] {
        &self.slots[..self.count]
    }

    fn clear(&mut self) {
        for &slot in &self.slots[..self.count] {
            self.is_named[slot as usize / 64] = 0;
        }
        self.count = 0;
    }
}

/// What stands in an unused slot of the index buffer: it covers nothing.
const HOLE: [u32; 3] = [0; 3];

/// Vertex and index buffers of the displayed mesh, patched as the front moves.
#[derive(Clone, Debug, Default)]
pub struct ActiveMesh {
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    displayed: usize,
    vertices: usize,
    changed_vertices: Changes,
    changed_triangles: Changes,
}

impl ActiveMesh {
    /// An empty mesh.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The vertex buffer: positions in object space. Slots that no triangle names hold old positions.
    #[must_use]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// The index buffer: three slots of the vertex buffer a triangle, counter-clockwise; three times the same in a hole.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// How many triangles are displayed: slots of the index buffer that are no holes.
    #[must_use]
    pub fn displayed(&self) -> usize {
        self.displayed
    }

    /// How many vertices are displayed: slots of the vertex buffer that are no holes.
    #[must_use]
    pub fn displayed_vertices(&self) -> usize {
        self.vertices
    }

    /// The displayed triangles, each with its slot.
    pub fn displayed_triangles(&self) -> impl Iterator<Item = (TriangleId, [VertexId; 3])> + '_ {
        (0..).zip(&self.triangles).filter(|(_, t)| t[0] != t[1]).map(|(slot, &t)| (slot, t))
    }

    /// Slots of the vertex buffer that have changed since the changes were cleared, each once.
    #[must_use]
    pub fn changed_vertices(&self) -> &[u32] {
        self.changed_vertices.named()
    }

    /// Slots of the index buffer that have changed since the changes were cleared, each once. Slots at and beyond
    /// `triangles().len()` are no longer used.
    #[must_use]
    pub fn changed_triangles(&self) -> &[u32] {
        self.changed_triangles.named()
    }

    /// Starts collecting changes anew: everything up to now has been uploaded.
    pub fn clear_changes(&mut self) {
        self.changed_vertices.clear();
        self.changed_triangles.clear();
    }

    /// A copy of the displayed mesh without holes: its vertices, and its triangles as triples of their numbers.
    #[must_use]
    pub fn gathered(&self) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
        let mut number = vec![NONE; self.positions.len()];
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for (_, corners) in self.displayed_triangles() {
            triangles.push(corners.map(|v| {
                let number = &mut number[v as usize];
                if *number == NONE {
                    *number = positions.len() as u32;
                    positions.push(self.positions[v as usize]);
                }
                *number
            }));
        }
        (positions, triangles)
    }

    #[inline]
    fn set(&mut self, triangle: TriangleId, corners: [VertexId; 3]) {
        let at = triangle as usize;
        if self.triangles.len() <= at {
            self.triangles.resize(at + 1, HOLE);
        }
        self.triangles[at] = corners;
        self.changed_triangles.note(triangle);
    }
}

impl MeshSink for ActiveMesh {
    #[inline(always)]
    fn prefetch(&self, triangle: TriangleId) {
        prefetch(&self.triangles, triangle as usize);
    }

    #[inline]
    fn vertex_added(&mut self, vertex: VertexId, position: [f32; 3]) {
        let at = vertex as usize;
        if self.positions.len() <= at {
            self.positions.resize(at + 1, position);
        }
        self.vertices += 1;
        self.positions[at] = position;
        self.changed_vertices.note(vertex);
    }

    #[inline]
    fn vertex_removed(&mut self, _: VertexId) {
        self.vertices -= 1;
    }

    #[inline]
    fn triangle_added(&mut self, triangle: TriangleId, corners: [VertexId; 3]) {
        self.displayed += 1;
        self.set(triangle, corners);
    }

    #[inline]
    fn triangle_removed(&mut self, triangle: TriangleId) {
        self.displayed -= 1;
        self.set(triangle, HOLE);
        if triangle as usize + 1 == self.triangles.len() {
            self.triangles.pop();
        }
    }

    #[inline]
    fn corner_moved(&mut self, triangle: TriangleId, corner: usize, to: VertexId) {
        self.triangles[triangle as usize][corner] = to;
        self.changed_triangles.note(triangle);
    }
}
