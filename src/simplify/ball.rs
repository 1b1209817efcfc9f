//! A small ball around balls.

use glam::DVec3;

/// A ball, in object units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub center: DVec3,
    pub radius: f64,
}

/// Radius that a ball at `center` needs to contain all `balls`.
pub(super) fn radius_around(center: DVec3, balls: &[Ball]) -> f64 {
    balls.iter().fold(0.0, |radius: f64, b| radius.max(center.distance(b.center) + b.radius))
}

/// A centre from which all `balls` can be contained with a radius close to the least possible.
///
/// Badoiu & Clarkson, "Smaller core-sets for balls" (2003): walk towards the farthest ball by 1/2, 1/3, 1/4, … of
/// the way.
pub(super) fn enclosing_center(balls: &[Ball]) -> DVec3 {
    let Some(&largest) = balls.iter().max_by(|a, b| a.radius.total_cmp(&b.radius)) else {
        return DVec3::ZERO;
    };
    let mut center = largest.center;
    let mut best = (radius_around(center, balls), center);
    for step in 0..STEPS {
        let mut far = (0.0, center);
        for b in balls {
            let distance = center.distance(b.center);
            if distance + b.radius > far.0 {
                // The farthest point of the ball lies behind its centre.
                let beyond = if distance > 0.0 { 1.0 + b.radius / distance } else { 0.0 };
                far = (distance + b.radius, center + (b.center - center) * beyond);
            }
        }
        if far.0 < best.0 {
            best = (far.0, center);
        }
        center += (far.1 - center) / f64::from(step + 2);
    }
    if radius_around(center, balls) < best.0 { center } else { best.1 }
}

const STEPS: u32 = 16;
