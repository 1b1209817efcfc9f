//! A backend that waits for its pages, inside of a change: the one way in which a frame waits for a store.
//!
//! Backends do not wait. A change whose page is missing is refused, the frame goes on, and what is shown is coarser for
//! a while. DeCoro & Pajarola and Holst & Schumann print the opposite: their traversals load what they come upon, and go on when
//! it is there. An engine over a tree in here does that: `Engine::new(Settled::new(tree), mesh, settings)`, with a tree that
//! fetches nothing ahead ([`Prefetch::None`](vertex_tree::Prefetch::None)). Every frame then has the cut that its views ask
//! for, at whatever time that takes, and [`PageStats::stalled`] says how long it waited: by the clock of the store, so
//! in virtual time where the store is on virtual time, and in real time, which is part of the
//! [time of the frame](crate::engine::FrameReport::select), where reads are real. `compare --prefetch blocking` is this.
//!
//! Replays whose cuts are to be compared in every frame wait in the same way, whatever fetches ahead.

use std::time::Duration;

use rustc_hash::FxHashSet;
use vertex_tree::{Bounds, Hierarchy, NodeId, NormalCone, PageStats, Refine, Step, TreeError};

/// Waits inside of a change until what it needs has come. A change that still is refused then, as memory is too small for
/// it, is a miss.
pub struct Settled<T> {
    tree: T,
    waits: bool,
    /// Nodes that were refused all the same. What has come for others while one was waited for is not told apart, so all
    /// of them can be asked again in the next frame.
    refused: Vec<NodeId>,
    /// How long changes have waited in this frame.
    stalled: Duration,
    /// The first fault that waiting has come upon since somebody asked.
    fault: Option<TreeError>,
    /// Nodes that a fault has kept back for as long as anybody waits. From then on each is asked for once more in a frame: pages
    /// that are damaged would otherwise be waited for as long in every frame, and for every node on them.
    damaged: FxHashSet<NodeId>,
}

/// A change that is refused more often is left to the next frame.
const PATIENCE: usize = 100;

impl<T: Hierarchy> Settled<T> {
    /// A backend that waits.
    #[must_use]
    pub fn new(tree: T) -> Self {
        Self::waiting(tree, true)
    }

    /// A backend that waits or, if it does not, is as it would be without this: so that what replays a path need not care.
    #[must_use]
    pub fn waiting(tree: T, waits: bool) -> Self {
        Self {
            tree,
            waits,
            refused: Vec::new(),
            stalled: Duration::ZERO,
            fault: None,
            damaged: FxHashSet::default(),
        }
    }

    fn insist(
        &mut self,
        node: NodeId,
        mut change: impl FnMut(&mut T) -> Result<Step, TreeError>,
    ) -> Result<Step, TreeError> {
        let is_known = !self.damaged.is_empty() && self.damaged.contains(&node);
        let mut is_damaged = is_known;
        for _ in 0..if is_known { 2 } else { PATIENCE } {
            match change(&mut self.tree)? {
                Step::NotResident if self.waits => {
                    self.stalled += self.tree.settle()?;
                    self.tree.begin_frame(&mut Vec::new())?;
                    if let Some(fault) = self.tree.take_fault() {
                        is_damaged = true;
                        self.fault.get_or_insert(fault);
                    }
                }
                step => {
                    if is_known {
                        self.damaged.remove(&node);
                    }
                    return Ok(step);
                }
            }
        }
        if is_damaged {
            self.damaged.insert(node);
        }
        self.refused.push(node);
        Ok(Step::NotResident)
    }
}

impl<T: Hierarchy> Hierarchy for Settled<T> {
    const IS_TREE: bool = T::IS_TREE;
    const PREPARATION: usize = T::PREPARATION;
    const HAS_CONES: bool = T::HAS_CONES;

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
    fn children_and_bounds(&self, node: NodeId) -> impl Iterator<Item = (NodeId, Bounds)> {
        self.tree.children_and_bounds(node)
    }
    fn children_and_parents(
        &self,
        node: NodeId,
    ) -> impl Iterator<Item = (NodeId, Bounds, impl Iterator<Item = NodeId>)> {
        self.tree.children_and_parents(node)
    }
    fn normal_cone(&self, node: NodeId) -> NormalCone {
        self.tree.normal_cone(node)
    }
    fn prepare(&self, node: NodeId, step: usize) {
        self.tree.prepare(node, step);
    }
    fn look_ahead(&self) -> u32 {
        self.tree.look_ahead()
    }
    fn will_need(&mut self, node: NodeId, frames: u32) {
        self.tree.will_need(node, frames);
    }
    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        self.tree.peek(node, children)
    }
    fn pass(&mut self, time: Duration) -> Result<(), TreeError> {
        self.tree.pass(time)
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
    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        arrived.append(&mut self.refused);
        self.tree.begin_frame(arrived)
    }
    fn give_up(&mut self, node: NodeId) {
        self.tree.give_up(node);
    }
    fn settle(&mut self) -> Result<Duration, TreeError> {
        self.tree.settle()
    }
    fn take_fault(&mut self) -> Option<TreeError> {
        self.fault.take().or_else(|| self.tree.take_fault())
    }
    fn assert_well_formed(&self) {
        self.tree.assert_well_formed();
    }
    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        let stalled = std::mem::take(&mut self.stalled);
        self.tree.end_frame().map(|pages| PageStats { stalled: pages.stalled + stalled, ..pages })
    }
}

impl<S, T: Refine<S>> Refine<S> for Settled<T> {
    fn start(&mut self, sink: &mut S) -> Result<(), TreeError> {
        self.tree.start(sink)
    }
    fn unfold_into(&mut self, node: NodeId, sink: &mut S) -> Result<Step, TreeError> {
        self.insist(node, |tree| tree.unfold_into(node, sink))
    }
    fn fold_into(&mut self, node: NodeId, sink: &mut S) -> Result<Step, TreeError> {
        self.insist(node, |tree| tree.fold_into(node, sink))
    }
    fn finish(&mut self, sink: &mut S) {
        self.tree.finish(sink);
    }
}
