use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use super::checks::NORMALISED;
use super::{Camera, View, ViewError, theta_of_pixels};

const WRONG: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

fn camera(fov_y: f64, aspect: f64) -> Result<Camera, ViewError> {
    Camera::new(DVec3::ONE, DQuat::IDENTITY, fov_y, aspect)
}

#[test]
fn a_camera_names_what_is_wrong() {
    let right = camera(1.0, 1.5).unwrap();
    assert_eq!((right.position(), right.orientation()), (DVec3::ONE, DQuat::IDENTITY));
    assert_eq!((right.fov_y(), right.aspect()), (1.0, 1.5));
    for x in WRONG.into_iter().chain([1.1e150]) {
        for axis in 0..3 {
            let mut eye = DVec3::ONE;
            eye[axis] = x;
            let error = Camera::new(eye, DQuat::IDENTITY, 1.0, 1.0).unwrap_err();
            assert!(matches!(error, ViewError::Eye { eye } if eye[axis].to_bits() == x.to_bits()));
            let error = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 1.0, 1.0).unwrap_err();
            assert!(matches!(error, ViewError::Eye { .. }), "{error}");
        }
    }
    for orientation in [
        DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0),
        DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
        DQuat::from_xyzw(0.0, 0.0, 0.0, 1.1),
        DQuat::from_xyzw(0.0, f64::INFINITY, 0.0, 1.0),
    ] {
        let error = Camera::new(DVec3::ONE, orientation, 1.0, 1.0).unwrap_err();
        assert!(matches!(error, ViewError::Orientation { .. }), "{error}");
    }
    for fov_y in WRONG.into_iter().chain([0.0, -1.0, PI, 4.0]) {
        assert!(matches!(camera(fov_y, 1.0), Err(ViewError::FieldOfView { .. })), "{fov_y}");
    }
    for aspect in WRONG.into_iter().chain([0.0, -1.0]) {
        assert!(matches!(camera(1.0, aspect), Err(ViewError::Aspect { .. })), "{aspect}");
    }
}

#[test]
fn a_camera_looks_at_something_else_than_its_own_place() {
    let (p, tiny) = (DVec3::new(1.0, 2.0, 3.0), DVec3::splat(1e-320));
    for (position, target) in [(p, p), (DVec3::ZERO, tiny), (p, DVec3::NAN), (p, DVec3::INFINITY)] {
        let error = Camera::look_at(position, target, DVec3::Z, 1.0, 1.5).unwrap_err();
        assert!(matches!(error, ViewError::Target { .. }), "{error}");
    }
    let error = Camera::look_at(p, p, DVec3::Z, 1.0, 1.5).unwrap_err().to_string();
    assert!(error.contains("[1.0, 2.0, 3.0]"), "{error}");
    // Whatever is said of up.
    for up in [DVec3::X, DVec3::ZERO, DVec3::NAN] {
        let camera = Camera::look_at(DVec3::X, DVec3::ZERO, up, 1.0, 1.5).unwrap();
        assert!(camera.direction().distance(DVec3::NEG_X) < 1e-12);
    }
}

#[test]
fn a_view_names_what_is_wrong() {
    let right = View::from_parts(DVec3::ONE, DVec3::X, 0.8, 0.6, 5.0).unwrap();
    assert_eq!((right.eye(), right.direction()), (DVec3::ONE, DVec3::X));
    assert_eq!((right.cos_beta(), right.sin_beta(), right.k()), (0.8, 0.6, 5.0));
    for x in WRONG {
        assert!(matches!(right.with_eye(DVec3::new(0.0, x, 0.0)), Err(ViewError::Eye { .. })));
        assert!(matches!(right.with_direction(DVec3::splat(x)), Err(ViewError::Direction { .. })));
        assert!(matches!(right.with_k(x), Err(ViewError::Scale { .. })));
        assert!(matches!(right.with_cone(x, 0.6), Err(ViewError::Cone { .. })));
        assert!(matches!(right.with_cone(0.8, x), Err(ViewError::Cone { .. })));
        assert!(matches!(right.coarser(x), Err(ViewError::Factor { .. })));
        assert!(matches!(right.relative_to([0.0, 0.0, x]), Err(ViewError::Origin { .. })));
        for theta in [x, 0.0, -1.0] {
            let error = View::new(&camera(1.0, 1.0).unwrap(), theta).unwrap_err();
            assert!(matches!(error, ViewError::Tolerance { .. }), "{error}");
        }
    }
    assert!(matches!(right.with_direction(DVec3::X * 1.1), Err(ViewError::Direction { .. })));
    assert!(matches!(right.with_direction(DVec3::ZERO), Err(ViewError::Direction { .. })));
    assert!(matches!(right.with_k(0.999), Err(ViewError::Scale { k: 0.999 })));
    for (cos_beta, sin_beta) in [(-0.8, 0.6), (0.8, -0.6), (0.8, 0.7), (0.0, 0.0)] {
        assert_eq!(right.with_cone(cos_beta, sin_beta), Err(ViewError::Cone { cos_beta, sin_beta }));
    }
    // Where the difference is too large, though neither is.
    let far = right.with_eye(DVec3::X * View::FARTHEST).unwrap();
    let error = far.relative_to([-View::FARTHEST, 0.0, 0.0]).unwrap_err();
    assert!(matches!(error, ViewError::Eye { .. }), "{error}");
    assert!(far.about([-View::FARTHEST, 0.0, 0.0]).eye().length_squared().is_finite());
}

#[test]
fn a_tolerance_may_be_small_but_not_too_small_for_k() {
    let lens = |fov_y| camera(fov_y, 1.5).unwrap();
    let k = View::new(&lens(PI / 3.0), theta_of_pixels(1e-6, 1080)).unwrap().k();
    assert!((k / 935_307_436.0 - 1.0).abs() < 1e-6, "{k}");
    assert!(View::new(&lens(PI / 3.0), 1e-307).unwrap().k().is_finite());
    for (fov_y, theta) in [(PI / 3.0, 1e-320), (1e-320, 0.001), (1e-160, 1e-160)] {
        assert_eq!(View::new(&lens(fov_y), theta), Err(ViewError::TooFine { theta, fov_y }));
    }
    // A tolerance of more than everything is one of everything.
    assert_eq!(View::new(&lens(1.0), 1e300).unwrap().k(), 1.0);
}

#[test]
fn every_lens_has_a_cone() {
    let widest = PI.next_down();
    for fov_y in [1e-300, 1e-8, 1.0, 3.1, 3.15 - 0.0085, widest] {
        for aspect in [1e-300, 1e-9, 1.0, 16.0 / 9.0, 1e8, 1e160, 1e300] {
            let view = View::new(&camera(fov_y, aspect).unwrap(), 1e-3).map(|v| (v.cos_beta, v.sin_beta));
            let (cos, sin) = view.unwrap();
            assert!((0.0..=1.0).contains(&cos) && (0.0..=1.0).contains(&sin), "{fov_y} {aspect}");
        }
    }
}

/// A direction that a view has given back is the same to the bit: a camera at rest stays so.
#[test]
fn what_is_normalised_is_kept_to_the_bit() {
    let mut x = 0.1_f64;
    for _ in 0..1000 {
        x = (x * 3.9 * (1.0 - x)).clamp(1e-3, 0.999);
        let direction = DVec3::new(x, 1.0 - x, 0.5 - x).normalize() * (1.0 + 1e-7 * (x - 0.5));
        let view = View::from_parts(DVec3::ZERO, direction, 0.8, 0.6, 2.0).unwrap();
        assert!((view.direction().length_squared() - 1.0).abs() <= NORMALISED);
        assert_eq!(view.with_direction(view.direction()), Ok(view));
    }
}

#[test]
fn a_budget_keeps_k_in_range() {
    let view = View::from_parts(DVec3::ZERO, DVec3::X, 0.8, 0.6, 1e308).unwrap();
    assert_eq!(view.coarser(1.0 / 256.0).unwrap().k(), f64::MAX);
    assert_eq!(view.coarser(f64::MAX).unwrap().k(), 1.0);
    assert_eq!(view.coarser(f64::MIN_POSITIVE).unwrap().k(), f64::MAX);
    assert_eq!(view.coarser(2.0).unwrap().k(), 5e307);
    assert!(matches!(view.coarser(0.0), Err(ViewError::Factor { factor: 0.0 })));
}
