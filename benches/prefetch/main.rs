//! What fetching ahead is worth: misses, bytes, precision and recall of each paper's own scheme and of the engine's
//! foresight, and the time that frames wait where they load as DeCoro & Pajarola and Holst & Schumann print it, along real trajectories over real meshes, on virtual time; then what a slow store does to the time of
//! selection.
//!
//! `cargo bench --bench prefetch [-- PART... MESH... BACKEND...]` prints tables. The parts are `--misses`, `--bytes` (see `bytes`), `--slow` and `--wall-clock`
//! (see `slow_store`), all of them unless some are named. The meshes are dragon, happy, tile (of the Sierra Nevada) and sierra (four of them) of the shared
//! data, or what is found under these names, as collapse logs, in the folder that `FOLDFRONT_LOGS` names.

mod bytes;
mod slow_store;

use std::path::{Path as FilePath, PathBuf};
use std::time::Duration;

use foldfront::collapse_log::read_log;
use foldfront::construction::mesh_io;
use foldfront::construction::simplify;
use foldfront::experiment::compare::csv::Summary;
use foldfront::experiment::compare::{Loading, Options, Pace, Paging, Run, Subject};
use foldfront::experiment::path::import::{self, Mode};
use foldfront::experiment::path::{Path, Pose};
use foldfront::experiment::store::{self, Backend, BuildOptions, Store};
use foldfront::page_store::Simulated;
use foldfront::selection::refine::Strategy;

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data");

const MESHES: [(&str, &[&str]); 4] = [
    ("dragon", &["meshes/dragon.ply"]),
    ("happy", &["meshes/happy.ply"]),
    ("tile", &["terrain/N36W119.hgt"]),
    ("sierra", &["terrain/N36W119.hgt", "terrain/N36W118.hgt", "terrain/N37W119.hgt", "terrain/N37W118.hgt"]),
];

/// Name, file, and how it is placed around a mesh and around a terrain.
type Trajectory = (&'static str, &'static str, [Mode; 2]);

/// The first [`WALKS`] are those of all tables, the others of `--bytes` alone.
const TRAJECTORIES: [Trajectory; 6] = [
    ("drone", "euroc_mh04_drone.txt", [Mode::Orbit, Mode::Fly]),
    ("car", "kitti_00_car_10hz.txt", [Mode::Orbit, Mode::Walk]),
    ("flight", "gcanyon_flight_hoppe.txt", [Mode::Orbit, Mode::Fly]),
    ("flight 4k", "gcanyon_4k2k_fly4.edited.frames", [Mode::Orbit, Mode::Fly]),
    ("soaring", "soaring_flight_hohe_tauern_dachstein_1hz.txt", [Mode::Orbit, Mode::Fly]),
    ("hand-held", "tum_fr2_desk_handheld_60hz.txt", [Mode::Orbit, Mode::Fly]),
];
const WALKS: usize = 3;

const BACKENDS: [Backend; 3] = [Backend::MetaNode, Backend::DetailBlock, Backend::MtPartition];

/// Frames of each path, from its middle on, and frames at rest after them.
const FRAMES: usize = 1200;
const REST: usize = 240;

const FRAME: Duration = Duration::from_nanos(16_666_667);
const LATENCY: Duration = Duration::from_millis(5);

/// What is measured.
#[derive(Clone, Copy)]
struct Parts {
    misses: bool,
    bytes: bool,
    slow: bool,
    wall_clock: bool,
}

fn main() {
    let is_named = |part: &str| std::env::args().any(|argument| argument == part);
    let mut parts = Parts {
        misses: is_named("--misses"),
        bytes: is_named("--bytes"),
        slow: is_named("--slow"),
        wall_clock: is_named("--wall-clock"),
    };
    if !(parts.misses || parts.bytes || parts.slow || parts.wall_clock) {
        parts = Parts { misses: true, bytes: true, slow: true, wall_clock: true };
    }
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let named = |all: &[&str]| wanted.iter().any(|name| all.contains(&name.as_str()));
    let backends = BACKENDS.map(Backend::name);
    for (mesh, files) in MESHES {
        if !named(&MESHES.map(|(mesh, _)| mesh)) || named(&[mesh]) {
            match hierarchy(mesh, files) {
                Some(log) => {
                    let is_wanted = |backend: &Backend| !named(&backends) || named(&[backend.name()]);
                    compare(mesh, &log, parts, BACKENDS.into_iter().filter(is_wanted));
                }
                None => println!("{mesh}: not there"),
            }
        }
    }
}

fn hierarchy(mesh: &str, files: &[&str]) -> Option<foldfront::CollapseLog> {
    if let Some(folder) = std::env::var_os("FOLDFRONT_LOGS") {
        return read_log(&PathBuf::from(folder).join(format!("{mesh}.log"))).ok();
    }
    let files: Vec<PathBuf> = files.iter().map(|file| FilePath::new(DATA).join(file)).collect();
    let input = files.iter().all(|file| file.exists()).then(|| mesh_io::read(&files, &mut |_, _| ()))?;
    let built = simplify::build(input.expect("a mesh"), &simplify::Options::default(), &mut |_, _| ());
    Some(built.expect("a mesh").0)
}

/// A trajectory brought to a mesh or a terrain, whole; `None` where it is not at hand.
fn imported(&(name, file, modes): &Trajectory, mesh: &str, log: &foldfront::CollapseLog) -> Option<Path> {
    let file = FilePath::new(DATA).join("paths").join(file);
    let mode = modes[usize::from(is_terrain(mesh))];
    let options = import::Options { mode, ..import::Options::default() };
    let path = file.exists().then(|| import::import(&file, &log.mesh, &options).expect("a trajectory"))?;
    Some(Path { name: name.to_owned(), ..path })
}

fn is_terrain(mesh: &str) -> bool {
    matches!(mesh, "tile" | "sierra")
}

fn compare(mesh: &str, log: &foldfront::CollapseLog, parts: Parts, backends: impl Iterator<Item = Backend>) {
    let folder = tempfile::tempdir().expect("room for files");
    let walks: Vec<Path> = if parts.misses || parts.slow || parts.wall_clock {
        let walk = |trajectory| {
            let mut path = imported(trajectory, mesh, log)?;
            let middle = path.frames.len() / 2;
            path.frames = path.frames[middle..].iter().copied().take(FRAMES).collect();
            Some(path)
        };
        TRAJECTORIES[..WALKS].iter().filter_map(walk).collect()
    } else {
        Vec::new()
    };
    let stretches = if parts.bytes { bytes::stretches(mesh, log) } else { Vec::new() };
    for backend in backends {
        let file = folder.path().join(backend.name());
        store::write(backend, &file, log, &BuildOptions::default()).expect("room for files");
        println!(
            "\n{mesh}, {}: {:.1} MiB",
            backend.name(),
            std::fs::metadata(&file).map_or(0.0, |m| m.len() as f64) / f64::from(1 << 20)
        );
        let memory: Vec<u64> =
            walks.iter().map(|walk| memory(&Subject::of_store(mesh, open(&file)), walk)).collect();
        let walks = || walks.iter().zip(memory.iter().copied());
        if parts.misses {
            heading();
            walks().for_each(|(walk, page_memory)| virtual_time(&file, mesh, walk, page_memory));
        }
        if parts.bytes {
            bytes::heading();
            let most = bytes::table(&file, mesh, &stretches);
            println!("at most {most:.3} times the bytes of loading on demand");
        }
        if parts.slow {
            slow_store::heading();
            walks().for_each(|(walk, page_memory)| slow_store::virtual_time(&file, mesh, walk, page_memory));
        }
        if parts.wall_clock {
            slow_store::heading();
            walks().for_each(|(walk, page_memory)| slow_store::wall_clock(&file, mesh, walk, page_memory));
        }
    }
}

fn options(pace: Pace, page_memory: u64, prefetch: Vec<Loading>) -> Options {
    Options {
        strategies: vec![Strategy::Event],
        paging: Paging { page_memory, ..Paging::default() },
        prefetch,
        pace,
        ..Options::default()
    }
}

/// Twice what the oracle's cut takes at its largest.
fn memory(subject: &Subject, walk: &Path) -> u64 {
    let frames: Vec<usize> = (0..walk.frames.len()).step_by(walk.frames.len() / 24).collect();
    2 * subject
        .needs(walk, &frames, &options(Pace::Settled, u64::MAX, vec![Loading::None]))
        .expect("a valid file")
}

/// The path, and its last frame for a while.
fn with_rest(walk: &Path) -> Path {
    let mut path = walk.clone();
    if let Some(&last) = walk.frames.last() {
        let still = |frame: usize| Pose { time: last.time + frame as f64 / 60.0, ..last };
        path.frames.extend((1..=REST).map(still));
    }
    path
}

fn open(file: &FilePath) -> Store {
    Store::open(file).expect("a valid file")
}

fn heading() {
    println!(
        "{:8} {:9} {:>7} {:>7} {:>8} {:>8} {:>7} {:>8} {:>6} {:>6} {:>6} {:>5} {:>9}",
        "path",
        "prefetch",
        "MiB",
        "misses",
        "flips",
        "miss %",
        "reads",
        "KiB",
        "prec",
        "rec",
        "memory",
        "stop",
        "stall ms"
    );
}

fn virtual_time(file: &FilePath, mesh: &str, walk: &Path, page_memory: u64) {
    let mut subject = Subject::of_store(mesh, open(file));
    let walk = with_rest(walk);
    let pace = Pace::Simulated(FRAME, Simulated::with_latency(LATENCY));
    let backend = subject.backend();
    let loading = Loading::ALL.into_iter().filter(|loading| loading.is_for(backend)).collect();
    let options = options(pace, page_memory, loading);
    let runs = subject.replay(&walk, 0..walk.frames.len(), &options, &mut |_, _| ()).expect("a valid file");
    for run in &runs {
        row(run, page_memory);
    }
}

fn row(run: &Run, page_memory: u64) {
    let s = Summary::new(run);
    // The first frame waits for its pages, whatever fetches them.
    let later = || run.rows.iter().skip(1).map(|row| &row.report);
    let sum = |f: &dyn Fn(&foldfront::selection::engine::FrameReport) -> u64| later().map(f).sum::<u64>();
    let (misses, changes) = (sum(&|r| r.misses), sum(&|r| r.unfolds + r.folds));
    let percent = |share: Option<f64>| share.map_or_else(|| "-".to_owned(), |share| format!("{share:.1}"));
    let rest = &run.rows[run.rows.len() - REST..];
    let settles = rest
        .iter()
        .rposition(|row| row.report.misses + row.report.unfolds + row.report.folds > 0)
        .map_or(0, |at| at + 1);
    let stalled = 1e3 * later().map(|r| r.pages.stalled).sum::<Duration>().as_secs_f64();
    println!(
        "{:8} {:9} {:7.2} {misses:7} {changes:8} {:8.3} {:7} {:8} {:>6} {:>6} {:6.1} {settles:5} {stalled:9.1}",
        run.path,
        run.prefetch.name(),
        page_memory as f64 / f64::from(1 << 20),
        100.0 * misses as f64 / (misses + changes).max(1) as f64,
        sum(&|r| r.pages.reads),
        sum(&|r| r.pages.read_bytes) / 1024,
        percent(s.precision),
        percent(s.recall),
        s.memory_limited,
    );
}
