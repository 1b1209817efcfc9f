//! A nominal pixel is a measured pixel: adaptive cuts of made-up meshes along made-up camera paths. Real ones are in
//! `tests/real`.

use std::path::Path as FilePath;

use crate::common::{meshes, seeded, trajectories};
use foldfront::Mesh;
use foldfront::experiment::path::around;
use foldfront::experiment::path::import::{Mode, Options, import_text};

fn nominal_is_measured(mesh: Mesh, trajectory: &str, mode: Mode, frames: usize) {
    let options = Options { mode, ..Options::default() };
    let path = import_text(FilePath::new("made up"), trajectory, &mesh, &options).unwrap();
    crate::nominal::nominal_is_measured(mesh, &path, frames);
}

#[test]
fn a_closed_surface_along_the_drone() {
    nominal_is_measured(meshes::with_handles(3, 30), &trajectories::drone(20), Mode::Orbit, 3);
}

#[test]
fn a_scan_along_the_hand_held_camera() {
    nominal_is_measured(meshes::scan(30, &mut seeded(1)), &trajectories::hand_held(20), Mode::Orbit, 3);
}

#[test]
fn mountains_from_all_around() {
    let mesh = meshes::ground(220, 8, &mut seeded(2));
    let path = around(&mesh).unwrap();
    crate::nominal::nominal_is_measured(mesh, &path, 3);
}

#[test]
fn mountains_along_the_car() {
    nominal_is_measured(meshes::ground(300, 0, &mut seeded(3)), &trajectories::car(60), Mode::Walk, 2);
}
