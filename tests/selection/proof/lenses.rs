//! Short walks of every size through every lens.

use std::f64::consts::PI;

use foldfront::selection::budget::Budget;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::Settings;
use foldfront::selection::view::View;
use glam::DQuat;

use super::follow::{Party, look, scaled_log};
use crate::common::{direction, seeded};
use rand::RngExt;
use rand_pcg::Pcg64;

const SCALES: [f64; 9] = [1e-42, 1e-40, 1e-30, 1e-15, 1.0, 1e9, 1e25, 1e36, 1e37];

/// From 1e-8 radians to 180 degrees.
fn lenses() -> [f64; 8] {
    [1e-8, 1e-6, 1e-3, 0.3, 1.0, 2.6, 3.13, PI.next_down()]
}

/// One frame of a walk: at rest, slow, fast, turning by as much as a narrow lens does and by more, elsewhere.
fn step(view: View, scale: f64, fov_y: f64, theta: f64, random: &mut Pcg64) -> View {
    let walk = |view: View, length: f64, random: &mut Pcg64| {
        view.with_eye(view.eye() + direction(random) * random.random::<f64>() * length * scale).unwrap()
    };
    let turn = |view: View, angle: f64, random: &mut Pcg64| {
        let turn = DQuat::from_axis_angle(direction(random), angle * random.random::<f64>());
        view.with_direction((turn * view.direction()).normalize()).unwrap()
    };
    match random.random_range(0..12) {
        0 => look(scale, fov_y, theta, random),
        1 => view,
        2 => walk(view, 0.5, random),
        3 => turn(view, 1.0, random),
        4..8 => turn(walk(view, 0.003, random), 0.3 * fov_y, random),
        _ => turn(walk(view, 0.3 * fov_y.min(0.1), random), 1e-3 * fov_y, random),
    }
}

#[test]
fn of_every_size_through_every_lens() {
    let mut random = seeded(43);
    for scale in SCALES {
        let log = scaled_log(scale, false, &mut random);
        let mut changes = 0;
        for fov_y in lenses() {
            for criterion in [Criterion::ScreenError, Criterion::SphereSize] {
                // At the same size on the image.
                let theta =
                    0.01 / (0.5 * fov_y).tan().max(1e-4) * [0.1, 1.0, 10.0][random.random_range(0..3)];
                let rho = 0.01 * scale;
                let mut party = Party::new(&log, Settings { criterion, rho, ..Settings::default() });
                let mut view = look(scale, fov_y, theta, &mut random);
                for frame in 0..120 {
                    if frame == 60 {
                        // Another aspect and another tolerance within a walk.
                        view = look(scale, fov_y, 3.0 * theta, &mut random);
                    }
                    party.advance(&[view], true);
                    view = step(view, scale, fov_y, theta, &mut random);
                }
                changes += party.changes;
            }
        }
        assert!(changes > 20_000, "scale {scale}: {changes} changes");
    }
}

#[test]
fn elsewhere_in_every_frame() {
    let mut random = seeded(44);
    for scale in [1e-42, 1.0, 1e37] {
        let log = scaled_log(scale, false, &mut random);
        let mut party = Party::new(&log, Settings { rho: 0.01 * scale, ..Settings::default() });
        for _ in 0..2000 {
            let fov_y = lenses()[random.random_range(0..8)];
            party.advance(&[look(scale, fov_y, 0.01, &mut random)], true);
        }
        assert!(party.changes > 20_000, "{} changes", party.changes);
    }
}

/// None, one, a few, more than the filter takes; some move and some do not.
#[test]
fn views_come_and_go() {
    let mut random = seeded(45);
    let log = scaled_log(1.0, false, &mut random);
    let mut party = Party::new(&log, Settings { rho: 0.01, ..Settings::default() });
    let mut views: Vec<View> = Vec::new();
    for _ in 0..6000 {
        match random.random_range(0..20) {
            0 if views.len() < 12 => {
                let fov_y = lenses()[random.random_range(0..8)];
                views.push(look(1.0, fov_y, 0.02, &mut random));
            }
            1 if !views.is_empty() => drop(views.swap_remove(random.random_range(0..views.len()))),
            2 if random.random_ratio(1, 8) => views.clear(),
            3 => views.reverse(),
            _ => {}
        }
        for view in &mut views {
            if random.random_ratio(2, 3) {
                *view = step(*view, 1.0, 0.3, 0.02, &mut random);
            }
        }
        party.advance(&views, true);
    }
    assert!(party.changes > 20_000, "{} changes", party.changes);
}

/// Where every error is 0 and the tolerance next to it, and where a budget steers a tolerance that can get no finer.
#[test]
fn flat_ground_at_the_finest_tolerance() {
    let mut random = seeded(46);
    for is_flat in [true, false] {
        let log = scaled_log(1.0, is_flat, &mut random);
        for criterion in [Criterion::ScreenError, Criterion::SphereSize] {
            for budget in [Budget::None, Budget::Displayed(60)] {
                let settings = Settings { criterion, budget, rho: 0.01, ..Settings::default() };
                let mut party = Party::new(&log, settings);
                let theta = 1.2e-308;
                let mut view = look(1.0, 1.0, theta, &mut random);
                for _ in 0..300 {
                    party.advance(&[view], true);
                    view = step(view, 1.0, 1.0, theta, &mut random);
                }
            }
        }
    }
}
