//! The displayed mesh: the patches of the arcs in the cut.
//!
//! A triangle never changes, it appears and disappears with its arc. Vertices are shared by patches and counted. The
//! triangles of an arc are chained through their slots, so an arc costs one entry of a map, whatever its patch.

use rustc_hash::FxHashMap;
use vertex_tree::{MeshSink, NONE, TriangleId, VertexId};

use crate::record::Record;

#[derive(Clone, Copy, Debug)]
struct Triangle {
    vertices: [VertexId; 3],
    /// The next of the same arc, or the next hole.
    next: TriangleId,
}

#[derive(Clone, Copy, Debug)]
struct Vertex {
    /// Number in the input.
    number: u32,
    /// Corners that are there; in a hole, the next hole.
    corners: u32,
}

/// What is displayed, in slots that are used again.
#[derive(Clone, Debug)]
pub(crate) struct Display {
    triangles: Vec<Triangle>,
    free_triangle: TriangleId,
    vertices: Vec<Vertex>,
    free_vertex: VertexId,
    /// Slots of the displayed input vertices.
    slots: FxHashMap<u32, VertexId>,
    /// First triangle of each displayed patch, by the nodes above and below.
    arcs: FxHashMap<(u32, u32), TriangleId>,
    /// For each vertex of the record being read, its slot where it has been looked up.
    places: Vec<VertexId>,
}

impl Display {
    pub fn new() -> Self {
        Self {
            triangles: Vec::new(),
            free_triangle: NONE,
            vertices: Vec::new(),
            free_vertex: NONE,
            slots: FxHashMap::default(),
            arcs: FxHashMap::default(),
            places: Vec::new(),
        }
    }

    /// The input vertex in a slot; `None` in a hole.
    pub fn input_vertex(&self, vertex: VertexId) -> Option<u32> {
        self.vertices.get(vertex as usize).map(|v| v.number).filter(|&number| number != NONE)
    }

    /// The patches of some outgoing arcs of a record appear: those of which `which` wants to know more.
    pub fn show<M: MeshSink>(&mut self, record: &Record, which: impl Fn(usize, u32) -> bool, mesh: &mut M) {
        self.places.clear();
        self.places.resize(record.vertices(), NONE);
        for (at, arc) in record.arcs().enumerate() {
            if arc.triangles == 0 || !which(at, arc.below) {
                continue;
            }
            let mut first = NONE;
            record.read_patch(at, |corners| {
                let vertices = corners.map(|place| self.vertex(record, place, mesh));
                let slot = self.add(Triangle { vertices, next: first });
                mesh.triangle_added(slot, vertices);
                first = slot;
            });
            self.arcs.insert((record.number(), arc.below), first);
        }
    }

    #[inline]
    fn add(&mut self, triangle: Triangle) -> TriangleId {
        for vertex in triangle.vertices {
            self.vertices[vertex as usize].corners += 1;
        }
        if self.free_triangle == NONE {
            self.triangles.push(triangle);
            return self.triangles.len() as u32 - 1;
        }
        let slot = self.free_triangle;
        self.free_triangle = std::mem::replace(&mut self.triangles[slot as usize], triangle).next;
        slot
    }

    /// The slot of a vertex of a record; makes one if it is not displayed.
    #[inline]
    fn vertex<M: MeshSink>(&mut self, record: &Record, place: u32, mesh: &mut M) -> VertexId {
        let known = self.places[place as usize];
        if known != NONE {
            return known;
        }
        let (number, position) = record.vertex(place as usize);
        let slot = match self.slots.get(&number) {
            Some(&slot) => slot,
            None => {
                let vertex = Vertex { number, corners: 0 };
                let slot = if self.free_vertex == NONE {
                    self.vertices.push(vertex);
                    self.vertices.len() as u32 - 1
                } else {
                    let slot = self.free_vertex;
                    self.free_vertex = std::mem::replace(&mut self.vertices[slot as usize], vertex).corners;
                    slot
                };
                self.slots.insert(number, slot);
                mesh.vertex_added(slot, position);
                slot
            }
        };
        self.places[place as usize] = slot;
        slot
    }

    /// The patch of an arc disappears, if it is displayed.
    pub fn hide<M: MeshSink>(&mut self, above: u32, below: u32, mesh: &mut M) {
        let Some(mut slot) = self.arcs.remove(&(above, below)) else { return };
        while slot != NONE {
            let Triangle { vertices, next } = self.triangles[slot as usize];
            mesh.triangle_removed(slot);
            self.triangles[slot as usize].next = self.free_triangle;
            self.free_triangle = slot;
            for vertex in vertices {
                let entry = &mut self.vertices[vertex as usize];
                entry.corners -= 1;
                if entry.corners == 0 {
                    self.slots.remove(&entry.number);
                    *entry = Vertex { number: NONE, corners: self.free_vertex };
                    self.free_vertex = vertex;
                    mesh.vertex_removed(vertex);
                }
            }
            slot = next;
        }
    }
}
