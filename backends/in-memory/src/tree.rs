//! The tree that the engine unfolds and folds.

use std::sync::Arc;

use star_mesh::{LeafTriangle, StarMesh};
use vertex_tree::{
    Bounds, Hierarchy, MeshSink, NONE, NodeId, PageStats, Step, TreeError, TriangleId, VertexId, VertexTree,
    prefetch,
};

use super::hierarchy::InMemoryHierarchy;
use crate::hierarchy::Node;

/// A hierarchy and the state of one front through it.
///
/// Nothing beyond structure is depended on: bounds are nested over everything a collapse relied on, so the cut that
/// the criterion asks for is one that the simplification went through.
#[derive(Clone, Debug)]
pub struct InMemoryTree {
    hierarchy: Arc<InMemoryHierarchy>,
    /// Kept only for a sink that wants the mesh.
    mesh: Option<StarMesh>,
    displayed: u64,
}

impl InMemoryTree {
    /// A tree with every node folded.
    #[must_use]
    pub fn new(hierarchy: Arc<InMemoryHierarchy>) -> Self {
        Self { hierarchy, mesh: None, displayed: 0 }
    }

    /// The hierarchy that the tree shows.
    #[must_use]
    pub fn hierarchy(&self) -> &Arc<InMemoryHierarchy> {
        &self.hierarchy
    }

    /// The input vertex that is shown in a slot; `None` in a hole, and for a sink that does not keep the mesh.
    #[must_use]
    pub fn input_vertex(&self, vertex: VertexId) -> Option<u32> {
        let leaf = self.mesh.as_ref()?.leaf(vertex);
        self.hierarchy.input_vertex.get(leaf as usize).copied()
    }

    /// The input triangle that is shown in a slot; `None` as for [`input_vertex`](Self::input_vertex).
    #[must_use]
    pub fn input_triangle(&self, triangle: TriangleId) -> Option<u32> {
        Some(self.mesh.as_ref()?.number(triangle)).filter(|&number| number != NONE)
    }

    fn node(&self, node: NodeId) -> &Node {
        &self.hierarchy.nodes[node.index()]
    }
}

impl Hierarchy for InMemoryTree {
    const IS_TREE: bool = true;
    const PREPARATION: usize = 2;

    fn node_limit(&self) -> u32 {
        self.hierarchy.nodes.len() as u32
    }

    fn displayed(&self) -> u64 {
        self.displayed
    }

    fn origin(&self) -> [f64; 3] {
        self.hierarchy.origin
    }

    fn roots(&self) -> &[NodeId] {
        &self.hierarchy.roots
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        let h = &*self.hierarchy;
        match h.parents[node.index()] {
            // Roots are numbered in ascending order.
            NONE => h.root_bounds[h.roots.partition_point(|&root| root < node)],
            parent => {
                let parent = &h.nodes[parent as usize];
                parent.child_bounds[usize::from(parent.children[1] == node.0)]
            }
        }
    }

    #[inline]
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.children_and_bounds(node).map(|(child, _)| child)
    }

    #[inline]
    fn children_and_bounds(&self, node: NodeId) -> impl Iterator<Item = (NodeId, Bounds)> {
        let &Node { children, child_bounds, .. } = self.node(node);
        let children = children.into_iter().zip(child_bounds);
        children.filter(|&(child, _)| child != NONE).map(|(child, bounds)| (NodeId(child), bounds))
    }

    #[inline]
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        Some(self.hierarchy.parents[node.index()]).filter(|&p| p != NONE).map(NodeId).into_iter()
    }

    fn log_number(&self, node: NodeId) -> u32 {
        self.node(node).log_number
    }

    #[inline(always)]
    fn prepare(&self, node: NodeId, step: usize) {
        let h = &*self.hierarchy;
        if step == 0 {
            prefetch(&h.nodes, node.index());
        } else if self.mesh.is_some() {
            prefetch(&h.positions, node.index());
            prefetch(&h.triangles, h.first_brought(node.index()) as usize);
        }
    }

    #[track_caller]
    fn assert_well_formed(&self) {
        if let Some(stars) = &self.mesh {
            stars.assert_well_formed();
            assert_eq!(stars.displayed() as u64, self.displayed, "triangles displayed");
        }
    }

    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        let h = &self.hierarchy;
        let resident_bytes = (h.nodes.len() * (size_of::<Node>() + 16)
            + h.input_vertex.len() * 4
            + h.triangles.len() * 16) as u64;
        Ok(PageStats { resident_bytes, ..PageStats::default() })
    }
}

impl VertexTree for InMemoryTree {
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        let h = &self.hierarchy;
        // A triangle with a doubled corner has no node that brings it and is no base triangle either.
        let is_shown = |triangle: &&LeafTriangle| {
            let [a, b, c] = triangle.leaves;
            a != b && b != c && c != a
        };
        let base = h.triangles[h.refining as usize..].iter().filter(is_shown);
        if !M::KEEPS_MESH {
            self.displayed = base.count() as u64;
            return Ok(());
        }
        let mut stars = StarMesh::new(h.input_vertex.len());
        for &(leaf, position) in &h.base_vertices {
            stars.add_vertex(leaf, position, mesh);
        }
        base.for_each(|&triangle| stars.add_triangle(triangle, mesh));
        self.displayed = stars.displayed() as u64;
        self.mesh = Some(stars);
        Ok(())
    }

    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let h = &*self.hierarchy;
        let brought = h.brought(node.index());
        self.displayed += brought.len() as u64;
        if let Some(stars) = self.mesh.as_mut().filter(|_| M::KEEPS_MESH) {
            let Node { kept, removed, .. } = h.nodes[node.index()];
            stars.split([kept, removed], h.positions[node.index()], brought.iter().copied(), mesh);
        }
        Ok(Step::Done)
    }

    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let h = &*self.hierarchy;
        self.displayed -= h.brought(node.index()).len() as u64;
        if let Some(stars) = self.mesh.as_mut().filter(|_| M::KEEPS_MESH) {
            let Node { kept, removed, .. } = h.nodes[node.index()];
            stars.merge([kept, removed], mesh);
        }
        Ok(Step::Done)
    }

    fn update_mesh<M: MeshSink>(&mut self, mesh: &mut M) {
        if let Some(stars) = &mut self.mesh {
            stars.update(mesh);
        }
    }
}
