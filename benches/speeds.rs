//! What declared speeds do to an event queue, and what it costs to declare none.
//!
//! `cargo bench --bench speeds [-- WORD...]` replays the calm paths of the built-in scenes, and orbits around the bunny and the
//! dragon where `shared/data` lies beside the repository, each scene as it is, a millionth as large and a million times. For
//! each it prints what finding takes a frame with `event-queue` and the best of a grid of declared speeds, with the default
//! ones, and with `event`, which is told none. The grid has speeds of the eye from a hundredth of the path's median to a hundred
//! times it, and of turning from a tenth of it to ten times, by factors of ten. Replays are made in turns, and medians count.
//!
//! Hierarchies are kept in `target/tmp/strategies`, as by the benchmark `strategies`.

mod kept;

use std::path::PathBuf;
use std::sync::Arc;

use foldfront::Bounds;
use foldfront::CollapseLog;
use foldfront::construction::{mesh_io, simplify};
use foldfront::experiment::path::{self, Path};
use foldfront::experiment::scene::{Scene, SceneKind};
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::{View, theta_of_pixels};
use foldfront::vertex_tree::NullSink;
use in_memory::{InMemoryHierarchy, InMemoryTree};

const RUNS: usize = 5;
/// Powers of two: the cuts are the same.
const SCALES: [f64; 3] = [1.0 / 1_048_576.0, 1.0, 1_048_576.0];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let is_chosen = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word.as_str()));
    println!("us a frame          scale       best (rho, omega)          default      event   event : best");
    for kind in SceneKind::ALL.into_iter().filter(|kind| is_chosen(kind.name())) {
        let scene = Scene::new(kind);
        let mut build = simplify::Options::default();
        build.merge_components = scene.is_many_objects();
        let log = kept::log(kind.name(), &build, || scene.mesh(&mut |_, _| {}));
        let [calm, _] = path::recorded(kind).expect("recorded paths are valid");
        table(&calm, &log);
    }
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    for name in ["bunny", "dragon"] {
        let file = data.join(format!("meshes/{name}.ply"));
        if is_chosen(name) && file.exists() {
            let read = || mesh_io::read(&[&file], &mut |_, _| {}).expect("the data are readable");
            let log = kept::log(name, &simplify::Options::default(), read);
            let orbit =
                Path { name: name.to_owned(), ..path::around(&log.mesh).expect("a place for a camera") };
            table(&orbit, &log);
        }
    }
}

fn table(walk: &Path, log: &CollapseLog) {
    for scale in SCALES {
        let hierarchy = Arc::new(InMemoryHierarchy::new(&scaled(log, scale as f32)).expect("the same tree"));
        let theta = theta_of_pixels(1.0, 1080);
        let views: Vec<View> = (0..walk.frames.len())
            .map(|frame| {
                let view = walk.view(frame, theta).expect("a view");
                view.with_eye(view.eye() * scale).expect("an eye")
            })
            .collect();
        let usual = walk.motion_percentile(50.0);
        let of = |speed: f64, otherwise: f64| if speed > 0.0 { speed } else { otherwise };
        let (rho, omega) = (of(usual.rho, 1.0) * scale, of(usual.omega, 0.02));
        let default = Settings::default();
        let mut declared: Vec<(f64, f64)> = vec![(default.rho, default.omega)];
        for far in [0.01, 0.1, 1.0, 10.0, 100.0] {
            declared.extend([0.1, 1.0, 10.0].map(|fast| (rho * far, omega * fast)));
        }
        let mut all: Vec<Settings> = declared
            .iter()
            .map(|&(rho, omega)| Settings { strategy: Strategy::EventQueue, rho, omega, ..default })
            .collect();
        all.push(default);
        let mut times = vec![Vec::new(); all.len()];
        let mut hashes = Vec::new();
        for _ in 0..RUNS {
            for (settings, times) in all.iter().zip(&mut times) {
                let (time, hash) = find(&hierarchy, *settings, &views);
                times.push(time);
                hashes.push(hash);
            }
        }
        assert!(hashes.iter().all(|hash| *hash == hashes[0]), "the cuts differ");
        let median = |mut times: Vec<f64>| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        };
        let mut times: Vec<f64> = times.into_iter().map(median).collect();
        let event = times.pop().unwrap_or(f64::NAN);
        let best = (1..times.len()).min_by(|&a, &b| times[a].total_cmp(&times[b])).unwrap_or(0);
        let (rho, omega) = declared[best];
        println!(
            "{:16} {scale:8.0e} {:9.2} ({rho:8.1e}, {omega:7.1e}) {:12.2} {event:10.2} {:10.2}",
            walk.name,
            times[best],
            times[0],
            event / times[best]
        );
    }
}

/// What finding takes in a frame, in microseconds, the first one left out; and a number for all cuts.
fn find(hierarchy: &Arc<InMemoryHierarchy>, settings: Settings, views: &[View]) -> (f64, u64) {
    let tree = InMemoryTree::new(hierarchy.clone());
    let mut engine = Engine::new(tree, NullSink, settings).expect("nothing can fail in memory");
    let (mut sum, mut hash) = (0, 0_u64);
    for (frame, view) in views.iter().enumerate() {
        let report = engine.advance(std::slice::from_ref(view)).expect("nothing can fail in memory");
        hash = hash.rotate_left(7) ^ report.cut_hash;
        if frame > 0 {
            sum += (report.select - report.apply).as_nanos();
        }
    }
    (sum as f64 / 1e3 / (views.len() - 1) as f64, hash)
}

/// The same hierarchy in other units.
fn scaled(log: &CollapseLog, scale: f32) -> CollapseLog {
    let mut log = log.clone();
    log.mesh.positions.iter_mut().flatten().for_each(|x| *x *= scale);
    for collapse in &mut log.collapses {
        let Bounds { center, radius, eps } = collapse.bounds;
        let center = center.map(|x| x * scale);
        collapse.bounds = Bounds { center, radius: radius * scale, eps: eps * scale };
    }
    log
}
