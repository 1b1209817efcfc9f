//! How fast the camera may move, and the clock that runs on distance travelled.

use glam::DVec3;

use crate::view::View;

/// Declared bounds on the camera's motion in one frame. They decide how far ahead events are scheduled, never
/// whether the cut is right: a camera that exceeds them makes the clock run faster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speed {
    /// Distance the eye moves in a frame at full speed, in object units. Where it is 0, or no number above 0, no motion
    /// is covered.
    pub rho: f64,
    /// Angle the direction turns in a frame at full speed, in radians; 0 as for `rho`.
    pub omega: f64,
    /// Change of [`View::k`] in a frame at full speed; 0 where the tolerance is fixed.
    pub kappa: f64,
}

/// How the camera may move in one frame of a clock: the eye forward along a heading by up to `rho` and besides in any
/// direction by up to `stray`; the direction turns by up to `omega`, and `k` changes by up to `kappa`.
///
/// With a heading, the clock knows that what is ahead comes nearer and what is behind or beside does not, or not as
/// fast: see [`Criterion::earliest_unfold`](crate::criterion::Criterion::earliest_unfold). Like [`Speed`], a course
/// decides how far ahead events are scheduled, never whether the cut is right: a camera that strays from it makes the
/// clock run faster.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// Unit vector, or zero where there is no heading.
    pub heading: DVec3,
    /// Distance along the heading, in object units.
    pub rho: f64,
    /// Distance in any direction, in object units.
    pub stray: f64,
    /// See [`Speed::omega`].
    pub omega: f64,
    /// See [`Speed::kappa`].
    pub kappa: f64,
}

impl From<Speed> for Course {
    /// In any direction by up to `rho`.
    fn from(Speed { rho, omega, kappa }: Speed) -> Self {
        Self { heading: DVec3::ZERO, rho: 0.0, stray: rho, omega, kappa }
    }
}

impl Course {
    /// Frames until `distance` has been covered at `rate` a frame: 0 if there is nothing left to cover, infinite
    /// if nothing moves.
    #[inline(always)]
    pub(crate) fn frames(&self, distance: f64, rate: f64) -> f64 {
        if distance > 0.0 { distance / rate } else { 0.0 }
    }

    /// The fewest frames that allow for the eye to move by `moved`: forward by no more than `rho` a frame, the rest of it
    /// by no more than `stray`.
    fn frames_to_move(&self, moved: DVec3) -> f64 {
        let forward = moved.dot(self.heading);
        if forward > 0.0 && self.rho > 0.0 {
            let astray = moved - forward * self.heading;
            later(frames_for(forward, self.rho), frames_for(length(astray), self.stray))
        } else {
            frames_for(length(moved), self.stray)
        }
    }
}

/// Frames that an amount takes at a rate; infinite where there is an amount and no rate. What is not a number is not
/// nothing: a camera that can not be compared has not been at rest.
fn frames_for(amount: f64, rate: f64) -> f64 {
    match amount {
        0.0 => 0.0,
        _ if rate > 0.0 => amount / rate,
        _ => f64::INFINITY,
    }
}

/// The larger of two; what is not a number is larger than all that is.
fn later(a: f64, b: f64) -> f64 {
    if b > a || b.is_nan() { b } else { a }
}

/// The length of a vector, or more where its squares are lost.
fn length(v: DVec3) -> f64 {
    let length = v.length();
    if length < 1e-150 { 2.0 * v.abs().max_element() } else { length }
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
    pub fn advance(&mut self, course: &Course, before: &[View], after: &[View]) -> Motion {
        self.advance_by(course, Travel::between(before, after).as_ref())
    }

    /// The time after a motion; infinite where no declared speed covers it.
    pub(crate) fn after(&self, course: &Course, travel: &Travel) -> f64 {
        match travel.on_course(course) {
            Motion::Rest => self.now,
            Motion::Frames(frames) => (self.now + frames).next_up(),
            Motion::Unbounded => f64::INFINITY,
        }
    }

    /// Advances by a motion; `None` is one between views that can not be compared.
    pub(crate) fn advance_by(&mut self, course: &Course, travel: Option<&Travel>) -> Motion {
        let motion = travel.map_or(Motion::Unbounded, |travel| travel.on_course(course));
        if let Motion::Frames(frames) = motion {
            // Millions of small steps must not be rounded away either.
            self.now = (self.now + frames).next_up();
        }
        motion
    }
}

/// How far the views have moved from one frame to the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Travel<'a> {
    before: &'a [View],
    after: &'a [View],
    /// The most that any of them has turned, and that the `k` of any has changed.
    pub turned: f64,
    pub steered: f64,
    is_rest: bool,
}

impl<'a> Travel<'a> {
    /// `None` if the views can not be compared.
    pub fn between(before: &'a [View], after: &'a [View]) -> Option<Self> {
        if before.len() != after.len() || !before.iter().zip(after).all(|(b, a)| b.same_cone(a)) {
            return None;
        }
        let mut travel = Self { before, after, turned: 0.0, steered: 0.0, is_rest: before == after };
        for (b, a) in before.iter().zip(after) {
            // acos of a dot product is 0 for slow pans, and the clock would stand still.
            let chord = length(a.direction() - b.direction());
            let turned = 2.0 * libm::atan2(chord, (a.direction() + b.direction()).length());
            let steered = (a.k() - b.k()).abs();
            // Below, and wherever a largest is looked for, what is not a number would be passed over.
            let compared = (a.eye() - b.eye()) + (a.direction() - b.direction());
            if !(compared.is_finite() && turned.is_finite() && steered.is_finite()) {
                return None;
            }
            travel.turned = travel.turned.max(turned);
            travel.steered = travel.steered.max(steered);
        }
        Some(travel)
    }

    /// How each eye has moved.
    pub fn moves(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.before.iter().zip(self.after).map(|(b, a)| a.eye() - b.eye())
    }

    fn on_course(&self, course: &Course) -> Motion {
        let mut frames = self.moves().map(|moved| course.frames_to_move(moved)).fold(0.0, later);
        for (amount, rate) in [(self.turned, course.omega), (self.steered, course.kappa)] {
            frames = later(frames, frames_for(amount, rate));
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

#[cfg(test)]
mod tests {
    use super::*;

    fn view(x: f64) -> View {
        View::from_parts(DVec3::new(x, 0.0, 0.0), DVec3::Z, 0.8, 0.6, 10.0).unwrap()
    }

    const FULL: Speed = Speed { rho: 0.5, omega: 0.1, kappa: 1.0 };

    #[test]
    fn what_is_no_number_is_no_rest() {
        let right = view(1.0);
        for nan in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let (eye, direction) = (right.eye(), right.direction());
            for wrong in [
                View::unchecked(DVec3::new(0.0, nan, 0.0), direction, 0.8, 0.6, 10.0),
                View::unchecked(eye, DVec3::new(nan, 0.0, 1.0), 0.8, 0.6, 10.0),
                View::unchecked(eye, direction, nan, 0.6, 10.0),
                View::unchecked(eye, direction, 0.8, 0.6, nan),
            ] {
                for views in [[[right], [wrong]], [[wrong], [right]], [[wrong], [wrong]]] {
                    let mut clock = Odometer::default();
                    let motion = clock.advance(&FULL.into(), &views[0], &views[1]);
                    // A cone of infinity is the same as before.
                    let is_same = views[0] == views[1] && wrong.cos_beta().is_infinite();
                    assert_eq!(motion, if is_same { Motion::Rest } else { Motion::Unbounded }, "{views:?}");
                }
            }
        }
    }

    #[test]
    fn a_motion_at_no_speed_is_not_covered() {
        let turned = view(1.0).with_direction(DVec3::new(0.6, 0.0, 0.8)).unwrap();
        let steered = view(1.0).with_k(11.0).unwrap();
        for none in [0.0, -0.0, -1.0, f64::NAN] {
            for (speed, after) in [
                (Speed { rho: none, ..FULL }, view(1.0 + 1e-9)),
                (Speed { omega: none, ..FULL }, turned),
                (Speed { kappa: none, ..FULL }, steered),
            ] {
                let motion = |after| Odometer::default().advance(&speed.into(), &[view(1.0)], &[after]);
                assert_eq!(motion(after), Motion::Unbounded, "{speed:?}");
                assert_eq!(motion(view(1.0)), Motion::Rest, "{speed:?}");
            }
            let course = Course { heading: DVec3::X, rho: 1.0, stray: none, omega: 1.0, kappa: 1.0 };
            let motion = |x| Odometer::default().advance(&course, &[view(1.0)], &[view(x)]);
            assert!(matches!(motion(1.5), Motion::Frames(_)), "straight on");
            assert_eq!(motion(0.5), Motion::Unbounded, "back");
        }
    }

    /// Squares of these are lost.
    #[test]
    fn the_smallest_motion_is_measured() {
        for step in [1e-170, 1e-200, 5e-324] {
            let slow = Speed { rho: step, ..FULL };
            let motion = Odometer::default().advance(&slow.into(), &[view(0.0)], &[view(step)]);
            assert!(matches!(motion, Motion::Frames(frames) if frames >= 1.0), "{step}: {motion:?}");
        }
    }

    /// Frames of a motion from the view at 0 to another one.
    fn frames(course: &Course, after: View) -> f64 {
        match Odometer::default().advance(course, &[view(0.0)], &[after]) {
            Motion::Frames(frames) => frames,
            motion => panic!("{motion:?}"),
        }
    }

    #[track_caller]
    fn assert_about(found: f64, expected: f64) {
        assert!((found / expected - 1.0).abs() < 1e-9, "{found}, not {expected}");
    }

    /// The clock runs by whatever of the motion takes longest at its speed.
    #[test]
    fn a_motion_takes_as_long_as_the_slowest_part_of_it() {
        let full = Course::from(FULL);
        let to = |x: f64, y: f64, z: f64| view(0.0).with_eye(DVec3::new(x, y, z)).unwrap();
        assert_about(frames(&full, to(1.0, 2.0, -2.0)), 3.0 / 0.5);
        // A turn by the angle whose tangent is 3/4, and a tolerance that gets coarser or finer.
        let turned = view(0.0).with_direction(DVec3::new(0.6, 0.0, 0.8)).unwrap();
        assert_about(frames(&full, turned), libm::atan2(0.6, 0.8) / 0.1);
        let about = view(0.0).with_direction(-DVec3::Z).unwrap();
        assert_about(frames(&full, about), std::f64::consts::PI / 0.1);
        assert_about(frames(&full, view(0.0).with_k(14.0).unwrap()), 4.0);
        assert_about(frames(&full, view(0.0).with_k(7.0).unwrap()), 3.0);
        // All of it at once.
        let all = |x: f64, k: f64| {
            turned.with_eye(DVec3::new(x, 0.0, 0.0)).and_then(|view| view.with_k(k)).unwrap()
        };
        assert_about(frames(&full, all(5.0, 11.0)), 10.0);
        assert_about(frames(&full, all(1.0, 22.0)), 12.0);
        assert_about(frames(&full, all(1.0, 11.0)), libm::atan2(0.6, 0.8) / 0.1);
        // With a heading: so far forward, and so far astray.
        let ahead = Course { heading: DVec3::X, rho: 2.0, stray: 0.25, ..full };
        assert_about(frames(&ahead, to(6.0, 0.0, 0.0)), 3.0);
        assert_about(frames(&ahead, to(6.0, 0.3, 0.4)), 3.0);
        assert_about(frames(&ahead, to(6.0, 0.6, 0.8)), 4.0);
        assert_about(frames(&ahead, to(0.0, 3.0, 0.0)), 12.0);
        // Back is astray, all of it.
        assert_about(frames(&ahead, to(-3.0, 4.0, 0.0)), 20.0);
        assert_about(frames(&Course { rho: 0.0, ..ahead }, to(1.0, 0.0, 0.0)), 4.0);
    }

    /// Of several views the one that has moved most counts, whichever it is.
    #[test]
    fn of_several_views_the_fastest_counts() {
        let turned = |view: View, x: f64| view.with_direction(DVec3::new(x, 0.0, 1.0).normalize()).unwrap();
        let full = Course::from(FULL);
        let before = [view(0.0), view(5.0), view(9.0)];
        let after = [turned(view(0.0), 0.1), view(7.0).with_k(11.5).unwrap(), turned(view(9.5), 0.2)];
        for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1]] {
            let (before, after) = (order.map(|at| before[at]), order.map(|at| after[at]));
            let travel = Travel::between(&before, &after).unwrap();
            assert_about(travel.turned, libm::atan2(0.2, 1.0));
            assert_about(travel.steered, 1.5);
            let moves: Vec<f64> = travel.moves().map(|moved| moved.x).collect();
            assert_eq!(moves, order.map(|at| [0.0, 2.0, 0.5][at]));
            assert_eq!(Odometer::default().advance(&full, &before, &before), Motion::Rest);
            let mut clock = Odometer::default();
            let Motion::Frames(frames) = clock.advance(&full, &before, &after) else { panic!("no frames") };
            assert_about(frames, 4.0);
        }
    }

    /// Time passes while there is motion, and its sum is that of the parts; to foresee it is not to let it pass.
    #[test]
    fn the_clock_counts_what_has_been_travelled() {
        let course = Course::from(FULL);
        let mut clock = Odometer::default();
        for (step, x) in [(0, 1.0), (1, 1.5), (2, 1.5), (3, 0.0)] {
            let before = [view([0.0, 1.0, 1.5, 1.5][step])];
            let after = [view(x)];
            let travel = Travel::between(&before, &after).unwrap();
            let then = clock.after(&course, &travel);
            let motion = clock.advance(&course, &before, &after);
            assert_eq!(clock.now(), then);
            assert_about(clock.now(), [2.0, 3.0, 3.0, 6.0][step]);
            assert_eq!(motion == Motion::Rest, step == 2);
        }
        // What no speed covers has no end, and does not move the clock.
        let before = clock.now();
        let far = [view(0.0), view(1e9)].map(|view| [view]);
        let travel = Travel::between(&far[0], &far[1]).unwrap();
        assert_eq!(clock.after(&course, &travel), f64::INFINITY);
        assert_eq!(clock.advance(&course, &far[0], &far[1]), Motion::Unbounded);
        assert_eq!(clock.now(), before);
        // However small a step is, the clock moves.
        let small = [view(0.0), view(5e-324)].map(|view| [view]);
        for _ in 0..3 {
            let before = clock.now();
            assert!(matches!(clock.advance(&course, &small[0], &small[1]), Motion::Frames(_)));
            assert!(clock.now() > before);
        }
    }

    #[test]
    fn other_views_can_not_be_compared() {
        let wide = view(0.0).with_cone(0.6, 0.8).unwrap();
        let course = Course::from(FULL);
        let motion = |before: &[View], after: &[View]| Odometer::default().advance(&course, before, after);
        assert_eq!(motion(&[view(0.0)], &[wide]), Motion::Unbounded);
        assert_eq!(motion(&[view(0.0)], &[view(0.0), view(0.0)]), Motion::Unbounded);
        assert_eq!(motion(&[view(0.0), wide], &[view(0.0), view(0.0)]), Motion::Unbounded);
        assert_eq!(motion(&[], &[view(0.0)]), Motion::Unbounded);
        assert_eq!(motion(&[], &[]), Motion::Rest);
        assert_eq!(motion(&[view(0.0), wide], &[view(0.0), wide]), Motion::Rest);
        // A billion frames and more are no motion that anybody has declared.
        assert!(matches!(motion(&[view(0.0)], &[view(4.9e8)]), Motion::Frames(_)));
        assert_eq!(motion(&[view(0.0)], &[view(5.1e8)]), Motion::Unbounded);
    }

    #[test]
    fn frames_to_a_mark() {
        let course = Course::from(FULL);
        assert_eq!(course.frames(3.0, 0.5), 6.0);
        assert_eq!((course.frames(0.0, 0.5), course.frames(-1.0, 0.5)), (0.0, 0.0));
        assert_eq!(course.frames(1.0, 0.0), f64::INFINITY);
        assert_eq!(later(1.0, 2.0), 2.0);
        assert_eq!(later(2.0, 1.0), 2.0);
        assert!(later(1.0, f64::NAN).is_nan() && later(f64::NAN, 1.0).is_nan());
    }
}
