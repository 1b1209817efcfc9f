//! Cones of normals: an axis and how far normals turn away from it.
//!
//! Angles are kept as cosine and sine, so that they are added and compared without trigonometry. From 90 degrees on a cone
//! says nothing about which side is seen.

use vertex_tree::NormalCone;

use crate::vector::{self, Vector};

/// The sine of a node without a normal cone.
pub(crate) const NO_CONE: f32 = 2.0;

/// An angle below 90 degrees; `None` for all others.
pub(crate) type Angle = Option<(f64, f64)>;

pub(crate) const ZERO: Angle = Some((1.0, 0.0));

/// The angle between two unit vectors.
pub(crate) fn between(a: Vector, b: Vector) -> Angle {
    let cosine = vector::dot(a, b);
    (cosine > 0.0).then(|| (cosine.min(1.0), vector::length(vector::cross(a, b)).min(1.0)))
}

/// The sum of two angles.
pub(crate) fn sum(a: Angle, b: Angle) -> Angle {
    let ((c, s), (d, t)) = (a?, b?);
    let cosine = c * d - s * t;
    (cosine > 0.0).then_some((cosine, (s * d + c * t).min(1.0)))
}

/// The larger of two angles.
pub(crate) fn larger(a: Angle, b: Angle) -> Angle {
    let (a, b) = (a?, b?);
    Some(if a.0 <= b.0 { a } else { b })
}

/// Whether a stored cone is within another. Rounding takes less than half of the room that
/// [`stored_sine`] leaves.
pub(crate) fn is_nested(inner: &NormalCone, outer: &NormalCone) -> bool {
    let Some((_, most)) = of_sine(outer.sine) else { return true };
    let [a, b] = [outer, inner].map(|cone| vector::unit(vector::of(cone.axis)));
    let apart = a.zip(b).and_then(|(a, b)| between(a, b));
    sum(apart, of_sine(inner.sine)).is_some_and(|(_, sine)| sine + 5e-7 <= most)
}

/// The sine to be stored for an angle, with room for rounding: never too small.
pub(crate) fn stored_sine(angle: Angle) -> f32 {
    match angle {
        Some((cosine, sine)) if cosine > 1e-3 => ((sine + 1e-6) as f32).next_up().min(1.0),
        _ => NO_CONE,
    }
}

/// The angle of a stored sine.
pub(crate) fn of_sine(sine: f32) -> Angle {
    let sine = f64::from(sine);
    (sine < 1.0).then(|| ((1.0 - sine * sine).sqrt(), sine))
}
