//! The trait between the engine and the storage backends of meshes.

use crate::error::TreeError;
use crate::hierarchy::{Hierarchy, NodeId, Refine, Step};
use crate::sink::MeshSink;

/// A forest of vertex merges (or a directed acyclic graph of them) that can be unfolded and folded node by node: a
/// [`Hierarchy`] that displays a mesh, in whatever [`MeshSink`].
///
/// All nodes start folded: the displayed mesh is the base mesh. The engine promises to unfold only boundary nodes
/// and to fold only collapsible ones. The backend promises that every order of such steps that ends in the same
/// set of active nodes ends in the same displayed mesh.
pub trait VertexTree: Hierarchy {
    /// Reports the base mesh: what is shown while every node is folded. Called once, before any other change.
    ///
    /// # Errors
    /// If the store fails, or what it holds is damaged.
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError>;
    /// Unfolds a boundary node: its vertex splits in two.
    ///
    /// # Errors
    /// If what the change takes was read, and the store failed or is damaged there. Nothing has changed then; a page that is
    /// only not here yet is no error, see [`Step::NotResident`].
    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError>;
    /// Folds a collapsible node: the inverse of [`unfold`](Self::unfold).
    ///
    /// # Errors
    /// As for [`unfold`](Self::unfold).
    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError>;

    /// Reports what [`unfold`](Self::unfold) and [`fold`](Self::fold) have put off: the mesh can follow all changes of a frame
    /// together at less cost than one by one. Called after the last change of a frame, whether that went well or not. Until
    /// then the sink may be behind.
    fn update_mesh<M: MeshSink>(&mut self, mesh: &mut M) {
        let _ = mesh;
    }
}

impl<T: VertexTree, M: MeshSink> Refine<M> for T {
    #[inline]
    fn start(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        self.base_mesh(mesh)
    }

    #[inline(always)]
    fn unfold_into(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        self.unfold(node, mesh)
    }

    #[inline(always)]
    fn fold_into(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        self.fold(node, mesh)
    }

    #[inline]
    fn finish(&mut self, mesh: &mut M) {
        self.update_mesh(mesh);
    }
}
