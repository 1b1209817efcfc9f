//! A nominal pixel is a measured pixel: adaptive cuts of real meshes along real camera paths.
//!
//! Needs the data in `../shared/data`, and is skipped without.

use std::path::{Path as FilePath, PathBuf};

use foldfront::compare::{Options, Subject};
use foldfront::cut::{Displayed, uniform_cut};
use foldfront::deviation::Reference;
use foldfront::path::import::{self, Mode, import};
use foldfront::{mesh_io, simplify};

const LINES: u32 = 1080;

fn data(file: &str) -> Option<PathBuf> {
    let file = FilePath::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data").join(file);
    file.exists().then_some(file)
}

/// At nominal 1 pixel, in frames spread over the path, one triangle inside the view's border, both ways: 99 % of the
/// surface within 1 pixel, all of it within 3; and a uniform cut through the same hierarchy that shows at most two
/// thirds of the adaptive cut's triangles in that view is worse than it.
fn nominal_is_measured(mesh: &str, trajectory: &str, mode: Mode, frames: usize) {
    let (Some(mesh), Some(trajectory)) = (data(mesh), data(trajectory)) else { return };
    let quiet = &mut |_, _| {};
    let mesh = mesh_io::read(&[mesh], quiet).unwrap();
    let path = import(&trajectory, &mesh, &import::Options { mode, ..import::Options::default() }).unwrap();
    let (log, _) = simplify::build(mesh, &simplify::Options::default(), quiet).unwrap();
    let forest = log.forest().unwrap();
    let subject = Subject::new("", &log).unwrap();
    let reference = Reference::new(&log.mesh);
    let options = Options::default();
    for n in 0..frames {
        let frame = (2 * n + 1) * path.frames.len() / (2 * frames);
        let camera = path.camera(frame).unwrap();
        let mesh = subject.frame(&path, frame, &options).unwrap();
        let adaptive = reference.deviation(&mesh, &camera, LINES);
        let (forward, reverse) = (adaptive.forward.inner, adaptive.reverse.inner);
        assert!(forward.count > 1000 && reverse.count > 1000, "frame {frame} shows nothing: {adaptive}");
        let p99 = forward.p99.max(reverse.p99);
        assert!(p99 <= 1.0 && forward.max.max(reverse.max) <= 3.0, "frame {frame}: {adaptive}");

        // The finest uniform cut with at most two thirds of the triangles in view.
        let uniform =
            |eps: f64| Displayed::new(&log, &uniform_cut(&log, &forest, eps as f32)).compact_mesh(&log.mesh);
        let most = adaptive.triangles_in_view * 2 / 3;
        let (mut fine, mut coarse) = (log.mesh.extent() * 1e-9, log.mesh.extent());
        while coarse / fine > 1.01 {
            let eps = (fine * coarse).sqrt();
            if reference.triangles_in_view(&uniform(eps), &camera) > most {
                fine = eps;
            } else {
                coarse = eps;
            }
        }
        let uniform = reference.deviation(&uniform(coarse), &camera, LINES);
        assert!(
            uniform.forward.inner.p99.max(uniform.reverse.inner.p99) > p99,
            "frame {frame}: {} triangles in view give {p99} pixels, and a uniform cut: {uniform}",
            adaptive.triangles_in_view,
        );
    }
}

#[test]
fn dragon_along_the_drone() {
    nominal_is_measured("meshes/dragon.ply", "paths/euroc_mh04_drone.txt", Mode::Orbit, 3);
}

#[test]
fn happy_along_the_hand_held_camera() {
    nominal_is_measured("meshes/happy.ply", "paths/tum_fr2_desk_handheld_60hz.txt", Mode::Orbit, 3);
}

#[test]
fn sierra_along_the_flight() {
    nominal_is_measured("terrain/N36W119.hgt", "paths/gcanyon_flight_hoppe.txt", Mode::Fly, 3);
}

#[test]
fn sierra_along_the_car() {
    nominal_is_measured("terrain/N36W119.hgt", "paths/kitti_00_car_10hz.txt", Mode::Walk, 2);
}
