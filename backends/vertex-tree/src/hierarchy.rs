//! What the engine needs of a hierarchy: nodes, what is above and below them, and how they unfold and fold.
//!
//! Nothing here knows what is displayed. A [`Hierarchy`] has nodes with bounds; that its nodes change their status is told to
//! a sink of whatever kind the backend writes to ([`Refine`]). Meshes are one kind, see [`VertexTree`](crate::VertexTree);
//! points, splats, tiles or clusters are others.

use std::time::Duration;

use crate::bounds::{Bounds, NormalCone};
use crate::error::TreeError;
use crate::paging::PageStats;

/// Number of an inner node in a backend's own numbering, less than [`Hierarchy::node_limit`].
///
/// The engine keeps a bit for each number and tables of the neighbourhoods in play where nodes have several parents, so numbers should
/// be dense, and nodes that are visited together should have numbers that are close: depth-first order is good.
///
/// 32 bits are enough for 4,294,967,294 nodes that can be unfolded: as collapses, for a mesh of 8.6 thousand million triangles; as
/// nodes with eight children each, for 34 thousand million leaves. What a node is displayed with may be as much as a backend
/// likes. Several hierarchies, each with numbers of its own, make a larger scene. The engine itself can have 2^31 nodes in
/// play at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct NodeId(pub u32);

impl NodeId {
    /// The number as an array index.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// How a request to unfold or fold a node ended. Only [`Step::Done`] changes anything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The node has changed its status, and the sink knows, or will after [`Refine::finish`].
    Done,
    /// Unfolding: another node must be unfolded first, a dependency beyond structure (the nodes that bring the
    /// faces w x y z in XFastMesh; neighbours with larger ids in El-Sana & Chiang). It may be anywhere below an
    /// active node; the engine forces it, ancestors first, and asks again.
    Needs(NodeId),
    /// A rule of the backend's own forbids the change for now (El-Sana & Chiang's implicit dependencies, where they
    /// block instead of forcing). The change is counted as blocked and asked for again in every frame.
    Blocked,
    /// Folding: something unfolded depends on this node. It folds when nothing does any more.
    StillNeeded,
    /// A page that the change needs is not in memory. The node will be among the arrivals of a later
    /// [`Hierarchy::begin_frame`], when it is worth asking again: as a page has come, or as the request could not be made
    /// or has failed. Until then the engine does not ask. If the change is not wanted any more, it says so
    /// ([`Hierarchy::give_up`]).
    NotResident,
}

/// A forest of nodes, or a directed acyclic graph of them, each of which is displayed coarsely while it is folded and by what is
/// below it once it is unfolded; or, where refinement adds, by itself and what is below it.
///
/// # Structure and further dependencies
///
/// A node's *structural* parents are its parent in the tree, or all its parents in a multi-triangulation. Bounds
/// are nested along them (see [`Bounds`]), so that the test of a child can only pass where that of each parent
/// passes. What else must hold before a node may change is said by [`Step::Needs`] and [`Step::StillNeeded`].
/// Leaves, which can not be unfolded, have no [`NodeId`].
///
/// # Residency
///
/// [`children`](Self::children), [`parents`](Self::parents) and [`bounds`](Self::bounds) are asked only of roots,
/// of boundary and active nodes, of the children of active nodes, and of nodes that [`Step::Needs`] has named and what
/// is above those. The engine keeps what it needs of the rest, so a backend may drop the pages of active nodes that are
/// not collapsible.
pub trait Hierarchy {
    /// Whether no node has more than one structural parent, as in a tree and not in a multi-triangulation. It spares
    /// the engine a look at the children's own records.
    const IS_TREE: bool = false;

    /// How many steps of [`prepare`](Self::prepare) there are: links of the longest chain of reads that a change of
    /// status follows.
    const PREPARATION: usize = 0;

    /// Whether nodes have cones of normals, see [`normal_cone`](Self::normal_cone).
    const HAS_CONES: bool = false;

    /// One more than the largest node number.
    fn node_limit(&self) -> u32;
    /// How much is displayed now, in what budgets count: triangles of a mesh, points, splats. What a node costs is what its
    /// change makes of this. Known also where the sink keeps nothing.
    fn displayed(&self) -> u64;
    /// World coordinates of the place that all positions and spheres are relative to. Views are brought there.
    fn origin(&self) -> [f64; 3] {
        [0.0; 3]
    }
    /// The inner nodes that have no structural parent.
    fn roots(&self) -> &[NodeId];
    /// Sphere and error of a node, as stored: strategies and the brute-force oracle read the same.
    fn bounds(&self, node: NodeId) -> Bounds;
    /// The nodes of which `node` is a structural parent.
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId>;
    /// The children, each with its [`bounds`](Self::bounds): one access for a backend that stores them together.
    fn children_and_bounds(&self, node: NodeId) -> impl Iterator<Item = (NodeId, Bounds)> {
        self.children(node).map(|child| (child, self.bounds(child)))
    }
    /// The children, each with its [`bounds`](Self::bounds) and its [`parents`](Self::parents): one access for a backend
    /// that stores them together. Asked where nodes may have several parents.
    fn children_and_parents(
        &self,
        node: NodeId,
    ) -> impl Iterator<Item = (NodeId, Bounds, impl Iterator<Item = NodeId>)> {
        self.children_and_bounds(node).map(move |(child, bounds)| {
            // In a tree that is known without a look at the child, whose page need not be in memory.
            let own = Self::IS_TREE.then_some(node);
            let looked_up = (!Self::IS_TREE).then(|| self.parents(child)).into_iter().flatten();
            (child, bounds, own.into_iter().chain(looked_up))
        })
    }
    /// The cone of normals of a node that is no root, asked for as it comes into play. Cones are nested as bounds are,
    /// but for roots, which have none.
    fn normal_cone(&self, node: NodeId) -> NormalCone {
        let _ = node;
        NormalCone::NONE
    }
    /// The structural parents, at least one but for a root, always in the same order.
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId>;
    /// A number that the node has in whatever backend it is, by which cuts of different backends can be compared: a
    /// collapse's in the log. By default the backend's own.
    fn log_number(&self, node: NodeId) -> u32 {
        node.0
    }

    /// Says that a boundary or a collapsible node is about to change its status: a chance to fetch what that takes into
    /// the caches. Called for steps 0, 1 and so on below [`PREPARATION`](Self::PREPARATION), each when what the step
    /// before has asked for has had the time to arrive. Changes nothing.
    fn prepare(&self, node: NodeId, step: usize) {
        let _ = (node, step);
    }
    /// For how many frames ahead the engine shall foresee what changes, and say so through
    /// [`will_need`](Self::will_need): at least as many as it takes to fetch a page; 0 for not at all, or while what
    /// refused changes wait for takes longer than anybody looks ahead. Asked in every frame, as a store may be slow for a while.
    fn look_ahead(&self) -> u32 {
        0
    }
    /// Says that `node` is expected to change its status in so many frames, 1 being the next. Called at the end of a
    /// frame, before [`end_frame`](Self::end_frame), for boundary and collapsible nodes and for what
    /// [`peek`](Self::peek) has shown below those; in every frame anew, so that what is not named any more is
    /// not expected any more.
    fn will_need(&mut self, node: NodeId, frames: u32) {
        let _ = (node, frames);
    }
    /// Appends the children, with their bounds, of a boundary node or of a node that this has appended before. Returns
    /// whether it could: the page that names them may not be in memory.
    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        let _ = (node, children);
        false
    }
    /// Lets time pass for a store on virtual time: called between frames by
    /// whoever plays the clock. What has arrived by then is there in the next [`begin_frame`](Self::begin_frame).
    ///
    /// # Errors
    /// Those of [`begin_frame`](Self::begin_frame).
    fn pass(&mut self, time: Duration) -> Result<(), TreeError> {
        let _ = time;
        Ok(())
    }
    /// Starts a frame. Appends to `arrived` the nodes for which a [`Step::NotResident`] was answered and that are to be asked
    /// again. One that is missing here waits for as long as it is wanted, so a backend in doubt names it.
    ///
    /// # Errors
    /// If a page that was asked for could not be read, or is damaged.
    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        let _ = arrived;
        Ok(())
    }
    /// Says that nobody waits any more for the page of a node for which a [`Step::NotResident`] was answered: its change is
    /// not wanted any more. It may be wanted again later, and is asked for anew then.
    fn give_up(&mut self, node: NodeId) {
        let _ = node;
    }
    /// Waits until every page that has been asked for has arrived or failed: for replays whose cuts shall be comparable,
    /// for a first frame, and for whoever would rather wait than show less. Nothing else here may wait. Returns how long
    /// that took, by the clock of the store: virtual time where the store is on virtual time.
    ///
    /// # Errors
    /// Those of [`begin_frame`](Self::begin_frame).
    fn settle(&mut self) -> Result<Duration, TreeError> {
        Ok(Duration::ZERO)
    }
    /// Takes the first of the faults since the last call: in which file, where, and what is wrong there. How many there were is in
    /// [`PageStats::faults`]. What they befell is asked for again while it is wanted; a fault that will not be mended so is an
    /// error of the frame.
    fn take_fault(&mut self) -> Option<TreeError> {
        None
    }
    /// Checks what the backend knows of its own state, between two frames: for tests. The engine's own check calls it.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    fn assert_well_formed(&self) {}
    /// Ends a frame: the moment for eviction.
    ///
    /// # Errors
    /// Those of [`begin_frame`](Self::begin_frame).
    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        Ok(PageStats::default())
    }
}

/// A hierarchy that reports to a sink of type `S` what is displayed.
///
/// All nodes start folded. The engine promises to unfold only boundary nodes and to fold only collapsible ones. The backend
/// promises that every order of such steps that ends in the same set of active nodes ends in the same things displayed.
///
/// What a sink is told is between it and the backend: an implementation for all sinks of a trait, as every
/// [`VertexTree`](crate::VertexTree) has it for every [`MeshSink`](crate::MeshSink), lets whoever displays choose.
pub trait Refine<S>: Hierarchy {
    /// Reports what is displayed while every node is folded. Called once, before any other change.
    ///
    /// # Errors
    /// If the store fails, or what it holds is damaged.
    fn start(&mut self, sink: &mut S) -> Result<(), TreeError>;
    /// Unfolds a boundary node.
    ///
    /// # Errors
    /// If what the change takes was read, and the store failed or is damaged there. Nothing has changed then; a page that is
    /// only not here yet is no error, see [`Step::NotResident`].
    fn unfold_into(&mut self, node: NodeId, sink: &mut S) -> Result<Step, TreeError>;
    /// Folds a collapsible node: the inverse of [`unfold_into`](Self::unfold_into).
    ///
    /// # Errors
    /// As for [`unfold_into`](Self::unfold_into).
    fn fold_into(&mut self, node: NodeId, sink: &mut S) -> Result<Step, TreeError>;
    /// Reports what changes have put off: a sink can follow all those of a frame together at less cost than one by one. Called
    /// after the last change of a frame, whether that went well or not. Until then the sink may be behind.
    fn finish(&mut self, sink: &mut S) {
        let _ = sink;
    }
}
