//! How to build a file.

use crate::partition::QueueOrder;

/// How to build a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildOptions {
    /// Nodes are merged until arcs hold so many triangles on average; 0 leaves the graph as it is.
    pub patch: f64,
    /// Nodes in a partition, at most. The paper advises 20 for one object, 50 to 100 for many.
    pub partition: u32,
    /// In which order partitions are merged.
    pub order: QueueOrder,
}

impl Default for BuildOptions {
    /// Patches of 10 triangles, partitions of 20 nodes.
    fn default() -> Self {
        Self { patch: 10.0, partition: 20, order: QueueOrder::default() }
    }
}
