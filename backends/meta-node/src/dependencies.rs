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
//! One thing is open. Where a chain of needed nodes is broken off for want of a page, those at its end that have been
//! unfolded are needed by nothing that is active yet, and fold in the next frame. With place holders for a few pages only,
//! chains that are longer than what fits may then never be completed; with memory for what the front touches they are.

use rustc_hash::FxHashMap;
use vertex_tree::{NONE, NodeId, StarMesh, Step, VertexId};

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
}

impl Rules {
    pub fn new(dependencies: Dependencies, leaves: u32) -> Option<Self> {
        let forces = dependencies == Dependencies::Force;
        (dependencies != Dependencies::Off).then_some(Self {
            forces,
            leaves,
            shown: Vec::new(),
            in_play: FxHashMap::default(),
        })
    }

    fn number(&self, collapse: u32) -> u32 {
        self.leaves.saturating_add(collapse)
    }

    /// A node, whose vertex is shown at `leaf`, comes into play below another, or as a root.
    pub fn enter(&mut self, half: Half, leaf: u32, above: Option<NodeId>) {
        if let Some((node, collapse)) = half {
            let above = above.unwrap_or(NodeId(NONE));
            self.in_play.insert(node, InPlay { above, collapse, leaf });
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
    pub fn may_split(&self, node: NodeId, mesh: &StarMesh) -> Option<Step> {
        let &InPlay { collapse, leaf, .. } = self.in_play.get(&node)?;
        let around = mesh.neighbours(mesh.vertex(leaf)).map(|vertex| self.shown[vertex as usize]);
        let largest = around.max_by_key(|shown| shown.number)?;
        if largest.number < self.number(collapse) {
            return None;
        }
        Some(if self.forces { Step::Needs(largest.node) } else { Step::Blocked })
    }

    /// What keeps a node, whose children are shown at two leaves, from being collapsed, if anything does.
    pub fn may_merge(&self, collapse: u32, leaves: [u32; 2], mesh: &StarMesh) -> Option<Step> {
        let halves = leaves.map(|leaf| mesh.vertex(leaf));
        let around = halves.into_iter().flat_map(|half| mesh.neighbours(half));
        let others = around.filter(|vertex| !halves.contains(vertex));
        let smallest = others.map(|vertex| self.shown[vertex as usize].parent).min()?;
        if self.number(collapse) < smallest {
            return None;
        }
        Some(if self.forces { Step::StillNeeded } else { Step::Blocked })
    }
}
