//! A tree whose backend is chosen at run time.

use std::time::Duration;

use detail_block::XfmTree;
use either::Either;
use in_memory::InMemoryTree;
use meta_node::MetaNodeTree;
use mt_partition::MtTree;
use vertex_tree::{Bounds, Hierarchy, MeshSink, NodeId, NormalCone, PageStats, Step, TreeError, VertexTree};

/// A tree of any backend. Which one is asked at every call, where trees of one backend have it settled when they are compiled.
///
/// To the engine it is a graph with normal cones, as one of them may be: nodes that have one parent say so, and those without a cone
/// have one that holds all directions.
pub enum AnyTree {
    /// The whole hierarchy resident.
    InMemory(InMemoryTree),
    /// Meta-node trees (El-Sana & Chiang).
    MetaNode(MetaNodeTree),
    /// XFastMesh (DeCoro & Pajarola).
    DetailBlock(XfmTree),
    /// A partitioned multi-triangulation (Holst & Schumann).
    MtPartition(MtTree),
}

/// How trees page, in the terms of each backend.
#[derive(Clone, Debug, Default)]
pub struct TreeSettings {
    /// Of meta-nodes.
    pub meta_node: meta_node::Settings,
    /// Of detail blocks.
    pub detail_block: detail_block::Settings,
    /// Of partitions.
    pub mt_partition: mt_partition::Settings,
}

/// Calls the same of whichever tree it is.
macro_rules! any {
    ($any:expr, $tree:ident => $call:expr) => {
        match $any {
            AnyTree::InMemory($tree) => $call,
            AnyTree::MetaNode($tree) => $call,
            AnyTree::DetailBlock($tree) => $call,
            AnyTree::MtPartition($tree) => $call,
        }
    };
}

/// The same for what gives an iterator of a kind of its own.
macro_rules! any_iterator {
    ($any:expr, $tree:ident => $call:expr) => {
        match $any {
            AnyTree::InMemory($tree) => Either::Left(Either::Left($call)),
            AnyTree::MetaNode($tree) => Either::Left(Either::Right($call)),
            AnyTree::DetailBlock($tree) => Either::Right(Either::Left($call)),
            AnyTree::MtPartition($tree) => Either::Right(Either::Right($call)),
        }
    };
}

fn preparation<T: Hierarchy>(_: &T) -> usize {
    T::PREPARATION
}

impl Hierarchy for AnyTree {
    const PREPARATION: usize = {
        let all =
            [InMemoryTree::PREPARATION, MetaNodeTree::PREPARATION, XfmTree::PREPARATION, MtTree::PREPARATION];
        let (mut most, mut at) = (0, 0);
        while at < all.len() {
            most = if all[at] > most { all[at] } else { most };
            at += 1;
        }
        most
    };
    const HAS_CONES: bool = true;

    fn node_limit(&self) -> u32 {
        any!(self, tree => tree.node_limit())
    }

    fn displayed(&self) -> u64 {
        any!(self, tree => tree.displayed())
    }

    fn origin(&self) -> [f64; 3] {
        any!(self, tree => tree.origin())
    }

    fn roots(&self) -> &[NodeId] {
        any!(self, tree => tree.roots())
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        any!(self, tree => tree.bounds(node))
    }

    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        any_iterator!(self, tree => tree.children(node))
    }

    fn children_and_bounds(&self, node: NodeId) -> impl Iterator<Item = (NodeId, Bounds)> {
        any_iterator!(self, tree => tree.children_and_bounds(node))
    }

    fn children_and_parents(
        &self,
        node: NodeId,
    ) -> impl Iterator<Item = (NodeId, Bounds, impl Iterator<Item = NodeId>)> {
        match self {
            Self::InMemory(tree) => Either::Left(Either::Left(
                tree.children_and_parents(node)
                    .map(|(n, b, parents)| (n, b, Either::Left(Either::Left(parents)))),
            )),
            Self::MetaNode(tree) => Either::Left(Either::Right(
                tree.children_and_parents(node)
                    .map(|(n, b, parents)| (n, b, Either::Left(Either::Right(parents)))),
            )),
            Self::DetailBlock(tree) => Either::Right(Either::Left(
                tree.children_and_parents(node)
                    .map(|(n, b, parents)| (n, b, Either::Right(Either::Left(parents)))),
            )),
            Self::MtPartition(tree) => Either::Right(Either::Right(
                tree.children_and_parents(node)
                    .map(|(n, b, parents)| (n, b, Either::Right(Either::Right(parents)))),
            )),
        }
    }

    fn normal_cone(&self, node: NodeId) -> NormalCone {
        any!(self, tree => tree.normal_cone(node))
    }

    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        any_iterator!(self, tree => tree.parents(node))
    }

    fn log_number(&self, node: NodeId) -> u32 {
        any!(self, tree => tree.log_number(node))
    }

    fn prepare(&self, node: NodeId, step: usize) {
        any!(self, tree => if step < preparation(tree) { tree.prepare(node, step) });
    }

    fn look_ahead(&self) -> u32 {
        any!(self, tree => tree.look_ahead())
    }

    fn will_need(&mut self, node: NodeId, frames: u32) {
        any!(self, tree => tree.will_need(node, frames));
    }

    fn peek(&self, node: NodeId, children: &mut Vec<(NodeId, Bounds)>) -> bool {
        any!(self, tree => tree.peek(node, children))
    }

    fn pass(&mut self, time: Duration) -> Result<(), TreeError> {
        any!(self, tree => tree.pass(time))
    }

    fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        any!(self, tree => tree.begin_frame(arrived))
    }

    fn give_up(&mut self, node: NodeId) {
        any!(self, tree => tree.give_up(node));
    }

    fn settle(&mut self) -> Result<Duration, TreeError> {
        any!(self, tree => tree.settle())
    }

    fn take_fault(&mut self) -> Option<TreeError> {
        any!(self, tree => tree.take_fault())
    }

    #[track_caller]
    fn assert_well_formed(&self) {
        any!(self, tree => tree.assert_well_formed());
    }

    fn end_frame(&mut self) -> Result<PageStats, TreeError> {
        any!(self, tree => tree.end_frame())
    }
}

impl VertexTree for AnyTree {
    fn base_mesh<M: MeshSink>(&mut self, mesh: &mut M) -> Result<(), TreeError> {
        any!(self, tree => tree.base_mesh(mesh))
    }

    fn unfold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        any!(self, tree => tree.unfold(node, mesh))
    }

    fn fold<M: MeshSink>(&mut self, node: NodeId, mesh: &mut M) -> Result<Step, TreeError> {
        any!(self, tree => tree.fold(node, mesh))
    }

    fn update_mesh<M: MeshSink>(&mut self, mesh: &mut M) {
        any!(self, tree => tree.update_mesh(mesh));
    }
}
