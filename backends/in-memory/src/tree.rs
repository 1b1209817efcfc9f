//! The tree that the engine unfolds and folds.

use std::sync::Arc;

use vertex_tree::{
    Bounds, LeafTriangle, MeshSink, NONE, NodeId, PageStats, StarMesh, Step, TreeError, TriangleId, VertexId,
    VertexTree, prefetch,
};

use crate::Hierarchy;
use crate::hierarchy::Node;

/// A hierarchy and the state of one front through it.
///
/// Nothing beyond structure is depended on: bounds are nested over everything a collapse relied on, so the cut that
/// the criterion asks for is one that the simplification went through.
#[derive(Clone, Debug)]
pub struct InMemoryTree {
    hierarchy: Arc<Hierarchy>,
    /// Kept only for a sink that wants the mesh.
    mesh: Option<StarMesh>,
    displayed: u64,
}

impl InMemoryTree {
    /// A tree with every node folded.
    #[must_use]
    pub fn new(hierarchy: Arc<Hierarchy>) -> Self {
        Self { hierarchy, mesh: None, displayed: 0 }
    }

    /// The hierarchy that the tree shows.
    #[must_use]
    pub fn hierarchy(&self) -> &Arc<Hierarchy> {
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
        let number = self.mesh.as_ref()?.number(triangle);
        self.hierarchy.input_triangle.get(number as usize).copied()
    }

    fn node(&self, node: NodeId) -> &Node {
        &self.hierarchy.nodes[node.index()]
    }
}

impl VertexTree for InMemoryTree {
    const IS_TREE: bool = true;

    fn node_limit(&self) -> u32 {
        self.hierarchy.nodes.len() as u32
    }

    fn displayed_triangles(&self) -> u64 {
        self.displayed
    }

    fn roots(&self) -> &[NodeId] {
        &self.hierarchy.roots
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        match self.node(node).parent {
            // Roots are numbered in ascending order.
            NONE => self.hierarchy.root_bounds[self.hierarchy.roots.partition_point(|&root| root < node)],
            parent => self.node(NodeId(parent)).child_bounds[usize::from(node.0 != parent + 1)],
        }
    }

    #[inline]
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        self.children_and_bounds(node).map(|(child, _)| child)
    }

    #[inline]
    fn children_and_bounds(&self, node: NodeId) -> impl Iterator<Item = (NodeId, Bounds)> {
        let &Node { first, pivot, end, child_bounds, .. } = self.node(node);
        let left = (pivot - first > 1).then_some((NodeId(node.0 + 1), child_bounds[0]));
        let right = (end - pivot > 1).then_some((NodeId(node.0 + (pivot - first)), child_bounds[1]));
        left.into_iter().chain(right)
    }

    #[inline]
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        Some(self.node(node).parent).filter(|&p| p != NONE).map(NodeId).into_iter()
    }

    fn log_number(&self, node: NodeId) -> u32 {
        self.node(node).log_number
    }

    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        let h = &self.hierarchy;
        // A triangle with a doubled corner has no node that brings it and is no base triangle either.
        let base = (h.refining..h.corners.len() as u32).filter(|&t| {
            let [a, b, c] = h.corners[t as usize];
            a != b && b != c && c != a
        });
        if !M::KEEPS_MESH {
            self.displayed = base.count() as u64;
            return Ok(());
        }
        let mut stars = StarMesh::new(h.positions.len());
        for &v in &h.base_vertices {
            stars.add_vertex(v, h.positions[v as usize], mesh);
        }
        for number in base {
            stars.add_triangle(LeafTriangle { leaves: h.corners[number as usize], number }, mesh);
        }
        self.displayed = stars.displayed() as u64;
        self.mesh = Some(stars);
        Ok(())
    }

    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let brought = self.hierarchy.brought(node.index());
        self.displayed += brought.len() as u64;
        let Some(stars) = self.mesh.as_mut().filter(|_| M::KEEPS_MESH) else { return Ok(Step::Done) };
        let h = &*self.hierarchy;
        let Node { first: kept, pivot: removed, .. } = h.nodes[node.index()];
        let brought = brought.map(|number| LeafTriangle { leaves: h.corners[number as usize], number });
        stars.split([kept, removed], h.positions[removed as usize], brought, mesh);
        Ok(Step::Done)
    }

    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        self.displayed -= self.hierarchy.brought(node.index()).len() as u64;
        let Some(stars) = self.mesh.as_mut().filter(|_| M::KEEPS_MESH) else { return Ok(Step::Done) };
        let Node { first: kept, pivot: removed, .. } = self.hierarchy.nodes[node.index()];
        stars.merge([kept, removed], mesh);
        Ok(Step::Done)
    }

    fn prepare<M: MeshSink>(&self, nodes: &[NodeId], mesh: &M) {
        let h = &*self.hierarchy;
        nodes.iter().for_each(|node| prefetch(&h.nodes, node.index()));
        let Some(stars) = &self.mesh else { return };
        for node in nodes {
            let Node { pivot: removed, .. } = h.nodes[node.index()];
            stars.prefetch_vertex(h.nodes[node.index()].first);
            stars.prefetch_vertex(removed);
            prefetch(&h.positions, removed as usize);
            prefetch(&h.corners, h.first_brought(node.index()) as usize);
        }
        for node in nodes {
            stars.prefetch_star(h.nodes[node.index()].first);
            stars.prefetch_star(h.nodes[node.index()].pivot);
        }
        for node in nodes {
            stars.prefetch_triangles(h.nodes[node.index()].first, mesh);
            stars.prefetch_triangles(h.nodes[node.index()].pivot, mesh);
            for triangle in h.brought(node.index()) {
                h.corners[triangle as usize].iter().for_each(|&leaf| stars.prefetch_leaf(leaf));
            }
        }
    }

    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        let h = &self.hierarchy;
        let resident_bytes =
            (h.nodes.len() * size_of::<Node>() + h.positions.len() * 16 + h.corners.len() * 16) as u64;
        Ok(PageStats { resident_bytes, ..PageStats::default() })
    }
}
