//! The forest of a collapse log, numbered depth-first, on disk: which leaves are below a node, and which triangles it
//! brings.
//!
//! Leaves are numbered in the order in which a walk in preorder meets them, the child with the kept vertex first, so
//! that every subtree is an interval of leaves and the vertex shown for a folded node is its first leaf (design of the
//! displayed mesh: [`StarMesh`](star_mesh::StarMesh)). Nodes are numbered in preorder too: those below a node with `k`
//! leaves are the `k - 2` after it, and where its children are follows from how many leaves they have.
//!
//! The nodes, their triangles and the places of the leaves are in temporary files, and read by number through a cache; how
//! they come there is in `arranging`.

use std::cell::RefCell;
use std::io;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

use collapse_log::external::{Paged, check_stop};
use vertex_tree::Bounds;

use crate::subtree::Span;

/// A node.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub span: Span,
    /// Its number in the log.
    pub log_number: u32,
    pub bounds: Bounds,
    /// [`NONE`] for a root.
    pub parent: u32,
    /// The triangles that it brings.
    pub brought: Range<u32>,
}

/// A log arranged.
pub(crate) struct Arrangement<'a> {
    /// Vertices and triangles of the input; of the triangles, those with a doubled corner, which are never shown and left
    /// out.
    pub leaves: u32,
    pub triangles: u32,
    pub doubled: u32,
    /// How many nodes there are.
    pub nodes: u32,
    /// The roots in the order of their leaves.
    pub roots: Vec<u32>,
    /// The first leaves of the trees, and the vertices that no collapse touches.
    pub base_leaves: Vec<u32>,
    /// The triangles that are shown while every node is folded: three leaves each.
    pub base_triangles: Vec<[u32; 3]>,
    pub stored: RefCell<Stored>,
    pub stop: &'a AtomicBool,
}

/// What is on disk.
pub(crate) struct Stored {
    pub nodes: Paged<12>,
    pub brought: Paged<3>,
    pub places: Paged<3>,
    /// What has gone wrong.
    pub failed: Option<io::Error>,
}

impl Arrangement<'_> {
    /// A node by its number in preorder.
    pub fn node(&self, n: u32) -> Node {
        let mut stored = self.stored.borrow_mut();
        let words = check_stop(self.stop).and_then(|()| stored.nodes.get(n.into()));
        let words = stored.or_fail(words, [0; 12]);
        let [first, pivot, end, log_number, x, y, z, radius, eps, parent, start, count] = words;
        let [x, y, z, radius, eps] = [x, y, z, radius, eps].map(f32::from_bits);
        Node {
            span: Span { first, pivot, end },
            log_number,
            bounds: Bounds { center: [x, y, z], radius, eps },
            parent,
            brought: start..start.saturating_add(count),
        }
    }

    /// The children of a node, that of the kept vertex first; [`NONE`] for a leaf.
    pub fn children(&self, n: u32) -> [u32; 2] {
        self.node(n).span.children(n)
    }

    /// A triangle that a node brings: three leaves.
    pub fn triangle(&self, t: u32) -> [u32; 3] {
        let mut stored = self.stored.borrow_mut();
        let leaves = stored.brought.get(t.into());
        stored.or_fail(leaves, [0; 3])
    }

    /// The place of a leaf.
    pub fn position(&self, leaf: u32) -> [f32; 3] {
        let mut stored = self.stored.borrow_mut();
        let words = stored.places.get(leaf.into());
        stored.or_fail(words, [0; 3]).map(f32::from_bits)
    }

    /// Fails if anything could not be read since: what came instead then is a leaf, or nothing.
    pub fn check(&self) -> io::Result<()> {
        self.stored.borrow_mut().failed.take().map_or(Ok(()), Err)
    }
}

impl Stored {
    fn or_fail<T>(&mut self, outcome: io::Result<T>, otherwise: T) -> T {
        outcome.unwrap_or_else(|error| {
            self.failed.get_or_insert(error);
            otherwise
        })
    }
}
