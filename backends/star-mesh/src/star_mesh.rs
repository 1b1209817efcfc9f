//! The displayed triangles, and the star of each displayed vertex.

mod change;
mod following;
mod well_formed;

use vertex_tree::{MeshSink, NONE, TriangleId, VertexId};

use self::change::Change;
use crate::leaf_map::LeafMap;
use crate::leaf_set::LeafSet;
use crate::leaf_triangle::LeafTriangle;
use crate::stars::{Corner, Stars};

/// A triangle while it is displayed.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Triangle {
    /// [`NONE`] in a hole.
    vertices: [VertexId; 3],
    /// The vertex that it came with and goes with; [`NONE`] for a triangle of the base mesh.
    owner: VertexId,
    leaves: [u32; 3],
    /// By what number the backend knows it.
    number: u32,
}

impl Triangle {
    const HOLE: Self = Self { vertices: [NONE; 3], owner: NONE, leaves: [NONE; 3], number: NONE };

    #[inline(always)]
    fn new(triangle: LeafTriangle, vertices: [VertexId; 3], owner: VertexId) -> Self {
        Self { vertices, owner, leaves: triangle.leaves, number: triangle.number() }
    }
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
    /// What is to be followed, and the triangles that come with it.
    changes: Vec<Change>,
    coming: Vec<LeafTriangle>,
    /// The removed leaf of a change that did not fit.
    misfit: Option<u32>,
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
            changes: Vec::new(),
            coming: Vec::new(),
            misfit: None,
        }
    }

    /// How many triangles are displayed.
    #[must_use]
    pub fn displayed(&self) -> usize {
        self.displayed
    }

    /// The removed leaf of a change since the last call that did not fit what was displayed: a vertex came that was there, or went that
    /// was not. Such a change is left out. What is displayed then is not what the hierarchy says, but nothing else is wrong with it.
    pub fn take_misfit(&mut self) -> Option<u32> {
        self.misfit.take()
    }

    #[cold]
    fn note_misfit(&mut self, removed: u32) {
        self.misfit.get_or_insert(removed);
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
        let corners = self.stars.corners(vertex).iter();
        let around = corners.flat_map(|corner| self.triangles[corner.triangle() as usize].vertices);
        around.filter(move |&other| other != vertex)
    }

    /// The backend's number of the triangle in a slot; [`NONE`] in a hole.
    #[must_use]
    pub fn number(&self, triangle: TriangleId) -> u32 {
        self.triangles[triangle as usize].number
    }

    /// A vertex of the base mesh appears.
    pub fn add_vertex<M: MeshSink>(&mut self, leaf: u32, position: [f32; 3], mesh: &mut M) -> VertexId {
        self.show_vertex(leaf, position, mesh).unwrap_or_else(|| self.vertex_of_leaf.get(leaf))
    }

    /// A leaf is shown at a vertex of its own; `None` if it was before.
    #[inline(always)]
    fn show_vertex<M: MeshSink>(&mut self, leaf: u32, position: [f32; 3], mesh: &mut M) -> Option<VertexId> {
        let vertex = self.stars.add(leaf);
        if !self.vertex_of_leaf.insert(leaf, vertex) {
            self.stars.remove(vertex);
            return None;
        }
        self.shown.insert(leaf);
        mesh.vertex_added(vertex, position);
        Some(vertex)
    }

    /// A triangle of the base mesh appears, between vertices that are shown.
    pub fn add_triangle<M: MeshSink>(&mut self, triangle: LeafTriangle, mesh: &mut M) {
        let vertices = triangle.leaves.map(|leaf| self.vertex_at(leaf));
        self.show(Triangle::new(triangle, vertices, NONE), mesh);
    }

    /// The vertex that stands for a leaf: every tree of the forest shows the first of its leaves at least, so there
    /// is one.
    #[inline(always)]
    fn vertex_at(&self, leaf: u32) -> VertexId {
        self.vertex_of_leaf.get(self.shown.at_or_below(leaf).unwrap_or(leaf))
    }

    #[inline(always)]
    fn show<M: MeshSink>(&mut self, triangle: Triangle, mesh: &mut M) -> TriangleId {
        let slot = loop {
            match self.holes.pop() {
                Some(slot) => {
                    if let Some(place) = self.triangles.get_mut(slot as usize) {
                        *place = triangle;
                        break slot;
                    }
                }
                None => {
                    self.triangles.push(triangle);
                    break self.triangles.len() as u32 - 1;
                }
            }
        };
        self.displayed += 1;
        for i in 0..3 {
            self.stars.push(triangle.vertices[i], Corner::new(slot, i));
        }
        mesh.triangle_added(slot, triangle.vertices);
        slot
    }

    /// The vertex of leaf `removed` comes back beside vertex `from`, and with it the triangles `brought`.
    #[inline(always)]
    fn split_vertex<M: MeshSink>(
        &mut self,
        from: VertexId,
        removed: u32,
        position: [f32; 3],
        brought: &[LeafTriangle],
        mesh: &mut M,
    ) {
        let Some(to) = self.show_vertex(removed, position, mesh) else {
            return self.note_misfit(removed);
        };
        let triangles = &mut self.triangles;
        let moves =
            |corner: Corner| triangles[corner.triangle() as usize].leaves[corner.index() % 3] >= removed;
        self.stars.split(from, to, moves);
        for &corner in self.stars.corners(to) {
            triangles[corner.triangle() as usize].vertices[corner.index() % 3] = to;
            mesh.corner_moved(corner.triangle(), corner.index() % 3, to);
        }
        for &triangle in brought {
            let far = triangle.far();
            let far_vertex = self.vertex_at(triangle.far_leaf());
            let vertices = std::array::from_fn(|i| match triangle.leaves[i] {
                _ if i == far => far_vertex,
                leaf if leaf >= removed => to,
                _ => from,
            });
            let slot = self.show(Triangle::new(triangle, vertices, to), mesh);
            self.stars.bring(to, slot);
        }
    }

    /// The inverse of [`split_vertex`](Self::split_vertex): vertex `from`, of leaf `removed`, goes, and what is left of its
    /// star is at vertex `to`.
    #[inline(always)]
    fn merge_vertex<M: MeshSink>(&mut self, to: VertexId, from: VertexId, removed: u32, mesh: &mut M) {
        if from == NONE || from == to {
            return self.note_misfit(removed);
        }
        for at in 0..self.stars.brought(from).len() {
            self.remove_brought(self.stars.brought(from)[at], mesh);
        }
        let triangles = &mut self.triangles;
        self.stars.merge(from, to, |corner| {
            triangles[corner.triangle() as usize].vertices[corner.index() % 3] = to;
            mesh.corner_moved(corner.triangle(), corner.index() % 3, to);
        });
        self.stars.remove(from);
        self.shown.remove(removed);
        self.vertex_of_leaf.remove(removed);
        mesh.vertex_removed(from);
        if self.has_many_holes() {
            self.close_holes(mesh);
        }
    }

    /// A triangle that came with a vertex disappears, before that is merged into another.
    #[inline(always)]
    fn remove_brought<M: MeshSink>(&mut self, slot: TriangleId, mesh: &mut M) {
        let triangle = std::mem::replace(&mut self.triangles[slot as usize], Triangle::HOLE);
        for vertex in triangle.vertices {
            self.stars.take(vertex, slot);
        }
        self.holes.push(slot);
        self.displayed -= 1;
        mesh.triangle_removed(slot);
    }

    #[inline(always)]
    fn has_many_holes(&self) -> bool {
        self.triangles.len() - self.displayed > self.triangles.len() / HOLES + 256
    }

    #[cold]
    fn close_holes<M: MeshSink>(&mut self, mesh: &mut M) {
        while self.has_many_holes() {
            self.close_hole(mesh);
        }
    }

    /// Gives up the last slot; what is in it moves into a hole.
    fn close_hole<M: MeshSink>(&mut self, mesh: &mut M) {
        let Some(triangle) = self.triangles.pop().filter(|triangle| triangle.number != NONE) else { return };
        let last = self.triangles.len() as u32;
        while let Some(hole) = self.holes.pop() {
            if hole < last {
                for vertex in triangle.vertices {
                    self.stars.replace(vertex, last, hole);
                }
                if triangle.owner != NONE {
                    self.stars.bring_instead(triangle.owner, last, hole);
                }
                self.triangles[hole as usize] = triangle;
                mesh.triangle_removed(last);
                mesh.triangle_added(hole, triangle.vertices);
                return;
            }
        }
    }
}
