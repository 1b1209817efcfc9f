//! The displayed mesh of a tree whose leaves are numbered depth-first: what a backend keeps to report changes.
//!
//! A corner of a triangle belongs to an input vertex, that is, to a leaf, and is shown at the vertex that stands for
//! the subtree the leaf is in. If leaves are numbered so that every subtree is an interval that starts with the leaf
//! whose vertex stands for it (a collapse keeps the place of its kept vertex), then
//!
//! * when a node splits, a corner stays or moves by one comparison with the first leaf of the removed side;
//! * the vertex at which a new triangle's far corner is shown is the nearest shown vertex at or below its leaf: a
//!   look-up in a [`LeafSet`], not a walk along parents;
//! * the triangles that disappear when a node folds are those with a corner at both of its vertices.
//!
//! Vertices and triangles live in slots that are used again, so everything here is as large as the displayed mesh and
//! not as the hierarchy. A triangle is half a cache line, the corners at a vertex are another (see [`stars`]).
//!
//! [`stars`]: crate::stars

use crate::leaf_map::LeafMap;
use crate::leaf_set::LeafSet;
use crate::stars::{Stars, corner, triangle_of};
use crate::{MeshSink, NONE, TriangleId, VertexId, prefetch};

/// A triangle of the hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafTriangle {
    /// The leaves of its corners, counter-clockwise.
    pub leaves: [u32; 3],
    /// The number, and in the upper two bits which corner is the far one.
    tag: u32,
}

impl LeafTriangle {
    /// Numbers are below this.
    pub const LIMIT: u32 = 1 << 30;

    /// A triangle that the backend knows by `number`. For one that a node brings, corner `far` is the one whose leaf is
    /// not below the node; for one of the base mesh it means nothing.
    #[must_use]
    pub fn new(leaves: [u32; 3], far: u32, number: u32) -> Self {
        debug_assert!(far < 3 && number < Self::LIMIT);
        Self { leaves, tag: far << 30 | number }
    }

    /// Whatever number the backend knows it by.
    #[must_use]
    pub fn number(self) -> u32 {
        self.tag & (Self::LIMIT - 1)
    }

    #[inline(always)]
    fn far(self) -> usize {
        (self.tag >> 30) as usize
    }

    #[inline(always)]
    fn far_leaf(self) -> u32 {
        self.leaves[self.far() % 3]
    }
}

/// A triangle while it is displayed.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Triangle {
    leaves: [u32; 3],
    vertices: [VertexId; 3],
    /// [`NONE`] in a hole.
    number: u32,
    _reserved: u32,
}

/// The displayed triangles, and the star of each displayed vertex.
#[derive(Clone, Debug)]
pub struct StarMesh {
    shown: LeafSet,
    /// The vertex of each leaf that is shown.
    vertex_of_leaf: LeafMap,
    stars: Stars,
    triangles: Vec<Triangle>,
    /// Slots to use again. Some may lie beyond the last slot: those have been given up since.
    holes: Vec<TriangleId>,
    displayed: usize,
}

/// Slots may be empty up to one in so many, and a few: then triangles at the end move into them.
const HOLES: usize = 8;

impl StarMesh {
    /// An empty mesh over `leaves` leaves.
    #[must_use]
    pub fn new(leaves: usize) -> Self {
        Self {
            shown: LeafSet::new(leaves),
            vertex_of_leaf: LeafMap::new(),
            stars: Stars::default(),
            triangles: Vec::new(),
            holes: Vec::new(),
            displayed: 0,
        }
    }

    /// How many triangles are displayed.
    #[must_use]
    pub fn displayed(&self) -> usize {
        self.displayed
    }

    /// The leaf shown in a slot of the vertices; [`NONE`] in a hole.
    #[must_use]
    pub fn leaf(&self, vertex: VertexId) -> u32 {
        self.stars.leaf(vertex)
    }

    /// The slot of a leaf that is shown; [`NONE`] if it is not.
    #[must_use]
    pub fn vertex(&self, leaf: u32) -> VertexId {
        self.vertex_of_leaf.get(leaf)
    }

    /// The vertices that share a displayed triangle with one, those across an inner edge twice.
    pub fn neighbours(&self, vertex: VertexId) -> impl Iterator<Item = VertexId> + '_ {
        let around = self
            .stars
            .corners(vertex)
            .iter()
            .flat_map(|&corner| self.triangles[triangle_of(corner).0].vertices);
        around.filter(move |&other| other != vertex)
    }

    /// The backend's number of the triangle in a slot; [`NONE`] in a hole.
    #[must_use]
    pub fn number(&self, triangle: TriangleId) -> u32 {
        self.triangles[triangle as usize].number
    }

    /// A vertex of the base mesh appears.
    pub fn add_vertex<M: MeshSink>(&mut self, leaf: u32, position: [f32; 3], mesh: &mut M) -> VertexId {
        let vertex = self.stars.add(leaf);
        self.shown.insert(leaf);
        self.vertex_of_leaf.insert(leaf, vertex);
        mesh.vertex_added(vertex, position);
        vertex
    }

    /// A triangle appears, between vertices that are shown.
    #[inline]
    pub fn add_triangle<M: MeshSink>(&mut self, triangle: LeafTriangle, mesh: &mut M) {
        let vertices = triangle.leaves.map(|leaf| self.vertex_at(leaf));
        self.show(triangle, vertices, mesh);
    }

    /// The vertex that stands for a leaf: every tree of the forest shows the first of its leaves at least, so there
    /// is one.
    #[inline(always)]
    fn vertex_at(&self, leaf: u32) -> VertexId {
        self.vertex_of_leaf.get(self.shown.at_or_below(leaf).unwrap_or(leaf))
    }

    #[inline(always)]
    fn show<M: MeshSink>(&mut self, triangle: LeafTriangle, vertices: [VertexId; 3], mesh: &mut M) {
        let triangle =
            Triangle { leaves: triangle.leaves, vertices, number: triangle.number(), _reserved: 0 };
        let slot = loop {
            match self.holes.pop() {
                Some(slot) if (slot as usize) < self.triangles.len() => {
                    self.triangles[slot as usize] = triangle;
                    break slot;
                }
                Some(_) => {}
                None => {
                    self.triangles.push(triangle);
                    break self.triangles.len() as u32 - 1;
                }
            }
        };
        self.displayed += 1;
        for (i, vertex) in vertices.into_iter().enumerate() {
            self.stars.push(vertex, corner(slot, i));
        }
        mesh.triangle_added(slot, vertices);
    }

    /// A node unfolds: the vertex of leaf `removed` comes back beside that of leaf `kept`, and `brought` are the
    /// triangles that come with it.
    #[inline]
    pub fn split<M: MeshSink>(
        &mut self,
        [kept, removed]: [u32; 2],
        position: [f32; 3],
        brought: &[LeafTriangle],
        mesh: &mut M,
    ) {
        let from = self.vertex_of_leaf.get(kept);
        let to = self.add_vertex(removed, position, mesh);
        let triangles = &mut self.triangles;
        self.stars.split(from, to, |corner| {
            let (t, i) = triangle_of(corner);
            let triangle = &mut triangles[t];
            let moves = triangle.leaves[i % 3] >= removed;
            if moves {
                triangle.vertices[i % 3] = to;
                mesh.corner_moved(t as u32, i % 3, to);
            }
            moves
        });
        for &triangle in brought {
            let far = triangle.far();
            let far_vertex = self.vertex_at(triangle.far_leaf());
            let vertices = std::array::from_fn(|i| match triangle.leaves[i] {
                _ if i == far => far_vertex,
                leaf if leaf >= removed => to,
                _ => from,
            });
            self.show(triangle, vertices, mesh);
        }
    }

    /// A node folds: the inverse of [`split`](Self::split).
    #[inline]
    pub fn merge<M: MeshSink>(&mut self, [kept, removed]: [u32; 2], mesh: &mut M) {
        let to = self.vertex_of_leaf.get(kept);
        let from = self.vertex_of_leaf.get(removed);
        while let Some(corner) = self.stars.pop(from) {
            let (t, i) = triangle_of(corner);
            let triangle = &mut self.triangles[t];
            let [a, b, c] = triangle.vertices;
            if (a == to) | (b == to) | (c == to) {
                for (j, vertex) in [a, b, c].into_iter().enumerate().filter(|&(j, _)| j != i) {
                    self.stars.take(vertex, self::corner(t as u32, j));
                }
                triangle.number = NONE;
                self.holes.push(t as u32);
                self.displayed -= 1;
                mesh.triangle_removed(t as u32);
            } else {
                triangle.vertices[i % 3] = to;
                self.stars.push(to, corner);
                mesh.corner_moved(t as u32, i % 3, to);
            }
        }
        self.stars.remove(from);
        self.shown.remove(removed);
        self.vertex_of_leaf.remove(removed);
        mesh.vertex_removed(from);
        while self.triangles.len() - self.displayed > self.triangles.len() / HOLES + 256 {
            self.close_hole(mesh);
        }
    }

    /// Steps of [`prepare`](Self::prepare).
    pub const PREPARATION: usize = 3;

    /// Starts to read what a split or a merge of these leaves will read, step by step: see
    /// [`VertexTree::prepare`](crate::VertexTree::prepare).
    #[inline(always)]
    pub fn prepare<M: MeshSink>(
        &self,
        [kept, removed]: [u32; 2],
        brought: &[LeafTriangle],
        step: usize,
        mesh: &M,
    ) {
        if step == 0 {
            self.vertex_of_leaf.prefetch(kept);
            self.vertex_of_leaf.prefetch(removed);
            return;
        }
        // A vertex that is shown will be merged away, another will come back.
        let (to, from) = (self.vertex_of_leaf.get(kept), self.vertex_of_leaf.get(removed));
        if step == 1 {
            self.stars.prefetch(to);
            self.stars.prefetch(from);
            if from == NONE {
                brought.iter().for_each(|triangle| self.shown.prefetch(triangle.far_leaf()));
            }
            return;
        }
        for &corner in self.stars.corners(if from == NONE { to } else { from }) {
            let (t, _) = triangle_of(corner);
            prefetch(&self.triangles, t);
            mesh.prefetch(t as u32);
        }
        if from == NONE {
            brought.iter().for_each(|triangle| self.stars.prefetch(self.vertex_at(triangle.far_leaf())));
        }
    }

    /// Gives up the last slot; what is in it moves into a hole.
    fn close_hole<M: MeshSink>(&mut self, mesh: &mut M) {
        let Some(triangle) = self.triangles.pop().filter(|triangle| triangle.number != NONE) else { return };
        let last = self.triangles.len() as u32;
        while let Some(hole) = self.holes.pop() {
            if hole < last {
                for (i, vertex) in triangle.vertices.into_iter().enumerate() {
                    self.stars.replace(vertex, corner(last, i), corner(hole, i));
                }
                self.triangles[hole as usize] = triangle;
                mesh.triangle_removed(last);
                mesh.triangle_added(hole, triangle.vertices);
                return;
            }
        }
    }
}
