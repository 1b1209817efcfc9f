//! Four vectors at a time.

use glam::{Vec3, Vec4};

/// Four vectors: all x, all y, all z.
pub(super) type Lanes = [Vec4; 3];

/// Four times the same one.
pub(super) fn splat(p: Vec3) -> Lanes {
    p.to_array().map(Vec4::splat)
}

/// Each of them given.
pub(super) fn gathered([a, b, c, d]: [Vec3; 4]) -> Lanes {
    [Vec4::new(a.x, b.x, c.x, d.x), Vec4::new(a.y, b.y, c.y, d.y), Vec4::new(a.z, b.z, c.z, d.z)]
}

/// Sets one of them.
pub(super) fn set(lanes: &mut Lanes, lane: usize, p: Vec3) {
    for (axis, x) in lanes.iter_mut().zip(p.to_array()) {
        axis[lane] = x;
    }
}

pub(super) fn minus(a: Lanes, b: Lanes) -> Lanes {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn dot(a: Lanes, b: Lanes) -> Vec4 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Lanes, b: Lanes) -> Lanes {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
