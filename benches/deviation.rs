//! What a nominal pixel measures, and what it costs in triangles, along recorded trajectories over real meshes.
//!
//! `cargo bench --bench deviation` prints a row a frame: distances between the original and the displayed mesh in
//! pixels at 1080 lines, one triangle inside the view's border, the worse of both ways; and the triangles in view, also
//! of the uniform cut (one error everywhere) through the same hierarchy that has the same 99th percentile there. It
//! needs `shared/data` beside the repository and takes some minutes.

use std::path::PathBuf;

use foldfront::construction::mesh_io;
use foldfront::construction::simplify;
use foldfront::experiment::compare::{Options, Subject};
use foldfront::experiment::deviation::{Deviation, Reference};
use foldfront::experiment::path::import::{self, Mode, import};
use foldfront::testing::cut::{Displayed, uniform_cut};

const LINES: u32 = 1080;
const FRAMES: usize = 4;

fn p99(deviation: &Deviation) -> f64 {
    deviation.forward.inner.p99.max(deviation.reverse.inner.p99)
}

fn worst(deviation: &Deviation) -> f64 {
    deviation.forward.inner.max.max(deviation.reverse.inner.max)
}

fn main() {
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    let cases = [
        ("dragon, drone", "meshes/dragon.ply", "paths/euroc_mh04_drone.txt", Mode::Orbit),
        ("happy, hand-held", "meshes/happy.ply", "paths/tum_fr2_desk_handheld_60hz.txt", Mode::Orbit),
        ("Sierra tile, flight", "terrain/N36W119.hgt", "paths/gcanyon_flight_hoppe.txt", Mode::Fly),
        ("Sierra tile, car", "terrain/N36W119.hgt", "paths/kitti_00_car_10hz.txt", Mode::Walk),
    ];
    println!(
        "| mesh, path | frame | 99 % | largest | triangles in view | of these flipped | uniform : adaptive |"
    );
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for (name, mesh, trajectory, mode) in cases {
        let (mesh, trajectory) = (data.join(mesh), data.join(trajectory));
        if !mesh.exists() || !trajectory.exists() {
            continue;
        }
        let quiet = &mut |_, _| {};
        let mesh = mesh_io::read(&[mesh], quiet).expect("the data are readable");
        let options = import::Options { mode, ..import::Options::default() };
        let path = import(&trajectory, &mesh, &options).expect("the data are readable");
        let (log, _) =
            simplify::build(mesh, &simplify::Options::default(), quiet).expect("the mesh is valid");
        let forest = log.forest().expect("the log was just built");
        let subject = Subject::new(name, &log).expect("the log was just built");
        let reference = Reference::new(&log.mesh);
        let options = Options::default();
        for n in 0..FRAMES {
            let frame = (2 * n + 1) * path.frames.len() / (2 * FRAMES);
            let camera = path.camera(frame).expect("a camera");
            let mesh = subject.frame(&path, frame, &options).expect("nothing can fail in memory");
            let adaptive = reference.deviation(&mesh, &camera, LINES);
            // The coarsest uniform cut that is no worse, to 2 % of its error.
            let (mut fine, mut coarse) = (log.mesh.extent() * 1e-7, log.mesh.extent() * 1e-2);
            let mut triangles = None;
            while coarse / fine > 1.02 {
                let eps = (fine * coarse).sqrt();
                let cut = Displayed::new(&log, &uniform_cut(&log, &forest, eps as f32));
                let uniform = reference.deviation(&cut.compact_mesh(&log.mesh), &camera, LINES);
                if p99(&uniform) <= p99(&adaptive) && uniform.forward.inner.count > 1000 {
                    (fine, triangles) = (eps, Some(uniform.triangles_in_view));
                } else {
                    coarse = eps;
                }
            }
            let ratio = triangles
                .map_or_else(String::new, |t| format!("{:.2}", t as f64 / adaptive.triangles_in_view as f64));
            println!(
                "| {name} | {frame} | {:.2} | {:.2} | {} | {} | {ratio} |",
                p99(&adaptive),
                worst(&adaptive),
                adaptive.triangles_in_view,
                adaptive.flipped_triangles,
            );
        }
    }
}
