//! Every recorded trajectory, brought to terrain, a town and scanned objects in every mode.

use std::path::PathBuf;

use foldfront::Mesh;
use foldfront::experiment::path::import::{Options, import};
use foldfront::experiment::scene::{Scene, SceneKind};
use libtest_mimic::Trial;

use crate::arriving::comes_to_in_every_mode;
use crate::kit::{self, needs};

/// Files and their rate. The soaring flight lasts ten hours.
const TRAJECTORIES: [(&str, f64); 6] = [
    ("paths/euroc_mh04_drone.txt", 60.0),
    ("paths/gcanyon_4k2k_fly4.edited.frames", 60.0),
    ("paths/gcanyon_flight_hoppe.txt", 60.0),
    ("paths/kitti_00_car_10hz.txt", 60.0),
    ("paths/soaring_flight_hohe_tauern_dachstein_1hz.txt", 5.0),
    ("paths/tum_fr2_desk_handheld_60hz.txt", 60.0),
];

fn all_come_to(mesh: &Mesh, trajectories: &[PathBuf]) {
    for (file, (_, rate)) in trajectories.iter().zip(TRAJECTORIES) {
        comes_to_in_every_mode(mesh, 900, |options| {
            import(file, mesh, &Options { rate, ..*options }).unwrap()
        });
    }
}

pub fn trials() -> Vec<Trial> {
    let trajectories = TRAJECTORIES.map(|(file, _)| file);
    let [a, b, c, d, e, f] = trajectories;
    let to = |mesh: &'static str| {
        let name = format!("path::all_trajectories_come_to::{}", kit::stem(mesh));
        needs(&name, [a, b, c, d, e, f, mesh], |files| all_come_to(&kit::mesh(files[6].clone()), &files[..6]))
    };
    vec![
        to("meshes/bunny.ply"),
        to("meshes/dragon.ply"),
        to("terrain/N37W119.hgt"),
        needs("path::all_trajectories_come_to::city", trajectories, |files| {
            all_come_to(&Scene::new(SceneKind::City).mesh(&mut |_, _| ()), &files);
        }),
    ]
}
