//! The brute-force cut of a backend's own nodes: what every strategy must arrive at over a store that has bounds, or nodes,
//! of its own.
//!
//! Unlike the [`Oracle`](crate::oracle), which reads a collapse log, this asks the backend itself: everything is unfolded
//! once, and bounds and parents of all nodes are noted. From then on nothing is shared with it.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use vertex_tree::{Bounds, MeshSink, NodeId, NormalCone, NullSink, Step, TreeError, VertexTree};

use crate::engine::{Engine, Settings};
use crate::front::mix;
use crate::normal_cone;
use crate::view::View;

/// Bounds and structural parents of all nodes, parents before their children.
#[derive(Clone, Debug, Default)]
pub struct BruteForce {
    nodes: Vec<Node>,
    /// Of each node by number, its place among the nodes.
    places: Vec<u32>,
    active: Vec<bool>,
}

#[derive(Clone, Debug)]
struct Node {
    bounds: Bounds,
    cone: NormalCone,
    log_number: u32,
    parents: Vec<u32>,
}

impl BruteForce {
    /// Unfolds all of a tree that is wholly folded, and has memory for everything.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn new<T: VertexTree>(tree: &mut T) -> Result<Self, TreeError> {
        let mut all = Self::default();
        unfold_all(tree, &mut NullSink, |tree, node| {
            all.add(tree, node);
            ControlFlow::Continue(())
        })?;
        all.active = vec![false; all.nodes.len()];
        Ok(all)
    }

    fn add<T: VertexTree>(&mut self, tree: &T, node: NodeId) {
        if self.places.len() <= node.index() {
            self.places.resize(node.index() + 1, u32::MAX);
        }
        self.places[node.index()] = self.nodes.len() as u32;
        self.nodes.push(Node {
            bounds: tree.bounds(node),
            // As in an engine, where roots have none.
            cone: match tree.parents(node).next() {
                Some(_) if T::HAS_CONES => tree.normal_cone(node),
                _ => NormalCone::NONE,
            },
            log_number: tree.log_number(node),
            parents: tree.parents(node).map(|parent| self.places[parent.index()]).collect(),
        });
    }

    /// How many nodes of an engine's front have not the status that brute force gives them for the engine's own views.
    pub fn wrong<T: VertexTree, M: MeshSink>(&mut self, engine: &Engine<T, M>) -> u64 {
        let (hash, count) = self.cut(engine.settings(), engine.views());
        if (hash, count) == (engine.front().cut_hash(), engine.front().active_nodes()) {
            return 0;
        }
        let mut differs = self.active.clone();
        engine.for_each_active(|node| {
            let place = self.places[node.index()] as usize;
            differs[place] = !differs[place];
        });
        differs.iter().filter(|&&differs| differs).count() as u64
    }

    /// [`wrong`](Self::wrong), and how many of these no change explains that was refused in the frame.
    pub fn judge<T: VertexTree, M: MeshSink>(
        &mut self,
        engine: &Engine<T, M>,
        has_dependencies: bool,
    ) -> [u64; 2] {
        let wrong = self.wrong(engine);
        let is_all = engine.missing().is_empty();
        [wrong, if is_all { wrong } else { self.unexplained(engine, has_dependencies) }]
    }

    /// Like [`wrong`](Self::wrong), for a frame in which changes were refused: those only that this does not explain. A node
    /// that was not unfolded keeps folded what is below it, and one that was not folded keeps active what is above it.
    /// Where the backend has dependencies beyond structure, a boundary node may have waited for another one: then nodes
    /// that are wrongly folded are explained by any refusal.
    fn unexplained<T: VertexTree, M: MeshSink>(
        &mut self,
        engine: &Engine<T, M>,
        has_dependencies: bool,
    ) -> u64 {
        self.cut(engine.settings(), engine.views());
        let mut is_active = vec![false; self.nodes.len()];
        engine.for_each_active(|node| is_active[self.places[node.index()] as usize] = true);
        let mut is_missing = vec![false; self.nodes.len()];
        for node in engine.missing() {
            is_missing[self.places[node.index()] as usize] = true;
        }
        let mut waits = is_missing.clone();
        let mut unexplained = 0;
        for (at, node) in self.nodes.iter().enumerate() {
            // Parents come first.
            waits[at] |=
                node.parents.iter().any(|&parent| waits[parent as usize] && !is_active[parent as usize]);
            let is_late = waits[at] || has_dependencies;
            unexplained += u64::from(self.active[at] && !is_active[at] && !is_late);
        }
        let mut holds = is_missing;
        for (at, node) in self.nodes.iter().enumerate().rev() {
            let is_held = holds[at] && is_active[at];
            if is_held {
                node.parents.iter().for_each(|&parent| holds[parent as usize] = true);
            }
            unexplained += u64::from(!self.active[at] && is_active[at] && !is_held);
        }
        unexplained
    }

    /// Tests every node and closes upwards; returns the hash and the size of the cut.
    fn cut(&mut self, settings: &Settings, views: &[View]) -> (u64, usize) {
        let criterion = settings.criterion;
        for (active, node) in self.active.iter_mut().zip(&self.nodes) {
            *active = match settings.normal_cone {
                true => normal_cone::unfold(criterion, views, &node.bounds, &node.cone),
                false => criterion.unfold(views, &node.bounds),
            };
        }
        let (mut hash, mut count) = (0_u64, 0);
        for (at, node) in self.nodes.iter().enumerate().rev() {
            if self.active[at] {
                node.parents.iter().for_each(|&parent| self.active[parent as usize] = true);
                hash = hash.wrapping_add(mix(node.log_number));
                count += 1;
            }
        }
        (hash, count)
    }
}

/// Unfolds all nodes of a tree that is wholly folded, the nearest to the roots first, and calls `unfolded` for each, until
/// that breaks off. Waits for pages.
///
/// # Errors
/// What the backend reports.
pub fn unfold_all<T: VertexTree, M: MeshSink>(
    tree: &mut T,
    mesh: &mut M,
    mut unfolded: impl FnMut(&T, NodeId) -> ControlFlow<()>,
) -> Result<(), TreeError> {
    let all = unfold_what_can(tree, mesh, &mut unfolded);
    tree.update_mesh(mesh);
    all
}

fn unfold_what_can<T: VertexTree, M: MeshSink>(
    tree: &mut T,
    mesh: &mut M,
    unfolded: &mut impl FnMut(&T, NodeId) -> ControlFlow<()>,
) -> Result<(), TreeError> {
    let mut active = vec![false; tree.node_limit() as usize];
    let mut waiting: VecDeque<NodeId> = tree.roots().iter().copied().collect();
    let mut arrived = Vec::new();
    // Nodes that have been put off since the last one was unfolded: when all have been, nothing can go on.
    let mut put_off = 0;
    while let Some(node) = waiting.pop_front() {
        if active[node.index()] || !tree.parents(node).all(|parent| active[parent.index()]) {
            continue;
        }
        match tree.unfold(node, mesh)? {
            Step::Done => {
                active[node.index()] = true;
                put_off = 0;
                if unfolded(tree, node).is_break() {
                    return Ok(());
                }
                waiting.extend(tree.children(node));
            }
            _ if put_off > 2 * waiting.len() + 100 => return Ok(()),
            _ => {
                put_off += 1;
                waiting.push_back(node);
                tree.end_frame()?;
                tree.settle()?;
                tree.begin_frame(&mut arrived)?;
                arrived.clear();
            }
        }
    }
    Ok(())
}
