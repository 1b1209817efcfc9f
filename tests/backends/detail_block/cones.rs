//! The normal-cone test as a part of the criterion.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use foldfront::selection::criterion::Criterion;
use foldfront::selection::motion::Course;
use foldfront::selection::normal_cone::{
    earliest_fold, earliest_unfold, is_back_facing, signed_distance, unfold,
};
use foldfront::selection::view::View;
use foldfront::vertex_tree::{Bounds, NormalCone};
use glam::DVec3;
use proptest::prelude::{Just, ProptestConfig, any, prop, prop_assert, prop_assert_eq, prop_oneof, proptest};
use proptest::strategy::Strategy as _;

/// A vector of length up to 1 that has a direction.
fn vector() -> impl proptest::strategy::Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0_f64).prop_map(|v| {
        let v = DVec3::from(v).clamp_length_max(1.0);
        if v.length() > 0.1 { v } else { DVec3::new(0.6, 0.0, v.z) }
    })
}

fn cone_of(axis: DVec3, sine: f64) -> NormalCone {
    NormalCone { axis: axis.normalize().as_vec3().to_array(), sine: sine as f32 }
}

/// A normal of the cone, at some angle up to the half-angle and some turn about the axis.
fn normal(axis: DVec3, sine: f64, share: f64, turn: f64) -> DVec3 {
    let side = axis.any_orthonormal_vector();
    let side = glam::DQuat::from_axis_angle(axis, turn) * side;
    let angle = share * sine.asin();
    axis * angle.cos() + side * angle.sin()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(3000))]

    /// The definition: where a node is back-facing, each point with each normal is; and where it is not, the worst
    /// point with the worst normal is not.
    #[test]
    fn back_facing_is_what_it_says(
        axis in vector(), eye in vector(), scale in prop_oneof![Just(1.0), Just(1e-3), Just(1e4)],
        radius in 0.0..1.5_f64, sine in prop_oneof![0.0..0.999, Just(0.0)],
        samples in prop::array::uniform8((0.0..1.0_f64, 0.0..6.3_f64, vector())),
    ) {
        let axis = axis.normalize();
        let center = DVec3::new(0.3, -0.7, 0.1) * scale;
        let eye = center + eye * 4.0 * scale;
        let bounds = Bounds {
            center: center.as_vec3().to_array(),
            radius: (radius * scale) as f32,
            eps: 0.0,
        };
        let cone = cone_of(axis, sine);
        let (center, radius) = (DVec3::from(bounds.center.map(f64::from)), f64::from(bounds.radius));
        let back = is_back_facing(eye, &bounds, &cone);
        let (g, _) = signed_distance(eye, &bounds, &cone).unwrap();
        let room = 1e-5 * scale;
        if g.abs() > room {
            prop_assert_eq!(back, g < 0.0);
        }
        let mut most = f64::MIN;
        for (share, turn, at) in samples {
            let m = normal(axis, sine, share, turn);
            let x = center + at.normalize() * radius;
            most = most.max(m.dot(eye - x));
        }
        prop_assert!(most <= g + room, "a point and a normal with {most}, more than {g}");
        // The worst of all.
        let from = eye - center;
        let side = (from - from.dot(axis) * axis).normalize_or(axis.any_orthonormal_vector());
        let angle = sine.asin().min(from.dot(side).atan2(from.dot(axis)));
        let m = axis * angle.cos() + side * angle.sin();
        let worst = m.dot(eye - (center - m * radius));
        prop_assert!((worst - g).abs() <= room, "{worst} is not {g}");
    }

    /// On no motion that a course allows does a node change before its time.
    #[test]
    fn bounds_never_miss(
        eye in vector(), aim in vector(), beta in 0.2..1.4_f64, k in 1.0..400.0_f64, axis in vector(),
        radius in 0.001..0.8_f64, eps in 0.0..0.02_f64, sine in 0.0..0.999_f64,
        rho in 0.0..0.1_f64, stray in 0.0001..0.05_f64, omega in 0.0..0.05_f64, kappa in 0.0..1.0_f64,
        heading in vector(),
        steps in prop::collection::vec((vector(), vector(), 0.0..1.0_f64, -1.0..1.0_f64), 1..40),
        sphere_size in any::<bool>(),
    ) {
        let criterion = if sphere_size { Criterion::SphereSize } else { Criterion::ScreenError };
        let heading = heading.normalize();
        let course = Course { heading, rho, stray, omega, kappa };
        let bounds = Bounds { center: [0.1, 0.2, -0.1], radius: radius as f32, eps: eps as f32 };
        let cone = cone_of(axis, sine);
        let direction = (DVec3::new(0.1, 0.2, -0.1) - eye * 3.0 + aim * 0.5).normalize_or(DVec3::X);
        let mut view = View::from_parts(eye * 3.0, direction, beta.cos(), beta.sin(), k).unwrap();
        let wanted = unfold(criterion, &[view], &bounds, &cone);
        let first = if wanted {
            earliest_fold(criterion, &[view], &course, &bounds, &cone)
        } else {
            earliest_unfold(criterion, &[view], &course, &bounds, &cone)
        };
        for (frame, (astray, about, forward, steered)) in (1..).zip(steps) {
            let moved = heading * rho * forward + astray.clamp_length_max(1.0) * stray;
            view = view.with_eye(view.eye() + moved).unwrap();
            let turn = glam::DQuat::from_axis_angle(about.normalize(), omega * forward);
            view = view.with_direction((turn * view.direction()).normalize()).unwrap();
            view = view.with_k((view.k() + kappa * steered).max(1.0)).unwrap();
            if f64::from(frame) < first {
                let now = unfold(criterion, &[view], &bounds, &cone);
                prop_assert_eq!(now, wanted, "frame {} of {}", frame, first);
            }
        }
    }
}

#[test]
fn what_says_nothing_is_never_back_facing() {
    let bounds = Bounds { center: [0.0; 3], radius: 0.1, eps: 0.1 };
    let eye = DVec3::new(0.0, 0.0, -5.0);
    assert!(is_back_facing(eye, &bounds, &NormalCone { axis: [0.0, 0.0, 1.0], sine: 0.5 }));
    for (axis, sine) in
        [([0.0, 0.0, 1.0], 1.0), ([0.0; 3], 0.0), ([f32::NAN; 3], 0.0), ([0.0, 0.0, 1.0], f32::NAN)]
    {
        assert!(!is_back_facing(eye, &bounds, &NormalCone { axis, sine }), "{axis:?}, {sine}");
    }
    assert!(!is_back_facing(eye, &bounds, &NormalCone::NONE));
    let inside = DVec3::new(0.0, 0.0, -0.05);
    assert!(!is_back_facing(inside, &bounds, &NormalCone { axis: [0.0, 0.0, 1.0], sine: 0.0 }));
}
