//! Long walks of every backend with every exact strategy against the brute-force cut, over any hierarchy.

#![expect(clippy::disallowed_methods, reason = "random motions")]

use std::f64::consts::PI;
use std::time::Duration;

use foldfront::experiment::path::{Path, around};
use foldfront::selection::budget::Budget;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::Settings;
use foldfront::selection::view::{Camera, View, theta_of_pixels};
use foldfront::testing::walk::turned;
use foldfront::{CollapseLog, Mesh};
use glam::{DQuat, DVec3};

use crate::common::backends::Conformance;
use crate::common::{random_step, random_view, seeded};

/// So many pixels on an image of 1080 lines.
pub fn pixels(number: f64) -> f64 {
    theta_of_pixels(number, 1080)
}

/// The speed of a path's 99th percentile is declared, as the command line does.
fn settings_for(path: &Path) -> Settings {
    let usual = path.motion_percentile(99.0);
    let least = |x: f64, otherwise: f64| if x > 0.0 { x } else { otherwise };
    Settings { rho: least(usual.rho, 1.0), omega: least(usual.omega, 0.02), ..Settings::default() }
}

/// Follows all frames of a path, so many of them with all backends, with at least so many changes.
pub fn follow(log: &CollapseLog, path: &Path, theta: f64, with_all: usize, changes: u64) {
    let mut table = Conformance::new(log, settings_for(path));
    for frame in 0..path.frames.len() {
        if frame == with_all {
            table.go_on_with_the_first();
        }
        table.advance(&[path.view(frame, theta).unwrap()]);
    }
    let totals = table.totals;
    eprintln!("{}: {totals:?}", path.name);
    assert_eq!(totals.frames, path.frames.len() as u64);
    assert!(totals.changes > changes, "{}: next to nothing happens: {totals:?}", path.name);
    assert!(totals.queue_tests < totals.oracle_tests / 16, "{}: the schedule spares nothing", path.name);
}

/// From the space of walks around the origin, where a mesh has an extent of about 2, to that of a mesh.
struct Placed {
    center: DVec3,
    scale: f64,
}

impl Placed {
    fn around(mesh: &Mesh) -> Self {
        let (lo, hi) = mesh.bounding_box().unwrap();
        let [lo, hi] = [lo, hi].map(|p| DVec3::from(p.map(f64::from)));
        Self { center: (lo + hi) / 2.0, scale: mesh.extent() / 2.0 }
    }

    fn view(&self, view: View) -> View {
        view.with_eye(self.center + self.scale * view.eye()).unwrap()
    }
}

/// How long a walk is.
#[derive(Clone, Copy)]
pub struct Length {
    pub frames: u32,
    /// So many of them are for all backends, the others for the first alone: what is long is for the engine.
    pub with_all: u32,
    /// At least so many nodes change.
    pub changes: u64,
}

/// Slow and fast, rests and teleports.
pub fn random(log: &CollapseLog, criterion: Criterion, k: f64, seed: u64, length: Length) {
    let placed = Placed::around(&log.mesh);
    let settings = Settings { criterion, rho: 0.02 * placed.scale, omega: 0.02, ..Settings::default() };
    let mut table = Conformance::new(log, settings);
    let mut random = seeded(seed);
    let mut view = random_view(&mut random).with_k(k).unwrap();
    for frame in 0..length.frames {
        if frame == length.with_all {
            table.go_on_with_the_first();
        }
        random_step(&mut view, &mut random);
        table.advance(&[placed.view(view)]);
    }
    eprintln!("{:?}", table.totals);
    assert!(table.totals.changes > length.changes, "{:?}", table.totals);
}

/// 1e-5 radians a frame: the arc cosine of an f32 dot product would not see it.
pub fn a_slow_pan(log: &CollapseLog, length: Length) {
    let placed = Placed::around(&log.mesh);
    let mut table = Conformance::new(log, Settings { rho: 0.02 * placed.scale, ..Settings::default() });
    let mut random = seeded(3);
    // From within, so that the mesh is on all sides.
    let eye = DVec3::new(0.1, -0.2, 0.1);
    let mut view = random_view(&mut random).with_k(200.0).unwrap().with_eye(eye).unwrap();
    let axis = view.direction().any_orthonormal_vector();
    for frame in 0..length.frames {
        if frame == length.with_all {
            table.go_on_with_the_first();
        }
        view =
            view.with_direction((DQuat::from_axis_angle(axis, 1e-5) * view.direction()).normalize()).unwrap();
        table.advance(&[placed.view(view)]);
    }
    eprintln!("{:?}", table.totals);
    assert!(table.totals.changes > length.changes, "{:?}", table.totals);
    assert!(table.totals.queue_tests < table.totals.oracle_tests / 100, "{:?}", table.totals);
}

/// The lens zooms in and out, and so does the tolerance, alone, together, and while the camera moves; then the window
/// changes its shape, which changes nothing but the cone. Each of the five takes so many frames.
pub fn a_zoom(log: &CollapseLog, swing_frames: u32, changes: u64) {
    let path = around(&log.mesh).unwrap();
    let mut table = Conformance::new(log, settings_for(&path));
    for frame in 0..5 * swing_frames {
        let phase = f64::from(frame) / f64::from(swing_frames);
        let swing = |from: f64, to: f64| from * (to / from).powf(0.5 - 0.5 * (2.0 * PI * phase).cos());
        let part = frame / swing_frames;
        let fov_y = if [0, 2, 3].contains(&part) { swing(60.0, 2.0) } else { 60.0 };
        let theta = if [1, 2, 3].contains(&part) { swing(1.0, 0.05) } else { 1.0 };
        // From frame 360 on the mesh is larger than the view.
        let moving = if part == 3 { frame as usize % 720 } else { 400 };
        let aspect = if part == 4 { swing(0.1, 2.0) } else { 1.8 };
        let at = path.camera(moving).unwrap();
        let camera = Camera::new(at.position(), at.orientation(), f64::to_radians(fov_y), aspect).unwrap();
        table.advance(&[View::new(&camera, pixels(theta)).unwrap()]);
    }
    eprintln!("{:?}", table.totals);
    assert!(table.totals.changes > changes, "{:?}", table.totals);
}

/// The budget is tightened and loosened, and lifted for a while, where it is 0; the camera moves, rests and moves on. Each
/// budget is there for so many frames, and fewer triangles than are wanted.
pub fn a_budget_tightened_and_loosened(log: &CollapseLog, budgets: [u64; 6], frames: usize, changes: u64) {
    let path = around(&log.mesh).unwrap();
    let mut table = Conformance::new(log, settings_for(&path));
    for (round, budget) in budgets.into_iter().enumerate() {
        table.set_budget(if budget == 0 { Budget::None } else { Budget::Displayed(budget) });
        table.totals.triangles = None;
        for frame in 0..frames {
            // At rest, the budget is what moves the front.
            let at = (round * 300 + frame.min(frames / 2)) % path.frames.len();
            table.advance(&[path.view(at, pixels(0.25)).unwrap()]);
        }
        eprintln!("{budget}: {:?}", table.totals);
        if budget != 0 {
            let (least, most) = table.totals.triangles.unwrap();
            assert!(least <= budget && most > budget / 2, "{budget}: {:?}", table.totals);
        }
    }
    assert!(table.totals.changes > changes, "{:?}", table.totals);
}

/// What a frame takes is different every time, and with it the tolerance; the cut is exact all the same.
pub fn a_budget_in_time(log: &CollapseLog, frames: usize, changes: u64) {
    let path = around(&log.mesh).unwrap();
    let mut table = Conformance::new(log, settings_for(&path));
    for microseconds in [5, 50, 1] {
        table.set_budget(Budget::FrameTime(Duration::from_micros(microseconds)));
        for frame in 0..frames {
            table.advance_each(&[path.view(frame, pixels(1.0)).unwrap()]);
        }
    }
    assert!(table.totals.changes > changes, "{:?}", table.totals);
}

/// Two eyes and a shadow's view, which come and go.
pub fn several_views(log: &CollapseLog, frames: usize, changes: u64) {
    let placed = Placed::around(&log.mesh);
    let mut table = Conformance::new(log, Settings { rho: 0.02 * placed.scale, ..Settings::default() });
    let mut random = seeded(4);
    let mut left = random_view(&mut random).with_k(300.0).unwrap();
    let mut shadow = random_view(&mut random).with_k(50.0).unwrap();
    for frame in 0..frames {
        random_step(&mut left, &mut random);
        shadow = turned(shadow, 0.001, &mut random);
        let right = left.with_eye(left.eye() + 0.01 * left.direction().any_orthonormal_vector()).unwrap();
        let views = [left, right, shadow].map(|view| placed.view(view));
        table.advance(&views[..[3, 2, 1, 0, 3][frame / 40 % 5]]);
    }
    assert!(table.totals.changes > changes, "{:?}", table.totals);
}
