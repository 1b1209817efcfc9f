//! Selection time along walkthroughs: Zach & Karner (2003), Figures 9 to 11, with their settings and with ours.
//!
//! `cargo bench --bench selection_time [-- --out FOLDER] [--theta X] [NAME...]` draws one SVG a figure and setting into the
//! folder, `target/selection_time` by default, and prints a table and ratios. What the paper shows is a city as a block model
//! (Figure 9, Graz), a laser scan of a city (Figure 10) and a terrain (Figure 11, north-west Styria), each with the times of two
//! methods along a recorded path: `top-down` as in VDSlib, and the event queue, which here is `event-published`. The built-in scenes
//! stand for all three. Where the folder `shared/data` lies beside the repository, or at `FOLDFRONT_DATA`, so do Den Haag
//! along a car's trajectory and a tile of the Sierra along a flight; of the laser scan there is no real one. Names are those of
//! scenes, or `denhaag` and `sierra`.
//!
//! Settings: the paper's are the size of spheres, an omega of 0.02 rad, and a rho of 1 (50 over terrain), in units of the mesh a frame,
//! metres everywhere here. It does not say its threshold; a projected radius of 2 % of half the image is used, `--theta` gives
//! another. Ours are a screen error of 1 pixel at 1080 lines, and speeds at the path's 99th percentile.
//!
//! Each replay is made three times, and of each frame the least times count. The first frame, which unfolds the whole cut, does not.
//! The ratios are those of all frames, and of the tenth of them for which top-down makes most tests and the tenth for which it
//! makes fewest. The paper's: "only about one third of the time [...] is required if the displayed mesh is very complex", and "where only
//! few tests are required, our procedure is comparably fast".

use std::path::{Path as FilePath, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use foldfront::CollapseLog;
use foldfront::construction::mesh_io;
use foldfront::construction::simplify;
use foldfront::container::output;
use foldfront::experiment::compare::{Options, Pace, Run, Subject};
use foldfront::experiment::path::import::{self, Mode};
use foldfront::experiment::path::{self, Path};
use foldfront::experiment::report::{Report, Section};
use foldfront::experiment::scene::{Scene, SceneKind};
use foldfront::experiment::store::{Backend, Store};
use foldfront::selection::criterion::Criterion;
use foldfront::selection::refine::Strategy;

const ROUNDS: usize = 3;

/// What is walked through.
enum Place {
    Scene(SceneKind),
    /// A mesh, a trajectory, and how that is placed.
    Real(&'static str, &'static str, Mode),
}

/// The number of the paper's figure, a name, rho, and the place.
const FIGURES: [(u32, &str, f64, Place); 5] = [
    (9, "city", 1.0, Place::Scene(SceneKind::City)),
    (
        9,
        "denhaag",
        1.0,
        Place::Real("city/denhaag01_lod2_terrain.obj", "paths/kitti_00_car_10hz.txt", Mode::Walk),
    ),
    (10, "laserscan", 1.0, Place::Scene(SceneKind::Laserscan)),
    (11, "alps", 50.0, Place::Scene(SceneKind::Alps)),
    (11, "sierra", 50.0, Place::Real("terrain/N36W119.hgt", "paths/gcanyon_flight_hoppe.txt", Mode::Fly)),
];

/// What was asked for.
struct Arguments {
    folder: PathBuf,
    theta: f64,
    names: Vec<String>,
    command: String,
}

fn arguments() -> Arguments {
    // The harness's own is not ours.
    let given: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let command = format!("cargo bench --bench selection_time -- {}", given.join(" "));
    let mut words = given.into_iter();
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("../selection_time");
    let mut arguments = Arguments { folder, theta: 0.02, names: Vec::new(), command };
    while let Some(word) = words.next() {
        match word.as_str() {
            "--out" => arguments.folder = words.next().expect("a folder after --out").into(),
            "--theta" => {
                let theta = words.next().and_then(|theta| theta.parse().ok());
                arguments.theta = theta.expect("a number after --theta");
            }
            name if FIGURES.iter().any(|&(_, known, ..)| known == name) => arguments.names.push(word),
            _ => panic!(
                "{word}: --out, --theta, or one of {:?} is expected",
                FIGURES.map(|(_, name, ..)| name)
            ),
        }
    }
    arguments
}

fn main() {
    let arguments = arguments();
    std::fs::create_dir_all(&arguments.folder).expect("the folder can be made");
    for (number, name, rho, place) in &FIGURES {
        if !arguments.names.is_empty() && !arguments.names.iter().any(|wanted| wanted == name) {
            continue;
        }
        let Some((log, walks)) = open(place) else {
            println!("Figure {number}, {name}: the data are not there\n");
            continue;
        };
        let ours = Options::default();
        let papers = Options {
            criterion: Criterion::SphereSize,
            theta: arguments.theta,
            rho: Some(*rho),
            omega: Some(0.02),
            ..ours.clone()
        };
        for (setting, options) in [("paper", papers), ("default", ours)] {
            let title = format!("{name} ({setting})");
            // Without an oracle: event-published is compared with front, which runs beside it and takes less.
            let store = Store::in_memory(log.clone()).expect("the log was just built");
            let mut subject = Subject::of_store(&title, store);
            let runs: Vec<Run> = walks.iter().flat_map(|walk| replay(&mut subject, walk, &options)).collect();
            for runs in runs.chunk_by(|a, b| a.path == b.path) {
                println!(
                    "Figure {number}, {title}, {} triangles, path {}",
                    subject.triangles(),
                    runs[0].path
                );
                ratios(runs);
            }
            let section = Section::new(&title, Backend::InMemory.name(), runs);
            let file = arguments.folder.join(format!("figure-{number}-{name}-{setting}.svg"));
            let curves = section.curves(&arguments.command).expect("curves can be drawn");
            output::write(&file, curves.as_bytes()).expect("the folder can be written to");
            let report =
                Report { command: arguments.command.clone(), pace: Pace::Settled, sections: vec![section] };
            println!("{}\n{}\n", report.to_text(), file.display());
        }
    }
}

/// The hierarchy of a place and the walks through it; `None` if it is not there.
fn open(place: &Place) -> Option<(Arc<CollapseLog>, Vec<Path>)> {
    let quiet = &mut |_, _| {};
    match place {
        Place::Scene(kind) => {
            let scene = Scene::new(*kind);
            let mut options = simplify::Options::default();
            options.merge_components = scene.is_many_objects();
            let (log, _) = simplify::build(scene.mesh(quiet), &options, quiet).expect("scenes are meshes");
            Some((Arc::new(log), path::recorded(*kind).expect("recorded paths are valid").to_vec()))
        }
        Place::Real(mesh, trajectory, mode) => {
            let beside = || concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data").into();
            let data = std::env::var_os("FOLDFRONT_DATA").unwrap_or_else(beside);
            let [mesh, trajectory] = [mesh, trajectory].map(|file| FilePath::new(&data).join(file));
            if !mesh.exists() || !trajectory.exists() {
                return None;
            }
            let mesh = mesh_io::read(&[mesh], quiet).expect("the data are readable");
            // A city is thousands of buildings; a terrain is one piece.
            let mut options = simplify::Options::default();
            options.merge_components = *mode == Mode::Walk;
            let (log, _) = simplify::build(mesh, &options, quiet).expect("the data are meshes");
            let options = import::Options { mode: *mode, ..import::Options::default() };
            let walk = import::import(&trajectory, &log.mesh, &options).expect("a trajectory");
            Some((Arc::new(log), vec![walk]))
        }
    }
}

/// Every strategy along a path, of each frame the least times.
fn replay(subject: &mut Subject, walk: &Path, options: &Options) -> Vec<Run> {
    let mut least: Vec<Run> = Vec::new();
    for _ in 0..ROUNDS {
        let runs = subject.replay(walk, 0..walk.frames.len(), options, &mut |_, _| {});
        let runs = runs.expect("nothing can fail in memory");
        if least.is_empty() {
            least = runs;
            continue;
        }
        for (least, run) in least.iter_mut().zip(runs) {
            for (least, row) in least.rows.iter_mut().zip(run.rows) {
                if row.report.select < least.report.select {
                    least.report = row.report;
                }
            }
        }
    }
    least
}

/// Prints the time of each strategy as a share of that of top-down.
fn ratios(runs: &[Run]) {
    let top_down =
        runs.iter().find(|run| run.strategy == Strategy::TopDown).expect("all strategies are replayed");
    let mut order: Vec<usize> = (1..top_down.rows.len()).collect();
    order.sort_by_key(|&frame| top_down.rows[frame].report.tests);
    let tenth = (order.len() / 10).max(1);
    let groups = [&order[..], &order[order.len() - tenth..], &order[..tenth]];
    println!(
        "{:16}{:>24}{:>24}{:>24}",
        "share of top-down", "all frames", "a tenth, most tests", "a tenth, fewest tests"
    );
    for run in runs {
        let time = |run: &Run, frames: &[usize]| {
            let all: Duration = frames.iter().map(|&frame| run.rows[frame].report.select).sum();
            all.as_secs_f64() * 1e6 / frames.len().max(1) as f64
        };
        let cells = groups.map(|frames| {
            let (own, its) = (time(run, frames), time(top_down, frames));
            format!("{own:13.1} us {:7.3}", own / its.max(1e-9))
        });
        println!("{:16}{:>24}{:>24}{:>24}", run.strategy.name(), cells[0], cells[1], cells[2]);
    }
}
