//! Every backend with every exact strategy along long walks over scans and terrain.

use std::path::PathBuf;
use std::sync::OnceLock;

use foldfront::CollapseLog;
use foldfront::experiment::path::import::{Mode, Options, import};
use foldfront::selection::criterion::Criterion;
use libtest_mimic::Trial;

use crate::common::data;
use crate::kit::{self, needs};
use crate::walks::{self, Length, follow, pixels};

/// A walk over the bunny, whose hierarchy is built once for all of them.
fn over_the_bunny(name: &str, walk: impl FnOnce(&CollapseLog) + Send + 'static) -> Trial {
    static BUNNY: OnceLock<CollapseLog> = OnceLock::new();
    needs(name, ["meshes/bunny.ply"], |[file]| walk(BUNNY.get_or_init(|| kit::log(file))))
}

/// A recorded trajectory, brought to a mesh.
fn imported(name: &str, [trajectory, mesh]: [&str; 2], mode: Mode, rate: f64, theta: f64) -> Trial {
    needs(name, [trajectory, mesh], move |[trajectory, mesh]: [PathBuf; 2]| {
        let mesh = kit::mesh(mesh);
        let path = import(&trajectory, &mesh, &Options { mode, rate, ..Options::default() }).unwrap();
        follow(&data::log(mesh), &path, theta, usize::MAX, 20_000);
    })
}

pub fn trials() -> Vec<Trial> {
    vec![
        over_the_bunny("conformance::random_walk", |log| {
            let length = Length { frames: 100_000, with_all: 4_000, changes: 1_000_000 };
            walks::random(log, Criterion::ScreenError, 300.0, 1, length);
        }),
        over_the_bunny("conformance::random_walk_by_the_size_of_spheres", |log| {
            let length = Length { frames: 20_000, with_all: 4_000, changes: 200_000 };
            walks::random(log, Criterion::SphereSize, 20.0, 2, length);
        }),
        // More than once around.
        over_the_bunny("conformance::a_slow_pan_of_a_million_frames", |log| {
            let length = Length { frames: 1_000_000, with_all: 40_000, changes: 1000 };
            walks::a_slow_pan(&data::reduced(log, 1500), length);
        }),
        over_the_bunny("conformance::a_zoom", |log| walks::a_zoom(log, 1000, 20_000)),
        over_the_bunny("conformance::a_budget_tightened_and_loosened", |log| {
            let budgets = [20_000, 4_000, 12_000, 0, 1_000, 30_000];
            walks::a_budget_tightened_and_loosened(log, budgets, 600, 50_000);
        }),
        over_the_bunny("conformance::a_budget_in_time", |log| walks::a_budget_in_time(log, 300, 20_000)),
        over_the_bunny("conformance::several_views", |log| {
            walks::several_views(&data::reduced(log, 8000), 4000, 100_000);
        }),
        imported(
            "conformance::a_drone_over_the_horse",
            ["paths/euroc_mh04_drone.txt", "meshes/horse.ply"],
            Mode::Fly,
            60.0,
            pixels(0.5),
        ),
        imported(
            "conformance::a_car_through_den_haag",
            ["paths/kitti_00_car_10hz.txt", "city/denhaag01_lod2_terrain.obj"],
            Mode::Walk,
            30.0,
            pixels(1.0),
        ),
        imported(
            "conformance::a_hand_held_camera_around_the_beast",
            ["paths/tum_fr2_desk_handheld_60hz.txt", "meshes/beast.ply"],
            Mode::Orbit,
            60.0,
            pixels(0.5),
        ),
        imported(
            "conformance::a_flight_over_the_grand_canyon",
            ["paths/gcanyon_4k2k_fly4.edited.frames", "terrain/gcanyon_elev_1200_8bit.png"],
            Mode::Fly,
            10.0,
            pixels(1.0),
        ),
    ]
}
