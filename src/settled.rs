//! A backend that waits for its pages: for replays whose cuts can be compared in every frame, not for viewers.

use vertex_tree::{Bounds, MeshSink, NodeId, NormalCone, PageStats, Step, TreeError, VertexTree};

/// Waits inside of a change until what it needs has come. A change that still is refused then, as memory is too small for
/// it, is a miss.
pub struct Settled<T>(pub T);

/// A change that is refused more often is left to the next frame.
const PATIENCE: usize = 100;

impl<T: VertexTree> Settled<T> {
    fn insist(
        &mut self,
        mut change: impl FnMut(&mut T) -> Result<Step, TreeError>,
    ) -> Result<Step, TreeError> {
        for _ in 0..PATIENCE {
            match change(&mut self.0)? {
                Step::NotResident => {
                    self.0.settle()?;
                    self.0.begin_frame(&mut Vec::new())?;
                }
                step => return Ok(step),
            }
        }
        Ok(Step::NotResident)
    }
}

impl<T: VertexTree> VertexTree for Settled<T> {
    const IS_TREE: bool = T::IS_TREE;
    const PREPARATION: usize = T::PREPARATION;
    const HAS_CONES: bool = T::HAS_CONES;

    fn node_limit(&self) -> u32 {
        self.0.node_limit()
    }
    fn displayed_triangles(&self) -> u64 {
        self.0.displayed_triangles()
    }
    fn roots(&self) -> &[NodeId] {
        self.0.roots()
    }
    fn bounds(&self, node: NodeId) -> Bounds {
        self.0.bounds(node)
    }
    fn children_and_bounds(&self, node: NodeId) -> impl Iterator<Item = (NodeId, Bounds)> {
        self.0.children_and_bounds(node)
    }
    fn normal_cone(&self, node: NodeId) -> NormalCone {
        self.0.normal_cone(node)
    }
    fn prepare<M: MeshSink>(&self, node: NodeId, step: usize, mesh: &M) {
        self.0.prepare(node, step, mesh);
    }
    fn look_ahead(&self) -> u32 {
        self.0.look_ahead()
    }
    fn will_need(&mut self, node: NodeId, frames: u32) {
        self.0.will_need(node, frames);
    }
    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        self.0.peek(node, children)
    }
    fn pass(&mut self, time: std::time::Duration) -> Result<(), TreeError> {
        self.0.pass(time)
    }
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.0.children(node)
    }
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.0.parents(node)
    }
    fn log_number(&self, node: NodeId) -> u32 {
        self.0.log_number(node)
    }
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        self.0.base_mesh(mesh)
    }
    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        self.insist(|tree| tree.unfold(node, mesh))
    }
    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        self.insist(|tree| tree.fold(node, mesh))
    }
    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        self.0.begin_frame(arrived)
    }
    fn settle(&mut self) -> Result<(), TreeError> {
        self.0.settle()
    }
    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        self.0.end_frame()
    }
}
