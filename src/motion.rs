//! How fast the camera may move, and the clock that runs on distance travelled.

use crate::view::View;

/// Declared bounds on the camera's motion in one frame. They decide how far ahead events are scheduled, never
/// whether the cut is right: a camera that exceeds them makes the clock run faster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speed {
    /// Distance the eye moves in a frame at full speed, in object units.
    pub rho: f64,
    /// Angle the direction turns in a frame at full speed, in radians.
    pub omega: f64,
    /// Change of [`View::k`] in a frame at full speed; 0 where the tolerance is fixed.
    pub kappa: f64,
}

impl Speed {
    /// Frames until `distance` has been covered at `rate` a frame: 0 if there is nothing left to cover, infinite
    /// if nothing moves.
    #[inline(always)]
    pub(crate) fn frames(&self, distance: f64, rate: f64) -> f64 {
        if distance > 0.0 { distance / rate } else { 0.0 }
    }
}

/// What happened to the views between two frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Nothing moved.
    Rest,
    /// The views moved by so many frames at full speed.
    Frames(f64),
    /// The views can not be compared, or moved in a way that no declared speed covers: test everything.
    Unbounded,
}

/// The odometer clock: its time is distance travelled, in frames at full speed.
///
/// A camera at rest stops it, a slow one lets it creep, and one that is faster than declared makes it run further:
/// a node whose bound has not passed on this clock can not have changed its answer, whatever the camera did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Odometer {
    now: f64,
}

/// Increments are rounded up by more than the arithmetic that measures them can have lost.
const ROUND_UP: f64 = 1.0 + 1e-12;

impl Odometer {
    /// The time: frames at full speed since the start.
    #[must_use]
    pub fn now(&self) -> f64 {
        self.now
    }

    /// Advances by the motion from the views of the last frame to those of this one.
    pub fn advance(&mut self, speed: &Speed, before: &[View], after: &[View]) -> Motion {
        match Travel::between(before, after) {
            Some(travel) => self.advance_by(speed, &travel),
            None => Motion::Unbounded,
        }
    }

    /// Advances by a motion.
    pub(crate) fn advance_by(&mut self, speed: &Speed, travel: &Travel) -> Motion {
        let motion = travel.on_clock(speed);
        if let Motion::Frames(frames) = motion {
            // Millions of small steps must not be rounded away either.
            self.now = (self.now + frames).next_up();
        }
        motion
    }
}

/// How far the views have moved from one frame to the next: the most that any of them has in each way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Travel {
    moved: f64,
    turned: f64,
    steered: f64,
    is_rest: bool,
}

impl Travel {
    /// `None` if the views can not be compared.
    pub fn between(before: &[View], after: &[View]) -> Option<Self> {
        if before.len() != after.len() || !before.iter().zip(after).all(|(b, a)| b.same_cone(a)) {
            return None;
        }
        let mut travel = Self { moved: 0.0, turned: 0.0, steered: 0.0, is_rest: before == after };
        for (b, a) in before.iter().zip(after) {
            // acos of a dot product is 0 for slow pans, and the clock would stand still.
            let turned =
                2.0 * (a.direction - b.direction).length().atan2((a.direction + b.direction).length());
            travel.moved = travel.moved.max(a.eye.distance(b.eye));
            travel.turned = travel.turned.max(turned);
            travel.steered = travel.steered.max((a.k - b.k).abs());
        }
        Some(travel)
    }

    fn on_clock(&self, speed: &Speed) -> Motion {
        let mut frames = 0.0_f64;
        for (amount, rate) in
            [(self.moved, speed.rho), (self.turned, speed.omega), (self.steered, speed.kappa)]
        {
            if amount > 0.0 {
                frames = frames.max(amount / rate);
            }
        }
        if frames == 0.0 && self.is_rest {
            Motion::Rest
        } else if frames < 1e9 {
            // A motion too small for its own arithmetic to see still ticks.
            Motion::Frames((frames * ROUND_UP).max(f64::MIN_POSITIVE))
        } else {
            Motion::Unbounded
        }
    }
}
