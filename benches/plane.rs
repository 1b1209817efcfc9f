//! Where an event queue pays and where a scan does: what finding costs over a plane of fronts and speeds.
//!
//! `cargo bench --bench plane [-- WORD...] [-- --runs N] [-- --svg FILE]` prints for each size of the front, each way to move
//! and each speed what the pure queue, the pure scan and the event strategy take to find what changes, in a sum over 600
//! frames; words select rows by front (`front-1000`) or motion (`moving`, `turning`, `both`, `teleports`, `changing`). Runs
//! are made in turns, and medians count. `--svg` draws the plane.
//!
//! The scene is a town of 2.9 million triangles (`scene:laserscan@2`), seen from above its middle. Full speed is 1 unit and
//! 0.02 radians a frame, and declared; the event strategy does not look at that. Within a row the tolerance is such that the
//! first view has that many active nodes.
//!
//! Hierarchies are kept in `target/tmp/strategies`, as by the benchmark `strategies`.

mod kept;

use std::path::PathBuf;
use std::sync::Arc;

use foldfront::construction::simplify;
use foldfront::experiment::scene::Scene;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::NullSink;
use glam::DVec3;
use in_memory::{InMemoryHierarchy, InMemoryTree};
use plotters::prelude::*;

const FRONTS: [u64; 6] = [100, 540, 5_000, 50_000, 300_000, 1_400_000];
const SPEEDS: [f64; 5] = [0.0, 0.01, 0.1, 1.0, 10.0];
const FRAMES: usize = 600;
/// Full speed, in units and radians a frame.
const RHO: f64 = 1.0;
const OMEGA: f64 = 0.02;
/// The strategies that are compared: the parts, and what chooses among them.
const STRATEGIES: [Strategy; 3] = [Strategy::EventQueue, Strategy::Front, Strategy::Event];

/// How a camera moves, at a speed in terms of full speed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    Moving,
    Turning,
    Both,
    /// Both, and elsewhere every 60 frames.
    Teleports,
    /// Both, and a hundredth as fast for 60 of every 120 frames.
    Changing,
}

const MOTIONS: [(Motion, &str); 5] = [
    (Motion::Moving, "moving"),
    (Motion::Turning, "turning"),
    (Motion::Both, "both"),
    (Motion::Teleports, "teleports"),
    (Motion::Changing, "changing"),
];

impl Motion {
    /// The views of a walk over a town of an extent around a middle.
    fn views(self, speed: f64, middle: DVec3, extent: f64, k: f64) -> Vec<View> {
        let (mut along, mut turned) = (0.0, 0.0);
        let radius = extent / 16.0;
        (0..FRAMES)
            .map(|frame| {
                let pace = if self == Self::Changing && frame / 60 % 2 == 1 { speed / 100.0 } else { speed };
                along += if self == Self::Turning { 0.0 } else { pace * RHO };
                turned += if self == Self::Moving { 0.0 } else { pace * OMEGA };
                let jump = if self == Self::Teleports { (frame / 60) as f64 * 2.0 } else { 0.0 };
                let (sine, cosine) = (libm::sin(along / radius + jump), libm::cos(along / radius + jump));
                let eye = middle + DVec3::new(radius * cosine, radius * sine, extent / 8.0);
                let (x, y) = (libm::cos(turned), libm::sin(turned));
                let direction = DVec3::new(x, y, -1.0).normalize();
                // 60 degrees from side to side.
                View::from_parts(eye, direction, 0.75_f64.sqrt(), 0.5, k).expect("a view")
            })
            .collect()
    }
}

/// What finding takes along some views, in nanoseconds, the first frame left out: it unfolds the whole cut.
fn find(hierarchy: &Arc<InMemoryHierarchy>, strategy: Strategy, views: &[View]) -> (f64, u64) {
    let settings = Settings { strategy, rho: RHO, omega: OMEGA, ..Settings::default() };
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
    (sum as f64, hash)
}

fn active(hierarchy: &Arc<InMemoryHierarchy>, view: &View) -> u64 {
    let tree = InMemoryTree::new(hierarchy.clone());
    let mut engine = Engine::new(tree, NullSink, Settings::default()).expect("nothing can fail in memory");
    engine.advance(std::slice::from_ref(view)).expect("nothing can fail in memory").active_nodes
}

/// A tolerance at which so many nodes are active, or all that there are.
fn tolerance(hierarchy: &Arc<InMemoryHierarchy>, nodes: u64, view: impl Fn(f64) -> View) -> f64 {
    let (mut low, mut high) = (1.0_f64, 1e9_f64);
    for _ in 0..30 {
        let middle = (low * high).sqrt();
        if active(hierarchy, &view(middle)) < nodes { low = middle } else { high = middle }
    }
    high
}

/// What a cell took, in microseconds a frame: queue, scan, event.
struct Cell {
    front: u64,
    motion: &'static str,
    speed: f64,
    find: [f64; 3],
}

impl Cell {
    /// Event by the lesser of the others.
    fn ratio(&self) -> f64 {
        self.find[2] / self.find[0].min(self.find[1])
    }

    /// The same, less the 0.3 microseconds a frame that a choice may cost.
    fn ratio_of_what_counts(&self) -> f64 {
        (self.find[2] - 0.3) / self.find[0].min(self.find[1])
    }
}

fn main() {
    let mut words = Vec::new();
    let (mut runs, mut svg) = (9, None);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--runs" => runs = arguments.next().and_then(|n| n.parse().ok()).expect("a number of runs"),
            "--svg" => svg = Some(PathBuf::from(arguments.next().expect("a file"))),
            _ if argument.starts_with("--") => {}
            _ => words.push(argument),
        }
    }
    // Words of one kind choose among their kind.
    let (fronts, motions): (Vec<String>, Vec<String>) =
        words.into_iter().partition(|word| word.starts_with("front-"));
    let is_chosen_front = |front: u64| fronts.is_empty() || fronts.contains(&format!("front-{front}"));
    let is_chosen = |motion: &str| motions.is_empty() || motions.iter().any(|word| word == motion);
    let scene = Scene::parse("scene:laserscan@2").expect("a scene");
    let log = kept::log("million", &simplify::Options::default(), || scene.mesh(&mut |_, _| {}));
    let (lo, hi) = log.mesh.bounding_box().expect("a town");
    let [lo, hi] = [lo, hi].map(|p| DVec3::from(p.map(f64::from)));
    let (middle, extent) = ((lo + hi) / 2.0, log.mesh.extent());
    let hierarchy = Arc::new(InMemoryHierarchy::new(&log).expect("the log was just built"));
    drop(log);

    println!(
        "   front  motion     speed      queue       scan      event us a frame   event : lesser (less 0.3 us)"
    );
    let mut cells = Vec::new();
    for front in FRONTS.into_iter().filter(|&front| is_chosen_front(front)) {
        let first = |k| Motion::Both.views(0.0, middle, extent, k)[0];
        let k = tolerance(&hierarchy, front, first);
        for (motion, name) in MOTIONS.into_iter().filter(|&(_, name)| is_chosen(name)) {
            for speed in SPEEDS {
                if speed == 0.0 && motion != Motion::Both {
                    continue;
                }
                let views = motion.views(speed, middle, extent, k);
                let mut times = [const { Vec::new() }; 3];
                let mut hashes = Vec::new();
                for _ in 0..runs {
                    for (strategy, times) in STRATEGIES.iter().zip(&mut times) {
                        let (time, hash) = find(&hierarchy, *strategy, &views);
                        times.push(time / (FRAMES - 1) as f64 / 1e3);
                        hashes.push(hash);
                    }
                }
                assert!(hashes.iter().all(|hash| *hash == hashes[0]), "the strategies differ");
                let median = |times: &mut Vec<f64>| {
                    times.sort_by(f64::total_cmp);
                    times[times.len() / 2]
                };
                let cell = Cell { front, motion: name, speed, find: times.each_mut().map(median) };
                let [queue, scan, event] = cell.find;
                println!(
                    "{front:8}  {name:9} {speed:6} {queue:10.2} {scan:10.2} {event:10.2}              {:6.2} ({:.2})",
                    cell.ratio(),
                    cell.ratio_of_what_counts()
                );
                cells.push(cell);
            }
        }
    }
    let worst = |all: &[&Cell]| all.iter().map(|cell| cell.ratio_of_what_counts()).fold(0.0, f64::max);
    let (steady, jumpy): (Vec<&Cell>, Vec<&Cell>) =
        cells.iter().partition(|cell| !["teleports", "changing"].contains(&cell.motion));
    println!(
        "at most {:.2} on steady paths, {:.2} with teleports or changing speeds",
        worst(&steady),
        worst(&jumpy)
    );
    if let Some(file) = svg {
        draw(&file, &cells).expect("the picture can be written");
    }
}

/// A panel for each of the steady motions: fronts to the right, speeds upwards, and as colour how the time of the event
/// strategy compares with the lesser of the others (blue: less; red: more).
fn draw(file: &std::path::Path, cells: &[Cell]) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::new(file, (960, 360)).into_drawing_area();
    area.fill(&WHITE)?;
    for (panel, (_, motion)) in area.split_evenly((1, 3)).iter().zip(&MOTIONS[..3]) {
        let mut chart = ChartBuilder::on(panel)
            .caption(motion, ("sans-serif", 18))
            .margin(10)
            .x_label_area_size(30)
            .y_label_area_size(44)
            .build_cartesian_2d(0.0..FRONTS.len() as f64, 0.0..(SPEEDS.len() - 1) as f64)?;
        let name = |names: &[String], at: f64| {
            if (at.fract() - 0.5).abs() < 0.01 {
                names.get(at as usize).cloned().unwrap_or_default()
            } else {
                String::new()
            }
        };
        let fronts: Vec<String> = FRONTS.iter().map(u64::to_string).collect();
        let speeds: Vec<String> = SPEEDS[1..].iter().map(f64::to_string).collect();
        chart
            .configure_mesh()
            .disable_mesh()
            .x_labels(2 * FRONTS.len() + 1)
            .y_labels(2 * SPEEDS.len() - 1)
            .x_label_formatter(&|at| name(&fronts, *at))
            .y_label_formatter(&|at| name(&speeds, *at))
            .x_desc("active nodes")
            .y_desc("speed")
            .draw()?;
        for cell in cells.iter().filter(|cell| cell.motion == *motion && cell.speed > 0.0) {
            let column = FRONTS.iter().position(|&front| front == cell.front).unwrap_or(0) as f64;
            let row = SPEEDS[1..].iter().position(|&speed| speed == cell.speed).unwrap_or(0) as f64;
            let ratio = cell.ratio();
            // From a quarter to four times, in logarithms.
            let tone = (libm::log2(ratio) / 2.0).clamp(-1.0, 1.0);
            let fade = |x: f64| (255.0 * (1.0 - 0.8 * x.max(0.0))) as u8;
            let colour = RGBColor(fade(-tone), fade(tone.abs()), fade(tone));
            chart
                .draw_series([Rectangle::new([(column, row), (column + 1.0, row + 1.0)], colour.filled())])?;
            chart.draw_series([Text::new(
                format!("{ratio:.2}"),
                (column + 0.2, row + 0.6),
                ("sans-serif", 13),
            )])?;
        }
    }
    area.present()?;
    Ok(())
}
