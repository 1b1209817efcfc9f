//! The event queue against an ordered map, and the time bounds against random motion.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::f64::consts::PI;

use foldfront::Bounds;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::in_play::{Kind, Slot};
use foldfront::selection::motion::{Course, Motion, Odometer};
use foldfront::selection::queue::{DUE, Event, EventQueue, HORIZON, TICKS_PER_FRAME};
use foldfront::selection::view::{Camera, View};
use glam::DVec3;
use proptest::prelude::*;
use rand::RngExt;
use rand_pcg::Pcg64;

use crate::common::{direction, seeded};

#[derive(Clone, Debug)]
enum Operation {
    Schedule {
        node: u32,
        clock: usize,
        frames: f64,
    },
    Press {
        node: u32,
    },
    Cancel {
        node: u32,
    },
    /// So often that what is cancelled is swept out.
    CancelOften {
        node: u32,
        times: u32,
    },
    Advance {
        clock: usize,
        frames: f64,
    },
    Rest,
    TakeClock {
        clock: usize,
    },
    TakeAll,
}

fn operation() -> impl Strategy<Value = Operation> {
    let node = 0..40_u32;
    let frames = prop_oneof![Just(0.0), 0.0..2.0, 0.0..100.0, 0.0..1e7, Just(1e30), Just(f64::INFINITY)];
    let motion = prop_oneof![Just(1e-300), 0.0..0.2, 0.0..3.0, 0.0..500.0, 0.0..1e6];
    prop_oneof![
        6 => (node.clone(), 0..CLOCKS, frames)
            .prop_map(|(node, clock, frames)| Operation::Schedule { node, clock, frames }),
        1 => node.clone().prop_map(|node| Operation::Press { node }),
        2 => node.clone().prop_map(|node| Operation::Cancel { node }),
        1 => (node, 1000..3000_u32).prop_map(|(node, times)| Operation::CancelOften { node, times }),
        6 => (0..CLOCKS, motion).prop_map(|(clock, frames)| Operation::Advance { clock, frames }),
        1 => Just(Operation::Rest),
        1 => (0..CLOCKS).prop_map(|clock| Operation::TakeClock { clock }),
        1 => Just(Operation::TakeAll),
    ]
}

/// The model: for each scheduled node, its clock, when it was scheduled and its deadline, or none if it presses.
type Model = BTreeMap<u32, Option<(usize, f64, f64)>>;

const CLOCKS: usize = 2;

const BOUNDS: Bounds = Bounds { center: [0.0; 3], radius: 1.0, eps: 0.0 };

/// Every event that has come up.
fn all_due(queue: &mut EventQueue) -> Vec<Event> {
    let (mut all, mut due) = (Vec::new(), [Event::BLANK; DUE]);
    loop {
        match queue.next_due(&mut due) {
            0 => return all,
            count => all.extend_from_slice(&due[..count]),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// Every event comes up exactly once and never late; never much too early; a cancelled one never does; events
    /// whose deadline lies in the tick that their clock is in come up at every advance.
    #[test]
    fn queue_agrees_with_an_ordered_map(operations in prop::collection::vec(operation(), 1..200)) {
        let mut queue = EventQueue::new(CLOCKS);
        let mut model = Model::new();
        let mut now = [0.0; CLOCKS];
        for operation in operations {
            match operation {
                Operation::Schedule { node, clock, frames } => {
                    if let Entry::Vacant(entry) = model.entry(node) {
                        let event = queue.event(Slot(node), Kind::Unfold, BOUNDS);
                        queue.schedule(clock, frames, event);
                        entry.insert(Some((clock, now[clock], now[clock] + frames)));
                    }
                    continue;
                }
                Operation::Press { node } => {
                    if let Entry::Vacant(entry) = model.entry(node) {
                        let event = queue.event(Slot(node), Kind::Unfold, BOUNDS);
                        queue.press(event);
                        entry.insert(None);
                    }
                    continue;
                }
                Operation::CancelOften { node, times } => {
                    model.remove(&node);
                    (0..times).for_each(|_| queue.cancel(Slot(node)));
                    continue;
                }
                Operation::Cancel { node } => {
                    model.remove(&node);
                    queue.cancel(Slot(node));
                    continue;
                }
                Operation::Advance { clock, frames } => {
                    now[clock] += frames;
                    let now = now[clock];
                    queue.advance(clock, now);
                    let due = all_due(&mut queue);
                    for event in &due {
                        let scheduled = model.remove(&event.slot.0);
                        prop_assert!(scheduled.is_some(), "node {} came up unscheduled", event.slot.0);
                        if let Some(Some((its_clock, since, deadline))) = scheduled {
                            prop_assert_eq!(its_clock, clock);
                            // A slot is at most a quarter as wide as the time it was ahead; the horizon is finite.
                            let horizon = f64::from(HORIZON) / TICKS_PER_FRAME;
                            let early = deadline.min(since + horizon) - now;
                            prop_assert!(
                                early <= (deadline - since) / 4.0 + 1.0 / TICKS_PER_FRAME,
                                "scheduled at {since} for {deadline}, came up at {now}"
                            );
                        }
                    }
                    for (node, scheduled) in &model {
                        let is_late = |(its_clock, _, deadline)| its_clock == clock && deadline <= now;
                        prop_assert!(scheduled.is_some_and(|s| !is_late(s)), "node {node} is late");
                    }
                }
                Operation::Rest => {
                    queue.take_pressing();
                    let due = all_due(&mut queue);
                    for event in &due {
                        prop_assert_eq!(model.remove(&event.slot.0), Some(None));
                    }
                    prop_assert!(model.values().all(Option::is_some), "a pressing event did not come up");
                }
                Operation::TakeClock { clock } => {
                    queue.take_clock(clock);
                    let due = all_due(&mut queue);
                    for event in &due {
                        let scheduled = model.remove(&event.slot.0).flatten();
                        prop_assert!(scheduled.is_some_and(|(its_clock, ..)| its_clock == clock));
                    }
                    prop_assert!(!model.values().flatten().any(|&(its_clock, ..)| its_clock == clock));
                }
                Operation::TakeAll => {
                    queue.take_all();
                    let due = all_due(&mut queue);
                    for event in &due {
                        prop_assert!(model.remove(&event.slot.0).is_some());
                    }
                    prop_assert!(model.is_empty());
                }
            }
        }
        // At the end of time, or at a motion without bounds, everything that is left comes up.
        queue.take_all();
        let due = all_due(&mut queue);
        let mut left: Vec<u32> = due.iter().map(|e| e.slot.0).collect();
        left.sort_unstable();
        prop_assert_eq!(left, model.into_keys().collect::<Vec<_>>());
        prop_assert!(queue.is_empty());
    }

    /// However the camera moves, a node does not change its answer before its bound has passed on the odometer.
    #[test]
    fn bounds_never_miss(
        center in prop::array::uniform3(-10.0..10.0_f32),
        radius in prop_oneof![0.0..0.1_f32, 0.0..5.0_f32],
        eps in prop_oneof![Just(0.0_f32), 0.0..0.01_f32, 0.0..0.5_f32],
        sphere_size in any::<bool>(),
        seed in any::<u64>(),
        heading in prop::array::uniform3(-1.0..1.0_f64),
        (rho, stray, omega, kappa) in (
            prop_oneof![Just(0.0), 0.001..0.5],
            prop_oneof![Just(0.0), 0.0001..0.5],
            prop_oneof![Just(0.0), 0.0001..0.1],
            prop_oneof![Just(0.0), 0.01..5.0],
        ),
    ) {
        let bounds = Bounds { center, radius, eps };
        let criterion = if sphere_size { Criterion::SphereSize } else { Criterion::ScreenError };
        let heading = DVec3::from(heading).normalize_or_zero();
        let course = Course { heading, rho, stray, omega, kappa };
        let random = &mut seeded(seed);
        let mut views: Vec<View> = (0..random.random_range(1..=2)).map(|_| random_view(random)).collect();
        let mut clock = Odometer::default();
        let mut active = criterion.unfold(&views, &bounds);
        let mut deadline = 0.0;
        for _ in 0..300 {
            let bound = if active {
                criterion.earliest_fold(&views, &course, &bounds)
            } else {
                criterion.earliest_unfold(&views, &course, &bounds)
            };
            deadline = f64::max(deadline, clock.now() + bound);
            let before = views.clone();
            for view in &mut views {
                step(view, &course, center, random);
            }
            match clock.advance(&course, &before, &views) {
                Motion::Rest => prop_assert_eq!(criterion.unfold(&views, &bounds), active),
                Motion::Unbounded => deadline = 0.0,
                Motion::Frames(_) => {}
            }
            let now_active = criterion.unfold(&views, &bounds);
            // Two at a time, the same is said of each.
            let other = Bounds { radius: bounds.radius * random.random::<f32>(), ..bounds };
            let both = [now_active, criterion.unfold(&views, &other)];
            prop_assert_eq!(criterion.unfold_both(&views, [&bounds, &other]), both);
            if now_active != active {
                prop_assert!(clock.now() >= deadline, "flipped at {}, bound {deadline}", clock.now());
                active = now_active;
                deadline = 0.0;
            }
        }
    }
}

/// At the origin, looking along x.
fn looking_along_x() -> View {
    View::new(&Camera::look_at(DVec3::ZERO, DVec3::X, DVec3::Z, 1.0, 1.0).unwrap(), 0.01).unwrap()
}

/// A sphere at a distance, at an angle from the x axis.
fn sphere(distance: f64, angle: f64, radius: f32, eps: f32) -> Bounds {
    let center = DVec3::new(distance * angle.cos(), distance * angle.sin(), 0.0);
    Bounds { center: center.as_vec3().to_array(), radius, eps }
}

fn still() -> Course {
    Course { heading: DVec3::ZERO, rho: 0.0, stray: 0.0, omega: 0.0, kappa: 0.0 }
}

#[track_caller]
fn assert_about(found: f64, expected: f64, what: &str) {
    assert!((found / expected - 1.0).abs() < 1e-6, "{what}: {found}, not {expected}");
}

/// A bound that said nothing would never miss. Each of them says all that the camera's motion leaves: the time until the
/// node comes into view (`t_r`) and until it is coarse (`t_m`), of which the later counts.
#[test]
fn a_bound_on_unfolding_is_the_later_of_two_times() {
    let view = looking_along_x();
    let beta = view.sin_beta().atan2(view.cos_beta());
    let earliest =
        |bounds: &Bounds, course: Course| Criterion::ScreenError.earliest_unfold(&[view], &course, bounds);
    let reach = |bounds: &Bounds| Criterion::ScreenError.reach_distance(bounds, view.k());
    // In view, and so far away that it is fine.
    let far = sphere(100.0, 0.0, 2.0, 0.1);
    let gap = 100.0 - reach(&far);
    assert_about(earliest(&far, Course { stray: 0.5, ..still() }), gap / 0.5, "any way");
    let ahead = Course { heading: DVec3::X, rho: 0.5, ..still() };
    assert_about(earliest(&far, ahead), gap / 0.5, "straight at it");
    assert_eq!(earliest(&far, Course { heading: -DVec3::X, ..ahead }), f64::INFINITY, "away from it");
    let aside = Course { heading: DVec3::new(0.6, 0.8, 0.0), ..ahead };
    assert_about(earliest(&far, aside), gap / (0.5 * 0.6), "past it");
    let slope = f64::from(far.eps);
    assert_about(
        earliest(&far, Course { kappa: 2.0, ..still() }),
        gap / (2.0 * slope),
        "the tolerance changes",
    );
    assert_about(earliest(&far, Course { kappa: 2.0, ..ahead }), gap / (0.5 + 2.0 * slope), "both");
    // Coarse, and out of view to the side.
    let beside = sphere(100.0, beta + 0.3, 2.0, 10.0);
    let gap = 100.0 * 0.3_f64.sin() - 2.0;
    assert_about(earliest(&beside, Course { omega: 0.01, ..still() }), gap / (0.01 * 100.0), "turning");
    assert_about(earliest(&beside, Course { stray: 0.5, ..still() }), gap / 0.5, "moving");
    assert_about(
        earliest(&beside, Course { omega: 0.01, stray: 0.5, ..still() }),
        gap / 1.5,
        "turning and moving",
    );
    assert_eq!(earliest(&beside, still()), f64::INFINITY);
    // Behind the eye the nearest point of the cone is the eye.
    let behind = sphere(100.0, PI, 2.0, 10.0);
    assert_about(
        earliest(&behind, Course { stray: 0.5, ..still() }),
        98.0 / 0.5,
        "from behind, into the sphere",
    );
    // Neither: one comes sooner, the other later.
    let neither = sphere(100.0, beta + 0.3, 2.0, 0.1);
    let course = Course { omega: 0.01, stray: 0.01, ..still() };
    assert_about(earliest(&neither, course), (100.0 - reach(&neither)) / 0.01, "coarse last");
    let course = Course { heading: DVec3::X, omega: 0.001, kappa: 1000.0, ..still() };
    assert_about(earliest(&neither, course), gap / 0.1, "in view last");
}

/// The dual, and `t_i`, the time until a sphere is left: folded is what is left and out of view or fine.
#[test]
fn a_bound_on_folding_is_the_later_of_leaving_and_the_first_of_two_times() {
    let view = looking_along_x();
    let beta = view.sin_beta().atan2(view.cos_beta());
    let earliest =
        |bounds: &Bounds, course: Course| Criterion::ScreenError.earliest_fold(&[view], &course, bounds);
    let reach = |bounds: &Bounds| Criterion::ScreenError.reach_distance(bounds, view.k());
    // In view, out to its far edge.
    let inside = sphere(100.0, beta - 0.1, 2.0, 10.0);
    let room = 100.0 * 0.1_f64.sin() + 2.0;
    assert_about(earliest(&inside, Course { omega: 0.01, ..still() }), room / (0.01 * 100.0), "turning");
    assert_about(earliest(&inside, Course { stray: 0.5, ..still() }), room / 0.5, "moving");
    // In the middle of the view, and coarse.
    let coarse = sphere(10.0, 0.0, 2.0, 0.05);
    let room = reach(&coarse) - 10.0;
    let away = Course { heading: -DVec3::X, rho: 0.01, omega: 1e-9, ..still() };
    let found = earliest(&coarse, away);
    assert!((0.9..=1.0).contains(&(found * 0.01 / room)), "{found}, at most {}", room / 0.01);
    let slope = f64::from(coarse.eps);
    let found = earliest(&coarse, Course { kappa: 2.0, ..still() });
    assert_about(found, room / (2.0 * slope), "the tolerance changes");
    // Of the two, the first.
    let both = Course { omega: 0.01, kappa: 1e-3, ..still() };
    assert_about(earliest(&inside, both), (100.0 * 0.1_f64.sin() + 2.0) / 1.0, "out of view first");
    let both = Course { omega: 1e-6, kappa: 100.0, ..still() };
    assert_about(earliest(&inside, both), (reach(&inside) - 100.0) / 1000.0, "fine first");
    // The eye is in the sphere, which is out of view as soon as it is left: not before.
    let around = sphere(1.0, PI, 4.0, 10.0);
    assert_about(earliest(&around, Course { stray: 0.25, ..still() }), 3.0 / 0.25, "until it is left");
    assert_about(
        earliest(&around, Course { stray: 0.25, omega: 1.0, ..still() }),
        3.0 / 0.25,
        "turning does not help",
    );
    assert_eq!(earliest(&around, Course { omega: 1.0, kappa: 100.0, ..still() }), f64::INFINITY);
}

fn random_view(random: &mut Pcg64) -> View {
    let beta: f64 = random.random_range(0.1..1.4);
    let (eye, ahead) = (direction(random) * random.random_range(0.0..12.0), direction(random));
    View::from_parts(eye, ahead, beta.cos(), beta.sin(), random.random_range(1.0..201.0)).unwrap()
}

/// Moves a view by up to full speed in each way at once, as often as not straight at or away from the centre.
fn step(view: &mut View, course: &Course, center: [f32; 3], random: &mut Pcg64) {
    let to_center = (DVec3::from(center.map(f64::from)) - view.eye()).normalize_or(DVec3::X);
    let straight = if random.random() { to_center } else { -to_center };
    let way = if random.random_bool(0.6) { straight } else { direction(random) };
    let moved =
        course.heading * course.rho * random.random::<f64>() + way * course.stray * random.random::<f64>();
    *view = view.with_eye(view.eye() + moved).unwrap();
    let aim = if random.random_bool(0.6) { straight } else { direction(random) };
    let axis = view.direction().cross(aim);
    if axis.length() > 1e-9 {
        let turn = glam::DQuat::from_axis_angle(axis.normalize(), course.omega * random.random::<f64>());
        *view = view.with_direction((turn * view.direction()).normalize()).unwrap();
    }
    let steered = course.kappa * random.random_range(-1.0..1.0);
    *view = view.with_k((view.k() + steered).max(1.0)).unwrap();
}

/// Deadlines would leave 64 bits: a clock that has come to its end lets everything come up at every advance.
#[test]
fn a_clock_can_go_on_for_ever() {
    let found_at_rest = |end: f64| {
        let mut queue = EventQueue::new(1);
        let mut due = [Event::BLANK; DUE];
        let mut found = 0;
        for now in [end / 2.0, end, end] {
            found = 0;
            for frames in [0.0, 1.0, 1e5, f64::INFINITY] {
                let event = queue.event(Slot(3), Kind::Unfold, BOUNDS);
                queue.schedule(0, frames, event);
            }
            queue.advance(0, now);
            while let count @ 1.. = queue.next_due(&mut due) {
                found += count;
            }
            assert_eq!(found + queue.len(), 4);
        }
        found
    };
    // Well before the end, what is due now comes up where the clock rests, and nothing else.
    assert_eq!(found_at_rest(9e15), 1);
    for end in [9.1e15, 3.6e16, 1e18, 1e300, f64::INFINITY] {
        assert_eq!(found_at_rest(end), 4, "at {end}");
    }
}
