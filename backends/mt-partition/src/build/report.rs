/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Triangles of the input.
    pub triangles: u64,
    /// Nodes of the reduced graph.
    pub nodes: u64,
    /// Partitions of nodes.
    pub partitions: u64,
    /// Triangles on the arcs, those of the input included.
    pub stored_triangles: u64,
    /// Arcs, those of the source and the drain included.
    pub arcs: u64,
    /// Triangles on arcs, and arcs, before the reduction.
    pub unreduced: (u64, u64),
    /// Arc collapses that were given up because of a second path between the nodes.
    pub refused: u64,
    /// By how much the radius of a node exceeds the largest of its collapses', mean and maximum.
    pub inflation: [f64; 2],
    /// Bytes of the file.
    pub bytes: u64,
}
