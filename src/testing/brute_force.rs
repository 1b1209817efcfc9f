//! The brute-force cut of a backend's own nodes: what every strategy must arrive at over a store that has bounds, or nodes,
//! of its own.
//!
//! Unlike the [`Oracle`](crate::oracle), which reads a collapse log, this asks the backend itself: everything is unfolded
//! once, and bounds and parents of all nodes are noted. From then on nothing is shared with it.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use glam::DVec3;
use vertex_tree::{Bounds, Hierarchy, NodeId, NormalCone, NullSink, Refine, Step, TreeError};

use selection::criterion::is_nested;
use selection::engine::{Engine, Settings};
use selection::front::mix;
use selection::normal_cone;
use selection::view::View;

/// Bounds and structural parents of all nodes, parents before their children.
#[derive(Clone, Debug, Default)]
pub struct BruteForce {
    nodes: Vec<Node>,
    /// Of each node by number, its place among the nodes.
    places: Vec<u32>,
    active: Vec<bool>,
    /// What is displayed with every node folded.
    at_first: u64,
}

/// A cut by brute force.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Comparable with [`Front::cut_hash`](selection::front::Front::cut_hash).
    pub hash: u64,
    /// How many nodes are active.
    pub nodes: u64,
    /// What is displayed, see [`Hierarchy::displayed`].
    pub displayed: u64,
}

#[derive(Clone, Debug)]
struct Node {
    bounds: Bounds,
    cone: NormalCone,
    log_number: u32,
    parents: Vec<u32>,
    /// By how much its unfolding changes what is displayed.
    displays: i64,
}

impl BruteForce {
    /// Unfolds all of a tree that has been [started](Refine::start), is wholly folded, and has memory for everything.
    ///
    /// # Errors
    /// Those of [`unfold_all`].
    pub fn new<T: Refine<NullSink>>(tree: &mut T) -> Result<Self, TreeError> {
        let mut all = Self { at_first: tree.displayed(), ..Self::default() };
        let mut displayed = all.at_first;
        unfold_all(tree, &mut NullSink, |tree, node| {
            let before = std::mem::replace(&mut displayed, tree.displayed());
            all.add(tree, node, displayed.wrapping_sub(before) as i64);
            ControlFlow::Continue(())
        })?;
        all.active = vec![false; all.nodes.len()];
        Ok(all)
    }

    fn add<T: Hierarchy>(&mut self, tree: &T, node: NodeId, displays: i64) {
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
            displays,
        });
    }

    /// Nodes of the hierarchy.
    #[must_use]
    pub fn node_count(&self) -> usize {
        self.nodes.len()
    }

    /// A sphere around all of it: centre, and radius.
    #[must_use]
    pub fn sphere(&self) -> ([f64; 3], f64) {
        let roots = || self.nodes.iter().filter(|node| node.parents.is_empty()).map(|node| node.bounds);
        let center = |bounds: Bounds| DVec3::from(bounds.center.map(f64::from));
        let count = roots().count().max(1) as f64;
        let middle = roots().map(center).sum::<DVec3>() / count;
        let reach = |bounds: Bounds| middle.distance(center(bounds)) + f64::from(bounds.radius);
        (middle.to_array(), roots().map(reach).fold(0.0, f64::max))
    }

    /// Checks that whatever view wants a node wants those above it too, see [`is_nested`].
    ///
    /// # Panics
    /// At the first node that sticks out.
    #[track_caller]
    pub fn assert_nested(&self) {
        for (at, node) in self.nodes.iter().enumerate() {
            for &parent in &node.parents {
                let (below, above) = (node.bounds, self.nodes[parent as usize].bounds);
                assert!(
                    is_nested(&below, &above),
                    "node {at}, {below:?}, sticks out of one above it, {above:?}"
                );
            }
        }
    }

    /// How many nodes of an engine's front have not the status that brute force gives them for the engine's own views.
    pub fn wrong<T: Refine<S>, S>(&mut self, engine: &Engine<T, S>) -> u64 {
        let Cut { hash, nodes, .. } = self.cut(engine.settings(), engine.views());
        if (hash, nodes) == (engine.front().cut_hash(), engine.front().active_nodes() as u64) {
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
    pub fn judge<T: Refine<S>, S>(&mut self, engine: &Engine<T, S>, has_dependencies: bool) -> [u64; 2] {
        let wrong = self.wrong(engine);
        let is_all = engine.missing().is_empty();
        [wrong, if is_all { wrong } else { self.unexplained(engine, has_dependencies) }]
    }

    /// Like [`wrong`](Self::wrong), for a frame in which changes were refused: those only that this does not explain. A node
    /// that was not unfolded keeps folded what is below it, and one that was not folded keeps active what is above it.
    /// Where the backend has dependencies beyond structure, a boundary node may have waited for another one: then nodes
    /// that are wrongly folded are explained by any refusal.
    fn unexplained<T: Refine<S>, S>(&mut self, engine: &Engine<T, S>, has_dependencies: bool) -> u64 {
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

    /// Tests every node and closes upwards. The views are relative to the tree's origin, as an engine
    /// [gives](Engine::views) them.
    pub fn cut(&mut self, settings: &Settings, views: &[View]) -> Cut {
        let criterion = settings.criterion;
        for (active, node) in self.active.iter_mut().zip(&self.nodes) {
            *active = match settings.normal_cone {
                true => normal_cone::unfold(criterion, views, &node.bounds, &node.cone),
                false => criterion.unfold(views, &node.bounds),
            };
        }
        let mut cut = Cut { hash: 0, nodes: 0, displayed: self.at_first };
        for (at, node) in self.nodes.iter().enumerate().rev() {
            if self.active[at] {
                node.parents.iter().for_each(|&parent| self.active[parent as usize] = true);
                cut.hash = cut.hash.wrapping_add(mix(node.log_number));
                cut.nodes += 1;
                cut.displayed = cut.displayed.wrapping_add_signed(node.displays);
            }
        }
        cut
    }
}

/// Unfolds all nodes of a tree that is wholly folded, the nearest to the roots first, and calls `unfolded` for each, until
/// that breaks off. Waits for pages.
///
/// # Errors
/// What the backend reports; the first fault, if one keeps a node back; and [`TreeError::Incomplete`].
pub fn unfold_all<T: Refine<S>, S>(
    tree: &mut T,
    sink: &mut S,
    unfolded: impl FnMut(&T, NodeId) -> ControlFlow<()>,
) -> Result<(), TreeError> {
    match unfold_what_can_be(tree, sink, unfolded)? {
        0 => Ok(()),
        nodes => Err(tree.take_fault().unwrap_or(TreeError::Incomplete { nodes })),
    }
}

/// As [`unfold_all`], but for what a fault or want of memory keeps back. Returns how many nodes that are; nothing is known of
/// those below them.
///
/// # Errors
/// What the backend reports.
pub fn unfold_what_can_be<T: Refine<S>, S>(
    tree: &mut T,
    sink: &mut S,
    mut unfolded: impl FnMut(&T, NodeId) -> ControlFlow<()>,
) -> Result<usize, TreeError> {
    let left = unfold(tree, sink, &mut unfolded);
    tree.finish(sink);
    left
}

fn unfold<T: Refine<S>, S>(
    tree: &mut T,
    sink: &mut S,
    unfolded: &mut impl FnMut(&T, NodeId) -> ControlFlow<()>,
) -> Result<usize, TreeError> {
    let mut active = vec![false; tree.node_limit() as usize];
    let mut waiting: VecDeque<NodeId> = tree.roots().iter().copied().collect();
    let mut arrived = Vec::new();
    // Nodes that have been put off since the last one was unfolded: when all have been, nothing can go on.
    let mut put_off = 0;
    while let Some(node) = waiting.pop_front() {
        if active[node.index()] || !tree.parents(node).all(|parent| active[parent.index()]) {
            continue;
        }
        match tree.unfold_into(node, sink)? {
            Step::Done => {
                active[node.index()] = true;
                put_off = 0;
                if unfolded(tree, node).is_break() {
                    return Ok(0);
                }
                waiting.extend(tree.children(node));
            }
            _ if put_off > 2 * waiting.len() + 100 => return Ok(1 + waiting.len()),
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
    Ok(0)
}
