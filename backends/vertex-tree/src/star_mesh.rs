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

use crate::leaf_set::LeafSet;
use crate::stars::{Corner, Stars, corner, triangle_of};
use crate::{MeshSink, NONE, TriangleId, VertexId, prefetch};

/// A triangle of the hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafTriangle {
    /// The leaves of its corners, counter-clockwise.
    pub leaves: [u32; 3],
    /// Whatever number the backend knows it by.
    pub number: u32,
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
    vertex_of_leaf: Vec<VertexId>,
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
            vertex_of_leaf: vec![NONE; leaves],
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
        self.vertex_of_leaf[leaf as usize]
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
        self.vertex_of_leaf[leaf as usize] = vertex;
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
        self.vertex_of_leaf[self.shown.at_or_below(leaf).unwrap_or(leaf) as usize]
    }

    #[inline(always)]
    fn show<M: MeshSink>(
        &mut self,
        LeafTriangle { leaves, number }: LeafTriangle,
        vertices: [VertexId; 3],
        mesh: &mut M,
    ) {
        let triangle = Triangle { leaves, vertices, number, _reserved: 0 };
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
        brought: impl Iterator<Item = LeafTriangle>,
        mesh: &mut M,
    ) {
        let from = self.vertex_of_leaf[kept as usize];
        let to = self.add_vertex(removed, position, mesh);
        let triangles = &mut self.triangles;
        self.stars.split(from, to, |corner| {
            let (t, i) = triangle_of(corner);
            let triangle = &mut triangles[t];
            let moves = triangle.leaves[i] >= removed;
            if moves {
                triangle.vertices[i] = to;
                mesh.corner_moved(t as u32, i, to);
            }
            moves
        });
        for triangle in brought {
            self.add_triangle(triangle, mesh);
        }
    }

    /// A node folds: the inverse of [`split`](Self::split).
    #[inline]
    pub fn merge<M: MeshSink>(&mut self, [kept, removed]: [u32; 2], mesh: &mut M) {
        let to = self.vertex_of_leaf[kept as usize];
        let from = self.vertex_of_leaf[removed as usize];
        while let Some(corner) = self.stars.pop(from) {
            let (t, i) = triangle_of(corner);
            let triangle = &mut self.triangles[t];
            if triangle.vertices.contains(&to) {
                self.hide(corner, mesh);
            } else {
                triangle.vertices[i] = to;
                self.stars.push(to, corner);
                mesh.corner_moved(t as u32, i, to);
            }
        }
        self.stars.remove(from);
        self.shown.remove(removed);
        self.vertex_of_leaf[removed as usize] = NONE;
        mesh.vertex_removed(from);
        while self.triangles.len() - self.displayed > self.triangles.len() / HOLES + 256 {
            self.close_hole(mesh);
        }
    }

    /// Removes a triangle of which one corner, `taken`, is in no star any more.
    #[inline(always)]
    fn hide<M: MeshSink>(&mut self, taken: Corner, mesh: &mut M) {
        let (t, taken) = triangle_of(taken);
        let vertices = self.triangles[t].vertices;
        for i in (0..3).filter(|&i| i != taken) {
            self.stars.replace(vertices[i], corner(t as u32, i), None);
        }
        self.triangles[t].number = NONE;
        self.holes.push(t as u32);
        self.displayed -= 1;
        mesh.triangle_removed(t as u32);
    }

    /// Starts to read where the vertex of a leaf is: the first of three steps before a split or a merge, each of which
    /// needs what the one before has fetched.
    #[inline(always)]
    pub fn prefetch_vertex(&self, leaf: u32) {
        prefetch(&self.vertex_of_leaf, leaf as usize);
    }

    /// Starts to read the star of the vertex of a leaf, if that is shown.
    #[inline(always)]
    pub fn prefetch_star(&self, leaf: u32) {
        self.stars.prefetch(self.vertex_of_leaf[leaf as usize]);
    }

    /// Starts to read the triangles around the vertex of a leaf, if that is shown.
    #[inline(always)]
    pub fn prefetch_triangles<M: MeshSink>(&self, leaf: u32, mesh: &M) {
        let vertex = self.vertex_of_leaf[leaf as usize];
        if vertex != NONE {
            for &corner in self.stars.corners(vertex) {
                let (t, _) = triangle_of(corner);
                prefetch(&self.triangles, t);
                mesh.prefetch(t as u32);
            }
        }
    }

    /// Starts to read what says where a corner with this leaf is shown.
    #[inline(always)]
    pub fn prefetch_leaf(&self, leaf: u32) {
        self.shown.prefetch(leaf);
    }

    /// Gives up the last slot; what is in it moves into a hole.
    fn close_hole<M: MeshSink>(&mut self, mesh: &mut M) {
        let Some(triangle) = self.triangles.pop().filter(|triangle| triangle.number != NONE) else { return };
        let last = self.triangles.len() as u32;
        while let Some(hole) = self.holes.pop() {
            if hole < last {
                for (i, vertex) in triangle.vertices.into_iter().enumerate() {
                    self.stars.replace(vertex, corner(last, i), Some(corner(hole, i)));
                }
                self.triangles[hole as usize] = triangle;
                mesh.triangle_removed(last);
                mesh.triangle_added(hole, triangle.vertices);
                return;
            }
        }
    }
}
