//! What the axes of recorded bodies and worlds mean.

use std::f64::consts::FRAC_1_SQRT_2;

use glam::{DMat3, DQuat, DVec3};

/// The rotation of a camera that looks along `forward`, with `up` as near to the top as can be. Not a rotation if the
/// two are parallel.
pub(super) fn look(forward: DVec3, up: DVec3) -> DQuat {
    let forward = forward.normalize_or_zero();
    let right = forward.cross(up).normalize_or_zero();
    if right == DVec3::ZERO {
        return DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
    }
    DQuat::from_mat3(&DMat3::from_cols(right, right.cross(forward), -forward)).normalize()
}

/// A quarter turn about x, from y to z.
pub(super) const QUARTER: DQuat = DQuat::from_xyzw(FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2);

/// From camera space to the recorded body's frame, after what the comments (in lower case) say.
pub(super) fn camera_in_body(comments: &str) -> DQuat {
    let says = |text: &str| comments.contains(text);
    let (forward, up) = if says("euroc") {
        (DVec3::Z, DVec3::X)
    } else if says("x forward") {
        (DVec3::X, DVec3::Z)
    } else if says("optical") || says("kitti") || says("z forward") || !says("body") {
        (DVec3::Z, DVec3::NEG_Y)
    } else {
        (DVec3::X, DVec3::Z)
    };
    look(forward, up)
}

/// From the recorded world to one with z up, after what the comments (in lower case) say.
pub(super) fn upright(comments: &str) -> DQuat {
    let says = |text: &str| comments.contains(text);
    if says("kitti") || says("y is down") {
        QUARTER.conjugate()
    } else if says("y up") {
        QUARTER
    } else {
        DQuat::IDENTITY
    }
}
