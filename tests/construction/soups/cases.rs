//! Meshes that construction once did not end on, or did next to nothing for.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::path::{Path, PathBuf};

use foldfront::Mesh;
use foldfront::construction::mesh_io;
use foldfront::experiment::compare::{Options, Subject};
use foldfront::experiment::path::around;
use foldfront::experiment::store::{self, Backend, BuildOptions, Store};
use foldfront::selection::view::theta_of_pixels;

use super::check::{backends, construction, log_within, same_within_little_memory};
use super::follow::views;

fn case(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/cases")).join(name)
}

fn read(name: &str) -> Mesh {
    mesh_io::read(&[case(name)], &mut |_, _| ()).unwrap()
}

fn collapses(mesh: &Mesh) -> (usize, f32) {
    let (_, report) = log_within(mesh, false, 200).unwrap();
    (report.collapses, report.largest_eps)
}

/// A candidate whose target had been merged away was taken up again in every round: winding hides a neighbour there.
#[test]
fn what_never_ended_ends() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["livelock-14.obj", "livelock-merging-41.obj", "construction-never-ends.obj"] {
        let mesh = read(name);
        for pixels in [1.0, 50.0] {
            let views = views(&mesh, pixels);
            for merge in [false, true] {
                let (log, _) = construction(&mesh, merge, &views).unwrap();
                backends(&log, folder.path(), &views).unwrap();
                if !merge && mesh.georeference.origin == [0.0; 3] {
                    same_within_little_memory(&mesh, &log, folder.path()).unwrap();
                }
            }
        }
        let (log, _) = construction(&mesh, false, &[]).unwrap();
        for backend in Backend::ALL {
            let file = folder.path().join("replayed");
            store::write(backend, &file, &log, &BuildOptions::default()).unwrap();
            let mut subject = Subject::of_store(name, Store::open(&file).unwrap());
            let options = Options { check: true, theta: theta_of_pixels(30.0, 1080), ..Options::default() };
            let path = around(&mesh).unwrap();
            let runs = subject.replay(&path, 0..path.frames.len(), &options, &mut |_, _| ()).unwrap();
            for run in runs.iter().filter(|run| run.strategy.is_exact()) {
                assert!(run.rows.iter().all(|row| row.wrong == Some(0)), "{name}, {}", backend.name());
            }
        }
    }
}

/// A grid of 20 by 20 makes as many collapses at x + 300,000 as at the origin, and as good ones.
#[test]
fn a_grid_is_simplified_wherever_it_is() {
    let there = read("grid-at-300000.obj");
    assert_eq!(there.georeference.origin, [0.0; 3], "32 bits hold it");
    let mut here = there.clone();
    here.positions.iter_mut().for_each(|p| p[0] -= 300_000.0);
    let ((there, there_eps), (here, here_eps)) = (collapses(&there), collapses(&here));
    assert!(there >= 380 && here >= 380, "{there} collapses at 300,000, {here} at the origin");
    assert!((there_eps / here_eps - 1.0).abs() < 0.01, "{there_eps} at 300,000, {here_eps} at the origin");
    let (utm, _) = collapses(&read("terrain-utm-10m.obj"));
    assert!(utm >= 380, "{utm} collapses in UTM");
}

/// A vertex that no triangle uses, a million units away, changes nothing.
#[test]
fn a_far_vertex_makes_no_difference() {
    let with = read("grid-with-far-vertex.ply");
    let far = with.positions.iter().position(|p| p[0] == 1e6).unwrap();
    assert_eq!(far + 1, with.positions.len());
    let mut without = with.clone();
    without.positions.pop();
    let ((with, with_eps), (without, without_eps)) = (collapses(&with), collapses(&without));
    assert!(without >= 380 && with == without, "{with} collapses, {without} without the vertex");
    assert!((with_eps / without_eps - 1.0).abs() < 0.01, "{with_eps}, {without_eps} without the vertex");
}

/// The coordinates of a file as it has them.
fn doubles(name: &str) -> Vec<[f64; 3]> {
    let bytes = std::fs::read(case(name)).unwrap();
    if name.ends_with(".obj") {
        let text = String::from_utf8(bytes).unwrap();
        let rows = text.lines().filter_map(|line| line.strip_prefix("v "));
        let row = |row: &str| row.split(' ').map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
        return rows.map(|text| row(text).try_into().unwrap()).collect();
    }
    let end = b"end_header\n";
    let start = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let body = bytes[start..].chunks_exact(24).take(144);
    body.map(|row| std::array::from_fn(|i| f64::from_le_bytes(row[8 * i..8 * i + 8].try_into().unwrap())))
        .collect()
}

/// Where 32 bits do not hold what is between two vertices, an origin is taken off, and given back in double precision.
#[test]
fn scans_in_world_coordinates_keep_their_shape() {
    for (name, spacing) in [("scan-utm-decimetres.obj", 0.1), ("scan-ecef-double.ply", 0.05)] {
        let given = doubles(name);
        assert_eq!(given.len(), 144);
        let mesh = read(name);
        let (log, report) = construction(&mesh, false, &views(&mesh, 1.0)).unwrap();
        assert!(report.collapses >= 100, "{name}: {report:?}");
        let folder = tempfile::tempdir().unwrap();
        for backend in Backend::ALL {
            let (file, out) = (folder.path().join("hierarchy"), folder.path().join("out.ply"));
            store::write(backend, &file, &log, &BuildOptions::default()).unwrap();
            let finest = Subject::of_store(name, Store::open(&file).unwrap()).finest().unwrap();
            mesh_io::write_ply(&out, &finest, None).unwrap();
            assert!(std::fs::read(&out).unwrap().windows(17).any(|w| w == b"property double x"), "{name}");
            let back = mesh_io::read(&[out], &mut |_, _| ()).unwrap();
            assert_eq!(back.triangles.len(), 242);
            let world: Vec<_> = back.positions.iter().map(|&p| back.georeference.world(p)).collect();
            // The backends number vertices in their own way; each is the one that is nearest.
            let apart =
                |a: [f64; 3], b: [f64; 3]| (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt();
            let nearest: Vec<_> = world
                .iter()
                .map(|&w| *given.iter().min_by(|a, b| apart(**a, w).total_cmp(&apart(**b, w))).unwrap())
                .collect();
            for i in 1..world.len() {
                let difference =
                    |from: &[[f64; 3]]| std::array::from_fn(|axis| from[i][axis] - from[0][axis]);
                let off = apart(difference(&world), difference(&nearest));
                assert!(off < spacing / 10.0, "{name}, {}: vertex {i} is {off} off", backend.name());
            }
            let mut places: Vec<_> = world.iter().map(|p| p.map(f64::to_bits)).collect();
            places.sort_unstable();
            places.dedup();
            assert_eq!(places.len(), 144, "{name}, {}: vertices fall together", backend.name());
        }
    }
}
