//! A small ball around balls.

use glam::DVec3;

/// A ball, in the units of the simplification.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub center: DVec3,
    pub radius: f64,
}

impl Ball {
    /// Radius that a ball around `center` needs to contain this one.
    fn reach(&self, center: DVec3) -> f64 {
        center.distance(self.center) + self.radius
    }
}

/// Radius that a ball around `center` needs to contain all `balls`.
pub(super) fn radius_around(center: DVec3, balls: &[Ball]) -> f64 {
    balls.iter().fold(0.0, |radius, b| b.reach(center).max(radius))
}

/// How often the centre is moved at most.
const STEPS: u32 = 12;
/// Of more balls not all pairs are looked at, but only those with the largest.
const MOST_IN_PAIRS: usize = 128;

/// A centre around which all `balls` can be contained with a radius close to the least possible. Balls that lie inside
/// the largest are dropped from the list.
///
/// Two balls touch their common hull at opposite ends, so of the hulls of all pairs the largest is a lower bound, and
/// the answer if it contains the rest, as it mostly does. If not, the radius needed around a centre is a convex
/// function of it with slope 1 away from the farthest ball, and is lowered by steps towards that ball, as long as the
/// radius exceeds the middle of what is proven and what has been reached (a subgradient method with Polyak's step).
pub(super) fn enclosing_center(balls: &mut Vec<Ball>) -> DVec3 {
    let Some(&largest) = balls.iter().max_by(|a, b| a.radius.total_cmp(&b.radius)) else {
        return DVec3::ZERO;
    };
    balls.retain(|b| b.reach(largest.center) > largest.radius);
    balls.push(largest);
    let (mut least, mut center) = (largest.radius, largest.center);
    let first = if balls.len() > MOST_IN_PAIRS { balls.len() - 1 } else { 0 };
    for (i, a) in balls.iter().enumerate().skip(first) {
        for b in &balls[..i] {
            let apart = a.center.distance(b.center);
            let radius = 0.5 * (apart + a.radius + b.radius);
            if radius > least && apart > 0.0 {
                least = radius;
                center = a.center + (b.center - a.center) * ((radius - a.radius) / apart);
            }
        }
    }
    if balls.len() < 3 {
        return center;
    }
    let mut best = (f64::INFINITY, center);
    for _ in 0..STEPS {
        let (mut radius, mut far) = (0.0, center);
        for b in balls.iter() {
            let reach = b.reach(center);
            if reach > radius {
                (radius, far) = (reach, b.center);
            }
        }
        if radius < best.0 {
            best = (radius, center);
        }
        let excess = radius - 0.5 * (least + best.0);
        if best.0 <= least * CLOSE_ENOUGH || far == center {
            break;
        }
        center += (far - center) * (excess / far.distance(center));
    }
    best.1
}

/// The search ends when the radius exceeds the lower bound by no more than this factor.
const CLOSE_ENOUGH: f64 = 1.001;
