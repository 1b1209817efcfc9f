//! The view from outside: a camera that looks at another camera's view.

use glam::{DMat3, DQuat, DVec3};

use selection::view::{Camera, ViewError};

/// Full vertical field of view of the outside camera, in radians.
const FOV_Y: f64 = 0.6;
/// How far to the side of the viewing direction, and how far above the ground, the outside camera stands, in radians.
const AZIMUTH: f64 = 0.75;
const ELEVATION: f64 = 0.7;
/// The picture is larger than what it must show by this factor.
const MARGIN: f64 = 1.06;
/// Length of the pyramid of a camera inside the mesh, and the least length of any, as fractions of the mesh's extent.
const FROM_INSIDE: f64 = 0.35;
const SHORTEST: f64 = 0.05;

/// Lower and upper corner of a bounding box.
type Bounds = ([f32; 3], [f32; 3]);

/// A bird's-eye view of a mesh and of the pyramid that `view` sees: from behind and above, a little to the side. It
/// is upright with respect to the coordinate axis that is nearest to the camera's [`up`](Camera::up).
///
/// # Errors
/// Where the bounds leave no place to stand.
pub fn outside_camera(view: &Camera, bounds: Bounds) -> Result<Camera, ViewError> {
    let camera = outside(view, bounds);
    Camera::new(camera.position(), camera.orientation(), camera.fov_y(), camera.aspect())
}

/// The same for a picture, which takes what comes.
pub(super) fn outside(view: &Camera, bounds: Bounds) -> Camera {
    let up = nearest_axis(view.up());
    // Looking straight up or down, the top of the image shows where ahead is.
    let level = |v: DVec3| v - up * v.dot(up);
    let ahead = [level(view.direction()), level(view.up())]
        .into_iter()
        .find(|v| v.length() > 1e-3)
        .unwrap_or_else(|| up.any_orthogonal_vector())
        .normalize();
    let heading = DQuat::from_axis_angle(up, AZIMUTH) * ahead;
    let direction = heading * ELEVATION.cos() - up * ELEVATION.sin();
    let right = direction.cross(up).normalize();
    let axes = DMat3::from_cols(right, right.cross(direction), -direction);
    let pyramid = Pyramid::new(view, bounds);
    let points = box_corners(bounds).into_iter().chain([pyramid.apex]).chain(pyramid.far);
    let eye = nearest_eye(points, &axes, FOV_Y, view.aspect());
    Camera::unchecked(eye, DQuat::from_mat3(&axes), FOV_Y, view.aspect())
}

/// The place, for a camera with these axes (right, up, backwards), from which it just sees all points.
///
/// In camera axes a point (x, y, z) is between left and right of a camera at (X, Y, Z) if |x - X| <= t (Z - z), with t
/// the tangent of half the field of view. So X + t Z >= x + t z and -X + t Z >= -x + t z: with a and b the largest
/// right-hand sides, the least Z is (a + b) / 2t, at X = (a - b) / 2. The same holds for top and bottom, and the
/// larger Z serves both.
fn nearest_eye(points: impl Iterator<Item = DVec3>, axes: &DMat3, fov_y: f64, aspect: f64) -> DVec3 {
    let tangent_y = (0.5 * fov_y).tan() / MARGIN;
    let tangents = [tangent_y * aspect, tangent_y];
    let mut sides = [[f64::NEG_INFINITY; 2]; 2];
    for point in points {
        let p = axes.transpose() * point;
        for axis in 0..2 {
            sides[axis][0] = sides[axis][0].max(p[axis] + tangents[axis] * p.z);
            sides[axis][1] = sides[axis][1].max(-p[axis] + tangents[axis] * p.z);
        }
    }
    let back = |axis: usize| (sides[axis][0] + sides[axis][1]) / (2.0 * tangents[axis]);
    let center = |axis: usize| (sides[axis][0] - sides[axis][1]) / 2.0;
    *axes * DVec3::new(center(0), center(1), back(0).max(back(1)))
}

/// What a camera sees, up to some length.
pub(super) struct Pyramid {
    apex: DVec3,
    /// Going around.
    far: [DVec3; 4],
}

impl Pyramid {
    pub(super) fn new(view: &Camera, bounds: Bounds) -> Self {
        let corners = box_corners(bounds);
        let direction = view.direction();
        let center = corners.iter().sum::<DVec3>() / 8.0;
        let extent = corners[0].distance(corners[7]);
        let depth = |p: DVec3| direction.dot(p - view.position());
        // It ends in the middle of a mesh seen from afar, and well within one seen from inside, or it would dwarf it.
        let furthest = corners.into_iter().map(depth).fold(0.0, f64::max);
        let length = furthest.min(depth(center).max(FROM_INSIDE * extent)).max(SHORTEST * extent);
        let half_height = (0.5 * view.fov_y()).tan() * length;
        let (x, y) = (view.right() * half_height * view.aspect(), view.up() * half_height);
        let middle = view.position() + direction * length;
        Self { apex: view.position(), far: [middle - x - y, middle + x - y, middle + x + y, middle - x + y] }
    }

    pub(super) fn sides(&self) -> [[DVec3; 3]; 4] {
        [0, 1, 2, 3].map(|i| [self.apex, self.far[i], self.far[(i + 1) % 4]])
    }

    pub(super) fn edges(&self) -> [[DVec3; 2]; 8] {
        let from_apex = self.far.map(|corner| [self.apex, corner]);
        let around = [0, 1, 2, 3].map(|i| [self.far[i], self.far[(i + 1) % 4]]);
        std::array::from_fn(|i| if i < 4 { from_apex[i] } else { around[i - 4] })
    }
}

fn nearest_axis(v: DVec3) -> DVec3 {
    let longest =
        (1..3).fold(0, |longest, axis| if v[axis].abs() > v[longest].abs() { axis } else { longest });
    DVec3::AXES[longest] * if v[longest] < 0.0 { -1.0 } else { 1.0 }
}

fn box_corners((lo, hi): Bounds) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        DVec3::from([0, 1, 2].map(|axis| f64::from(if i >> axis & 1 == 0 { lo[axis] } else { hi[axis] })))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::frustum::Frustum;

    #[test]
    fn mesh_and_pyramid_are_in_the_picture_and_fill_it() {
        let bounds = ([-3.0, -2.0, -1.0], [3.0, 2.0, 1.0]);
        for (position, orientation) in [
            (DVec3::new(0.0, 0.5, 9.0), DQuat::IDENTITY),
            (DVec3::ZERO, DQuat::from_rotation_y(2.0)),
            (DVec3::new(0.0, 40.0, 0.0), DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2)),
            (DVec3::new(-5.0, 1.0, 2.0), DQuat::from_rotation_z(1.0)),
        ] {
            let view = Camera::new(position, orientation, 0.8, 1.5).unwrap();
            let camera = outside_camera(&view, bounds).unwrap();
            let pyramid = Pyramid::new(&view, bounds);
            let points = [&box_corners(bounds)[..], &[pyramid.apex], &pyramid.far].concat();
            let seen = Frustum::new(&camera, 1e-3, 1.0);
            assert!(points.iter().all(|&p| seen.contains(p)), "from {position}");
            let smaller = Frustum::new(&camera, 1e-3, 0.9 / MARGIN);
            assert!(!points.iter().all(|&p| smaller.contains(p)), "from {position}");
            assert!(camera.direction().dot(nearest_axis(view.up())) < -0.5, "not from above");
        }
    }
}
