//! What finding and making the changes takes, against hierarchies of single collapses: in memory, and in meta-nodes.

use std::path::PathBuf;
use std::sync::Arc;

use foldfront::CollapseLog;
use foldfront::experiment::path::import::{Mode, Options, import};
use foldfront::experiment::path::{self, Path};
use foldfront::page_store::source::FileSource;
use foldfront::selection::engine::{Engine, FrameReport};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{Hierarchy, NullSink, VertexTree};
use in_memory::{InMemoryHierarchy, InMemoryTree};
use meta_node::{MetaNodeFile, MetaNodeTree};
use mt_partition::{BuildOptions, CacheMode};

use crate::{build, folder, replay, settings, tree, views};

/// Each replay is made this often, in turn; of each frame the least time counts.
const ROUNDS: usize = 5;
/// Frames of a path, from its start.
const FRAMES: usize = 1200;

pub fn selection(log: &CollapseLog) {
    let (file, _) = build(log, &BuildOptions::default());
    let hierarchy = Arc::new(InMemoryHierarchy::new(log).expect("a log"));
    let meta_file = meta_nodes(log);
    for path in paths(log) {
        let mut views = views(&path);
        views.truncate(FRAMES);
        for strategy in [Strategy::TopDown, Strategy::Front, Strategy::Event] {
            let settings = settings(&path, strategy);
            let mut figures = [const { Vec::new() }; 4];
            for _ in 0..ROUNDS {
                let plain = InMemoryTree::new(hierarchy.clone());
                least(&mut figures[0], &views, Engine::new(plain, NullSink, settings).expect("in memory"));
                let mut meta = MetaNodeTree::new(meta_file.clone(), meta_node::Settings::default())
                    .expect("memory for everything");
                meta.load_all();
                meta.settle().expect("a whole file");
                least(&mut figures[1], &views, Engine::new(meta, NullSink, settings).expect("a whole file"));
                let mut groups = tree(&file, CacheMode::PCc);
                groups.load_all();
                groups.settle().expect("a whole file");
                for (trees, figures) in
                    [groups, tree(&file, CacheMode::PCc)].into_iter().zip(&mut figures[2..])
                {
                    least(figures, &views, Engine::new(trees, NullSink, settings).expect("a whole file"));
                }
            }
            let [plain, meta, groups, paging] = figures.map(|frames| Figures::new(&frames));
            println!("{}, {}:", path.name, strategy.name());
            let all = [
                ("in-memory", &plain),
                ("meta-node", &meta),
                ("mt-partition", &groups),
                ("mt-partition, p-cc", &paging),
            ];
            for (name, f) in all {
                println!(
                    "  {name:18}: {:.3} ns a triangle displayed, {:.2} us a frame, {:.2} us one without changes, {:.0} \
                     triangles, {:.0} tests, {:.2} changes; meta-node : this, {:.2} by triangle, {:.2} by frame",
                    f.ns / f.triangles,
                    f.ns / 1e3,
                    f.idle_ns / 1e3,
                    f.triangles,
                    f.tests,
                    f.changes,
                    (meta.ns / meta.triangles) / (f.ns / f.triangles),
                    meta.ns / f.ns,
                );
            }
        }
    }
}

/// A flight that was recorded, and a calm turn.
fn paths(log: &CollapseLog) -> Vec<Path> {
    let file =
        PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/paths/euroc_mh04_drone.txt"));
    let options = Options { mode: Mode::Fly, rate: 60.0, ..Options::default() };
    let mut paths = vec![path::around(&log.mesh).expect("a place for a camera")];
    if file.exists() {
        paths.insert(0, import(&file, &log.mesh, &options).expect("a valid trajectory"));
    }
    paths
}

fn meta_nodes(log: &CollapseLog) -> Arc<MetaNodeFile> {
    let path = folder().join("experiment.meta");
    meta_node::write(&path, log, &meta_node::BuildOptions::default()).expect("target is writable");
    let source = FileSource::open(&path).expect("it was just written");
    Arc::new(MetaNodeFile::open(Arc::new(source)).expect("it was just written"))
}

/// Means over the frames.
struct Figures {
    ns: f64,
    /// Over those without changes.
    idle_ns: f64,
    triangles: f64,
    tests: f64,
    changes: f64,
}

impl Figures {
    fn new(frames: &[FrameReport]) -> Self {
        // The first frame unfolds the whole cut.
        let frames = &frames[1..];
        let mean =
            |f: &dyn Fn(&FrameReport) -> u64| frames.iter().map(f).sum::<u64>() as f64 / frames.len() as f64;
        let (idle, count) = frames
            .iter()
            .filter(|r| r.unfolds + r.folds == 0)
            .fold((0.0, 0_u32), |(sum, count), r| (sum + r.select.as_nanos() as f64, count + 1));
        Self {
            idle_ns: idle / f64::from(count.max(1)),
            ns: mean(&|r| r.select.as_nanos() as u64),
            triangles: mean(&|r| r.displayed),
            tests: mean(&|r| r.tests),
            changes: mean(&|r| r.unfolds + r.folds),
        }
    }
}

/// Replays, and keeps the least time of each frame: of the last advance of a frame, in which nothing is missing; most frames
/// have no other.
fn least<T: VertexTree>(least: &mut Vec<FrameReport>, views: &[View], mut engine: Engine<T, NullSink>) {
    let mut at = 0;
    replay(&mut engine, views, |report, _| {
        if at == least.len() {
            least.push(*report);
        } else {
            assert_eq!(least[at].cut_hash, report.cut_hash, "another cut");
            if report.select < least[at].select {
                least[at] = *report;
            }
        }
        at += 1;
    });
}
