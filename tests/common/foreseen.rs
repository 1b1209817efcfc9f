//! A backend with everything in memory that writes down what the engine foresees.

use foldfront::vertex_tree::{Bounds, Hierarchy, MeshSink, NodeId, PageStats, Step, TreeError, VertexTree};

/// Passes everything on, and keeps what was named since the frame began.
pub struct Foreseen<T> {
    pub tree: T,
    pub look_ahead: u32,
    /// Nodes named in this frame, each with the frames until its change.
    pub named: Vec<(NodeId, u32)>,
    /// Nodes that have changed in this frame.
    pub changed: Vec<NodeId>,
}

impl<T: VertexTree> Foreseen<T> {
    pub fn new(tree: T, look_ahead: u32) -> Self {
        Self { tree, look_ahead, named: Vec::new(), changed: Vec::new() }
    }
}

impl<T: VertexTree> Hierarchy for Foreseen<T> {
    const IS_TREE: bool = T::IS_TREE;

    fn node_limit(&self) -> u32 {
        self.tree.node_limit()
    }
    fn displayed(&self) -> u64 {
        self.tree.displayed()
    }
    fn origin(&self) -> [f64; 3] {
        self.tree.origin()
    }
    fn roots(&self) -> &[NodeId] {
        self.tree.roots()
    }
    fn bounds(&self, node: NodeId) -> Bounds {
        self.tree.bounds(node)
    }
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.tree.children(node)
    }
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.tree.parents(node)
    }
    fn log_number(&self, node: NodeId) -> u32 {
        self.tree.log_number(node)
    }
    fn look_ahead(&self) -> u32 {
        self.look_ahead
    }
    fn will_need(&mut self, node: NodeId, frames: u32) {
        assert!((1..=self.look_ahead).contains(&frames), "{node:?} in {frames} frames");
        self.named.push((node, frames));
    }
    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        if !self.tree.peek(node, children) {
            children.extend(self.tree.children_and_bounds(node));
        }
        true
    }
    fn assert_well_formed(&self) {
        self.tree.assert_well_formed();
    }
    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        self.named.clear();
        self.changed.clear();
        self.tree.begin_frame(arrived)
    }
    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        self.tree.end_frame()
    }
}

impl<T: VertexTree> VertexTree for Foreseen<T> {
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        self.tree.base_mesh(mesh)
    }
    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let step = self.tree.unfold(node, mesh)?;
        if step == Step::Done {
            self.changed.push(node);
        }
        Ok(step)
    }
    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let step = self.tree.fold(node, mesh)?;
        if step == Step::Done {
            self.changed.push(node);
        }
        Ok(step)
    }
    fn update_mesh<M: MeshSink>(&mut self, mesh: &mut M) {
        self.tree.update_mesh(mesh);
    }
}
