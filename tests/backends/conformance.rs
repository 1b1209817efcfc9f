//! Every backend with every exact strategy against the brute-force cut, in every frame of long walks over built-in scenes
//! and made-up scans; those over real ones are in `tests/real`.

use std::path::Path as FilePath;
use std::sync::OnceLock;

use crate::common::{data, meshes, scenes, seeded, trajectories};
use crate::walks::{Length, follow, pixels};
use foldfront::experiment::path::import::{Mode, Options, import_text};
use foldfront::experiment::path::recorded;
use foldfront::experiment::scene::SceneKind;
use foldfront::selection::criterion::Criterion;
use foldfront::{CollapseLog, Mesh};

/// The first frames are for all backends. That they follow the same cuts in the rest, with every strategy, is frozen, see
/// `tests/experiment/frozen/cuts.rs`; and all do in all frames of the walks over real data.
const WITH_ALL: usize = 100;

fn recorded_paths(kind: SceneKind) {
    let log = scenes::log(kind);
    for path in recorded(kind).unwrap() {
        follow(log, &path, pixels(1.0), WITH_ALL, 20_000);
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

/// A scan with holes, handles and shards, its hierarchy built once for all tests.
fn scan() -> &'static CollapseLog {
    static SCAN: OnceLock<CollapseLog> = OnceLock::new();
    SCAN.get_or_init(|| data::log(meshes::scan(12, &mut seeded(1))))
}

#[test]
fn random_walk_over_a_scan() {
    let length = Length { frames: 6_000, with_all: 500, changes: 200_000 };
    crate::walks::random(scan(), Criterion::ScreenError, 300.0, 1, length);
}

#[test]
fn random_walk_by_the_size_of_spheres() {
    let length = Length { frames: 2_000, with_all: 200, changes: 100_000 };
    crate::walks::random(scan(), Criterion::SphereSize, 20.0, 2, length);
}

#[test]
fn a_slow_pan() {
    let log = data::reduced(scan(), 1500);
    crate::walks::a_slow_pan(&log, Length { frames: 50_000, with_all: 1_000, changes: 300 });
}

#[test]
fn a_zoom() {
    crate::walks::a_zoom(scan(), 60, 20_000);
}

#[test]
fn a_budget_tightened_and_loosened() {
    let budgets = [4_000, 1_000, 2_400, 0, 1_200, 6_000];
    crate::walks::a_budget_tightened_and_loosened(scan(), budgets, 200, 15_000);
}

#[test]
fn a_budget_in_time() {
    crate::walks::a_budget_in_time(scan(), 60, 20_000);
}

#[test]
fn several_views() {
    crate::walks::several_views(scan(), 400, 20_000);
}

/// A trajectory, brought to a mesh.
fn imported(trajectory: &str, mesh: Mesh, mode: Mode, rate: f64, theta: f64) {
    let options = Options { mode, rate, ..Options::default() };
    let path = import_text(FilePath::new("made up"), trajectory, &mesh, &options).unwrap();
    follow(&data::log(mesh), &path, theta, usize::MAX, 5_000);
}

#[test]
fn a_drone_over_an_object() {
    imported(&trajectories::drone(20), meshes::with_handles(3, 12), Mode::Fly, 60.0, pixels(2.0));
}

#[test]
fn a_car_through_a_town() {
    imported(&trajectories::car(20), meshes::part_of(SceneKind::City, 0.3), Mode::Walk, 30.0, pixels(1.0));
}

#[test]
fn a_hand_held_camera_around_a_patchwork() {
    let mesh = meshes::patchwork(10, &mut seeded(2));
    imported(&trajectories::hand_held(10), mesh, Mode::Orbit, 60.0, pixels(3.0));
}

#[test]
fn a_flight_over_mountains_with_voids() {
    let mesh = meshes::ground(100, 8, &mut seeded(3));
    imported(&trajectories::flight(12), mesh, Mode::Fly, 30.0, pixels(4.0));
}
