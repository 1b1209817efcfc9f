//! The viewing frustum as planes, and triangles clipped to it (Sutherland & Hodgman 1974).

// The measured figures and the pictures are off the selection path.
#![expect(clippy::disallowed_methods, reason = "off the selection path")]

use glam::DVec3;

use selection::view::Camera;

/// A clipped triangle has at most this many corners: each plane adds one at most.
const MOST_CORNERS: usize = 3 + 5;

/// The pyramid that a camera sees, without a far plane, cut off at a near plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frustum {
    eye: DVec3,
    /// The near plane is this far ahead of the eye.
    near: f64,
    /// Normals of near plane, left, right, bottom and top, pointing inwards. Only the signs and ratios of distances
    /// matter, so they need not be of unit length.
    normals: [DVec3; 5],
}

/// A convex polygon inside a triangle, by barycentric coordinates of its corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Polygon {
    corners: [DVec3; MOST_CORNERS],
    len: usize,
}

impl Polygon {
    /// The whole triangle.
    pub(crate) const TRIANGLE: Self = {
        let mut corners = [DVec3::ZERO; MOST_CORNERS];
        corners[0] = DVec3::X;
        corners[1] = DVec3::Y;
        corners[2] = DVec3::Z;
        Self { corners, len: 3 }
    };

    pub(crate) fn corners(&self) -> &[DVec3] {
        &self.corners[..self.len]
    }

    /// The part where `distance`, linear over the triangle and given at its corners, is at least 0. A coordinate
    /// that is 0 at both ends of an edge is exactly 0 between them.
    fn clip(&self, distance: DVec3) -> Self {
        let mut clipped = Self { len: 0, ..*self };
        let mut push = |corner| {
            if clipped.len < MOST_CORNERS {
                clipped.corners[clipped.len] = corner;
                clipped.len += 1;
            }
        };
        for (i, &from) in self.corners().iter().enumerate() {
            let to = self.corners[(i + 1) % self.len];
            let (d_from, d_to) = (distance.dot(from), distance.dot(to));
            if d_from >= 0.0 {
                push(from);
            }
            if (d_from >= 0.0) != (d_to >= 0.0) {
                push((from * d_to - to * d_from) / (d_to - d_from));
            }
        }
        clipped
    }
}

impl Frustum {
    /// What `camera` sees further ahead than `near`, in object units, with the image enlarged `widen` times.
    pub(crate) fn new(camera: &Camera, near: f64, widen: f64) -> Self {
        let (ahead, right, up) = (camera.direction(), camera.right(), camera.up());
        let half_height = (0.5 * camera.fov_y()).tan() * widen;
        let half_width = half_height * camera.aspect();
        let normals = [
            ahead,
            ahead * half_width + right,
            ahead * half_width - right,
            ahead * half_height + up,
            ahead * half_height - up,
        ];
        Self { eye: camera.position(), near, normals }
    }

    /// Signed distances from the planes, in the units of each plane's normal; inside, all are at least 0.
    fn distances(&self, point: DVec3) -> [f64; 5] {
        let from_eye = point - self.eye;
        let mut distances = self.normals.map(|normal| normal.dot(from_eye));
        distances[0] -= self.near;
        distances
    }

    pub(crate) fn contains(&self, point: DVec3) -> bool {
        self.distances(point).iter().all(|&d| d >= 0.0)
    }

    /// How a triangle lies in the frustum.
    pub(crate) fn clip(&self, corners: [DVec3; 3]) -> Clipped {
        let distances = corners.map(|corner| self.distances(corner));
        let outside = |plane: usize| distances.map(|d| d[plane] < 0.0);
        let crossed = |plane: &usize| outside(*plane).contains(&true);
        if (0..5).any(|plane| outside(plane) == [true; 3]) {
            return Clipped::Outside;
        }
        let mut polygon = Polygon::TRIANGLE;
        let mut whole = true;
        for plane in (0..5).filter(crossed) {
            whole = false;
            polygon = polygon.clip(DVec3::from(distances.map(|d| d[plane])));
        }
        match polygon.len {
            _ if whole => Clipped::Inside,
            0..3 => Clipped::Outside,
            _ => Clipped::Partly(polygon),
        }
    }
}

/// How a triangle lies in a [`Frustum`].
#[derive(Clone, Copy, Debug)]
pub(crate) enum Clipped {
    /// All of it is in view.
    Inside,
    /// This part of it is in view.
    Partly(Polygon),
    /// None of it is in view.
    Outside,
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, dvec3};

    /// Looks along -z from the origin, 90 degrees high and wide.
    fn frustum() -> Frustum {
        let right_angle = std::f64::consts::FRAC_PI_2;
        let camera = Camera::new(DVec3::ZERO, DQuat::IDENTITY, right_angle, 1.0).unwrap();
        Frustum::new(&camera, 0.5, 1.0)
    }

    #[test]
    fn points_are_inside_the_pyramid_and_beyond_the_near_plane() {
        let frustum = frustum();
        assert!(frustum.contains(dvec3(0.9, -0.9, -1.0)));
        assert!(!frustum.contains(dvec3(1.1, 0.0, -1.0)));
        assert!(!frustum.contains(dvec3(0.0, 0.0, -0.4)));
        assert!(!frustum.contains(dvec3(0.0, 0.0, 1.0)));
    }

    /// At depth 2 the image is the square from -2 to 2:
    ///
    /// ```text
    ///    +---------+
    ///    |         |
    ///    |    a----|----b
    ///    |     \   |   /
    ///    +------\--+  /
    ///            \   /
    ///              c
    /// ```
    #[test]
    fn a_triangle_is_cut_along_the_sides() {
        let corners = [dvec3(0.0, 0.0, -2.0), dvec3(4.0, 0.0, -2.0), dvec3(2.0, -4.0, -2.0)];
        let Clipped::Partly(polygon) = frustum().clip(corners) else {
            panic!("the triangle crosses the border")
        };
        let mut points: Vec<[f64; 2]> = polygon
            .corners()
            .iter()
            .map(|w| (0..3).map(|i| corners[i] * w[i]).sum::<DVec3>())
            .map(|p| [(p.x * 1e6).round() / 1e6, (p.y * 1e6).round() / 1e6])
            .collect();
        points.sort_by(|a, b| a.partial_cmp(b).unwrap());
        assert_eq!(points, [[0.0, 0.0], [1.0, -2.0], [2.0, -2.0], [2.0, 0.0]]);
    }

    #[test]
    fn a_large_triangle_is_seen_though_no_corner_is() {
        let corners = [dvec3(-90.0, -90.0, -2.0), dvec3(90.0, -90.0, -2.0), dvec3(0.0, 90.0, -2.0)];
        assert!(matches!(frustum().clip(corners), Clipped::Partly(p) if p.len == 4));
        let past_a_corner = [dvec3(0.0, 5.0, -2.0), dvec3(5.0, 0.0, -2.0), dvec3(5.0, 5.0, -2.0)];
        assert!(matches!(frustum().clip(past_a_corner), Clipped::Outside));
    }
}
