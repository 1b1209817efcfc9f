//! The experiments of Holst & Schumann (2007) on the backend `mt-partition`, and what its coarse nodes cost and gain.
//!
//! `cargo bench --bench mt_partition [-- WORD...]`; words select among `reduction`, `figures`, `within`, `selection` and `scene`,
//! and models by name. Models are the armadillo (99,976 triangles, by others) and the dragon, where the folder `shared/data` lies beside
//! the repository. Pictures go to `target/tmp/mt-partition`.
//!
//! * `reduction`: triangles stored, arcs, bytes, growth of bounds, by patch size; and triangles displayed at one pixel
//!   along a path, against the in-memory tree, whose nodes are single collapses.
//! * `figures`: the paper's figures 4 and 5: the sum of read operations and the memory over the frames, for an object that
//!   comes near and one that turns, for all four cache modes and both orders of the partitioning queue.
//! * `within`: what files are like that are written with less memory than the graph takes.
//! * `selection`: what finding the changes takes, by displayed triangle, everything in memory and paging, against the in-memory
//!   tree and meta-nodes.
//! * `scene`: partitions of 20 to 100 nodes over a scene of a hundred objects; see `scene.rs`. Its models are its own.
//!
//! Frames are settled: each waits for its pages, and its cut is compared between modes; another cut fails the benchmark.

#![expect(clippy::disallowed_methods, reason = "shapes to measure with")]

mod figures;
mod scene;
mod selection;
mod within;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use foldfront::collapse_log::{read_log, write_log};
use foldfront::construction::mesh_io;
use foldfront::construction::simplify;
use foldfront::experiment::path::{Path, Pose};
use foldfront::page_store::source::FileSource;
use foldfront::selection::engine::{Engine, FrameReport, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::{Camera, View, theta_of_pixels};
use foldfront::vertex_tree::{MeshSink, NullSink, VertexTree};
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;
use in_memory::{InMemoryHierarchy, InMemoryTree};
use mt_partition::{BuildOptions, CacheMode, MtFile, MtTree, WriteReport};

const EXPERIMENTS: [&str; 5] = ["reduction", "figures", "within", "selection", "scene"];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let models = ["armadillo_100k", "dragon", "happy"];
    let is_chosen = |name: &&&str, among: &[&str]| {
        let is_named = |name: &str| words.iter().any(|word| name.contains(word.as_str()));
        !among.iter().any(|name| is_named(name)) || is_named(name)
    };
    // It has models of its own.
    if is_chosen(&&"scene", &EXPERIMENTS) && !words.iter().any(|word| models.contains(&word.as_str())) {
        scene::scenes(&folder());
    }
    for model in models.iter().filter(|name| is_chosen(name, &models)) {
        let Some(log) = model_log(model) else { continue };
        for &experiment in EXPERIMENTS[..4].iter().filter(|name| is_chosen(name, &EXPERIMENTS)) {
            println!("{model}: {experiment}");
            match experiment {
                "reduction" => reduction(&log),
                "figures" => figures::figures(model, &log),
                "within" => within::within(&folder(), &log),
                _ => selection::selection(&log),
            }
        }
    }
}

fn folder() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("mt-partition");
    std::fs::create_dir_all(&folder).expect("target is writable");
    folder
}

/// The hierarchy of a model, kept between runs: delete the folder after changing the construction.
fn model_log(name: &str) -> Option<CollapseLog> {
    let kept = folder().join(format!("{name}.log"));
    let mesh = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/meshes"))
        .join(format!("{name}.ply"));
    if !mesh.exists() {
        return None;
    }
    Some(read_log(&kept).unwrap_or_else(|_| {
        let mesh = mesh_io::read(&[mesh], &mut |_, _| {}).expect("a mesh");
        let (log, _) =
            simplify::build(mesh, &simplify::Options::default(), &mut |_, _| {}).expect("a valid mesh");
        write_log(&kept, &log).expect("target is writable");
        log
    }))
}

fn build(log: &CollapseLog, options: &BuildOptions) -> (Arc<MtFile>, WriteReport) {
    let path = folder().join("experiment.mt");
    let report = mt_partition::write(&path, log, options).expect("target is writable");
    let source = FileSource::open(&path).expect("it was just written");
    (Arc::new(MtFile::open(Arc::new(source)).expect("it was just written")), report)
}

/// A camera that looks at the middle of a mesh from where `place` says, by the share of the path behind it, in units of
/// the extent.
fn path(name: &str, mesh: &Mesh, frames: usize, place: impl Fn(f64) -> DVec3) -> Path {
    let (lo, hi) = mesh.bounding_box().unwrap_or_default();
    let center = (DVec3::from(lo.map(f64::from)) + DVec3::from(hi.map(f64::from))) / 2.0;
    let (fov_y, aspect) = (std::f64::consts::FRAC_PI_3, 16.0 / 9.0);
    let pose = |frame: usize| {
        let position = center + mesh.extent() * place(frame as f64 / (frames - 1) as f64);
        let camera = Camera::look_at(position, center, DVec3::Y, fov_y, aspect).expect("a camera");
        Pose { time: frame as f64 / 60.0, position, orientation: camera.orientation() }
    };
    Path {
        name: name.to_owned(),
        units: "units".to_owned(),
        fov_y,
        aspect,
        frames: (0..frames).map(pose).collect(),
    }
}

/// From 16 extents away to 0.4, evenly in the logarithm of the distance: the whole path from a speck to a close-up.
fn near(mesh: &Mesh) -> Path {
    path("far to near", mesh, 600, |share| {
        DVec3::new(0.2, 0.2, 1.0).normalize() * 16.0 * (0.4_f64 / 16.0).powf(share)
    })
}

/// Once around at 0.55 extents: a part of the object is in view, and which one changes.
fn turning(mesh: &Mesh) -> Path {
    path("turning", mesh, 600, |share| {
        let angle = share * std::f64::consts::TAU;
        DVec3::new(angle.sin(), 0.15, angle.cos()) * 0.55
    })
}

fn views(path: &Path) -> Vec<View> {
    (0..path.frames.len())
        .map(|frame| path.view(frame, theta_of_pixels(1.0, 1080)).expect("a view"))
        .collect()
}

fn tree(file: &Arc<MtFile>, cache: CacheMode) -> MtTree {
    let settings = mt_partition::Settings { cache, ..Default::default() };
    MtTree::new(file.clone(), settings).expect("no limit of memory")
}

/// Replays views with every frame settled: what all advances of a frame did together.
fn replay<T: VertexTree, M: MeshSink>(
    engine: &mut Engine<T, M>,
    views: &[View],
    mut each: impl FnMut(&FrameReport, &Engine<T, M>),
) {
    for view in views {
        let mut reads = 0;
        loop {
            let mut report = engine.advance(std::slice::from_ref(view)).expect("a file that is whole");
            reads += report.pages.reads;
            if report.misses == 0 {
                report.pages.reads = reads;
                each(&report, engine);
                break;
            }
            engine.tree_mut().settle().expect("a file that is whole");
        }
    }
}

fn settings(path: &Path, strategy: Strategy) -> Settings {
    let usual = path.motion_percentile(99.0);
    Settings { strategy, rho: usual.rho, omega: usual.omega.max(1e-3), ..Settings::default() }
}

fn reduction(log: &CollapseLog) {
    let path = near(&log.mesh);
    let views = views(&path);
    let mean = |sum: u64| sum as f64 / views.len() as f64;
    let settings = settings(&path, Strategy::TopDown);
    let mut exact = Engine::new(
        InMemoryTree::new(Arc::new(InMemoryHierarchy::new(log).expect("a log"))),
        NullSink,
        settings,
    )
    .expect("nothing can fail in memory");
    let mut triangles = Vec::new();
    replay(&mut exact, &views, |report, _| triangles.push(report.displayed));
    let least = mean(triangles.iter().sum());
    println!("single collapses: {least:.0} triangles displayed on average");
    for patch in [0.0, 3.0, 5.0, 10.0, 20.0, 40.0] {
        let start = Instant::now();
        let (file, r) = build(log, &BuildOptions { patch, ..BuildOptions::default() });
        let time = start.elapsed().as_secs_f64();
        let mut engine =
            Engine::new(tree(&file, CacheMode::PCc), NullSink, settings).expect("a file that is whole");
        let (mut sum, mut ratios) = (0, Vec::new());
        replay(&mut engine, &views, |report, _| {
            let before: u64 = triangles[ratios.len()];
            ratios.push(report.displayed as f64 / before as f64);
            sum += report.displayed;
        });
        ratios.sort_by(f64::total_cmp);
        println!(
            "patch {patch:2}: {:6} nodes, {:.2} triangles stored for each, {:5.2} an arc, {:5.1} bytes a triangle, radii \
             grow by {:.3} (at most {:.1}), {:5} arc collapses refused, {:.1} us a triangle; displayed {:.2} times the \
             triangles (median frame {:.2}, worst {:.2})",
            r.nodes,
            r.stored_triangles as f64 / r.triangles as f64,
            r.stored_triangles as f64 / r.arcs as f64,
            r.bytes as f64 / r.triangles as f64,
            r.inflation[0],
            r.inflation[1],
            r.refused,
            time * 1e6 / r.triangles as f64,
            mean(sum) / least,
            ratios[ratios.len() / 2],
            ratios[ratios.len() - 1],
        );
    }
}
