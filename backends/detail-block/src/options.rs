//! How to build a file, and what that did.

/// How to build a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildOptions {
    /// Levels of a detail block, 1 to 5. The paper found 4 efficient.
    pub levels: u32,
    /// Whether to store nodes in 30 bytes instead of 52. Positions then move to a lattice of 2^19 points a side.
    pub quantize: bool,
    /// Whether to nest bounds over what splits need beyond the tree, so that nothing is ever forced.
    pub nest_needs: bool,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { levels: 4, quantize: false, nest_needs: true }
    }
}

/// What a build did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Triangles of the fully refined mesh.
    pub triangles: u64,
    /// Input triangles that name a vertex twice: never shown, left out.
    pub degenerate: u64,
    /// Vertices that were added to split non-manifold ones apart.
    pub added_vertices: u64,
    /// Non-manifold edges that were cut.
    pub cut_edges: u64,
    /// Vertices that the log removes and that stay, as that would not have been a collapse of the manifold mesh.
    pub left_out: u64,
    /// Nodes.
    pub nodes: u64,
    /// Roots of the forest.
    pub roots: u64,
    /// Vertices of the base mesh.
    pub initial_vertices: u64,
    /// Faces of the base mesh.
    pub initial_faces: u64,
    /// Detail blocks.
    pub blocks: u64,
    /// Those of them without children.
    pub leaf_blocks: u64,
    /// Bytes of the file.
    pub bytes: u64,
}
