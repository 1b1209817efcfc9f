//! With memory for everything: the whole refinement step against the in-memory tree, frame by frame.

use std::sync::Arc;

use foldfront::experiment::path::{self, Path};
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{Hierarchy, MeshSink, NullSink, VertexTree};
use in_memory::{InMemoryHierarchy, InMemoryTree};
use meta_node::{BuildOptions, MetaNodeTree};

use crate::subject::{log, meta_nodes, open, spread, views};

/// Each replay is made this often, in turn. Of each frame the least times count.
const ROUNDS: usize = 5;

pub fn table() {
    println!(
        "mesh    strategy   sink   in-memory us: mean  median  p99   meta-node us: mean  median  p99   ratios"
    );
    for name in ["bunny", "dragon"] {
        let Some((log, _)) = log(name) else { continue };
        let file = open(&meta_nodes(name, &log, &BuildOptions::default()));
        let hierarchy = Arc::new(InMemoryHierarchy::new(&log).expect("valid"));
        let walk = path::around(&log.mesh).expect("a place for a camera");
        let views = views(&walk, 1.0);
        for strategy in [Strategy::TopDown, Strategy::Front, Strategy::Event] {
            let settings = settings(&walk, strategy);
            let in_memory = || InMemoryTree::new(hierarchy.clone());
            let meta = || {
                let mut tree =
                    MetaNodeTree::new(file.clone(), meta_node::Settings::default()).expect("memory is there");
                tree.load_all();
                tree.settle().expect("the store is fine");
                tree
            };
            compare(name, strategy, "none", &views, settings, (in_memory, meta), || NullSink, |_| {});
            compare(
                name,
                strategy,
                "mesh",
                &views,
                settings,
                (in_memory, meta),
                ActiveMesh::new,
                ActiveMesh::clear_changes,
            );
        }
    }
}

pub fn settings(walk: &Path, strategy: Strategy) -> Settings {
    let speed = walk.motion_percentile(99.0);
    Settings { strategy, rho: speed.rho, omega: speed.omega, ..Settings::default() }
}

/// Selection times and hashes of the cut, without the first frame, which unfolds the whole cut.
fn replay<T: VertexTree, M: MeshSink>(
    tree: T,
    sink: M,
    clear: impl Fn(&mut M),
    settings: Settings,
    views: &[View],
) -> Vec<(f64, u64)> {
    let mut engine = Engine::new(tree, sink, settings).expect("the store is fine");
    let advance = |view: &View| {
        let report = engine.advance(std::slice::from_ref(view)).expect("the store is fine");
        assert_eq!(report.misses, 0, "everything is in memory");
        clear(engine.sink_mut());
        (report.select.as_nanos() as f64 / 1e3, report.cut_hash)
    };
    views.iter().map(advance).skip(1).collect()
}

#[allow(clippy::too_many_arguments, reason = "a row of the table")]
fn compare<A: VertexTree, B: VertexTree, M: MeshSink>(
    name: &str,
    strategy: Strategy,
    kind: &str,
    views: &[View],
    settings: Settings,
    (a, b): (impl Fn() -> A, impl Fn() -> B),
    sink: impl Fn() -> M,
    clear: impl Fn(&mut M),
) {
    let mut least: [Vec<f64>; 2] = [vec![f64::MAX; views.len() - 1], vec![f64::MAX; views.len() - 1]];
    for _ in 0..ROUNDS {
        let runs =
            [replay(a(), sink(), &clear, settings, views), replay(b(), sink(), &clear, settings, views)];
        assert!(runs[0].iter().zip(&runs[1]).all(|(a, b)| a.1 == b.1), "the cuts differ");
        for (least, run) in least.iter_mut().zip(runs) {
            least.iter_mut().zip(run).for_each(|(least, (time, _))| *least = least.min(time));
        }
    }
    let [memory, meta] = least.map(spread);
    let ratios = [0, 1, 2].map(|i| format!("{:4.2}", meta[i] / memory[i])).join(" ");
    println!(
        "{name:7} {:9} {kind}  {:19.1} {:7.1} {:6.1}  {:17.1} {:7.1} {:6.1}   {ratios}",
        strategy.name(),
        memory[0],
        memory[1],
        memory[2],
        meta[0],
        meta[1],
        meta[2]
    );
}
