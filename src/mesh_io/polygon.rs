//! Polygons into triangles.
//!
//! A polygon is projected on its Newell plane (the normal is the sum of the cross products of consecutive corners,
//! Sutherland, Sproull & Schumacker 1974). If the fan around its first corner turns the right way everywhere, as in
//! every strictly convex polygon, it is taken; otherwise ears are clipped (the `earcut` crate). Every edge of a
//! polygon becomes the edge of one triangle, so that neighbouring polygons still meet without a gap.

use std::path::Path;

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;

use super::{MAX_VERTICES, MeshIoError, Place, Receiver};
use crate::Mesh;

/// Ear clipping is quadratic at worst.
pub(super) const MAX_CORNERS: usize = 1 << 14;

/// The faces of a file, collected before they are triangulated: a face may come before its vertices.
pub(super) struct Faces {
    corners: Vec<u32>,
    /// For each face, its number in the file and the end of its corners in `corners`.
    ends: Vec<(u64, usize)>,
    place: fn(u64) -> Place,
}

impl Faces {
    /// No faces yet; `place` makes the place of a face from its number.
    pub fn new(place: fn(u64) -> Place) -> Self {
        Self { corners: Vec::new(), ends: Vec::new(), place }
    }

    /// Adds a corner to the face that the next [`end_face`](Self::end_face) ends.
    pub fn push_corner(&mut self, vertex: u32) {
        self.corners.push(vertex);
    }

    pub fn end_face(&mut self, number: u64) {
        self.ends.push((number, self.corners.len()));
    }

    /// Triangulates. `first` is the number of the first vertex in the file, for the error.
    pub fn into_mesh(self, file: &Path, positions: Vec<[f32; 3]>, first: i64) -> Result<Mesh, MeshIoError> {
        let vertices = positions.len();
        if vertices > MAX_VERTICES {
            return Err(MeshIoError::TooManyVertices { file: file.to_owned() });
        }
        let mut triangles = Vec::with_capacity(self.corners.len().saturating_sub(2 * self.ends.len()));
        let mut triangulator = Triangulator::default();
        let mut start = 0;
        for (number, end) in self.ends {
            let corners = &self.corners[start..end];
            start = end;
            let (file, place) = (|| file.to_owned(), (self.place)(number));
            if corners.len() > MAX_CORNERS {
                return Err(MeshIoError::TooManyCorners { file: file(), place, corners: corners.len() });
            }
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                let index = i64::from(vertex) + first;
                return Err(MeshIoError::IndexOutOfRange { file: file(), place, index, vertices });
            }
            let push = &mut |t: [u32; 3]| push_triangle(&mut triangles, t);
            triangulator.triangulate(corners, |i| positions[corners[i] as usize], push);
        }
        Ok(Mesh { positions, triangles, ..Mesh::default() })
    }
}

/// Adds a triangle, unless it names a vertex twice and so has no surface.
pub(super) fn push_triangle(triangles: &mut Vec<[u32; 3]>, [a, b, c]: [u32; 3]) {
    if a != b && b != c && c != a {
        triangles.push([a, b, c]);
    }
}

/// Triangulates faces as they come, for a receiver that has all their vertices.
pub(super) struct FaceSender<'a> {
    pub receiver: &'a mut dyn Receiver,
    /// How many it has.
    pub vertices: usize,
    pub file: &'a Path,
    triangulator: Triangulator,
    points: Vec<[f32; 3]>,
}

impl<'a> FaceSender<'a> {
    pub fn new(receiver: &'a mut dyn Receiver, vertices: usize, file: &'a Path) -> Self {
        Self { receiver, vertices, file, triangulator: Triangulator::default(), points: Vec::new() }
    }

    /// `first` is the number of the first vertex in the file, for the error.
    pub fn send(&mut self, corners: &[u32], place: Place, first: i64) -> Result<(), MeshIoError> {
        let file = || self.file.to_owned();
        if corners.len() > MAX_CORNERS {
            return Err(MeshIoError::TooManyCorners { file: file(), place, corners: corners.len() });
        }
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= self.vertices) {
            let index = i64::from(vertex) + first;
            return Err(MeshIoError::IndexOutOfRange { file: file(), place, index, vertices: self.vertices });
        }
        self.points.clear();
        if corners.len() > 3 {
            for &v in corners {
                self.points.push(self.receiver.position_of(v).map_err(MeshIoError::Receiver)?);
            }
        }
        let (receiver, points) = (&mut *self.receiver, &self.points);
        let mut outcome = Ok(());
        self.triangulator.triangulate(corners, |i| points[i], &mut |[a, b, c]| {
            if a != b && b != c && c != a && outcome.is_ok() {
                outcome = receiver.triangle([a, b, c]);
            }
        });
        outcome.map_err(MeshIoError::Receiver)
    }
}

/// The work space of the triangulation.
#[derive(Default)]
struct Triangulator {
    earcut: Earcut<f64>,
    ring: Vec<[f64; 3]>,
    plane: Vec<[f64; 2]>,
    ears: Vec<u32>,
}

impl Triangulator {
    /// Calls `push` with triangles, some of which may name a vertex twice. `position` gives that of a corner by its
    /// place in the list.
    fn triangulate(
        &mut self,
        corners: &[u32],
        position: impl Fn(usize) -> [f32; 3],
        push: &mut dyn FnMut([u32; 3]),
    ) {
        if let &[a, b, c] = corners {
            return push([a, b, c]);
        }
        if corners.len() < 3 {
            return;
        }
        // Relative to the first corner, or a small face far from the origin would drown in rounding.
        let origin = position(0).map(f64::from);
        self.ring.clear();
        self.ring.extend((0..corners.len()).map(|i| {
            let p = position(i).map(f64::from);
            [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]]
        }));
        let flat = project3d_to_2d(&self.ring, self.ring.len(), &mut self.plane);
        let mut push = |local: [usize; 3]| push(local.map(|i| corners[i]));
        if flat && !self.fan_fits() && self.clip_ears() {
            for ear in self.ears.chunks_exact(3) {
                push([ear[0] as usize, ear[1] as usize, ear[2] as usize]);
            }
        } else {
            // The fan is right, or else the polygon has no area or crosses itself: then nothing is right, and the
            // fan at least keeps its edges.
            for i in 1..corners.len() - 1 {
                push([0, i, i + 1]);
            }
        }
    }

    /// Whether all triangles of the fan around corner 0 are counter-clockwise in the plane.
    fn fan_fits(&self) -> bool {
        (1..self.plane.len() - 1).all(|i| signed_area(self.plane[0], self.plane[i], self.plane[i + 1]) > 0.0)
    }

    /// Fills `ears` with triangles that turn as the polygon does; false if they do not use every corner.
    fn clip_ears(&mut self) -> bool {
        self.earcut.earcut_slice(&self.plane, &[], &mut self.ears);
        self.ears.len() == 3 * (self.plane.len() - 2)
    }
}

/// Twice the area of a triangle, positive if it is counter-clockwise.
fn signed_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangulates a polygon in the xy plane and returns the sum of the areas and of their absolute values.
    fn areas(points: &[[f32; 2]]) -> (Vec<[u32; 3]>, f64, f64) {
        let positions: Vec<_> = points.iter().map(|p| [p[0], p[1], 5.0]).collect();
        let corners: Vec<_> = (0..points.len() as u32).collect();
        let mut triangles = Vec::new();
        let push = &mut |t: [u32; 3]| push_triangle(&mut triangles, t);
        Triangulator::default().triangulate(&corners, |i| positions[i], push);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| points[v as usize].map(f64::from));
            signed_area(a, b, c) / 2.0
        };
        let (sum, magnitude) =
            (triangles.iter().map(area).sum(), triangles.iter().map(|t| area(t).abs()).sum());
        (triangles, sum, magnitude)
    }

    #[test]
    fn a_convex_polygon_becomes_a_fan() {
        let (triangles, area, _) = areas(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]);
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(area, 2.0);
    }

    /// An arrow head: the fan around a wing would leave the polygon.
    ///
    /// ```text
    ///      ___--2
    ///   3--   1
    ///      ---__0
    /// ```
    #[test]
    fn a_concave_polygon_keeps_its_area_and_winding() {
        let arrow = [[4.0, 0.0], [1.0, 2.0], [4.0, 4.0], [0.0, 2.0]];
        for turn in 0..4 {
            let mut turned = arrow;
            turned.rotate_left(turn);
            let (triangles, area, magnitude) = areas(&turned);
            assert_eq!((triangles.len(), area, magnitude), (2, 2.0, 2.0), "from corner {turn}");
            turned.reverse();
            let (_, area, magnitude) = areas(&turned);
            assert_eq!((area, magnitude), (-2.0, 2.0), "reversed, from corner {turn}");
        }
    }

    /// An L with further corners on three of its edges: were they dropped, a neighbour that uses them would be left
    /// with a gap.
    #[test]
    fn corners_on_a_straight_edge_are_kept() {
        let mut l: Vec<[f32; 2]> = vec![
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [3.0, 0.0],
            [3.0, 1.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
        ];
        l.extend([[0.0, 3.0], [0.0, 2.0], [0.0, 1.0]]);
        for turn in 0..l.len() {
            let mut turned = l.clone();
            turned.rotate_left(turn);
            let (triangles, area, magnitude) = areas(&turned);
            assert_eq!((triangles.len(), area, magnitude), (l.len() - 2, 5.0, 5.0), "from corner {turn}");
            for i in 0..l.len() as u32 {
                let edge = [i, (i + 1) % l.len() as u32];
                let sides = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].contains(&edge);
                assert_eq!(triangles.iter().filter(|t| sides(t)).count(), 1, "edge {edge:?}");
            }
        }
    }

    #[test]
    fn polygons_without_a_plane_do_not_disturb() {
        assert_eq!(areas(&[[1.0, 1.0]; 5]).0.len(), 3);
        assert_eq!(areas(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]).1, 0.0);
        assert_eq!(areas(&[[0.0, 0.0], [1.0, 1.0]]).0.len(), 0);
    }
}
