//! What files are like that are written with less memory than the graph takes, against those of the whole graph.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use foldfront::CollapseLog;
use foldfront::page_store::source::FileSource;
use foldfront::vertex_tree::NodeId;
use mt_partition::{BuildOptions, MtFile, Workspace};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Tolerance of one pixel in an image of 1080 lines with a field of view of 60 degrees.
const K: f64 = 935.0;

/// Triangles of a file at some errors, for all of the surface alike, and from some eyes around it.
fn displayed(file: &MtFile, errors: &[f32], eyes: &[[f64; 3]]) -> Vec<i64> {
    let mut triangles = vec![i64::from(file.base_triangles()); errors.len() + eyes.len()];
    for node in (0..file.nodes()).map(NodeId) {
        let node = file.node(node).expect("it was just written");
        let gain = i64::from(node.triangles[1]) - i64::from(node.triangles[0]);
        let (center, radius, eps) = (node.bounds.center.map(f64::from), node.bounds.radius, node.bounds.eps);
        let is_near = |eye: &[f64; 3]| {
            let apart = (0..3).map(|i| (center[i] - eye[i]) * (center[i] - eye[i])).sum::<f64>().sqrt();
            apart < f64::from(radius) + K * f64::from(eps)
        };
        let is_active = errors.iter().map(|&error| eps > error).chain(eyes.iter().map(is_near));
        for (triangles, _) in triangles.iter_mut().zip(is_active).filter(|(_, is_active)| *is_active) {
            *triangles += gain;
        }
    }
    triangles
}

/// 64 eyes, in the box of the mesh and up to four times as far away.
fn eyes(log: &CollapseLog) -> Vec<[f64; 3]> {
    let (lo, hi) = log.mesh.bounding_box().unwrap_or_default();
    let mut random = Pcg64::seed_from_u64(7);
    let mut share = || random.random_range(-0.5..0.5);
    let [lo, hi] = [lo, hi].map(|corner| corner.map(f64::from));
    let extent = (0..3).map(|i| hi[i] - lo[i]).fold(0.0, f64::max);
    let reach = [0.0, 0.2, 1.0, 4.0].map(|times| times * extent);
    let eye = |n: usize| [0, 1, 2].map(|i| (lo[i] + hi[i]) / 2.0 + share() * (hi[i] - lo[i] + reach[n % 4]));
    (0..64).map(eye).collect()
}

pub fn within(folder: &Path, log: &CollapseLog) {
    let mut errors: Vec<f32> = log.collapses.iter().map(|c| c.bounds.eps).collect();
    errors.sort_unstable_by(f32::total_cmp);
    let errors = [0.5, 0.7, 0.9, 0.97].map(|share| errors[((errors.len() - 1) as f64 * share) as usize]);
    let eyes = eyes(log);
    let (path, stop) = (folder.join("experiment.mt"), &AtomicBool::new(false));
    let triangles = log.mesh.triangles.len() as u64;
    println!(
        "bytes of memory a triangle; as shares of what the whole graph gives: displayed at four errors and, mean"
    );
    println!(
        "of each 16, from eyes ever farther away; nodes, partitions, growth of radii, stored, bytes; us a triangle"
    );
    let mut whole: Option<Vec<f64>> = None;
    for memory in [1024, 80, 20, 10, 5] {
        let workspace = Workspace { folder: folder.to_owned(), memory: memory * triangles, stop };
        let start = Instant::now();
        let report = mt_partition::write_within(&path, log, &BuildOptions::default(), &workspace)
            .expect("target is writable");
        let time = start.elapsed().as_secs_f64() * 1e6 / triangles as f64;
        let source = FileSource::open(&path).expect("it was just written");
        let file = MtFile::open(Arc::new(source)).expect("it was just written");
        file.verify().expect("it was just written");
        let displayed = displayed(&file, &errors, &eyes);
        let mean = |n: usize| displayed[4..].iter().skip(n).step_by(4).map(|&t| t as f64).sum::<f64>();
        let mut figures: Vec<f64> = displayed[..4].iter().map(|&t| t as f64).collect();
        figures.extend((0..4).map(mean));
        let counts = [report.nodes, report.partitions, report.stored_triangles, report.bytes];
        let [nodes, partitions, stored, bytes] = counts.map(|count| count as f64);
        figures.extend([nodes, partitions, report.inflation[0], stored, bytes]);
        let whole = whole.get_or_insert_with(|| figures.clone());
        let shares = figures.iter().zip(&*whole).map(|(figure, whole)| format!(" {:.3}", figure / whole));
        println!("{memory:5}:{} {time:.1}", shares.collect::<String>());
    }
}
