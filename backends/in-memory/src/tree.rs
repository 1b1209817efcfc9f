//! The tree that the engine unfolds and folds.

use std::sync::Arc;

use vertex_tree::{Bounds, MeshSink, NONE, NodeId, PageStats, Step, TreeError, VertexTree};

use crate::Hierarchy;
use crate::hierarchy::Node;
use crate::leaf_set::LeafSet;
use crate::live::{LiveTriangles, triangle_of};

/// A hierarchy and the state of one front through it.
///
/// Nothing beyond structure is depended on: bounds are nested over everything a collapse relied on, so the cut that
/// the criterion asks for is one that the simplification went through.
#[derive(Clone, Debug)]
pub struct InMemoryTree {
    hierarchy: Arc<Hierarchy>,
    /// The vertices of the displayed mesh. Like `live`, kept only for a sink that wants the mesh.
    shown: LeafSet,
    live: Option<LiveTriangles>,
    displayed: u64,
}

impl InMemoryTree {
    /// A tree with every node folded.
    #[must_use]
    pub fn new(hierarchy: Arc<Hierarchy>) -> Self {
        let displayed = 0;
        Self { shown: LeafSet::new(hierarchy.positions.len()), hierarchy, live: None, displayed }
    }

    /// The hierarchy that the tree shows.
    #[must_use]
    pub fn hierarchy(&self) -> &Arc<Hierarchy> {
        &self.hierarchy
    }

    fn node(&self, node: NodeId) -> &Node {
        &self.hierarchy.nodes[node.index()]
    }

    /// The triangles that a node brings.
    fn brought(&self, node: NodeId) -> std::ops::Range<u32> {
        let end = self.hierarchy.nodes.get(node.index() + 1).map_or(self.hierarchy.refining, |n| n.triangles);
        self.hierarchy.nodes[node.index()].triangles..end
    }
}

/// Lists of corners that are followed at once, and how far: as many triangles as meet at most vertices.
const PREPARED_CORNERS: usize = 32;
const PREPARED_STEPS: usize = 7;

/// The vertices at which the corners with these leaves are shown.
fn shown_at(shown: &LeafSet, leaves: [u32; 3]) -> [u32; 3] {
    // Every tree of the forest shows the first of its leaves at least, so there always is a vertex below.
    leaves.map(|leaf| shown.at_or_below(leaf).unwrap_or(leaf))
}

impl VertexTree for InMemoryTree {
    const IS_TREE: bool = true;

    fn node_limit(&self) -> u32 {
        self.hierarchy.nodes.len() as u32
    }

    fn vertex_count(&self) -> u32 {
        self.hierarchy.positions.len() as u32
    }

    fn triangle_count(&self) -> u32 {
        self.hierarchy.corners.len() as u32
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
        let mut live = LiveTriangles::new(&h.corners, h.positions.len());
        for &v in &h.base_vertices {
            self.shown.insert(v);
            mesh.vertex_added(v, h.positions[v as usize]);
        }
        for t in base {
            let vertices = shown_at(&self.shown, h.corners[t as usize]);
            live.show(t, vertices);
            mesh.triangle_added(t, vertices);
            self.displayed += 1;
        }
        self.live = Some(live);
        Ok(())
    }

    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let brought = self.brought(node);
        self.displayed += brought.len() as u64;
        let Some(live) = self.live.as_mut().filter(|_| M::KEEPS_MESH) else { return Ok(Step::Done) };
        let Node { first: kept, pivot: removed, .. } = self.hierarchy.nodes[node.index()];
        self.shown.insert(removed);
        mesh.vertex_added(removed, self.hierarchy.positions[removed as usize]);
        // The corners whose leaves are on the far side of the pivot follow the vertex that comes back.
        let mut corner = live.first_at(kept);
        while corner != NONE {
            let next = live.next(corner);
            if live.leaf(corner) >= removed {
                live.move_to(corner, removed);
                let (triangle, index) = triangle_of(corner);
                mesh.corner_moved(triangle, index, removed);
            }
            corner = next;
        }
        for triangle in brought {
            let vertices = shown_at(&self.shown, live.leaves(triangle));
            live.show(triangle, vertices);
            mesh.triangle_added(triangle, vertices);
        }
        Ok(Step::Done)
    }

    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let brought = self.brought(node);
        self.displayed -= brought.len() as u64;
        let Some(live) = self.live.as_mut().filter(|_| M::KEEPS_MESH) else { return Ok(Step::Done) };
        let Node { first: kept, pivot: removed, .. } = self.hierarchy.nodes[node.index()];
        for triangle in brought {
            live.hide(triangle);
            mesh.triangle_removed(triangle);
        }
        let mut corner = live.first_at(removed);
        while corner != NONE {
            let next = live.next(corner);
            live.move_to(corner, kept);
            let (triangle, index) = triangle_of(corner);
            mesh.corner_moved(triangle, index, kept);
            corner = next;
        }
        self.shown.remove(removed);
        mesh.vertex_removed(removed);
        Ok(Step::Done)
    }

    fn prepare(&self, nodes: &[NodeId]) {
        // What one node needs is a chain of reads each of which must wait for the one before. Taking the first step for
        // all nodes, then the second, keeps many reads under way at once. The sum is only there to be read.
        let mut sum = nodes.iter().fold(0, |sum, &n| sum ^ self.node(n).first);
        if let Some(live) = &self.live {
            let mut corners = [NONE; PREPARED_CORNERS];
            for nodes in nodes.chunks(PREPARED_CORNERS / 2) {
                for (&node, corners) in nodes.iter().zip(corners.chunks_mut(2)) {
                    let node = self.node(node);
                    // Whichever way the node changes, one of the two lists has its corners.
                    corners[0] = live.first_at(node.first);
                    corners[1] = live.first_at(node.pivot);
                    sum ^= live.leaves(node.triangles.min(live.last()))[0];
                }
                for _ in 0..PREPARED_STEPS {
                    for corner in &mut corners[..2 * nodes.len()] {
                        if *corner != NONE {
                            *corner = live.next(*corner);
                        }
                    }
                }
                sum ^= corners[0];
            }
        }
        std::hint::black_box(sum);
    }

    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        let h = &self.hierarchy;
        let resident_bytes =
            (h.nodes.len() * size_of::<Node>() + h.positions.len() * 16 + h.corners.len() * 16) as u64;
        Ok(PageStats { resident_bytes, ..PageStats::default() })
    }
}
