//! The displayed mesh as a renderer keeps it: a vertex buffer, an index buffer, and what changed in them.
//!
//! The index buffer is dense: its first `triangles().len()` entries are the displayed triangles, so one draw call
//! shows them; a triangle that disappears is replaced by the last one. The vertex buffer has holes, which are used
//! again last in, first out. Per frame a renderer uploads the entries named by [`ActiveMesh::changed_triangles`] and
//! [`ActiveMesh::changed_vertices`], then calls [`ActiveMesh::clear_changes`].

use vertex_tree::{Mesh, MeshSink, NONE, TriangleId, VertexId, VertexTree};

/// A slot of one of the buffers is named at most once among the changes.
#[derive(Clone, Debug, Default)]
struct Changes {
    slots: Vec<u32>,
    /// For each slot, the round in which it last changed.
    round_of: Vec<u32>,
    round: u32,
}

impl Changes {
    fn note(&mut self, slot: u32) {
        if self.round_of.len() <= slot as usize {
            self.round_of.resize(slot as usize + 1, u32::MAX);
        }
        let round_of = &mut self.round_of[slot as usize];
        if *round_of != self.round {
            *round_of = self.round;
            self.slots.push(slot);
        }
    }

    fn clear(&mut self) {
        self.slots.clear();
        self.round = self.round.wrapping_add(1);
        if self.round == u32::MAX {
            self.round_of.fill(u32::MAX);
            self.round = 0;
        }
    }
}

/// Vertex and index buffers of the displayed mesh, patched as the front moves.
#[derive(Clone, Debug)]
pub struct ActiveMesh {
    positions: Vec<[f32; 3]>,
    /// The vertex in each slot, [`NONE`] in a hole.
    vertex_in: Vec<VertexId>,
    holes: Vec<u32>,
    slot_of_vertex: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    triangle_in: Vec<TriangleId>,
    slot_of_triangle: Vec<u32>,
    changed_vertices: Changes,
    changed_triangles: Changes,
}

impl ActiveMesh {
    /// An empty mesh for what `tree` will report.
    pub fn new(tree: &impl VertexTree) -> Self {
        Self {
            positions: Vec::new(),
            vertex_in: Vec::new(),
            holes: Vec::new(),
            slot_of_vertex: vec![NONE; tree.vertex_count() as usize],
            triangles: Vec::new(),
            triangle_in: Vec::new(),
            slot_of_triangle: vec![NONE; tree.triangle_count() as usize],
            changed_vertices: Changes::default(),
            changed_triangles: Changes::default(),
        }
    }

    /// The vertex buffer: positions in object space. Slots that no triangle names hold old positions.
    #[must_use]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// The index buffer: three slots of the vertex buffer a triangle, counter-clockwise.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The backend's number of the triangle in each slot of the index buffer.
    #[must_use]
    pub fn triangle_ids(&self) -> &[TriangleId] {
        &self.triangle_in
    }

    /// The backend's number of the vertex in each slot of the vertex buffer; [`NONE`] in a hole.
    #[must_use]
    pub fn vertex_ids(&self) -> &[VertexId] {
        &self.vertex_in
    }

    /// Slots of the vertex buffer that have changed since the changes were cleared, each once.
    #[must_use]
    pub fn changed_vertices(&self) -> &[u32] {
        &self.changed_vertices.slots
    }

    /// Slots of the index buffer that have changed since the changes were cleared, each once. Slots at and beyond
    /// `triangles().len()` are no longer used.
    #[must_use]
    pub fn changed_triangles(&self) -> &[u32] {
        &self.changed_triangles.slots
    }

    /// Starts collecting changes anew: everything up to now has been uploaded.
    pub fn clear_changes(&mut self) {
        self.changed_vertices.clear();
        self.changed_triangles.clear();
    }

    /// A copy of the displayed mesh, without holes.
    #[must_use]
    pub fn to_mesh(&self) -> Mesh {
        let mut slot = vec![NONE; self.positions.len()];
        let mut mesh = Mesh::default();
        for (at, &vertex) in self.vertex_in.iter().enumerate() {
            if vertex != NONE {
                slot[at] = mesh.positions.len() as u32;
                mesh.positions.push(self.positions[at]);
            }
        }
        mesh.triangles = self.triangles.iter().map(|t| t.map(|v| slot[v as usize])).collect();
        mesh
    }
}

impl MeshSink for ActiveMesh {
    fn vertex_added(&mut self, vertex: VertexId, position: [f32; 3]) {
        let slot = self.holes.pop().unwrap_or_else(|| {
            self.positions.push(position);
            self.vertex_in.push(NONE);
            self.positions.len() as u32 - 1
        });
        self.positions[slot as usize] = position;
        self.vertex_in[slot as usize] = vertex;
        self.slot_of_vertex[vertex as usize] = slot;
        self.changed_vertices.note(slot);
    }

    fn vertex_removed(&mut self, vertex: VertexId) {
        let slot = self.slot_of_vertex[vertex as usize];
        self.slot_of_vertex[vertex as usize] = NONE;
        self.vertex_in[slot as usize] = NONE;
        self.holes.push(slot);
    }

    fn triangle_added(&mut self, triangle: TriangleId, corners: [VertexId; 3]) {
        let slot = self.triangles.len() as u32;
        self.triangles.push(corners.map(|v| self.slot_of_vertex[v as usize]));
        self.triangle_in.push(triangle);
        self.slot_of_triangle[triangle as usize] = slot;
        self.changed_triangles.note(slot);
    }

    fn triangle_removed(&mut self, triangle: TriangleId) {
        let slot = self.slot_of_triangle[triangle as usize];
        self.slot_of_triangle[triangle as usize] = NONE;
        self.triangles.swap_remove(slot as usize);
        self.triangle_in.swap_remove(slot as usize);
        if let Some(&moved) = self.triangle_in.get(slot as usize) {
            self.slot_of_triangle[moved as usize] = slot;
        }
        self.changed_triangles.note(slot);
    }

    fn corner_moved(&mut self, triangle: TriangleId, corner: usize, to: VertexId) {
        let slot = self.slot_of_triangle[triangle as usize];
        self.triangles[slot as usize][corner] = self.slot_of_vertex[to as usize];
        self.changed_triangles.note(slot);
    }
}
