//! Implicit dependencies: El-Sana & Chiang (2000), section 3.3.5.
//!
//! Vertices are numbered in the order in which they come to be: those of the input first, then that of each collapse.
//! The paper's two rules, for a vertex `p` with children `a` and `b`:
//!
//! * `p` can be split if its number is greater than those of all its neighbours in the displayed mesh;
//! * `a` and `b` can be collapsed if the number of `p` is less than those of the parents of all their neighbours.
//!
//! So two numbers decide: the largest of the neighbours, and the smallest of the neighbours' parents. The paper stores
//! both with each vertex and updates them at every change around it. Here they are taken from the vertex's star when
//! they are asked for, which is at about as many vertices as change, and not at all of their neighbours.
//!
//! # Forcing
//!
//! Where a rule does not hold, the paper does nothing, and what is displayed depends on the way there. Forcing the
//! neighbours with larger numbers to split first makes the cut a function of the views again. Why the neighbour `q` of `p`
//! with `q > p` is a prerequisite of `p` wherever it is found: when `p` came to be, its neighbours were some `N(p)`, all
//! less than `p`. Until `p` is collapsed, merging is all that happens to its neighbours, so each of its later ones is an
//! ancestor of one in `N(p)`. So `q` is, and `p` looks as it did then only after `q` has been split. The other way
//! round, if every parent of a vertex in `N(p)` is split, no neighbour of `p` is greater. Thus forcing ends in the closure
//! of what is wanted under "`p` needs the parents of `N(p)`", whatever the order; and since what is needed has a
//! larger number, it ends. A collapse that the second rule forbids is still needed by a neighbour that is finer.
//!
//! A chain of needed nodes may be broken off for want of a page. Those at its end that have been unfolded by then are
//! needed by nothing that is active yet. If they folded again, and memory held only a few pages, a chain that is longer
//! than what fits would never be completed. So a node that has been unfolded for another is held for as long as that one,
//! or one for which that one has been named in its turn, is refused, by the rule or for want of its page: until it has
//! been split, and the second rule holds the node, or until a frame has passed in which it has not been asked for. Then
//! every page that comes takes a chain further, and nothing takes it back.

use rustc_hash::{FxHashMap, FxHashSet};
use star_mesh::StarMesh;
use vertex_tree::{NONE, NodeId, Step, VertexId};

/// What is done about neighbours that are too coarse or too fine for a change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Dependencies {
    /// They change first.
    Force,
    /// The change is refused: the paper's own rule. The cut then depends on the way to it.
    Block,
    /// Nothing. With spheres and errors nested over all that a collapse relied on, the wanted cut is consistent by
    /// itself, and the displayed mesh need not be kept to know it.
    #[default]
    Off,
}

/// A displayed vertex.
#[derive(Clone, Copy, Debug)]
struct Shown {
    /// Its node; [`NONE`] for a vertex of the input.
    node: NodeId,
    number: u32,
    /// The number of its parent; the largest possible for a root, which nothing waits for.
    parent: u32,
}

const NOTHING: Shown = Shown { node: NodeId(NONE), number: 0, parent: u32::MAX };

/// A node that is active or on the boundary.
#[derive(Clone, Copy, Debug)]
struct InPlay {
    /// The node above; [`NONE`] for a root.
    above: NodeId,
    /// Its number in the log.
    collapse: u32,
    /// Where its vertex is shown.
    leaf: u32,
    /// Where the other one is, that its split has brought; [`NONE`] before that.
    removed: u32,
}

/// One of the two vertices of a split: its node and that node's number in the log, or nothing for a leaf.
pub(crate) type Half = Option<(NodeId, u32)>;

/// The displayed vertices, by their slot in the mesh.
#[derive(Debug)]
pub(crate) struct Rules {
    forces: bool,
    /// Vertices of the input.
    leaves: u32,
    shown: Vec<Shown>,
    /// The nodes in play: what is needed, or what needs it, may be on a page that is not there.
    in_play: FxHashMap<NodeId, InPlay>,
    /// Of nodes that have been named as needed: for which node.
    held: FxHashMap<NodeId, NodeId>,
    /// Nodes that have been refused as they need another, and the last frame in which that was so.
    refused: FxHashMap<NodeId, u64>,
    frame: u64,
    /// Whether this frame has come to unfolding: then what is refused in it is known, at least for what follows.
    unfolds: bool,
    /// Nodes that were to fold in this frame and have been held.
    were_held: FxHashSet<NodeId>,
}

impl Rules {
    pub fn new(dependencies: Dependencies, leaves: u32) -> Option<Self> {
        let forces = dependencies == Dependencies::Force;
        (dependencies != Dependencies::Off).then_some(Self {
            forces,
            leaves,
            shown: Vec::new(),
            in_play: FxHashMap::default(),
            held: FxHashMap::default(),
            refused: FxHashMap::default(),
            frame: 0,
            unfolds: false,
            were_held: FxHashSet::default(),
        })
    }

    /// A frame starts: what has not been asked for in the one before is not waited for any more.
    pub fn begin_frame(&mut self) {
        let last = self.frame;
        self.frame += 1;
        self.refused.retain(|_, frame| *frame == last);
        if self.refused.is_empty() {
            self.held.clear();
        }
        self.were_held.clear();
        self.unfolds = false;
    }

    fn number(&self, collapse: u32) -> u32 {
        self.leaves.saturating_add(collapse)
    }

    /// A node, whose vertex is shown at `leaf`, comes into play below another, or as a root.
    pub fn enter(&mut self, half: Half, leaf: u32, above: Option<NodeId>) {
        if let Some((node, collapse)) = half {
            let above = above.unwrap_or(NodeId(NONE));
            self.in_play.insert(node, InPlay { above, collapse, leaf, removed: NONE });
        }
    }

    /// A node goes out of play.
    pub fn leave(&mut self, half: Half) {
        if let Some((node, _)) = half {
            self.in_play.remove(&node);
        }
    }

    /// The node above one that is in play; a number that is none for a root.
    pub fn above(&self, node: NodeId) -> Option<NodeId> {
        self.in_play.get(&node).map(|node| node.above)
    }

    /// What is shown in a slot changes. `parent` is a number in the log, if there is a parent.
    pub fn show(&mut self, vertex: VertexId, leaf: u32, half: Half, parent: Option<u32>) {
        let at = vertex as usize;
        if at >= self.shown.len() {
            self.shown.resize(at + 1, NOTHING);
        }
        let parent = parent.map_or(u32::MAX, |collapse| self.number(collapse));
        self.shown[at] = match half {
            Some((node, collapse)) => Shown { node, number: self.number(collapse), parent },
            None => Shown { node: NodeId(NONE), number: leaf, parent },
        };
    }

    /// What keeps a boundary node from splitting, if anything does. It is known without the node's page: a chain of nodes
    /// that need each other unfolds with a page at a time.
    pub fn may_split(&mut self, node: NodeId, mesh: &StarMesh) -> Option<Step> {
        self.unfolds = true;
        let &InPlay { collapse, leaf, .. } = self.in_play.get(&node)?;
        let around = mesh.neighbours(mesh.vertex(leaf)).map(|vertex| self.shown[vertex as usize]);
        let largest = around.max_by_key(|shown| shown.number)?;
        if largest.number < self.number(collapse) {
            // Its page may still be missing.
            if let Some(frame) = self.refused.get_mut(&node) {
                *frame = self.frame;
            }
            return None;
        }
        if !self.forces {
            return Some(Step::Blocked);
        }
        self.refused.insert(node, self.frame);
        self.held.insert(largest.node, node);
        Some(Step::Needs(largest.node))
    }

    /// A node has been split, and a vertex is shown at another leaf: it waits for nothing any more.
    pub fn split(&mut self, node: NodeId, removed: u32) {
        self.refused.remove(&node);
        if let Some(node) = self.in_play.get_mut(&node) {
            node.removed = removed;
        }
    }

    /// Whether a node that is to fold has been unfolded for another that still waits. At first in a frame, before anything
    /// unfolds, that is one that was refused in the frame before; when the node is asked again, in this one.
    fn is_held(&mut self, node: NodeId) -> bool {
        let since = if self.unfolds || self.were_held.contains(&node) { self.frame } else { self.frame - 1 };
        // Each has a larger number than the one that it was named for, so this ends, unless numbers lie.
        let for_which = |node: &NodeId| self.held.get(node).copied();
        let is_refused = |node: NodeId| self.refused.get(&node).is_some_and(|&frame| frame >= since);
        let is_held =
            std::iter::successors(for_which(&node), for_which).take(self.held.len()).any(is_refused);
        if is_held {
            self.were_held.insert(node);
        }
        is_held
    }

    /// What keeps the children of an active node from being collapsed, if anything does. This too is known without its page:
    /// what is still needed asks for none.
    pub fn may_merge(&mut self, node: NodeId, mesh: &StarMesh) -> Option<Step> {
        if self.is_held(node) {
            return Some(Step::StillNeeded);
        }
        let &InPlay { collapse, leaf, removed, .. } =
            self.in_play.get(&node).filter(|n| n.removed != NONE)?;
        let halves = [leaf, removed].map(|leaf| mesh.vertex(leaf));
        let around = halves.into_iter().flat_map(|half| mesh.neighbours(half));
        let others = around.filter(|vertex| !halves.contains(vertex));
        let smallest = others.map(|vertex| self.shown[vertex as usize].parent).min()?;
        if self.number(collapse) < smallest {
            return None;
        }
        Some(if self.forces { Step::StillNeeded } else { Step::Blocked })
    }
}
