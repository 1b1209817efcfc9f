//! Where the views are going: recent motion, carried on.
//!
//! Every quantity goes on at the rate of the last frame, where the frame before bears it out: a camera that has just jumped
//! is not expected to jump again, nor one that has just started to be at full speed. Means over more frames are worse along
//! every path that was tried, recorded or real, as they lag behind; accelerations are worse where the motion is not smooth
//! (see the record of the comparison).
//!
//! Rotations are taken as Rodrigues vectors, `axis tan(angle / 2)`: from one unit vector to another that is
//! `(a x b) / (1 + a.b)`, and to apply it is a rational function too. So nothing here needs the trigonometric functions of
//! a platform, and what is foreseen is the same everywhere.

use glam::DVec3;

use crate::motion::Speed;
use crate::view::View;

/// A rate is at most so many times the one of the frame before.
const MOST: f64 = 2.0;

/// What is slower than this share of full speed needs no frame before that bears it out.
const LEAST: f64 = 1.0 / 32.0;

/// What happens to a view in one frame.
#[derive(Clone, Copy, Debug, Default)]
struct Rate {
    /// Displacement of the eye, in object units.
    moved: DVec3,
    /// Rotation of the direction, as a Rodrigues vector.
    turned: DVec3,
    /// Change of `k`.
    steered: f64,
    /// Change of the cone's half-angle, as the tangent of its half.
    widened: f64,
}

impl Rate {
    fn between(before: &View, after: &View) -> Self {
        let (a, b) = (before.direction(), after.direction());
        // To turn round within a frame says nothing of the next.
        let turned = if a.dot(b) > 0.0 { a.cross(b) / (1.0 + a.dot(b)) } else { DVec3::ZERO };
        let (old, new) = ([before.cos_beta(), before.sin_beta()], [after.cos_beta(), after.sin_beta()]);
        let (cosine, sine) = (new[0] * old[0] + new[1] * old[1], new[1] * old[0] - new[0] * old[1]);
        Self {
            moved: after.eye() - before.eye(),
            turned,
            steered: after.k() - before.k(),
            widened: sine / (1.0 + cosine),
        }
    }

    /// The rate to go on with after two frames.
    fn carried_on(earlier: &Self, latest: &Self, speed: &Speed) -> Self {
        let vector = |earlier: DVec3, latest: DVec3, declared: f64| {
            let most = MOST * earlier.length().max(declared * LEAST);
            latest.clamp_length_max(most)
        };
        let scalar = |earlier: f64, latest: f64| {
            let most = MOST * earlier.abs();
            latest.clamp(-most, most)
        };
        Self {
            moved: vector(earlier.moved, latest.moved, speed.rho),
            turned: vector(earlier.turned, latest.turned, 0.5 * speed.omega),
            steered: scalar(earlier.steered, latest.steered),
            widened: scalar(earlier.widened, latest.widened),
        }
    }

    fn is_zero(&self) -> bool {
        self.moved == DVec3::ZERO && self.turned == DVec3::ZERO && self.steered == 0.0 && self.widened == 0.0
    }

    /// The view a frame later; the same where that would be none.
    fn apply(&self, view: &View) -> View {
        let turn = 2.0 / (1.0 + self.turned.length_squared());
        let across = self.turned.cross(view.direction());
        let direction = view.direction() + turn * (across + self.turned.cross(across));
        let (mut cos_beta, mut sin_beta) = (view.cos_beta(), view.sin_beta());
        if self.widened != 0.0 {
            let w = self.widened;
            let wider = ((1.0 - w * w) * cos_beta - 2.0 * w * sin_beta).clamp(-1.0, 1.0) / (1.0 + w * w);
            let sine = ((1.0 - w * w) * sin_beta + 2.0 * w * cos_beta) / (1.0 + w * w);
            // A cone stays one.
            if wider > 0.0 && sine > 0.0 {
                (cos_beta, sin_beta) = (wider, sine);
            }
        }
        let direction = direction.normalize_or(view.direction());
        let k = (view.k() + self.steered).max(1.0);
        View::from_parts(view.eye() + self.moved, direction, cos_beta, sin_beta, k).unwrap_or(*view)
    }
}

/// How the views have been moving.
#[derive(Debug, Default)]
pub(super) struct Trend {
    /// Of each view, its rates in the last frame but one and in the last.
    rates: Vec<[Rate; 2]>,
}

impl Trend {
    /// Nothing is known of the motion any more.
    pub fn forget(&mut self) {
        self.rates.clear();
    }

    /// A frame has passed.
    pub fn observe(&mut self, before: &[View], after: &[View]) {
        if before.len() != after.len() {
            self.rates.clear();
            return;
        }
        self.rates.resize(after.len(), [Rate::default(); 2]);
        for (rates, (before, after)) in self.rates.iter_mut().zip(before.iter().zip(after)) {
            *rates = [rates[1], Rate::between(before, after)];
        }
    }

    /// Appends the views of a later instant: those of each of the `instants`, counted in frames from now and in ascending
    /// order. Returns whether anything moves.
    pub fn carry_on(&self, now: &[View], instants: &[u32], speed: &Speed, views: &mut Vec<View>) -> bool {
        let mut moves = false;
        let first = views.len();
        for _ in instants {
            views.extend_from_slice(now);
        }
        for (at, rates) in self.rates.iter().enumerate().take(now.len()) {
            let rate = Rate::carried_on(&rates[0], &rates[1], speed);
            if rate.is_zero() {
                continue;
            }
            moves = true;
            let (mut view, mut frame) = (now[at], 0);
            for (number, &instant) in instants.iter().enumerate() {
                while frame < instant {
                    view = rate.apply(&view);
                    frame += 1;
                }
                views[first + number * now.len() + at] = view;
            }
        }
        moves
    }
}
