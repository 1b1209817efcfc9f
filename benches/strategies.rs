//! What each strategy costs: finding what changes, changing it, and the worst frames.
//!
//! `cargo bench --bench strategies [-- WORD...]` prints one table a path, for the built-in scenes always and for
//! real meshes where the folder `shared/data` lies beside the repository; words select subjects by name. The
//! tolerance is 1 pixel at 1080 lines; full speed is declared as the path's 99th percentile, as `compare` does.
//!
//! Hierarchies are kept in `target/tmp/strategies`; delete that folder after changing the construction.
//!
//! Every exact strategy must arrive at the same cut in every frame: the benchmark fails where two hashes differ.

#![expect(clippy::disallowed_methods, reason = "shapes to measure with")]

mod kept;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use foldfront::construction::mesh_io;
use foldfront::construction::simplify;
use foldfront::experiment::path::{self, Path, Pose};
use foldfront::experiment::scene::{Scene, SceneKind};
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::engine::{Engine, FrameReport, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::{View, theta_of_pixels};
use foldfront::vertex_tree::{MeshSink, NullSink};
use foldfront::{CollapseLog, Mesh};
use glam::{DMat3, DQuat, DVec3};
use in_memory::{InMemoryHierarchy, InMemoryTree};

const EXACT: [Strategy; 3] = [Strategy::TopDown, Strategy::Front, Strategy::Event];
/// Each replay is made this often, strategies in turn. Of each frame the least times count: what else the machine does
/// can only add to them.
const ROUNDS: usize = 3;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let is_chosen = |name: &str| words.is_empty() || words.iter().any(|word| name.contains(word.as_str()));
    for kind in SceneKind::ALL {
        if is_chosen(kind.name()) {
            let scene = Scene::new(kind);
            let mut build = simplify::Options::default();
            build.merge_components = scene.is_many_objects();
            let hierarchy = arrange(&kept::log(kind.name(), &build, || scene.mesh(&mut |_, _| {})));
            let [calm, wild] = path::recorded(kind).expect("recorded paths are valid");
            calm_tables(&hierarchy, &calm, 1.0);
            wild_table(&hierarchy, &wild);
        }
    }
    // Everything in view and next to everything unfolded: what a test costs where the front leaves the caches.
    if is_chosen("million") {
        let scene = Scene::parse("scene:laserscan@2").expect("a scene");
        let log = kept::log("million", &simplify::Options::default(), || scene.mesh(&mut |_, _| {}));
        let mut walk =
            Path { name: "million".to_owned(), ..path::around(&log.mesh).expect("a place for a camera") };
        walk.frames.truncate(40);
        calm_tables(&arrange(&log), &walk, 0.003);
    }
    let data = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    for name in ["bunny", "dragon"] {
        let file = data.join(format!("meshes/{name}.ply"));
        if is_chosen(name) && file.exists() {
            let log = kept::log(name, &simplify::Options::default(), || read(&[file]));
            let walk =
                Path { name: name.to_owned(), ..path::around(&log.mesh).expect("a place for a camera") };
            calm_tables(&arrange(&log), &walk, 1.0);
        }
    }
    let tiles = ["N36W118", "N36W119", "N37W118", "N37W119"].map(|t| data.join(format!("terrain/{t}.hgt")));
    if is_chosen("sierra") && tiles[0].exists() {
        let log = kept::log("sierra", &simplify::Options::default(), || read(&tiles));
        let walk = flight(&log.mesh, "sierra flight", DVec3::X);
        // Out of the mosaic, with the neighbours behind.
        let outward = flight(&log.mesh, "outward flight", DVec3::new(-1.0, -1.0, 0.0).normalize());
        let hierarchy = arrange(&log);
        let quarter = kept::log("quarter", &simplify::Options::default(), || quarter(&log.mesh));
        drop(log);
        calm_tables(&hierarchy, &walk, 1.0);
        calm_tables(&hierarchy, &walk, 0.25);
        println!("{} at 1 pixel in the mosaic", outward.name);
        let whole = table(&hierarchy, &outward, &outward, 1.0);
        drop(hierarchy);
        println!("{} at 1 pixel over the quarter that it lies in, alone", outward.name);
        let alone = table(&arrange(&quarter), &outward, &outward, 1.0);
        for ((strategy, [whole, _]), [alone, _]) in EXACT.iter().zip(whole).zip(alone) {
            println!(
                "{:10} in the mosaic : alone  select {:6.2}  active nodes {:6.3}",
                strategy.name(),
                whole.select / alone.select,
                whole.active / alone.active
            );
        }
    }
}

fn read(files: &[PathBuf]) -> Mesh {
    mesh_io::read(files, &mut |_, _| {}).expect("the data are readable")
}

fn arrange(log: &CollapseLog) -> Arc<InMemoryHierarchy> {
    Arc::new(InMemoryHierarchy::new(log).expect("the log was just built"))
}

/// The triangles of a mesh that lie south-west of the origin.
fn quarter(mesh: &Mesh) -> Mesh {
    let is_inside = |v: u32| mesh.positions[v as usize][..2].iter().all(|&x| x <= 0.0);
    let triangles: Vec<[u32; 3]> =
        mesh.triangles.iter().copied().filter(|t| t.iter().all(|&v| is_inside(v))).collect();
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let mut part = Mesh::default();
    for corners in triangles {
        part.triangles.push(corners.map(|v| {
            let number = &mut number[v as usize];
            if *number == u32::MAX {
                *number = part.positions.len() as u32;
                part.positions.push(mesh.positions[v as usize]);
            }
            *number
        }));
    }
    part
}

/// A flight in wide curves over the south-western quarter of a terrain, 50 m a frame, above the highest ground around.
fn flight(mesh: &Mesh, name: &str, heading: DVec3) -> Path {
    const FRAMES: usize = 400;
    let ((lo, _), around) = (mesh.bounding_box().expect("a terrain"), 4000.0_f32);
    let ground = |x: f32, y: f32| {
        let heights =
            mesh.positions.iter().filter(|p| (p[0] - x).abs() < around && (p[1] - y).abs() < around);
        heights.map(|p| p[2]).fold(f32::MIN, f32::max)
    };
    let middle = DVec3::new(f64::from(lo[0]) * 0.5, f64::from(lo[1]) * 0.5, 0.0);
    let place = |frame: f64| {
        let along = frame * 50.0;
        middle + heading * (along - 10_000.0) + DVec3::Z.cross(heading) * 3000.0 * (along / 6000.0).sin()
    };
    let knots: Vec<f64> = (0..=(FRAMES + 200) / 50)
        .map(|i| {
            let p = place(50.0 * i as f64);
            f64::from(ground(p.x as f32, p.y as f32)) + 300.0
        })
        .collect();
    let at = |frame: f64| {
        let (i, share) = ((frame / 50.0) as usize, (frame / 50.0).fract());
        let smooth = share * share * (3.0 - 2.0 * share);
        place(frame) + DVec3::Z * (knots[i] * (1.0 - smooth) + knots[i + 1] * smooth)
    };
    let frames = (0..FRAMES)
        .map(|frame| {
            let position = at(frame as f64);
            let ahead = (at(frame as f64 + 100.0) - position - DVec3::Z * 800.0).normalize();
            let right = ahead.cross(DVec3::Z).normalize();
            let orientation =
                DQuat::from_mat3(&DMat3::from_cols(right, right.cross(ahead), -ahead)).normalize();
            Pose { time: frame as f64 / 60.0, position, orientation }
        })
        .collect();
    let (units, fov_y, aspect) = ("m".to_owned(), 60_f64.to_radians(), 16.0 / 9.0);
    Path { name: name.to_owned(), units, fov_y, aspect, frames }
}

/// The middle tenth of a path, at a tenth of its speed.
fn slow(walk: &Path) -> Path {
    let count = walk.frames.len();
    let poses = &walk.frames[count * 9 / 20..count * 11 / 20 + 1];
    let between = |pair: &[Pose]| {
        let (a, b) = (pair[0], pair[1]);
        (0..10).map(move |i| {
            let share = f64::from(i) / 10.0;
            Pose {
                time: a.time + (b.time - a.time) * share,
                position: a.position.lerp(b.position, share),
                orientation: a.orientation.slerp(b.orientation, share),
            }
        })
    };
    Path { frames: poses.windows(2).flat_map(between).collect(), ..walk.clone() }
}

fn rest(walk: &Path) -> Path {
    Path { frames: vec![walk.frames[walk.frames.len() / 2]; 50], ..walk.clone() }
}

/// Replays a path from the base mesh on and leaves the first frame out: it unfolds the whole cut.
fn replay<M: MeshSink>(
    hierarchy: &Arc<InMemoryHierarchy>,
    settings: Settings,
    views: &[View],
    sink: impl FnOnce(&InMemoryTree) -> M,
    clear: impl Fn(&mut M),
) -> Vec<FrameReport> {
    let tree = InMemoryTree::new(hierarchy.clone());
    let mesh = sink(&tree);
    let mut engine = Engine::new(tree, mesh, settings).expect("nothing can fail in memory");
    let mut reports = Vec::with_capacity(views.len());
    for view in views {
        reports.push(engine.advance(std::slice::from_ref(view)).expect("nothing can fail in memory"));
        clear(engine.sink_mut());
    }
    reports.remove(0);
    reports
}

/// Figures of one replay, in nanoseconds.
#[derive(Clone, Copy, Default)]
struct Figures {
    find: f64,
    select: f64,
    select_p99: f64,
    test: f64,
    change: f64,
    tests: f64,
    changes: f64,
    active: f64,
}

impl Figures {
    fn new(reports: &[FrameReport]) -> Self {
        let sorted = |f: &dyn Fn(&FrameReport) -> Duration| {
            let mut times: Vec<f64> = reports.iter().map(|r| f(r).as_nanos() as f64).collect();
            times.sort_by(f64::total_cmp);
            times
        };
        let (find, select) = (sorted(&|r| r.select - r.apply), sorted(&|r| r.select));
        let count = reports.len() as f64;
        let mean = |f: &dyn Fn(&FrameReport) -> u64| reports.iter().map(f).sum::<u64>() as f64 / count;
        let (tests, changes) = (mean(&|r| r.tests), mean(&|r| r.unfolds + r.folds));
        let apply = mean(&|r| r.apply.as_nanos() as u64);
        Self {
            find: find[find.len() / 2],
            select: select[select.len() / 2],
            select_p99: select[(select.len() * 99).div_ceil(100) - 1],
            test: find.iter().sum::<f64>() / count / tests,
            change: apply / changes,
            tests,
            changes,
            active: mean(&|r| r.active_nodes),
        }
    }
}

/// Replays `walk` with every strategy and prints a table; `[mesh kept, null sink]` for each strategy.
fn table(hierarchy: &Arc<InMemoryHierarchy>, walk: &Path, declared: &Path, pixels: f64) -> Vec<[Figures; 2]> {
    let theta = theta_of_pixels(pixels, 1080);
    let views: Vec<View> =
        (0..walk.frames.len()).map(|frame| walk.view(frame, theta).expect("a view")).collect();
    let speed = declared.motion_percentile(99.0);
    let mut least: Vec<[Vec<FrameReport>; 2]> = vec![Default::default(); EXACT.len()];
    let mut hashes: Vec<u64> = Vec::new();
    for round in 0..ROUNDS {
        for (&strategy, least) in EXACT.iter().zip(&mut least) {
            let settings = Settings { strategy, rho: speed.rho, omega: speed.omega, ..Settings::default() };
            let with_mesh =
                replay(hierarchy, settings, &views, |_| ActiveMesh::new(), ActiveMesh::clear_changes);
            let without = replay(hierarchy, settings, &views, |_| NullSink, |_| {});
            for (least, reports) in least.iter_mut().zip([with_mesh, without]) {
                if hashes.is_empty() {
                    hashes = reports.iter().map(|r| r.cut_hash).collect();
                }
                let differs = reports.iter().zip(&hashes).position(|(r, &hash)| r.cut_hash != hash);
                assert_eq!(differs, None, "{} has another cut than the others", strategy.name());
                if round == 0 {
                    *least = reports;
                } else {
                    for (least, report) in least.iter_mut().zip(reports) {
                        *least = if report.select < least.select { report } else { *least };
                    }
                }
            }
        }
    }
    let best: Vec<[Figures; 2]> =
        least.iter().map(|[kept, null]| [Figures::new(kept), Figures::new(null)]).collect();
    for (strategy, [kept, null]) in EXACT.iter().zip(&best) {
        println!(
            "{:10} find {:9.1} us  select {:9.1} us  p99 {:9.1} us  {:9.0} tests  {:7.1} ns a test  {:7.0} changes  \
             {:6.1} tests a change  {:6.0} ns a change  {:6.0} with a null sink  {:8.0} active",
            strategy.name(),
            null.find / 1e3,
            kept.select / 1e3,
            kept.select_p99 / 1e3,
            kept.tests,
            null.test,
            kept.changes,
            kept.tests / kept.changes,
            kept.change,
            null.change,
            kept.active
        );
    }
    let [top_down, front, event] = [0, 1, 2].map(|s| best[s]);
    println!(
        "           find top-down : event {:6.2}  front : event {:6.2}  select top-down : event {:6.2}  p99 event : \
         top-down {:6.2}",
        top_down[1].find / event[1].find,
        front[1].find / event[1].find,
        top_down[0].select / event[0].select,
        event[0].select_p99 / top_down[0].select_p99
    );
    best
}

/// A calm path at full speed, at a tenth of it and at rest.
fn calm_tables(hierarchy: &Arc<InMemoryHierarchy>, walk: &Path, pixels: f64) {
    println!("{} at {pixels} pixels, full speed", walk.name);
    table(hierarchy, walk, walk, pixels);
    println!("{} at {pixels} pixels, a tenth of full speed", walk.name);
    table(hierarchy, &slow(walk), walk, pixels);
    println!("{} at {pixels} pixels, at rest", walk.name);
    table(hierarchy, &rest(walk), walk, pixels);
}

/// A path with stops, slow pans, spins and a teleport.
fn wild_table(hierarchy: &Arc<InMemoryHierarchy>, walk: &Path) {
    println!("{}", walk.name);
    table(hierarchy, walk, walk, 1.0);
}
