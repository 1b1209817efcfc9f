//! A nominal pixel is a measured pixel, on scans and terrain along recorded camera paths.

use foldfront::experiment::path::import::{Mode, Options, import};
use libtest_mimic::Trial;

use crate::kit::{self, needs};
use crate::nominal::nominal_is_measured;

fn trial(name: &str, files: [&str; 2], mode: Mode, frames: usize) -> Trial {
    needs(&format!("deviation::{name}"), files, move |[mesh, trajectory]| {
        let mesh = kit::mesh(mesh);
        let path = import(&trajectory, &mesh, &Options { mode, ..Options::default() }).unwrap();
        nominal_is_measured(mesh, &path, frames);
    })
}

pub fn trials() -> Vec<Trial> {
    let [dragon, buddha, sierra] = ["meshes/dragon.ply", "meshes/happy.ply", "terrain/N36W119.hgt"];
    let hand_held = "paths/tum_fr2_desk_handheld_60hz.txt";
    vec![
        trial("dragon_along_the_drone", [dragon, "paths/euroc_mh04_drone.txt"], Mode::Orbit, 3),
        trial("buddha_along_the_hand_held_camera", [buddha, hand_held], Mode::Orbit, 3),
        trial("sierra_along_the_flight", [sierra, "paths/gcanyon_flight_hoppe.txt"], Mode::Fly, 3),
        trial("sierra_along_the_car", [sierra, "paths/kitti_00_car_10hz.txt"], Mode::Walk, 2),
    ]
}
