//! The displayed triangles: which vertex each corner is at, and which corners are at each vertex.

use vertex_tree::NONE;

/// Corner `c` of triangle `t` is numbered `4 t + c`: the triangle is found by a shift.
pub(crate) type Corner = u32;

pub(crate) fn corner(triangle: u32, index: usize) -> Corner {
    triangle << 2 | index as u32
}

pub(crate) fn triangle_of(corner: Corner) -> (u32, usize) {
    (corner >> 2, (corner & 3) as usize)
}

/// What a triangle needs while it is displayed, within a cache line: its leaves, the vertex that each corner is
/// at, and its neighbours in the lists of corners at those vertices.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Triangle {
    leaves: [u32; 3],
    vertices: [u32; 3],
    next: [Corner; 3],
    previous: [Corner; 3],
}

/// Doubly linked lists of the displayed corners at each vertex, through the triangles themselves.
#[derive(Clone, Debug)]
pub(crate) struct LiveTriangles {
    triangles: Vec<Triangle>,
    first_at: Vec<Corner>,
}

impl LiveTriangles {
    /// All triangles hidden.
    pub fn new(corners: &[[u32; 3]], vertices: usize) -> Self {
        let hidden = |&leaves: &[u32; 3]| Triangle {
            leaves,
            vertices: [NONE; 3],
            next: [NONE; 3],
            previous: [NONE; 3],
        };
        Self { triangles: corners.iter().map(hidden).collect(), first_at: vec![NONE; vertices] }
    }

    pub fn leaf(&self, c: Corner) -> u32 {
        let (t, i) = triangle_of(c);
        self.triangles[t as usize].leaves[i]
    }

    /// The last triangle.
    pub fn last(&self) -> u32 {
        (self.triangles.len() as u32).saturating_sub(1)
    }

    pub fn leaves(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize].leaves
    }

    pub fn first_at(&self, vertex: u32) -> Corner {
        self.first_at[vertex as usize]
    }

    pub fn next(&self, c: Corner) -> Corner {
        let (t, i) = triangle_of(c);
        self.triangles[t as usize].next[i]
    }

    pub fn show(&mut self, triangle: u32, vertices: [u32; 3]) {
        for (i, vertex) in vertices.into_iter().enumerate() {
            self.link(corner(triangle, i), vertex);
        }
    }

    pub fn hide(&mut self, triangle: u32) {
        for i in 0..3 {
            self.unlink(corner(triangle, i));
        }
    }

    pub fn move_to(&mut self, c: Corner, vertex: u32) {
        self.unlink(c);
        self.link(c, vertex);
    }

    fn link(&mut self, c: Corner, vertex: u32) {
        let first = std::mem::replace(&mut self.first_at[vertex as usize], c);
        let (t, i) = triangle_of(c);
        let triangle = &mut self.triangles[t as usize];
        triangle.vertices[i] = vertex;
        triangle.next[i] = first;
        triangle.previous[i] = NONE;
        if first != NONE {
            let (t, i) = triangle_of(first);
            self.triangles[t as usize].previous[i] = c;
        }
    }

    fn unlink(&mut self, c: Corner) {
        let (t, i) = triangle_of(c);
        let triangle = self.triangles[t as usize];
        let (next, previous) = (triangle.next[i], triangle.previous[i]);
        if previous == NONE {
            self.first_at[triangle.vertices[i] as usize] = next;
        } else {
            let (t, i) = triangle_of(previous);
            self.triangles[t as usize].next[i] = next;
        }
        if next != NONE {
            let (t, i) = triangle_of(next);
            self.triangles[t as usize].previous[i] = previous;
        }
    }
}
