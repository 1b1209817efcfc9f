//! The course of the clock follows the camera, and the number of tests is what that course implies.

#![expect(clippy::disallowed_methods, reason = "figures to compare with")]

use std::collections::BTreeSet;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::criterion::Criterion;
use crate::view::View;

const SPEED: Speed = Speed { rho: 1.0, omega: 0.1, kappa: 2.0 };

/// A camera with the strategy that follows it.
struct Flight {
    strategy: EventDriven,
    views: Vec<View>,
    speed: Speed,
}

/// What a frame has come to.
struct Seen {
    flips: Vec<Slot>,
    tests: u64,
}

impl Flight {
    fn new(view: View) -> Self {
        Self { strategy: EventDriven::queue_alone(), views: vec![view], speed: SPEED }
    }

    fn frame<R>(&mut self, next: &[View], act: impl FnOnce(&mut EventDriven, &Frame) -> R) -> R {
        let before = std::mem::replace(&mut self.views, next.to_vec());
        let travel = Travel::between(&before, next);
        let motion = Odometer::default().advance_by(&self.speed.into(), travel.as_ref());
        let criterion = Criterion::ScreenError;
        let frame = Frame {
            criterion,
            views: next,
            speed: self.speed,
            motion,
            travel,
            looks_ahead: false,
            cones: None,
        };
        act(&mut self.strategy, &frame)
    }

    /// To other views; what flips is not watched any more.
    fn go(&mut self, next: &[View]) -> Seen {
        self.frame(next, |strategy, frame| {
            let mut flips = Flips::default();
            strategy.find(frame, &mut flips);
            flips.unfold.append(&mut flips.fold);
            flips.unfold.iter().for_each(|&slot| strategy.changed(slot));
            flips.tests += strategy.settle(frame);
            Seen { flips: flips.unfold, tests: flips.tests }
        })
    }

    fn by(&mut self, moved: DVec3) -> Seen {
        let next: Vec<View> =
            self.views.iter().map(|view| view.with_eye(view.eye() + moved).unwrap()).collect();
        self.go(&next)
    }

    fn watch(&mut self, slot: u32, kind: Kind, bounds: Bounds) {
        let views = self.views.clone();
        self.frame(&views, |strategy, frame| strategy.watch(frame, Slot(slot), kind, bounds));
    }

    fn course(&self) -> Course {
        self.strategy.clocks[self.strategy.clock].course
    }
}

fn view() -> View {
    View::from_parts(DVec3::ZERO, DVec3::X, 0.6, 0.8, 10.0).unwrap()
}

#[track_caller]
fn assert_close(found: Course, expected: Course) {
    let is_close = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
    assert!(
        (found.heading - expected.heading).length() < 1e-9
            && is_close(found.rho, expected.rho)
            && is_close(found.stray, expected.stray)
            && is_close(found.omega, expected.omega)
            && is_close(found.kappa, expected.kappa),
        "{found:?}, not {expected:?}"
    );
}

/// Straight on at half the declared speed: the pace is a half, and other speeds are a sixteenth of the declared ones at this
/// pace. Room to stray is an eighth of the speed.
#[test]
fn the_course_of_a_camera_that_goes_straight_on_is_its_motion() {
    let heading = DVec3::new(0.6, 0.0, 0.8);
    let mut flight = Flight::new(view());
    for frame in 0..40 {
        flight.by(0.5 * heading);
        assert_eq!((flight.strategy.clock, flight.strategy.frames), (1, frame), "one course for all of it");
    }
    let course = Course { heading, rho: 0.5, stray: 0.5 / 8.0, omega: 0.1 / 32.0, kappa: 2.0 / 32.0 };
    assert_close(flight.course(), course);
    // A frame of the clock for each frame since it was started.
    let now = flight.strategy.clocks[1].odometer.now();
    assert!((now - 39.0).abs() < 1e-9, "{now}");
    // Slower, the same clock creeps: a new one would cost as much.
    (0..40).for_each(|_| _ = flight.by(0.05 * heading));
    assert_eq!((flight.strategy.clock, flight.strategy.frames), (1, 79));
    let now = flight.strategy.clocks[1].odometer.now();
    assert!((now - 43.0).abs() < 1e-9, "{now}");
    assert_close(flight.course(), course);
}

/// A camera that turns back has left its course at once. Until the means of its motion have followed it is expected anywhere.
#[test]
fn a_camera_that_turns_back_gets_a_new_course() {
    let mut flight = Flight::new(view());
    (0..40).for_each(|_| _ = flight.by(0.5 * DVec3::Y));
    let before = flight.course();
    flight.by(-0.5 * DVec3::Y);
    assert_eq!(flight.strategy.clock, 2);
    assert_close(flight.course(), Course { heading: DVec3::ZERO, rho: 0.0, stray: 0.5, ..before });
    // It is kept for a while, so that shaking does not wear out the clocks.
    for _ in 0..6 {
        flight.by(-0.5 * DVec3::Y);
        assert_eq!(flight.strategy.clock, 2);
    }
    (0..30).for_each(|_| _ = flight.by(-0.5 * DVec3::Y));
    let course = flight.course();
    assert_close(course, Course { heading: -DVec3::Y, stray: course.stray, ..before });
    assert!(course.stray >= before.stray && course.stray < 0.25, "{course:?}");
}

/// To turn on the spot at a fifth of the declared speed: the eye may move by a sixteenth of its speed at that pace.
#[test]
fn the_course_of_a_camera_that_turns_is_a_turn() {
    let slow = || {
        let mut flight = Flight::new(view());
        flight.speed.rho = 4.0;
        (0..10).for_each(|_| _ = flight.by(DVec3::X * 0.01));
        flight
    };
    let mut flight = slow();
    for frame in 1..30 {
        let angle = 0.02 * f64::from(frame);
        let next =
            flight.views[0].with_direction(DVec3::new(libm::cos(angle), libm::sin(angle), 0.0)).unwrap();
        flight.go(&[next]);
    }
    let still = Course { heading: DVec3::ZERO, rho: 0.0, stray: 0.0, omega: 0.0, kappa: 0.0 };
    assert_close(flight.course(), Course { stray: 0.8 / 16.0, omega: 0.02, kappa: 0.4 / 16.0, ..still });
    assert_eq!(flight.strategy.clock, 2);
    // And if nothing but the tolerance changes, by a quarter of what has been declared.
    let mut flight = slow();
    (1..30)
        .for_each(|frame| _ = flight.go(&[flight.views[0].with_k(10.0 + 0.5 * f64::from(frame)).unwrap()]));
    assert_close(flight.course(), Course { stray: 1.0 / 16.0, omega: 0.025 / 16.0, kappa: 0.5, ..still });
    // To turn at full speed, and go on slowly: a sixteenth of the declared speed where the camera goes, an eighth of that astray.
    let mut flight = slow();
    for frame in 1..40 {
        let (angle, eye) = (0.1 * f64::from(frame), DVec3::X * (0.1 + 0.125 * f64::from(frame)));
        let direction = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
        flight.go(&[view().with_eye(eye).and_then(|view| view.with_direction(direction)).unwrap()]);
    }
    let expected =
        Course { heading: DVec3::X, rho: 4.0 / 16.0, stray: 0.5 / 16.0, omega: 0.1, kappa: 2.0 / 16.0 };
    assert_close(flight.course(), expected);
    // What no speed is declared for has none.
    let mut flight = Flight::new(view());
    flight.speed = Speed { rho: 1.0, omega: 0.0, kappa: 0.0 };
    (1..30).for_each(|_| _ = flight.by(DVec3::Z));
    assert_close(flight.course(), Course { heading: DVec3::Z, rho: 1.0, stray: 0.125, ..still });
}

/// A camera that swerves is given room to: half as much again as it has strayed from its mean motion. Two cameras that part are
/// given room by the faster one.
#[test]
fn there_is_room_for_what_the_camera_strays() {
    let mut flight = Flight::new(view());
    let mut most = 0.0_f64;
    for frame in 0..60 {
        let side = if frame % 2 == 0 { 0.1 } else { -0.1 };
        flight.by(DVec3::new(0.8, side, 0.0));
        most = most.max(flight.strategy.strayed);
    }
    // The mean of +0.1 and -0.1, newer ones counting a quarter, swings by 0.1 / 7 about the way: 6 / 7 of 0.1 are left.
    let course = flight.course();
    assert!((course.heading - DVec3::X).length() < 0.025 && (course.rho - 0.8).abs() < 0.01, "{course:?}");
    assert!((0.08..0.086).contains(&most), "{most}");
    assert!((0.1..0.13).contains(&course.stray), "{course:?}");
    assert!(flight.strategy.clock <= 3, "{} courses", flight.strategy.clock);

    // One that zigzags by half as much as it goes on would need more room than half of its speed: it is expected anywhere.
    let mut flight = Flight::new(view());
    for frame in 0..60 {
        flight.by(DVec3::new(0.5, if frame % 2 == 0 { 0.25 } else { -0.25 }, 0.0));
    }
    let course = flight.course();
    assert!(course.heading == DVec3::ZERO && (course.stray - 0.3125_f64.sqrt()).abs() < 1e-9, "{course:?}");

    let mut flight = Flight::new(view());
    flight.views.push(view());
    for frame in 1..30 {
        let x = 0.1 * f64::from(frame);
        flight.go(&[view(), view().with_eye(DVec3::new(0.0, 3.0 * x, 0.0)).unwrap()]);
    }
    assert!((flight.course().stray - 0.3).abs() < 1e-9, "{:?}", flight.course());
}

/// However the camera shakes, a course is kept for six frames at least, and there are enough clocks.
#[test]
fn shaking_does_not_wear_out_the_clocks() {
    let mut random = Pcg64Mcg::seed_from_u64(9);
    let mut flight = Flight::new(view());
    let (mut changes, mut last) = (0, None);
    for frame in 0..2_000_u32 {
        let size = [0.01, 0.3, 2.0][random.random_range(0..3)];
        let before = flight.strategy.clock;
        flight.by(DVec3::from([0; 3].map(|_| random.random_range(-size..size))));
        if flight.strategy.clock != before {
            assert_eq!(flight.strategy.clock, (before + 1) % CLOCKS);
            assert!(last.is_none_or(|last| frame - last > LEAST_FRAMES), "frame {frame}, after {last:?}");
            (changes, last) = (changes + 1, Some(frame));
        }
    }
    assert!((30..280).contains(&changes), "{changes} courses");
}

/// Half of all directions are ahead: a frame straight on at full speed costs half of one anywhere.
#[test]
fn costs_are_in_terms_of_the_declared_speeds() {
    let course = Course { heading: DVec3::X, rho: 0.5, stray: 0.125, omega: 0.03, kappa: 0.2 };
    assert!((cost(&course, &SPEED) - (0.25 + 0.125 + 0.3 + 0.1)).abs() < 1e-12);
    assert!((cost(&Course::from(SPEED), &SPEED) - 3.0).abs() < 1e-12);
    let faster = Speed { rho: 2.0, omega: 0.2, kappa: 8.0 };
    assert!((cost(&course, &faster) - (0.1875 + 0.15 + 0.025)).abs() < 1e-12);
    for none in [0.0, -1.0, f64::NAN] {
        assert_eq!(cost(&course, &Speed { rho: none, omega: none, kappa: none }), 0.0);
    }
}

const NODE: Bounds = Bounds { center: [0.0; 3], radius: 1.0, eps: 1.0 };

/// Straight at a node that is coarse within 11: each test allows for an eighth more speed and comes up an eighth to a quarter early, so
/// between two thirds and eight ninths of the way are behind the camera at the next one. The number of tests is
/// logarithmic in the way.
#[test]
fn a_node_that_is_approached_is_tested_as_often_as_its_distance_halves() {
    for way in [100.0, 1_000.0, 10_000.0] {
        let mut flight = Flight::new(view().with_eye(DVec3::new(-11.0 - way, 0.0, 0.0)).unwrap());
        flight.watch(7, Kind::Unfold, NODE);
        let mut tests = 0;
        let mut frames = 0.0;
        let found = loop {
            let seen = flight.by(DVec3::X * 0.5);
            tests += seen.tests;
            frames += 1.0;
            if !seen.flips.is_empty() {
                break seen.flips;
            }
        };
        assert_eq!((found, frames), (vec![Slot(7)], 2.0 * way));
        let steps = 2.0 * way;
        // The first two are those of the first frame, when nothing is known of the camera.
        let (fewest, most) = (1.0 + steps.ln() / 9.0_f64.ln(), 4.0 + steps.ln() / 3.0_f64.ln());
        assert!((fewest..most).contains(&(tests as f64)), "{tests} tests, not {fewest} to {most}");
    }
}

/// Away from a node, no more than the room to stray can bring it nearer; past one that is active, nothing folds it for long; at
/// rest nothing is tested.
#[test]
fn what_the_camera_leaves_behind_is_hardly_tested() {
    let mut flight = Flight::new(view().with_eye(DVec3::new(20.0, 0.0, 0.0)).unwrap());
    flight.by(DVec3::X);
    flight.watch(7, Kind::Unfold, NODE);
    let tests: u64 = (0..1_000).map(|_| flight.by(DVec3::X).tests).sum();
    // 20 away, in view of nobody: the sphere is reached by straying for 20 * 8 frames, then for 180 * 8.
    assert!((2..=4).contains(&tests), "{tests}");
    assert_eq!((0..100).map(|_| flight.by(DVec3::ZERO).tests).sum::<u64>(), 0);
}

/// What a motion makes due is known before it is made.
#[test]
fn what_is_foreseen_is_what_is_tested() {
    let mut random = Pcg64Mcg::seed_from_u64(10);
    let mut flight = Flight::new(view());
    for slot in 2..400 {
        let bounds = Bounds {
            center: [0; 3].map(|_| random.random_range(-30.0..30.0)),
            radius: random.random_range(0.1..2.0),
            eps: random.random_range(0.1..2.0),
        };
        let wanted = Criterion::ScreenError.unfold(&flight.views, &bounds);
        flight.watch(slot, if wanted { Kind::Fold } else { Kind::Unfold }, bounds);
    }
    flight.by(DVec3::ZERO);
    let mut all = [0; 2];
    for frame in 0..400 {
        let next = flight.views[0]
            .with_eye(flight.views[0].eye() + DVec3::new(0.02, 0.01 * f64::from(frame % 3), 0.0));
        let next = [next.unwrap()];
        let due = |travels: &[Option<Travel>]| {
            let mut due = BTreeSet::new();
            flight.strategy.for_each_due(|| travels.iter().copied(), |event| _ = due.insert(event.slot));
            due
        };
        let travel = Travel::between(&flight.views, &next);
        let foreseen = due(&[travel]);
        assert_eq!(
            due(&[Travel::between(&flight.views, &flight.views), travel]),
            foreseen,
            "the furthest counts"
        );
        assert!(due(&[]).is_subset(&foreseen));
        let mut watched = BTreeSet::new();
        flight.strategy.for_each_watched(&mut |slot, _, _| _ = watched.insert(slot));
        assert_eq!(due(&[None, travel]), watched, "anything may be due where views can not be compared");
        let clock = flight.strategy.clock;
        let seen = flight.go(&next);
        assert!(seen.flips.iter().all(|slot| foreseen.contains(slot)));
        if flight.strategy.clock == clock {
            assert_eq!(seen.tests, foreseen.len() as u64, "frame {frame}");
            all[0] += 1;
        }
        all[1] += foreseen.len();
    }
    assert!(all[0] > 300 && all[1] > 100, "{all:?}");
}

/// What has been refused is pressing: it is due at rest.
#[test]
fn what_is_refused_is_found_again_at_rest() {
    let mut flight = Flight::new(view().with_eye(DVec3::new(-5.0, 0.0, 0.0)).unwrap());
    let views = flight.views.clone();
    for _ in 0..3 {
        flight.frame(&views, |strategy, _| strategy.refused(Slot(3), Kind::Unfold, NODE));
        let mut due = Vec::new();
        flight.strategy.for_each_due(std::iter::empty, |event| due.push(event.slot));
        assert_eq!(due, [Slot(3)]);
        let seen = flight.go(&views);
        assert_eq!((seen.flips, seen.tests), (vec![Slot(3)], 1));
        assert_eq!(flight.go(&views).tests, 0);
    }
}

/// As many at a time as there are lanes, whatever has been cancelled meanwhile, and with more views than the filter takes.
#[test]
fn batches_are_tested_whole() {
    for (count, views) in [(1, 1), (15, 1), (16, 1), (17, 2), (33, 1), (100, 9), (31, 9), (16, 9)] {
        let mut flight = Flight::new(view());
        flight.views = vec![view().with_eye(DVec3::new(-5.0, 0.0, 0.0)).unwrap(); views];
        (1..=count).for_each(|slot| flight.watch(slot, Kind::Unfold, NODE));
        // Every fourth is cancelled before it has been scheduled, and every fifth after that.
        (1..=count).filter(|slot| slot % 4 == 0).for_each(|slot| flight.strategy.unwatch(Slot(slot)));
        let left: Vec<u32> = (1..=count).filter(|slot| slot % 4 != 0).collect();
        let same = flight.views.clone();
        let tests = flight.frame(&same, EventDriven::settle);
        assert_eq!(tests, left.len() as u64);
        (1..=count).filter(|slot| slot % 5 == 0).for_each(|slot| flight.strategy.unwatch(Slot(slot)));
        let left: Vec<Slot> = left.into_iter().filter(|slot| slot % 5 != 0).map(Slot).collect();
        let mut seen = flight.by(DVec3::X * 0.01);
        seen.flips.sort_unstable();
        assert_eq!((seen.tests, seen.flips), (left.len() as u64, left));
    }
}
