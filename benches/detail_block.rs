//! The experiments of XFastMesh (DeCoro & Pajarola 2002) on detail blocks: sizes (their Table 1), construction (Table 2),
//! frames (Table 3), what packing saves and how soon a first frame is there (section 4), the tolerance steered to a frame time
//! (Figure 10); and what they did not report: blocks that are
//! loaded again soon after their removal, what a mapped block index gives over one that is read, what forcing costs against nesting, what the normal-cone test spares, and what
//! quantisation costs in pixels.
//!
//! `cargo bench --bench detail_block` runs all on bunny, horse, dragon and happy; with names after `--`, on those alone:
//! of `bunny horse dragon happy sierra alps city laserscan`. Meshes are taken from `shared/data` beside the repository;
//! `sierra` is one tile of the Sierra Nevada.

#![expect(clippy::disallowed_methods, reason = "shapes to measure with")]

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use detail_block::{Arrangement, BuildOptions, Io, XfmFile, XfmTree};
use foldfront::Mesh;
use foldfront::collapse_log::CollapseLog;
use foldfront::construction::mesh_io;
use foldfront::construction::simplify;
use foldfront::experiment::deviation::Reference;
use foldfront::experiment::path::{Path, around, recorded};
use foldfront::experiment::scene::{Scene, SceneKind};
use foldfront::page_store::source::FileSource;
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::budget::Budget;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::{View, theta_of_pixels};
use foldfront::vertex_tree::{MeshSink, NullSink};

/// Vertices and triangles as a mesh.
fn shown((positions, triangles): (Vec<[f32; 3]>, Vec<[u32; 3]>)) -> Mesh {
    Mesh { positions, triangles, ..Mesh::default() }
}

const LINES: u32 = 1080;
/// The paper's soft quota.
const SOFT: f64 = 0.1;

fn build(quantize: bool, nest_needs: bool) -> BuildOptions {
    BuildOptions { quantize, nest_needs, ..BuildOptions::default() }
}

/// The mesh of a name, and a path along it.
fn subject(name: &str) -> Option<(Mesh, Vec<Path>)> {
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    let kind = match name {
        "alps" => Some(SceneKind::Alps),
        "city" => Some(SceneKind::City),
        "laserscan" => Some(SceneKind::Laserscan),
        _ => None,
    };
    if let Some(kind) = kind {
        let paths = recorded(kind).expect("recorded paths are there");
        let calm = paths.into_iter().filter(|path| path.name.contains("calm")).collect();
        return Some((Scene::new(kind).mesh(&mut |_, _| {}), calm));
    }
    let files: Vec<PathBuf> = match name {
        "sierra" => vec![data.join("terrain/N37W119.hgt")],
        _ => vec![data.join(format!("meshes/{name}.ply"))],
    };
    if !files.iter().all(|file| file.exists()) {
        eprintln!("{name}: no such data");
        return None;
    }
    let mesh = mesh_io::read(&files, &mut |_, _| {}).expect("the data are readable");
    let path = around(&mesh).expect("a place for a camera");
    Some((mesh, vec![path]))
}

struct Built {
    file: Arc<XfmFile>,
    seconds: f64,
    log: CollapseLog,
    path: PathBuf,
    /// The temporary file is there as long as this is.
    _folder: tempfile::TempDir,
}

fn built(log: &CollapseLog, options: &BuildOptions) -> Built {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("mesh.xfm");
    let start = Instant::now();
    let arrangement = Arrangement::new(log, options).expect("the log was just built");
    arrangement.write(&path).expect("the temporary folder can be written to");
    let seconds = start.elapsed().as_secs_f64();
    let source = FileSource::open(&path).expect("it was just written");
    let file = Arc::new(XfmFile::open(Arc::new(source)).expect("it was just written"));
    Built { file, seconds, log: arrangement.effective_log(), path, _folder: folder }
}

fn engine<M: MeshSink>(
    file: &Arc<XfmFile>,
    mesh: M,
    path: &Path,
    strategy: Strategy,
    soft: f64,
) -> Engine<XfmTree, M> {
    let paging = detail_block::Settings {
        io: Io::Blocking,
        soft_quota: (soft * file.resident_bytes_of_all() as f64) as u64,
        ..detail_block::Settings::default()
    };
    let tree = XfmTree::new(file.clone(), paging).expect("no thread is started");
    Engine::new(tree, mesh, settings(path, strategy)).expect("the store is there")
}

fn settings(path: &Path, strategy: Strategy) -> Settings {
    let usual = path.motion_percentile(99.0);
    Settings { strategy, rho: usual.rho, omega: usual.omega, ..Settings::default() }
}

fn view(path: &Path, frame: usize) -> View {
    path.view(frame, theta_of_pixels(1.0, LINES)).expect("a view")
}

fn ms(time: Duration, frames: usize) -> f64 {
    time.as_secs_f64() * 1e3 / frames as f64
}

/// Table 3 and what is loaded again, along one path.
fn frames(name: &str, file: &Arc<XfmFile>, path: &Path, strategy: Strategy) {
    let mut engine = engine(file, ActiveMesh::new(), path, strategy, SOFT);
    let count = path.frames.len();
    let (mut shown, mut updates, mut tests) = (0, 0, 0);
    let (mut select, mut apply) = (Duration::ZERO, Duration::ZERO);
    let mut start = engine.tree().counts();
    let mut first = 0;
    for frame in 0..count {
        let report = engine.advance(&[view(path, frame)]).expect("the store is there");
        engine.sink_mut().clear_changes();
        if frame == 0 {
            // The first frame loads what the path starts with.
            start = engine.tree().counts();
            first = report.unfolds;
            continue;
        }
        shown += report.displayed;
        updates += report.unfolds + report.folds;
        tests += report.tests;
        (select, apply) = (select + report.select, apply + report.apply);
    }
    let counts = engine.tree().counts();
    let blocked = counts.blocked - start.blocked;
    let (loads, again) = (counts.loads - start.loads, counts.soon_again - start.soon_again);
    let n = (count - 1) as u64;
    println!(
        "| {name}, {}, {} | {} | {} | {} | {:.3} | {:.3} | {:.3} | {:.1} | {} | {:.2} % | {first} |",
        path.name,
        strategy.name(),
        shown / n,
        updates / n,
        tests / n,
        ms(apply.saturating_sub(blocked), count - 1),
        ms(select - apply, count - 1),
        ms(blocked, count - 1),
        loads as f64 / n as f64,
        counts.peak_bytes / 1024,
        100.0 * again as f64 / counts.removals.max(1) as f64,
    );
}

/// The block index read into memory against the paper's, mapped (section 3.3): medians of several runs in turns.
fn index(name: &str, path: &std::path::Path, walk: &Path) {
    const RUNS: usize = 7;
    let mut rows = [[const { Vec::new() }; 3], [const { Vec::new() }; 3]];
    for run in 0..2 * RUNS {
        let is_mapped = run % 2 == 1;
        let start = Instant::now();
        let file = if is_mapped {
            #[expect(unsafe_code, reason = "mapping is what is measured")]
            // SAFETY: the file is in a temporary folder of this process, which does not touch it any more.
            let file = unsafe { XfmFile::open_mapped(path) };
            file
        } else {
            let source = FileSource::open(path).expect("it was just written");
            XfmFile::open(Arc::new(source))
        };
        let file = Arc::new(file.expect("it was just written"));
        let opened = start.elapsed();
        let mut engine = engine(&file, NullSink, walk, Strategy::Event, SOFT);
        let mut times = Vec::new();
        for frame in 0..walk.frames.len() {
            let start = Instant::now();
            engine.advance(&[view(walk, frame)]).expect("the store is there");
            times.push(start.elapsed());
        }
        times.sort_unstable();
        let row = &mut rows[usize::from(is_mapped)];
        for (column, time) in
            row.iter_mut().zip([opened, times[times.len() / 2], times[times.len() * 99 / 100]])
        {
            column.push(time);
        }
    }
    let [read, mapped] = rows.each_mut().map(|row| row.each_mut().map(|column| median(column)));
    println!(
        "| {name}, {} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} |",
        walk.name, read[0], read[1], read[2], mapped[0], mapped[1], mapped[2]
    );
}

/// What nesting over needs costs against forcing: active nodes, and forced unfolds, along one path.
fn nesting(name: &str, nested: &Arc<XfmFile>, forcing: &Arc<XfmFile>, path: &Path) {
    let run = |file: &Arc<XfmFile>| {
        let mut engine = engine(file, NullSink, path, Strategy::Event, 1.0);
        let (mut nodes, mut triangles, mut unfolds, mut forced) = (0, 0, 0, 0);
        for frame in 0..path.frames.len() {
            let report = engine.advance(&[view(path, frame)]).expect("the store is there");
            (nodes, triangles) = (nodes + report.active_nodes, triangles + report.displayed);
            (unfolds, forced) = (unfolds + report.unfolds, forced + report.forced);
        }
        let n = path.frames.len() as u64;
        (nodes / n, triangles / n, 100.0 * forced as f64 / unfolds.max(1) as f64)
    };
    let ((n, t, f), (m, s, g)) = (run(nested), run(forcing));
    println!("| {name}, {} | {n} | {t} | {f:.2} % | {m} | {s} | {g:.2} % |", path.name);
}

/// What the normal-cone test spares and costs along one path, with memory for everything.
fn cones(name: &str, file: &Arc<XfmFile>, path: &Path, strategy: Strategy) {
    let run = |normal_cone: bool| {
        let paging = detail_block::Settings { io: Io::Blocking, ..detail_block::Settings::default() };
        let tree = XfmTree::new(file.clone(), paging).expect("no thread is started");
        let settings = Settings { normal_cone, ..settings(path, strategy) };
        let mut engine = Engine::new(tree, NullSink, settings).expect("the store is there");
        let (mut triangles, mut updates, mut tests, mut times) = (0, 0, 0, Vec::new());
        for frame in 0..path.frames.len() {
            let report = engine.advance(&[view(path, frame)]).expect("the store is there");
            if frame > 0 {
                triangles += report.displayed;
                updates += report.unfolds + report.folds;
                tests += report.tests;
                times.push(report.select.as_secs_f64() * 1e3);
            }
        }
        times.sort_by(f64::total_cmp);
        let n = times.len() as u64;
        (triangles / n, updates / n, tests / n, times[times.len() / 2])
    };
    let ((t, u, n, ms), (tc, uc, nc, msc)) = (run(false), run(true));
    println!(
        "| {name}, {}, {} | {t} | {u} | {n} | {ms:.3} | {tc} | {uc} | {nc} | {msc:.3} |",
        path.name,
        strategy.name()
    );
}

/// What a file says of itself.
fn fact(file: &XfmFile, wanted: &str) -> String {
    let fact = file.facts().into_iter().find(|&(name, _)| name == wanted);
    fact.map_or_else(String::new, |(_, value)| value)
}

/// In milliseconds.
fn median(times: &mut [Duration]) -> f64 {
    times.sort_unstable();
    times[times.len() / 2].as_secs_f64() * 1e3
}

/// What the file would take with a place for every node that a block can have, and with two numbers of children's blocks in
/// every place of a block's lowest level.
fn packing(file: &XfmFile) {
    let fact = |wanted: &str| -> u64 { fact(file, wanted).parse().expect("a number") };
    let (bytes, nodes, blocks) = (fact("bytes"), fact("nodes"), fact("detail blocks"));
    let (node_bytes, levels) = (fact("node bytes"), fact("levels a block"));
    let unpacked = bytes + (blocks * ((1 << levels) - 1) - nodes) * node_bytes;
    // Blocks that are no leaves have a number, of four bytes, for each place below their lowest level.
    let pointers = bytes + fact("leaf blocks") * (1 << levels) * 4;
    let more = |other: u64| 100.0 * (other as f64 / bytes as f64 - 1.0);
    println!(
        "| {bytes} | {unpacked}, {:.0} % more | {pointers}, {:.0} % more |",
        more(unpacked),
        more(pointers)
    );
}

/// From the closed file to the coarsest mesh, and on to the first frame of a path at one pixel: medians of several times, ms.
fn first_frame(name: &str, path: &std::path::Path, walk: &Path) {
    const RUNS: usize = 7;
    let mut times = [Vec::new(), Vec::new()];
    for _ in 0..RUNS {
        let start = Instant::now();
        let source = FileSource::open(path).expect("it was just written");
        let file = Arc::new(XfmFile::open(Arc::new(source)).expect("it was just written"));
        let mut engine = engine(&file, ActiveMesh::new(), walk, Strategy::Event, SOFT);
        times[0].push(start.elapsed());
        engine.advance(&[view(walk, 0)]).expect("the store is there");
        times[1].push(start.elapsed());
    }
    let [coarse, first] = times.map(|mut times| median(&mut times));
    println!("| {name}, {} | {coarse:.1} | {first:.1} |", walk.name);
}

/// Distances to the original in pixels: 99 % and largest, the worse of both ways, over some frames.
fn deviation(log: &CollapseLog, file: &Arc<XfmFile>, path: &Path) -> (f64, f64) {
    let reference = Reference::new(&log.mesh);
    let (mut p99, mut most) = (0.0_f64, 0.0_f64);
    let mut engine = engine(file, ActiveMesh::new(), path, Strategy::Event, 1.0);
    for frame in (60..path.frames.len()).step_by(path.frames.len() / 4) {
        engine.advance(&[view(path, frame)]).expect("the store is there");
        let found = reference.deviation(
            &shown(engine.sink().gathered()),
            &path.camera(frame).expect("a camera"),
            LINES,
        );
        for way in [&found.forward, &found.reverse] {
            (p99, most) = (p99.max(way.inner.p99), most.max(way.inner.max));
        }
    }
    (p99, most)
}

/// How far the quantised positions of the fully refined mesh are from the input, at the nearest vertex of the path.
fn displacement(log: &CollapseLog, quantised: &CollapseLog, path: &Path) -> f64 {
    let lines = f64::from(LINES) / 2.0;
    let mut most = 0.0_f64;
    for frame in (60..path.frames.len()).step_by(path.frames.len() / 4) {
        let camera = path.camera(frame).expect("a camera");
        for (p, q) in log.mesh.positions.iter().zip(&quantised.mesh.positions) {
            let [p, q] = [p, q].map(|p| foldfront::glam::DVec3::from(p.map(f64::from)));
            let d = (p - camera.position()).length();
            most = most.max(p.distance(q) / ((camera.fov_y() / 2.0).tan() * d) * lines);
        }
    }
    most
}

/// Figure 10: the tolerance follows a frame time.
fn steered(name: &str, file: &Arc<XfmFile>, path: &Path) {
    for target in [100, 500, 2000].map(Duration::from_micros) {
        let mut engine = engine(file, ActiveMesh::new(), path, Strategy::Event, SOFT);
        engine.set_budget(Budget::FrameTime(target));
        let mut times = Vec::new();
        let (mut least, mut most, mut triangles) = (f64::MAX, 0.0_f64, (u64::MAX, 0));
        for frame in 0..path.frames.len() {
            let asked = path.view(frame, theta_of_pixels(0.1, LINES)).expect("a view");
            let report = engine.advance(&[asked]).expect("the store is there");
            engine.sink_mut().clear_changes();
            if frame >= 60 {
                times.push(report.select.as_secs_f64() * 1e3);
                let pixels = 0.1 * asked.k() / engine.views()[0].k();
                (least, most) = (least.min(pixels), most.max(pixels));
                triangles = (triangles.0.min(report.displayed), triangles.1.max(report.displayed));
            }
        }
        times.sort_by(f64::total_cmp);
        println!(
            "| {name} | {:.1} | {:.2} | {:.2} | {least:.2} to {most:.2} | {} to {} |",
            target.as_secs_f64() * 1e3,
            times[times.len() / 2],
            times[times.len() * 99 / 100],
            triangles.0,
            triangles.1
        );
    }
}

fn main() {
    let asked: Vec<String> = std::env::args().skip(1).filter(|argument| !argument.starts_with('-')).collect();
    let all = ["bunny", "horse", "dragon", "happy"].map(str::to_owned).to_vec();
    for name in if asked.is_empty() { all } else { asked } {
        let Some((mesh, paths)) = subject(&name) else { continue };
        let start = Instant::now();
        let (log, _) =
            simplify::build(mesh, &simplify::Options::default(), &mut |_, _| {}).expect("the mesh is valid");
        let simplified = start.elapsed().as_secs_f64();
        let (plain, quantised) = (built(&log, &build(false, true)), built(&log, &build(true, true)));
        let forcing = built(&log, &build(false, false));
        let fact = |built: &Built, wanted: &str| fact(&built.file, wanted);
        let faces = log.mesh.triangles.len() as f64;
        println!(
            "\n| {name}: faces | bytes | a triangle | quantised | blocks | leaf blocks | nodes a block |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- |");
        println!(
            "| {faces} | {} | {} | {} | {} | {} | {} |",
            fact(&plain, "bytes"),
            fact(&plain, "bytes a triangle"),
            fact(&quantised, "bytes a triangle"),
            fact(&plain, "detail blocks"),
            fact(&plain, "leaf blocks"),
            fact(&plain, "nodes a block"),
        );
        println!(
            "\n| bytes | with a place for every node | with children's blocks in leaves |\n| --- | --- | --- |"
        );
        packing(&plain.file);
        println!("\n| from the file, ms | to the coarsest mesh | to the first frame |\n| --- | --- | --- |");
        paths.iter().for_each(|path| first_frame(&name, &plain.path, path));
        println!("\n| construction | s | us a triangle |\n| --- | --- | --- |");
        for (what, seconds) in
            [("simplification", simplified), ("file", plain.seconds), ("file, quantised", quantised.seconds)]
        {
            println!("| {what} | {seconds:.2} | {:.2} |", seconds * 1e6 / faces);
        }
        println!(
            "\n| frames | shown | updates | tests | updates, ms | view tests, ms | loading, ms | blocks | peak, KiB | again | first |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |");
        for path in &paths {
            for strategy in [Strategy::TopDown, Strategy::Event] {
                frames(&name, &plain.file, path, strategy);
            }
        }
        println!("\n| block index, ms | read: open | median | 99 % | mapped: open | median | 99 % |");
        println!("| --- | --- | --- | --- | --- | --- | --- |");
        for path in &paths {
            index(&name, &plain.path, path);
        }
        println!("\n| needs | nested: nodes | triangles | forced | not nested: nodes | triangles | forced |");
        println!("| --- | --- | --- | --- | --- | --- | --- |");
        for path in &paths {
            nesting(&name, &plain.file, &forcing.file, path);
        }
        println!(
            "\n| normal cone | without: shown | updates | tests | median, ms | with: shown | updates | tests | median, ms |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- | --- | --- |");
        for path in &paths {
            for strategy in [Strategy::TopDown, Strategy::Front, Strategy::Event] {
                cones(&name, &plain.file, path, strategy);
            }
        }
        if name != "sierra" {
            println!(
                "\n| 1 pixel | 99 % | largest | moved by quantisation, largest |\n| --- | --- | --- | --- |"
            );
            let path = &paths[0];
            for (what, built) in [("plain", &plain), ("quantised", &quantised)] {
                let (p99, most) = deviation(&log, &built.file, path);
                println!("| {what} | {p99:.3} | {most:.3} | {:.4} |", displacement(&log, &built.log, path));
            }
        }
        println!("\n| steered to, ms | target | median | 99 % | tolerance, pixels | triangles |");
        println!("| --- | --- | --- | --- | --- | --- |");
        steered(&name, &plain.file, &paths[0]);
    }
}
