//! Polygons into triangles.
//!
//! A polygon is projected on its Newell plane (the normal is the sum of the cross products of consecutive corners,
//! Sutherland, Sproull & Schumacker 1974). If the fan around its first corner turns the right way everywhere, as in
//! every strictly convex polygon, it is taken; otherwise ears are clipped (the `earcut` crate).
//!
//! Before that, corners that enclose nothing are taken off: those at the place of their neighbour, and the tips of spikes
//! that go out and back. Each leaves a triangle without area, so that every edge of a polygon becomes the edge of one
//! triangle, and neighbouring polygons still meet without a gap. Corners nearly like this are taken off only if ears do not
//! fill the polygon otherwise.

use earcut::Earcut;
use earcut::utils3d::project3d_to_2d;

/// What counts as no length, as a part of the polygon's size: far above what rounding leaves in a plane that lies askew, and
/// far below what anybody has meant.
const EXACT: f64 = 1e-12;
/// The same for a second attempt, where corners are nearly at one place.
const COARSE: f64 = 1e-6;

/// The work space of the triangulation.
#[derive(Default)]
pub(super) struct Triangulator {
    earcut: Earcut<f64>,
    ring: Vec<[f64; 3]>,
    plane: Vec<[f64; 2]>,
    /// The corners that are left, by their places in the list, and where they are in the plane.
    left: Vec<usize>,
    left_plane: Vec<[f64; 2]>,
    /// Triangles without area that corners have left which have been taken off.
    flat: Vec<[usize; 3]>,
    ears: Vec<u32>,
}

impl Triangulator {
    /// Calls `push` with triangles, some of which may name a vertex twice. There is a point for each corner, unless there are
    /// less than four.
    pub fn triangulate(&mut self, corners: &[u32], points: &[[f64; 3]], push: &mut dyn FnMut([u32; 3])) {
        if let &[a, b, c] = corners {
            return push([a, b, c]);
        }
        if corners.len() < 3 {
            return;
        }
        let mut push = |local: [usize; 3]| push(local.map(|i| corners[i]));
        if self.project(points) && !self.fan_fits() {
            for tolerance in [EXACT, COARSE] {
                self.clean(corners, tolerance);
                if self.clip_ears(tolerance) {
                    self.flat.iter().for_each(|&t| push(t));
                    let ears = self.ears.chunks_exact(3);
                    return ears.for_each(|e| push([e[0], e[1], e[2]].map(|i| self.left[i as usize])));
                }
            }
        }
        // The fan is right, or else the polygon has no area or crosses itself: then nothing is right, and the fan at least
        // keeps its edges.
        for i in 1..corners.len() - 1 {
            push([0, i, i + 1]);
        }
    }

    /// Lays the polygon on its plane, with a size of about 1; false if it has none.
    fn project(&mut self, points: &[[f64; 3]]) -> bool {
        // Relative to the first corner, or a small face far from the origin would drown in rounding.
        let origin = points[0];
        self.ring.clear();
        self.ring.extend(points.iter().map(|p| [p[0] - origin[0], p[1] - origin[1], p[2] - origin[2]]));
        let size = self.ring.as_flattened().iter().fold(0.0_f64, |size, x| size.max(x.abs()));
        if size == 0.0 {
            return false;
        }
        self.ring.as_flattened_mut().iter_mut().for_each(|x| *x /= size);
        project3d_to_2d(&self.ring, self.ring.len(), &mut self.plane) && area(&self.plane) > EXACT
    }

    /// Whether all triangles of the fan around corner 0 are counter-clockwise in the plane.
    fn fan_fits(&self) -> bool {
        (1..self.plane.len() - 1).all(|i| signed_area(self.plane[0], self.plane[i], self.plane[i + 1]) > 0.0)
    }

    /// Fills `left`, and `flat` for the corners that are not in it.
    fn clean(&mut self, corners: &[u32], tolerance: f64) {
        let n = self.plane.len();
        self.flat.clear();
        let mut next: Vec<usize> = (0..n).map(|i| (i + 1) % n).collect();
        let mut last: Vec<usize> = (0..n).map(|i| (i + n - 1) % n).collect();
        // So many corners up to `at` are known to be right.
        let (mut at, mut count, mut right) = (0, n, 0);
        while right < count && count > 2 {
            let (before, behind) = (last[at], next[at]);
            let same = corners[before] == corners[at] || corners[at] == corners[behind];
            if same || is_tip([before, at, behind].map(|i| self.plane[i]), tolerance) {
                self.flat.push([before, at, behind]);
                (next[before], last[behind]) = (behind, before);
                count -= 1;
                // Both neighbours have to be looked at again.
                right = usize::saturating_sub(right, 1).min(count - 2);
                at = before;
            } else {
                right += 1;
                at = behind;
            }
        }
        self.left.clear();
        let mut corner = at;
        for _ in 0..count {
            self.left.push(corner);
            corner = next[corner];
        }
        // In the order of the file, as far as there is one in a ring.
        if let Some(first) = (0..count).min_by_key(|&i| self.left[i]) {
            self.left.rotate_left(first);
        }
        self.left_plane.clear();
        self.left_plane.extend(self.left.iter().map(|&i| self.plane[i]));
    }

    /// Fills `ears` with triangles that turn as the polygon does; false if they do not fill it.
    fn clip_ears(&mut self, tolerance: f64) -> bool {
        self.earcut.earcut_slice(&self.left_plane, &[], &mut self.ears);
        let corner = |i: u32| self.left_plane[i as usize];
        let areas = self.ears.chunks_exact(3).map(|e| signed_area(corner(e[0]), corner(e[1]), corner(e[2])));
        let (sum, least) = areas.fold((0.0, 0.0_f64), |(sum, least), area| (sum + area, least.min(area)));
        let slack = 10.0 * tolerance;
        if least < -slack || (sum - area(&self.plane)).abs() > slack.max(1e-9) {
            return false;
        }
        // Ear clipping leaves out corners on straight edges if nothing else is left.
        let mut used = vec![false; self.left.len()];
        self.ears.iter().for_each(|&i| used[i as usize] = true);
        let n = self.left.len();
        let mut before = (0..n).rev().find(|&i| used[i]).unwrap_or(0);
        for i in (0..n).map(|i| (before + 1 + i) % n).collect::<Vec<_>>() {
            if used[i] {
                before = i;
            } else {
                self.flat.push([self.left[before], self.left[i], self.left[(i + 1) % n]]);
            }
        }
        true
    }
}

/// Whether a corner is at the place of a neighbour, or the tip of a spike.
fn is_tip([a, b, c]: [[f64; 2]; 3], tolerance: f64) -> bool {
    let [before, behind] = [[b[0] - a[0], b[1] - a[1]], [c[0] - b[0], c[1] - b[1]]];
    let length = |v: [f64; 2]| (v[0] * v[0] + v[1] * v[1]).sqrt();
    let shorter = length(before).min(length(behind));
    let longer = length(before).max(length(behind));
    let back = before[0] * behind[0] + before[1] * behind[1] < 0.0;
    // Twice the area over the longer edge is how far the end of the shorter is from it.
    shorter <= tolerance || back && signed_area(a, b, c).abs() <= tolerance * longer
}

/// Twice the area of a ring.
fn area(ring: &[[f64; 2]]) -> f64 {
    (1..ring.len().max(1) - 1).map(|i| signed_area(ring[0], ring[i], ring[i + 1])).sum()
}

/// Twice the area of a triangle, positive if it is counter-clockwise.
fn signed_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangulates a polygon in the xy plane and returns the sum of the areas and of their absolute values.
    fn areas(points: &[[f64; 2]]) -> (Vec<[u32; 3]>, f64, f64) {
        let corners: Vec<_> = (0..points.len() as u32).collect();
        areas_of(&corners, points)
    }

    fn areas_of(corners: &[u32], points: &[[f64; 2]]) -> (Vec<[u32; 3]>, f64, f64) {
        let positions: Vec<_> =
            corners.iter().map(|&v| points[v as usize]).map(|p| [p[0], p[1], 5.0]).collect();
        let mut triangles = Vec::new();
        let push = &mut |[a, b, c]: [u32; 3]| {
            if a != b && b != c && c != a {
                triangles.push([a, b, c]);
            }
        };
        Triangulator::default().triangulate(corners, &positions, push);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| points[v as usize]);
            signed_area(a, b, c) / 2.0
        };
        let (sum, magnitude) =
            (triangles.iter().map(area).sum(), triangles.iter().map(|t| area(t).abs()).sum());
        (triangles, sum, magnitude)
    }

    /// Each edge of the ring, but those that go back along another, is in one triangle.
    fn assert_edges(corners: &[u32], triangles: &[[u32; 3]]) {
        let ring: Vec<_> =
            (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]).collect();
        for &[a, b] in ring.iter().filter(|&&[a, b]| a != b && !ring.contains(&[b, a])) {
            let sides = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].contains(&[a, b]);
            assert_eq!(triangles.iter().filter(|t| sides(t)).count(), 1, "edge {a} {b} in {triangles:?}");
        }
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
        let mut l: Vec<[f64; 2]> = vec![
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
            let corners: Vec<_> = (0..l.len() as u32).collect();
            assert_edges(&corners, &triangles);
        }
    }

    #[test]
    fn polygons_without_a_plane_do_not_disturb() {
        assert_eq!(areas(&[[1.0, 1.0]; 5]).0.len(), 3);
        assert_eq!(areas(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]).1, 0.0);
        assert_eq!(areas(&[[0.0, 0.0], [1.0, 1.0]]).0.len(), 0);
    }

    /// A square with a notch from above down to (2, 1), of area 10.
    const NOTCHED: [[f64; 2]; 5] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0]];

    /// A corner twice in a row, as one vertex, as two at one place, or as two 1e-7 apart in any direction: at each corner,
    /// from each corner on, both ways round, and far smaller as well.
    #[test]
    fn a_corner_that_comes_twice_does_not_count() {
        let apart =
            [[0.0, 0.0], [1e-7, 0.0], [-1e-7, 0.0], [0.0, 1e-7], [0.0, -1e-7], [1e-7, 1e-7], [-1e-7, 1e-7]];
        for scale in [1.0, 1e-12] {
            for twice in 0..5 {
                for second in std::iter::once(None).chain(apart.map(Some)) {
                    let mut points = NOTCHED.to_vec();
                    if let Some(by) = second {
                        points.push([NOTCHED[twice][0] + by[0], NOTCHED[twice][1] + by[1]]);
                    }
                    points.as_flattened_mut().iter_mut().for_each(|x| *x *= scale);
                    let mut corners: Vec<u32> = (0..5).collect();
                    corners.insert(twice + 1, if second.is_some() { 5 } else { twice as u32 });
                    for turn in 0..6 {
                        corners.rotate_left(1);
                        let (triangles, area, magnitude) = areas_of(&corners, &points);
                        let unit = scale * scale;
                        let text = format!("{scale} {corners:?} {second:?} {turn}: {triangles:?}");
                        assert!((area / unit - 10.0).abs() < 1e-5, "{area} {text}");
                        assert!((magnitude - area) / unit < 1e-5, "{magnitude} {text}");
                        assert_edges(&corners, &triangles);
                        let back: Vec<_> = corners.iter().rev().copied().collect();
                        let (_, area, magnitude) = areas_of(&back, &points);
                        assert!((area / unit + 10.0).abs() < 1e-5, "{area} {text}");
                        assert!((magnitude + area) / unit < 1e-5, "{magnitude} {text}");
                    }
                }
            }
        }
    }

    /// Spikes to the outside and the inside, from a corner and from within an edge, back to the same vertex, to another at its place and
    /// to a place halfway.
    #[test]
    fn spikes_do_not_count() {
        let mut points = NOTCHED.to_vec();
        // 5 and 6 in the middle of the lower edge, 7 below it, 8 above; 9 off the corner 1, 10 at its place, 11 halfway.
        points.extend([
            [2.0, 0.0],
            [2.0, 0.0],
            [2.0, -3.0],
            [2.0, 0.5],
            [7.0, -1.0],
            [4.0, 0.0],
            [2.0, -1.5],
        ]);
        for corners in [
            &[0, 5, 7, 5, 1, 2, 3, 4][..],
            &[0, 5, 7, 6, 1, 2, 3, 4],
            &[0, 5, 8, 5, 1, 2, 3, 4],
            &[0, 5, 8, 6, 1, 2, 3, 4],
            &[0, 5, 7, 11, 5, 1, 2, 3, 4],
            &[0, 1, 9, 1, 2, 3, 4],
            &[0, 1, 9, 10, 2, 3, 4],
            &[0, 5, 7, 6, 1, 9, 10, 2, 3, 4, 0],
        ] {
            for turn in 0..corners.len() {
                let mut corners = corners.to_vec();
                corners.rotate_left(turn);
                let (triangles, area, magnitude) = areas_of(&corners, &points);
                assert!((area - 10.0).abs() < 1e-9, "{area} {corners:?} {triangles:?}");
                assert!((magnitude - 10.0).abs() < 1e-9, "{magnitude} {corners:?} {triangles:?}");
            }
        }
    }

    /// A square hole in a square, reached by an edge that is gone along twice, with one vertex at its ends or two.
    #[test]
    fn a_keyhole_leaves_a_hole() {
        let mut points = vec![[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        points.extend([[1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [3.0, 1.0], [0.0, 0.0], [1.0, 1.0]]);
        for corners in [[0, 1, 2, 3, 0, 4, 5, 6, 7, 4], [0, 1, 2, 3, 8, 9, 5, 6, 7, 4]] {
            for turn in 0..corners.len() {
                let mut corners = corners;
                corners.rotate_left(turn);
                let (triangles, area, magnitude) = areas_of(&corners, &points);
                assert_eq!((triangles.len(), area, magnitude), (8, 12.0, 12.0), "{corners:?}");
            }
        }
    }
}
