//! Every backend with every exact strategy against the brute-force cut, in every frame of long walks over built-in
//! scenes and real meshes.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

mod common;

use std::f64::consts::PI;
use std::sync::OnceLock;
use std::time::Duration;

use common::backends::{Conformance, Totals};
use common::{Random, data, random_step, random_view, turn};
use foldfront::budget::Budget;
use foldfront::criterion::Criterion;
use foldfront::engine::Settings;
use foldfront::path::import::{Mode, Options, import};
use foldfront::path::{Path, around, recorded};
use foldfront::scene::{Scene, SceneKind};
use foldfront::view::{Camera, View, theta_of_pixels};
use foldfront::{CollapseLog, Mesh};
use glam::{DQuat, DVec3};

/// One pixel on an image of 1080 lines.
fn pixels(number: f64) -> f64 {
    theta_of_pixels(number, 1080)
}

/// The speed of a path's 99th percentile is declared, as the command line does.
fn settings_for(path: &Path) -> Settings {
    let usual = path.motion_percentile(99.0);
    let least = |x: f64, otherwise: f64| if x > 0.0 { x } else { otherwise };
    Settings { rho: least(usual.rho, 1.0), omega: least(usual.omega, 0.02), ..Settings::default() }
}

/// Follows all frames of a path.
fn follow(log: &CollapseLog, path: &Path, theta: f64, criterion: Criterion) -> Totals {
    let mut table = Conformance::new(log, Settings { criterion, ..settings_for(path) });
    for frame in 0..path.frames.len() {
        table.advance(&[path.view(frame, theta).unwrap()]);
    }
    let totals = table.totals;
    eprintln!("{}: {totals:?}", path.name);
    assert_eq!(totals.frames, path.frames.len() as u64);
    assert!(totals.changes > 20_000, "{}: next to nothing happens: {totals:?}", path.name);
    assert!(totals.event_tests < totals.oracle_tests / 4, "{}: the schedule spares nothing", path.name);
    totals
}

fn recorded_paths(kind: SceneKind) {
    let scene = Scene::new(kind);
    let log = data::log(scene.mesh(&mut |_, _| ()));
    for path in recorded(kind).unwrap() {
        follow(&log, &path, pixels(1.0), Criterion::ScreenError);
    }
}

#[test]
fn city() {
    recorded_paths(SceneKind::City);
}

#[test]
fn alps() {
    recorded_paths(SceneKind::Alps);
}

#[test]
fn laserscan() {
    recorded_paths(SceneKind::Laserscan);
}

/// The bunny, built once for all tests.
fn bunny() -> Option<&'static CollapseLog> {
    static BUNNY: OnceLock<Option<CollapseLog>> = OnceLock::new();
    BUNNY.get_or_init(|| data::mesh("meshes/bunny.ply").map(data::log)).as_ref()
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

/// So many frames of a long walk are for all backends, the others for the first alone: what is long is for the engine.
const ALL_BACKENDS: usize = 4_000;

/// Slow and fast, rests and teleports.
fn random_walk(criterion: Criterion, k: f64, seed: u64, frames: usize) {
    let Some(log) = bunny() else { return };
    let placed = Placed::around(&log.mesh);
    let settings = Settings { criterion, rho: 0.02 * placed.scale, omega: 0.02, ..Settings::default() };
    let mut table = Conformance::new(log, settings);
    let mut random = Random(seed);
    let mut view = random_view(&mut random).with_k(k).unwrap();
    for frame in 0..frames {
        if frame == ALL_BACKENDS {
            table.go_on_with_the_first();
        }
        random_step(&mut view, &mut random);
        table.advance(&[placed.view(view)]);
    }
    eprintln!("{:?}", table.totals);
    assert!(table.totals.changes > 10 * frames as u64, "{:?}", table.totals);
}

#[test]
fn random_walk_over_the_bunny() {
    random_walk(Criterion::ScreenError, 300.0, 1, 100_000);
}

#[test]
fn random_walk_by_the_size_of_spheres() {
    random_walk(Criterion::SphereSize, 20.0, 2, 20_000);
}

/// 1e-5 radians a frame, more than once around: the arc cosine of an f32 dot product would not see it.
#[test]
fn a_pan_of_a_million_frames() {
    let Some(log) = bunny() else { return };
    let log = &data::reduced(log, 1500);
    let placed = Placed::around(&log.mesh);
    let mut table = Conformance::new(log, Settings { rho: 0.02 * placed.scale, ..Settings::default() });
    let mut random = Random(3);
    // From within, so that the mesh is on all sides.
    let eye = DVec3::new(0.1, -0.2, 0.1);
    let mut view = random_view(&mut random).with_k(200.0).unwrap().with_eye(eye).unwrap();
    let axis = view.direction().any_orthonormal_vector();
    for frame in 0..1_000_000 {
        if frame == 10 * ALL_BACKENDS {
            table.go_on_with_the_first();
        }
        view =
            view.with_direction((DQuat::from_axis_angle(axis, 1e-5) * view.direction()).normalize()).unwrap();
        table.advance(&[placed.view(view)]);
    }
    eprintln!("{:?}", table.totals);
    assert!(table.totals.changes > 1000, "{:?}", table.totals);
    assert!(table.totals.event_tests < table.totals.oracle_tests / 100, "{:?}", table.totals);
}

/// The lens zooms in and out, and so does the tolerance, alone, together, and while the camera moves; then the window
/// changes its shape, which changes nothing but the cone.
#[test]
fn a_zoom() {
    let Some(log) = bunny() else { return };
    let path = around(&log.mesh).unwrap();
    let mut table = Conformance::new(log, settings_for(&path));
    for frame in 0..5000 {
        let phase = f64::from(frame) / 1000.0;
        let swing = |from: f64, to: f64| from * (to / from).powf(0.5 - 0.5 * (2.0 * PI * phase).cos());
        let fov_y = if [0, 2, 3].contains(&(frame / 1000)) { swing(60.0, 2.0) } else { 60.0 };
        let theta = if [1, 2, 3].contains(&(frame / 1000)) { swing(1.0, 0.05) } else { 1.0 };
        // From frame 360 on the mesh is larger than the view.
        let moving = if frame / 1000 == 3 { frame as usize % 720 } else { 400 };
        let aspect = if frame / 1000 == 4 { swing(0.1, 2.0) } else { 1.8 };
        let at = path.camera(moving).unwrap();
        let camera = Camera::new(at.position(), at.orientation(), f64::to_radians(fov_y), aspect).unwrap();
        table.advance(&[View::new(&camera, pixels(theta)).unwrap()]);
    }
    eprintln!("{:?}", table.totals);
    assert!(table.totals.changes > 20_000, "{:?}", table.totals);
}

/// The budget is tightened and loosened, and lifted for a while; the camera moves, rests and moves on.
#[test]
fn a_budget_tightened_and_loosened() {
    let Some(log) = bunny() else { return };
    let path = around(&log.mesh).unwrap();
    let mut table = Conformance::new(log, settings_for(&path));
    for (round, budget) in [20_000, 4_000, 12_000, 0, 1_000, 30_000].into_iter().enumerate() {
        table.set_budget(if budget == 0 { Budget::None } else { Budget::Triangles(budget) });
        table.totals.triangles = None;
        for frame in 0..600 {
            // At rest, the budget is what moves the front.
            let at = (round * 300 + frame.min(300)) % path.frames.len();
            table.advance(&[path.view(at, pixels(0.25)).unwrap()]);
        }
        eprintln!("{budget}: {:?}", table.totals);
        if budget != 0 {
            let (least, most) = table.totals.triangles.unwrap();
            assert!(least <= budget && most > budget / 2, "{budget}: {:?}", table.totals);
        }
    }
    assert!(table.totals.changes > 50_000, "{:?}", table.totals);
}

/// What a frame takes is different every time, and with it the tolerance; the cut is exact all the same.
#[test]
fn a_budget_in_time() {
    let Some(log) = bunny() else { return };
    let path = around(&log.mesh).unwrap();
    let mut table = Conformance::new(log, settings_for(&path));
    for microseconds in [5, 50, 1] {
        table.set_budget(Budget::FrameTime(Duration::from_micros(microseconds)));
        for frame in 0..300 {
            table.advance_each(&[path.view(frame, pixels(1.0)).unwrap()]);
        }
    }
    assert!(table.totals.changes > 20_000, "{:?}", table.totals);
}

/// Two eyes and a shadow's view, which come and go.
#[test]
fn several_views() {
    let Some(log) = bunny() else { return };
    let log = &data::reduced(log, 8000);
    let placed = Placed::around(&log.mesh);
    let mut table = Conformance::new(log, Settings { rho: 0.02 * placed.scale, ..Settings::default() });
    let mut random = Random(4);
    let mut left = random_view(&mut random).with_k(300.0).unwrap();
    let mut shadow = random_view(&mut random).with_k(50.0).unwrap();
    for frame in 0..4000 {
        random_step(&mut left, &mut random);
        turn(&mut shadow, 0.001, &mut random);
        let right = left.with_eye(left.eye() + 0.01 * left.direction().any_orthonormal_vector()).unwrap();
        let views = [left, right, shadow].map(|view| placed.view(view));
        table.advance(&views[..[3, 2, 1, 0, 3][frame / 40 % 5]]);
    }
    assert!(table.totals.changes > 100_000, "{:?}", table.totals);
}

/// A recorded trajectory, brought to a mesh.
fn imported(trajectory: &str, fit: &str, mode: Mode, rate: f64, theta: f64) {
    let (Some(file), Some(mesh)) = (data::shared(&format!("paths/{trajectory}")), data::mesh(fit)) else {
        return;
    };
    let path = import(&file, &mesh, &Options { mode, rate, ..Options::default() }).unwrap();
    follow(&data::log(mesh), &path, theta, Criterion::ScreenError);
}

#[test]
fn a_drone_over_an_animal() {
    imported("euroc_mh04_drone.txt", "meshes/horse.ply", Mode::Fly, 60.0, pixels(0.5));
}

#[test]
fn a_car_through_a_town() {
    imported("kitti_00_car_10hz.txt", "city/denhaag01_lod2_terrain.obj", Mode::Walk, 30.0, pixels(1.0));
}

#[test]
fn a_hand_held_camera_around_a_scan() {
    imported("tum_fr2_desk_handheld_60hz.txt", "meshes/beast.ply", Mode::Orbit, 60.0, pixels(0.5));
}

#[test]
fn a_flight_over_a_canyon() {
    imported(
        "gcanyon_4k2k_fly4.edited.frames",
        "terrain/gcanyon_elev_1200_8bit.png",
        Mode::Fly,
        10.0,
        pixels(1.0),
    );
}
