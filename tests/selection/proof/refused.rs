//! Frames that are none: a view with a value that is no number is an error where it is made, and whatever an application
//! does then, the engine is exact.

use std::sync::Arc;

use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::{Camera, View, ViewError};
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{NullSink, TreeError};
use glam::{DQuat, DVec3};
use in_memory::{InMemoryHierarchy, InMemoryTree};

use super::follow::{Party, look, scaled_log};
use crate::common::{direction, seeded};
use rand::RngExt;

/// Everything that can be asked of a view with one wrong value.
fn wrong(view: &View, x: f64) -> [Result<View, ViewError>; 9] {
    let (eye, direction) = (view.eye(), view.direction());
    let (cos, sin) = (view.cos_beta(), view.sin_beta());
    let camera = |position: DVec3, fov_y: f64, aspect: f64, theta: f64| {
        View::new(&Camera::new(position, DQuat::IDENTITY, fov_y, aspect)?, theta)
    };
    [
        view.with_eye(eye.with_y(x)),
        view.with_direction(direction.with_x(x)),
        view.with_cone(x, sin),
        view.with_k(x),
        View::from_parts(eye.with_z(x), direction, cos, sin, view.k()),
        camera(eye.with_x(x), 1.0, 1.5, 0.01),
        camera(eye, x, 1.5, 0.01),
        camera(eye, 1.0, x, 0.01),
        camera(eye, 1.0, 1.5, x),
    ]
}

/// The application skips such a frame, or shows the one before again.
#[test]
fn a_frame_that_is_no_number_changes_nothing() {
    let mut random = seeded(48);
    let log = scaled_log(1.0, false, &mut random);
    let mut party = Party::new(&log, Settings { rho: 0.02, ..Settings::default() });
    let mut view = look(1.0, 1.0, 0.02, &mut random);
    let mut refused = 0;
    for frame in 0..4000 {
        let next = match frame % 7 {
            3 => {
                let x = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][random.random_range(0..3)];
                for view in wrong(&view, x) {
                    let error = view.unwrap_err().to_string();
                    assert!(error.contains("NaN") || error.contains("inf"), "{error}");
                    refused += 1;
                }
                view
            }
            _ if random.random_ratio(1, 30) => look(1.0, 1.0, 0.02, &mut random),
            _ => {
                let turn = DQuat::from_axis_angle(direction(&mut random), random.random_range(0.0..0.02));
                let next = view
                    .with_eye(view.eye() + direction(&mut random) * random.random_range(0.0..0.02))
                    .unwrap();
                next.with_direction((turn * view.direction()).normalize()).unwrap()
            }
        };
        view = next;
        if frame % 14 != 3 {
            party.advance(&[view], true);
        }
    }
    assert!(refused > 5000 && party.changes > 10_000, "{refused} refused, {} changes", party.changes);
}

/// A speed of 0 says that the camera is not expected to move or to turn. It does, and the cut is exact all the same: a frame
/// in which it does tests everything that is watched, and one in which it does not tests nothing.
#[test]
fn no_declared_speed_costs_tests_and_no_cut() {
    let mut random = seeded(49);
    let log = scaled_log(1.0, false, &mut random);
    for (rho, omega) in
        [(0.0, 0.02), (0.02, 0.0), (0.0, 0.0), (-1.0, f64::NAN), (f64::INFINITY, f64::INFINITY)]
    {
        let mut oracle = Oracle::new(&log).unwrap();
        let hierarchy = Arc::new(InMemoryHierarchy::new(&log).unwrap());
        let settings = Settings { rho, omega, ..Settings::default() };
        let engine = |strategy| {
            let tree = InMemoryTree::new(hierarchy.clone());
            Engine::new(tree, NullSink, Settings { strategy, ..settings }).unwrap()
        };
        // The front scan tests all that is watched in every frame.
        let (mut engine, mut all) = (engine(Strategy::EventQueue), engine(Strategy::Front));
        let mut view = look(1.0, 1.0, 0.02, &mut random);
        for frame in 0..600 {
            let before = view;
            if frame % 3 > 0 {
                view = view.with_eye(view.eye() + direction(&mut random) * 0.01).unwrap();
            }
            if frame % 5 > 1 {
                let turn = DQuat::from_axis_angle(direction(&mut random), 0.01);
                view = view.with_direction((turn * view.direction()).normalize()).unwrap();
            }
            let (report, all) = (engine.advance(&[view]).unwrap(), all.advance(&[view]).unwrap());
            assert_eq!(oracle.compare(&engine), None, "rho {rho}, omega {omega}, frame {frame}");
            let none = |speed: f64| speed.is_nan() || speed <= 0.0;
            let is_unexpected = before.eye() != view.eye() && none(rho)
                || before.direction() != view.direction() && none(omega);
            if is_unexpected {
                assert!(report.tests >= all.tests, "frame {frame}: {} of {}", report.tests, all.tests);
            } else if before == view && frame > 0 {
                assert_eq!(report.tests, 0, "frame {frame} at rest");
            }
        }
    }
}

/// What all views would be brought to.
#[test]
fn a_tree_that_is_nowhere_is_refused() {
    let mut random = seeded(50);
    let mut log = scaled_log(1.0, false, &mut random);
    for x in [f64::NAN, f64::INFINITY, -1e151] {
        log.mesh.georeference.origin = [0.0, x, 0.0];
        let tree = InMemoryTree::new(Arc::new(InMemoryHierarchy::new(&log).unwrap()));
        let error = Engine::new(tree, NullSink, Settings::default()).err().unwrap();
        assert!(matches!(error, TreeError::Origin { .. }), "{error}");
    }
    // As far as can be, on both sides.
    log.mesh.georeference.origin = [0.0, -View::FARTHEST, 0.0];
    let tree = InMemoryTree::new(Arc::new(InMemoryHierarchy::new(&log).unwrap()));
    let mut engine = Engine::new(tree, NullSink, Settings::default()).unwrap();
    let view = look(1.0, 1.0, 0.02, &mut random).with_eye(DVec3::Y * View::FARTHEST).unwrap();
    assert_eq!(engine.advance(&[view]).unwrap().active_nodes, 0);
}
