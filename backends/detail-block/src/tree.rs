//! The tree that the engine unfolds and folds.
//!
//! To unfold a node takes its own block, its child blocks if it is on the lowest level (what becomes a boundary node has to
//! be known), and the nodes that bring the faces of w x y z, active. Such a node is named once its block and all blocks
//! from there up to an active node are loaded, as the engine goes that way: the paper's forced split. Going up, block
//! numbers fall, so the way ends; that needs never go in a circle is the engine's to see, which keeps a stack of who waits.
//!
//! A node folds when no active node needs its triangles: each counts the half-edges among w x y z of active
//! nodes that are its own.
//!
//! For a sink that does not keep the mesh none is kept here either: what is displayed follows from the nodes.

use std::sync::Arc;
use std::time::Duration;

use container::FileError;
use vertex_tree::{
    Bounds, Hierarchy, MeshSink, NONE, NodeId, NormalCone, PageStats, Prefetch, Step, TreeError, VertexTree,
};

use crate::block::ACTIVE;
use crate::error::{XfmError, tree_error};
use crate::file::XfmFile;
use crate::foresight::peek;
use crate::half_edges::{Adjacent, BOUNDARY, HalfEdge};
use crate::numbering::{Owner, owner};
use crate::paging::{Paging, PagingCounts};
use crate::settings::{Io, Settings};
use crate::shown::Shown;

/// A front through an XFM file.
pub struct XfmTree {
    pub(crate) paging: Paging,
    roots: Vec<NodeId>,
    pub(crate) shown: Option<Shown>,
    pub(crate) displayed: u64,
    foresees: bool,
}

impl XfmTree {
    /// A tree with every node folded.
    ///
    /// # Errors
    /// [`FileError::Memory`] if the hard quota is less than [`XfmFile::least_memory`], [`XfmError::Thread`].
    pub fn new(file: Arc<XfmFile>, settings: Settings) -> Result<Self, XfmError> {
        FileError::check_memory(file.name(), settings.hard_quota, file.least_memory())?;
        let roots = file.roots().iter().map(|&(root, _)| root).collect();
        let paging = Paging::new(file, &settings)?;
        let foresees = settings.prefetch == Prefetch::Schedule && settings.io != Io::Blocking;
        Ok(Self { paging, roots, shown: None, displayed: 0, foresees })
    }

    /// The file.
    #[must_use]
    pub fn file(&self) -> &Arc<XfmFile> {
        &self.paging.blocks.file
    }

    /// Sets the quotas, in bytes of blocks, from now on. What the front occupies stays, whatever the quotas are.
    pub fn set_quotas(&mut self, soft: u64, hard: u64) {
        (self.paging.soft, self.paging.hard) = (soft, hard);
    }

    /// Bytes of the blocks in memory, and with those that are under way.
    #[must_use]
    pub fn block_bytes(&self) -> (u64, u64) {
        (self.paging.blocks.bytes, self.paging.blocks.bytes + self.paging.reserved)
    }

    /// What paging has done so far.
    #[must_use]
    pub fn counts(&self) -> PagingCounts {
        self.paging.counts
    }

    fn damaged(&self, node: NodeId, reason: &'static str) -> TreeError {
        let file = &self.paging.blocks.file;
        let offset = file.place(file.levels().block(node)).0;
        tree_error(XfmError::Node { file: file.name().to_owned(), offset, node: node.0, reason })
    }

    /// The slot of a half-edge of the file, whose owner is active.
    pub(crate) fn half_edge(&self, h: u32) -> Option<HalfEdge> {
        match owner(h) {
            Owner::Boundary => Some(BOUNDARY),
            Owner::Face(face, k) => Some(face << 2 | k),
            Owner::Node(node, side, k) => {
                let slot = self.paging.blocks.node(node)?.slots[side];
                (slot != NONE).then_some(slot << 2 | k)
            }
        }
    }

    /// Whether the blocks from that of a needed node up to an active one are loaded; asks for the first that is not.
    fn way_is_loaded(&mut self, needed: NodeId, node: NodeId) -> Result<bool, TreeError> {
        let levels = self.paging.blocks.file.levels();
        let mut at = needed;
        loop {
            let number = levels.block(at);
            if !self.paging.demand(number..number + 1, node) {
                self.paging.take_error()?;
                self.paging.pin_for(node, Some(needed));
                return Ok(false);
            }
            if self.paging.blocks.node(at).is_none() {
                return Err(self.damaged(at, "it is needed, or above one that is, and not there"));
            }
            match self.paging.blocks.block(number).map_or(NONE, |block| block.parent) {
                NONE => return Ok(true),
                parent if self.paging.blocks.is_active(NodeId(parent)) => return Ok(true),
                parent => at = NodeId(parent),
            }
        }
    }

    /// Changes how often the nodes that bring w x y z are counted as needed, by one.
    fn count_needs(&mut self, adjacent: [u32; 4], step: i32) {
        for h in adjacent {
            if let Owner::Node(needed, ..) = owner(h)
                && let Some(needed) = self.paging.blocks.node_mut(needed)
            {
                needed.status = needed.status.wrapping_add_signed(step);
            }
        }
    }
}

fn sides([w, x, y, z]: [u32; 4]) -> [bool; 2] {
    Adjacent { w, x, y, z }.sides()
}

fn brought(adjacent: [u32; 4]) -> u64 {
    sides(adjacent).into_iter().map(u64::from).sum()
}

impl Hierarchy for XfmTree {
    const IS_TREE: bool = true;
    const HAS_CONES: bool = true;

    fn node_limit(&self) -> u32 {
        (self.paging.blocks.file.header().blocks as u32) << self.paging.blocks.file.levels().get()
    }

    fn displayed(&self) -> u64 {
        self.displayed
    }

    fn origin(&self) -> [f64; 3] {
        self.file().georeference().origin
    }

    fn roots(&self) -> &[NodeId] {
        &self.roots
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        if let Some(node) = self.paging.blocks.node(node) {
            return node.stored.bounds();
        }
        let file = &self.paging.blocks.file;
        let listed = file.roots().binary_search_by_key(&node, |&(root, _)| root);
        let stub = || self.paging.blocks.stub(file.levels().block(node)).map(|stub| stub.bounds);
        let bounds = listed.map_or_else(|_| stub(), |i| Some(file.roots()[i].1));
        bounds.unwrap_or(Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 })
    }

    fn normal_cone(&self, node: NodeId) -> NormalCone {
        match self.paging.blocks.node(node) {
            Some(found) if self.parents(node).next().is_some() => found.stored.cone(),
            // The root list has no room for cones, so roots have none.
            _ => NormalCone::NONE,
        }
    }

    #[inline]
    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let levels = self.paging.blocks.file.levels();
        let block = self.paging.blocks.block(levels.block(node));
        let offset = levels.offset(node);
        let child = move |side: u32| {
            let block = block?;
            match offset.checked_sub(levels.lowest()) {
                Some(i) => block.child_block(2 * i + side).map(|child| levels.node(child, 0)),
                None => {
                    let below = 2 * offset + 1 + side;
                    block.index_of(below).map(|_| levels.node(block.number, below))
                }
            }
        };
        child(0).into_iter().chain(child(1))
    }

    #[inline]
    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let levels = self.paging.blocks.file.levels();
        let (number, offset) = (levels.block(node), levels.offset(node));
        let parent = match offset {
            0 => match self.paging.blocks.block(number) {
                Some(block) => block.parent,
                None => self.paging.blocks.stub(number).map_or(NONE, |stub| stub.parent),
            },
            _ => levels.node(number, (offset - 1) / 2).0,
        };
        Some(parent).filter(|&parent| parent != NONE).map(NodeId).into_iter()
    }

    fn log_number(&self, node: NodeId) -> u32 {
        let file = &self.paging.blocks.file;
        let (number, offset) = (file.levels().block(node), file.levels().offset(node));
        // Of a block that is not loaded only the root can be meant.
        let index = self.paging.blocks.block(number).and_then(|block| block.index_of(offset)).unwrap_or(0);
        file.header().nodes as u32 - 1 - file.nodes_before(number) - index as u32
    }

    fn look_ahead(&self) -> u32 {
        if self.foresees { self.paging.look_ahead() } else { 0 }
    }

    fn will_need(&mut self, node: NodeId, frames: u32) {
        if self.foresees {
            self.paging.foresee(node, frames);
        }
    }

    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        peek(&self.paging.blocks, node, children)
    }

    fn pass(&mut self, time: Duration) -> Result<(), TreeError> {
        self.paging.pass(time);
        Ok(())
    }

    fn take_fault(&mut self) -> Option<TreeError> {
        self.paging.fault.take()
    }

    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        self.paging.begin_frame(arrived)
    }

    fn give_up(&mut self, node: NodeId) {
        self.paging.give_up(node);
    }

    fn settle(&mut self) -> Result<Duration, TreeError> {
        Ok(self.paging.settle())
    }

    #[track_caller]
    fn assert_well_formed(&self) {
        // The type's own, which goes before this one.
        XfmTree::assert_well_formed(self);
    }

    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        if self.foresees {
            self.paging.ask_for_foreseen();
        }
        Ok(self.paging.end_frame())
    }
}

impl VertexTree for XfmTree {
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        let file = &self.paging.blocks.file;
        self.displayed = file.initial_faces().triangles.len() as u64;
        if M::KEEPS_MESH {
            self.shown = Some(Shown::new(file.initial_vertices(), file.initial_faces(), mesh));
        }
        Ok(())
    }

    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let levels = self.paging.blocks.file.levels();
        let number = levels.block(node);
        self.paging.stop_waiting(node);
        let own_is_loaded = self.paging.demand(number..number + 1, node);
        let below = self.paging.blocks.child_blocks(node);
        if !own_is_loaded || !below.is_some_and(|below| self.paging.demand(below, node)) {
            self.paging.take_error()?;
            self.paging.pin_for(node, None);
            return Ok(Step::NotResident);
        }
        let Some(stored) = self.paging.blocks.node(node).map(|node| node.stored) else {
            return Err(self.damaged(node, "it is not there"));
        };
        let adjacent = stored.adjacent;
        for h in adjacent {
            if let Owner::Node(needed, side, _) = owner(h) {
                if !self.paging.blocks.is_active(needed) {
                    if needed == node {
                        return Err(self.damaged(node, "it needs itself"));
                    }
                    let is_loaded = self.way_is_loaded(needed, node)?;
                    return Ok(if is_loaded { Step::Needs(needed) } else { Step::NotResident });
                }
                if !self.paging.blocks.node(needed).is_some_and(|needed| sides(needed.stored.adjacent)[side])
                {
                    return Err(self.damaged(node, "it needs a triangle that there is not"));
                }
            }
        }
        if let Some(mut shown) = self.shown.take().filter(|_| M::KEEPS_MESH) {
            let [w, x, y, z] = adjacent.map(|h| self.half_edge(h));
            let found = w.zip(x).zip(y.zip(z)).map(|((w, x), (y, z))| Adjacent { w, x, y, z });
            let slots = found.and_then(|adjacent| shown.split(adjacent, stored.position, mesh));
            self.shown = Some(shown);
            let slots = slots.ok_or_else(|| self.damaged(node, "w x y z are not around one vertex"))?;
            if let Some(node) = self.paging.blocks.node_mut(node) {
                node.slots = slots;
            }
        }
        self.count_needs(adjacent, 1);
        if let Some(node) = self.paging.blocks.node_mut(node) {
            node.status |= ACTIVE;
        }
        if let Some(block) = self.paging.blocks.block_mut(number) {
            block.active += 1;
        }
        self.displayed += brought(adjacent);
        Ok(Step::Done)
    }

    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        let Some(&found) = self.paging.blocks.node(node).filter(|node| node.is_active()) else {
            return Err(self.damaged(node, "it is not active"));
        };
        if found.needed_by() > 0 {
            return Ok(Step::StillNeeded);
        }
        let adjacent = found.stored.adjacent;
        if let Some(shown) = self.shown.as_mut().filter(|_| M::KEEPS_MESH) {
            shown.merge(found.slots, mesh);
        }
        self.count_needs(adjacent, -1);
        if let Some(node) = self.paging.blocks.node_mut(node) {
            node.status &= !ACTIVE;
            node.slots = [NONE; 2];
        }
        let number = self.paging.blocks.file.levels().block(node);
        self.paging.use_block(number);
        if let Some(block) = self.paging.blocks.block_mut(number) {
            block.active -= 1;
            if block.active == 0 {
                self.paging.may_go(number);
                if let Some(sibling) = self.paging.blocks.sibling(number) {
                    self.paging.may_go(sibling);
                }
            }
        }
        self.paging.leave_play(node);
        self.displayed -= brought(adjacent);
        Ok(Step::Done)
    }
}
