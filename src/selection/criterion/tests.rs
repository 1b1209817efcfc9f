use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;

/// In any view, and however near its axis, the predicate says what the lengths say that its bounds go by, but within a
/// trillionth of a mark.
#[test]
fn squares_and_lengths_decide_alike() {
    let mut random = Pcg64Mcg::seed_from_u64(17);
    let mut seen = [0; 2];
    for trial in 0..300_000 {
        let mut unit = || random.random_range(-1.0..1.0_f64);
        let direction = DVec3::new(unit(), unit(), unit()).normalize();
        let across = direction.cross(DVec3::new(unit(), unit(), unit())).normalize();
        let tan = [1e-6_f64, 0.1, 0.126, 1.0, 7.9, 8.1, 1e6][trial % 7];
        let (cos, sin) = (1.0 / (1.0 + tan * tan).sqrt(), tan / (1.0 + tan * tan).sqrt());
        let eye = DVec3::new(unit(), unit(), unit()) * [0.0, 1.0, 1e3][trial / 7 % 3];
        let view = View::from_parts(eye, direction, cos, sin, 1e9).unwrap();
        // At the axis, about a sixteenth off it, at the cone's edge, anywhere.
        let off = [1e-9, 1e-3, 0.0625, tan, 2.0 * unit().abs()][trial / 21 % 5] * (1.0 + 1e-6 * unit());
        let ahead = unit();
        let center = eye + direction * ahead + across * off * ahead;
        let bounds = Bounds {
            center: center.as_vec3().to_array(),
            radius: (ahead * [0.0, 1e-7, 0.01, 0.9][trial / 105 % 4]).abs() as f32,
            eps: 1.0,
        };
        let course = Course::from(Speed { rho: 0.0, omega: 0.0, kappa: 0.0 });
        let s = Situation::new(Criterion::ScreenError, &view, &course, &bounds);
        if s.gap.abs().min((s.d - s.r).abs()) > 1e-12 * (s.d + s.r) {
            let wanted = s.d < s.r || s.gap <= 0.0;
            assert_eq!(Criterion::ScreenError.unfold(&[view], &bounds), wanted, "{view:?} {bounds:?}");
            seen[usize::from(wanted)] += 1;
        }
    }
    assert!(seen.iter().all(|&count| count > 50_000), "{seen:?}");
}

fn unit(random: &mut Pcg64Mcg) -> DVec3 {
    loop {
        let v = DVec3::from([0; 3].map(|_| random.random_range(-1.0..1.0)));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

fn still() -> Course {
    Course { heading: DVec3::ZERO, rho: 0.0, stray: 0.0, omega: 0.0, kappa: 0.0 }
}

const BOTH: [Criterion; 2] = [Criterion::ScreenError, Criterion::SphereSize];

/// The paper's words: inside, or in view by angles and large enough; `None` near a mark.
fn wanted_by_angles(criterion: Criterion, view: &View, bounds: &Bounds) -> Option<bool> {
    let to_center = DVec3::from(bounds.center.map(f64::from)) - view.eye();
    let (d, r) = (to_center.length(), f64::from(bounds.radius));
    let alpha = libm::acos((to_center.dot(view.direction()) / d).clamp(-1.0, 1.0));
    let beta = libm::atan2(view.sin_beta(), view.cos_beta());
    let phi = libm::asin((r / d).min(1.0));
    // How large the error or the sphere is, as a multiple of what is tolerated.
    let size = match criterion {
        Criterion::ScreenError => f64::from(bounds.eps) * view.k() / (d - r),
        Criterion::SphereSize => r * view.k() / d,
    };
    if (d - r).abs().min((alpha - phi - beta).abs()).min((size - 1.0).abs()) < 1e-5 {
        return None;
    }
    Some(d < r || alpha - phi <= beta && size >= 1.0)
}

/// However many views there are, and one node at a time or two, the predicate is the published one.
#[test]
fn a_node_is_wanted_by_angle_and_by_size() {
    let mut random = Pcg64Mcg::seed_from_u64(3);
    let mut seen = [0; 2];
    for trial in 0..100_000 {
        let mut view = || {
            let beta = random.random_range(0.05..1.5);
            let (eye, k) =
                (unit(&mut random) * random.random_range(0.0..5.0), random.random_range(1.0..40.0));
            View::from_parts(eye, unit(&mut random), libm::cos(beta), libm::sin(beta), k).unwrap()
        };
        let all = [view(), view(), view()];
        let views = &all[..[1, 1, 1, 2, 3, 0][trial % 6]];
        let criterion = BOTH[trial / 6 % 2];
        let nodes = [0; 2].map(|_| Bounds {
            center: (unit(&mut random) * random.random_range(0.0..10.0)).as_vec3().to_array(),
            radius: random.random_range(0.01..2.0),
            eps: random.random_range(0.0..0.5),
        });
        let by_angles = nodes.map(|node| {
            let each: Option<Vec<bool>> =
                views.iter().map(|view| wanted_by_angles(criterion, view, &node)).collect();
            each.map(|each| each.contains(&true))
        });
        let both = criterion.unfold_both(views, [&nodes[0], &nodes[1]]);
        for at in 0..2 {
            if let Some(wanted) = by_angles[at] {
                assert_eq!(
                    criterion.unfold(views, &nodes[at]),
                    wanted,
                    "{criterion:?} {views:?} {:?}",
                    nodes[at]
                );
                assert_eq!(both[at], wanted, "two at a time: {criterion:?} {views:?} {:?}", nodes[at]);
                seen[usize::from(wanted)] += 1;
            }
        }
    }
    assert!(seen.iter().all(|&count| count > 10_000), "{seen:?}");
}

/// The room that construction leaves is a share of `2^-20` of the outer radius, of which half is asked for.
#[test]
fn nested_is_what_leaves_room_for_rounding() {
    let outer = Bounds { center: [1.0, 2.0, 3.0], radius: 4.0, eps: 0.5 };
    let room = 4.0 / 2_097_152.0;
    let inner = |shift: f32, radius: f32, eps: f32| {
        is_nested(&Bounds { center: [1.0, 2.0 + shift, 3.0], radius, eps }, &outer)
    };
    assert!(is_nested(&outer, &outer), "itself, without any room");
    assert!(inner(0.0, 4.0 - room, 0.5) && !inner(0.0, 4.0 - room / 2.0, 0.5));
    assert!(inner(1.0, 2.75, 0.5) && inner(-1.0, 2.75, 0.5), "there is room to the side");
    assert!(!inner(1.0, 3.0, 0.5) && !inner(-1.5, 2.75, 0.5), "it sticks out");
    assert!(inner(1.0, 2.0, 0.0) && !inner(1.0, 2.0, 0.75), "no more error than what is around it");
}

/// A view that has moved on a course for `t` frames: besides along the heading, towards `side`, turned towards `aim`, which
/// is of length 1 and across the direction, and with `k` changed in the direction of a sign.
fn moved(view: &View, course: &Course, t: f64, side: DVec3, aim: DVec3, sign: f64) -> View {
    let turn = course.omega * t;
    let direction = view.direction() * libm::cos(turn) + aim * libm::sin(turn);
    view.with_eye(view.eye() + (course.heading * course.rho + side * course.stray) * t)
        .and_then(|view| view.with_direction(direction))
        .and_then(|view| view.with_k(view.k() + sign * course.kappa * t))
        .unwrap()
}

/// What a time bound says of a node that is near a mark, and the motion that gets there first.
struct Race {
    criterion: Criterion,
    view: View,
    bounds: Bounds,
    course: Course,
    side: DVec3,
    aim: DVec3,
    sign: f64,
}

impl Race {
    /// The bound is not late, and not early by more than a thousandth: the motion changes the answer just then.
    #[track_caller]
    fn assert_tight(&self) {
        let Self { criterion, view, bounds, course, .. } = self;
        let is_wanted = criterion.unfold(&[*view], bounds);
        let frames = if is_wanted {
            criterion.earliest_fold(&[*view], course, bounds)
        } else {
            criterion.earliest_unfold(&[*view], course, bounds)
        };
        let after =
            |t: f64| criterion.unfold(&[moved(view, course, t, self.side, self.aim, self.sign)], bounds);
        let what = || format!("{criterion:?} {view:?} {bounds:?} {course:?}: {frames} frames");
        assert!(frames > 0.0 && frames.is_finite(), "{}", what());
        assert_eq!(after(0.999_999 * frames), is_wanted, "too late: {}", what());
        assert_ne!(after(1.001 * frames), is_wanted, "too early: {}", what());
    }
}

/// Near a mark nothing but the speed towards it counts. So the bounds are checked there, against the motion that is fastest.
#[test]
fn a_time_bound_is_as_late_as_the_fastest_motion_allows() {
    let mut random = Pcg64Mcg::seed_from_u64(4);
    for trial in 0..40_000 {
        let criterion = BOTH[trial % 2];
        let beta = random.random_range(0.2..1.2);
        let k = random.random_range(150.0..300.0);
        let bounds = Bounds {
            center: (unit(&mut random) * 5.0).as_vec3().to_array(),
            radius: random.random_range(0.1..1.0),
            eps: random.random_range(0.5..1.0),
        };
        let center = DVec3::from(bounds.center.map(f64::from));
        let r = f64::from(bounds.radius);
        let reach = match criterion {
            Criterion::ScreenError => r + f64::from(bounds.eps) * k,
            Criterion::SphereSize => r * k,
        };
        // One of the speeds, or all of them.
        let mut speed = |which: usize, most: f64| {
            if [which, 4, 5].contains(&(trial / 2 % 6)) { most * random.random_range(0.1..1.0) } else { 0.0 }
        };
        let [rho, stray, omega, kappa] = [speed(0, 0.5), speed(1, 0.5), speed(2, 0.05), speed(3, 2.0)];
        let direction = unit(&mut random);
        let across = direction.cross(unit(&mut random)).normalize();
        // The node at an angle from the direction and at a distance.
        let place = |alpha: f64, d: f64| {
            let ahead = direction * libm::cos(alpha) + across * libm::sin(alpha);
            let view =
                View::from_parts(center - ahead * d, direction, libm::cos(beta), libm::sin(beta), k).unwrap();
            (view, ahead)
        };
        let near = if trial / 12 % 2 == 0 { 1e-5 } else { -1e-5 };
        // Fine by a little or coarse by a little, in the middle of the view. What does not come nearer may have a heading
        // that does so at an angle.
        if rho + stray + kappa > 0.0 {
            let d = reach * (1.0 + near);
            let (view, ahead) = place(0.5 * beta, d);
            let sign = near.signum();
            let slant = random.random_range(0.0..1.0);
            let beside = ahead.cross(unit(&mut random)).normalize();
            let heading = ahead * sign * libm::cos(slant) + beside * libm::sin(slant);
            let course = Course { heading, rho, stray, omega: 0.0, kappa };
            Race { criterion, view, bounds, course, side: ahead * sign, aim: across, sign }.assert_tight();
            if near < 0.0 && rho > 0.0 {
                // Straight past it the distance grows with the square of the time alone.
                let course = Course { heading: beside, rho, ..still() };
                Race { criterion, view, bounds, course, side: beside, aim: across, sign }.assert_tight();
            }
        }
        // Coarse, and out of view by a little, or in view by a little.
        if rho + stray + omega > 0.0 {
            let d = 0.5 * reach;
            let (view, _) = place(beta + libm::asin((r + near * d) / d), d);
            let sign = near.signum();
            let out = across * libm::cos(beta) - direction * libm::sin(beta);
            let course = Course { heading: out * sign, rho, stray, omega, kappa: 0.0 };
            Race { criterion, view, bounds, course, side: out * sign, aim: across * sign, sign }
                .assert_tight();
        }
        // Behind the eye, and about to enter the sphere or to leave it.
        if rho + stray > 0.0 {
            let (view, ahead) = place(3.0, r * (1.0 + near));
            let ahead = ahead * near.signum();
            let omega = if near < 0.0 { omega } else { 0.0 };
            let course = Course { heading: ahead, rho, stray, omega, kappa: 0.0 };
            Race { criterion, view, bounds, course, side: ahead, aim: -across, sign: 0.0 }.assert_tight();
        }
    }
}

/// Of several views the first to want a node unfolds it, and the last to let go folds it. Without a view nothing is wanted.
#[test]
fn of_several_views_the_first_unfolds_and_the_last_folds() {
    let at = |x: f64| View::from_parts(DVec3::new(x, 0.0, 0.0), DVec3::X, 0.28, 0.96, 10.0).unwrap();
    let bounds = Bounds { center: [0.0; 3], radius: 1.0, eps: 1.0 };
    let course = Course { stray: 0.5, ..still() };
    // Coarse within 11.
    let unfold = |views: &[View]| Criterion::ScreenError.earliest_unfold(views, &course, &bounds);
    let fold = |views: &[View]| Criterion::ScreenError.earliest_fold(views, &course, &bounds);
    let is_about = |found: f64, expected: f64| (found / expected - 1.0).abs() < 1e-6;
    assert!(is_about(unfold(&[at(-21.0), at(-31.0), at(-26.0)]), 20.0));
    assert!(is_about(fold(&[at(-9.0), at(-6.0), at(-7.0)]), 10.0));
    assert_eq!((unfold(&[]), fold(&[])), (f64::INFINITY, 0.0));
    for views in [&[at(-21.0), at(-9.0)][..], &[at(-9.0), at(-21.0)]] {
        assert_eq!(unfold(views), 0.0, "one wants it already");
    }
}

/// In terms of the tolerance: what is twice as far is half as urgent, and where something is wanted, it is urgent.
#[test]
fn urgency_is_the_size_of_the_error() {
    let at = |x: f64| View::from_parts(DVec3::new(x, 0.0, 0.0), DVec3::X, 0.8, 0.6, 10.0).unwrap();
    let bounds = Bounds { center: [0.0; 3], radius: 2.0, eps: 0.5 };
    let error = |views: &[View]| Criterion::ScreenError.urgency(views, &bounds);
    let size = |views: &[View]| Criterion::SphereSize.urgency(views, &bounds);
    // The error is seen at 5 times the tolerance at a distance of 1; the sphere at 20 times.
    assert_eq!((error(&[at(-12.0)]), error(&[at(-7.0)]), error(&[at(-4.5)])), (0.5, 1.0, 2.0));
    assert_eq!((size(&[at(-40.0)]), size(&[at(-20.0)]), size(&[at(-10.0)])), (0.5, 1.0, 2.0));
    for criterion in BOTH {
        let urgency = |views: &[View]| criterion.urgency(views, &bounds);
        assert_eq!(urgency(&[at(-1.0)]), f64::INFINITY, "in the sphere");
        assert_eq!(urgency(&[at(30.0)]), 0.0, "behind");
        assert_eq!(urgency(&[]), 0.0, "nobody looks");
        let most = urgency(&[at(-12.0)]);
        assert_eq!(urgency(&[at(-12.0), at(-40.0), at(30.0)]), most, "the view that wants it most");
    }
}
