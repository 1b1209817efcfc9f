//! Meta-node trees under an engine: little memory, faults, dependencies, and the displayed mesh.

mod common;

use std::sync::Arc;
use std::time::Duration;

use common::backends::{meta_node_bytes, meta_node_file};
use common::sink::StrictMesh;
use common::{Random, bumpy_grid, data, random_log, random_step, random_view};
use foldfront::cut::Displayed;
use foldfront::engine::{Engine, FrameReport, Settings};
use foldfront::oracle::Oracle;
use foldfront::refine::Strategy;
use foldfront::simplify;
use foldfront::vertex_tree::source::{Faults, Faulty, MemorySource};
use foldfront::vertex_tree::{CollapseLog, MeshSink, NONE, NullSink, VertexTree};
use foldfront::view::View;
use in_memory::{Hierarchy, InMemoryTree};
use meta_node::{BuildOptions, Dependencies, InUse, MetaNodeFile, MetaNodeTree};

const EXACT: [Strategy; 3] = [Strategy::TopDown, Strategy::Front, Strategy::Event];
/// Small pages, so that small meshes have many.
const PAGES: BuildOptions = BuildOptions { levels: Some(3), page_bytes: 700 };

/// A simplified mesh with good triangles.
fn grid(side: usize) -> CollapseLog {
    let mesh = bumpy_grid(side, &mut Random(3));
    simplify::build(mesh, &simplify::Options::default(), &mut |_, _| ()).unwrap().0
}

fn holder_bytes(file: &MetaNodeFile) -> u64 {
    file.facts().iter().find(|(fact, _)| *fact == "largest page, bytes").unwrap().1.parse().unwrap()
}

fn settings(strategy: Strategy) -> Settings {
    Settings { strategy, rho: 0.02, ..Settings::default() }
}

/// Advances until nothing is missing any more; every step of that must make progress in time.
fn settle<M: MeshSink>(engine: &mut Engine<MetaNodeTree, M>, views: &[View]) -> FrameReport {
    for _ in 0..20_000 {
        let report = engine.advance(views).unwrap();
        if report.misses == 0 {
            return report;
        }
        engine.tree_mut().settle().unwrap();
    }
    panic!("the camera has stopped, and the cut is not reached: {:?}", engine.tree().last_fault());
}

/// A long walk with memory for almost nothing, frames that do not wait, and every now and then a rest: then the cut is the
/// oracle's, whatever the strategy, and memory has never been more than allowed.
#[test]
fn a_camera_that_stops_always_gets_its_cut() {
    let mut random = Random(1);
    for (log, holders) in
        [(grid(60), 4), (grid(60), 40), (random_log(bumpy_grid(50, &mut random), &mut random), 6)]
    {
        let file = meta_node_file(&log, &PAGES);
        let page_memory = holders * holder_bytes(&file);
        let paging = meta_node::Settings { page_memory, ..meta_node::Settings::default() };
        let mut oracle = Oracle::new(&log).unwrap();
        for strategy in EXACT {
            let tree = MetaNodeTree::new(file.clone(), paging).unwrap();
            let mut engine = Engine::new(tree, NullSink, settings(strategy)).unwrap();
            let mut random = Random(9);
            let mut view = random_view(&mut random);
            let mut misses = 0;
            for round in 0..40 {
                for _ in 0..random.below(40) {
                    random_step(&mut view, &mut random);
                    let report = engine.advance(&[view]).unwrap();
                    assert!(report.pages.resident_bytes <= page_memory, "{:?}", report.pages);
                    misses += report.misses;
                }
                settle(&mut engine, &[view]);
                assert_eq!(oracle.compare(&engine), None, "{}, round {round}", strategy.name());
                let displayed = Displayed::new(&log, oracle.active()).triangles.len() as u64;
                assert_eq!(engine.tree().displayed_triangles(), displayed);
            }
            assert!(misses > 1000, "{misses}");
        }
    }
}

/// Memory that grows and shrinks while the camera moves.
#[test]
fn memory_may_change_while_the_camera_moves() {
    let log = grid(60);
    let file = meta_node_file(&log, &PAGES);
    let each = holder_bytes(&file);
    let tree = MetaNodeTree::new(file, meta_node::Settings::default()).unwrap();
    let mut engine = Engine::new(tree, NullSink, settings(Strategy::Event)).unwrap();
    let mut oracle = Oracle::new(&log).unwrap();
    let mut random = Random(4);
    let mut view = random_view(&mut random);
    for round in 0..60 {
        let holders = if round % 5 == 0 { 100_000 } else { 4 + random.below(60) as u64 };
        // Nothing is being read, and what is allowed holds from the first frame on.
        engine.tree_mut().settle().unwrap();
        engine.advance(&[view]).unwrap();
        engine.tree_mut().settle().unwrap();
        engine.tree_mut().set_page_memory(holders * each).unwrap();
        for _ in 0..20 {
            random_step(&mut view, &mut random);
            let report = engine.advance(&[view]).unwrap();
            assert!(
                report.pages.resident_bytes <= holders * each,
                "{:?}, {holders} place holders",
                report.pages
            );
        }
        settle(&mut engine, &[view]);
        assert_eq!(oracle.compare(&engine), None, "round {round}");
    }
}

/// The paper's rule: pages in use stay. A cut that needs more of them is not reached, a smaller one is, again and again.
#[test]
fn where_pages_in_use_stay_the_front_still_follows() {
    let log = grid(60);
    let file = meta_node_file(&log, &PAGES);
    let page_memory = 30 * holder_bytes(&file);
    let paging = meta_node::Settings { page_memory, in_use: InUse::Stays, ..meta_node::Settings::default() };
    let mut oracle = Oracle::new(&log).unwrap();
    let mut engine =
        Engine::new(MetaNodeTree::new(file, paging).unwrap(), NullSink, settings(Strategy::Event)).unwrap();
    let mut random = Random(4);
    let mut view = random_view(&mut random);
    let mut coarser = 0;
    for _ in 0..40 {
        for _ in 0..30 {
            random_step(&mut view, &mut random);
            engine.advance(&[view]).unwrap();
        }
        for _ in 0..200 {
            engine.advance(&[view]).unwrap();
            engine.tree_mut().settle().unwrap();
        }
        oracle.cut(engine.settings().criterion, &[view]);
        let wanted = oracle.active_nodes();
        let active = engine.front().active_nodes();
        assert!(active <= wanted, "{active} of {wanted}: what is not wanted has been folded");
        coarser += usize::from(active < wanted);
        // Far away, a few nodes are enough.
        let far = View { eye: view.eye * 1000.0, ..view };
        settle(&mut engine, &[far]);
        assert_eq!(oracle.compare(&engine), None);
    }
    assert!(coarser > 10, "{coarser}");
}

/// The displayed mesh, as sorted triangles by place.
fn places(mesh: &StrictMesh) -> Vec<[[u32; 3]; 3]> {
    let place = |v: &u32| mesh.vertices[v].0.map(f32::to_bits);
    let mut triangles: Vec<_> = mesh
        .triangles
        .values()
        .map(|corners| {
            let mut places = [0, 1, 2].map(|i| place(&corners[i]));
            // The corner that is least first: the sense of rotation stays.
            let least = (0..3).min_by_key(|&i| places[i]).unwrap();
            places.rotate_left(least);
            places
        })
        .collect();
    triangles.sort_unstable();
    triangles
}

#[test]
fn the_displayed_mesh_is_that_of_the_in_memory_tree() {
    let log = grid(50);
    let file = meta_node_file(&log, &PAGES);
    let hierarchy = Arc::new(Hierarchy::new(&log).unwrap());
    for (dependencies, holders) in
        [(Dependencies::Off, 4), (Dependencies::Off, 12), (Dependencies::Force, 1_000_000)]
    {
        let page_memory = holders * holder_bytes(&file);
        let paging = meta_node::Settings { page_memory, dependencies, ..meta_node::Settings::default() };
        let tree = MetaNodeTree::new(file.clone(), paging).unwrap();
        let mut engine = Engine::new(tree, StrictMesh::default(), settings(Strategy::Event)).unwrap();
        let reference = InMemoryTree::new(hierarchy.clone());
        let mut reference = Engine::new(reference, StrictMesh::default(), settings(Strategy::Event)).unwrap();
        let mut random = Random(6);
        let mut view = random_view(&mut random);
        let mut equal = 0;
        for _ in 0..60 {
            for _ in 0..5 {
                random_step(&mut view, &mut random);
                engine.advance(&[view]).unwrap();
                reference.advance(&[view]).unwrap();
            }
            settle(&mut engine, &[view]);
            if engine.front().cut_hash() == reference.front().cut_hash() {
                assert_eq!(places(engine.mesh()), places(reference.mesh()));
                equal += 1;
            }
            assert_eq!(engine.mesh().triangles.len() as u64, engine.tree().displayed_triangles());
        }
        assert!(equal == 60 || dependencies == Dependencies::Force, "{equal}");
    }
}

/// A store that fails in all ways, under an engine.
#[test]
fn frames_go_on_while_the_store_fails() {
    let log = grid(60);
    let faulty =
        Arc::new(Faulty::new(MemorySource::new("grid", meta_node_bytes(&log, &PAGES)), 5, Faults::default()));
    let file = Arc::new(MetaNodeFile::open(faulty.clone()).unwrap());
    let page_memory = 30 * holder_bytes(&file);
    let paging = meta_node::Settings { page_memory, ..meta_node::Settings::default() };
    let tree = MetaNodeTree::new(file, paging).unwrap();
    let mut engine = Engine::new(tree, NullSink, settings(Strategy::Event)).unwrap();
    let mut oracle = Oracle::new(&log).unwrap();
    let mut random = Random(8);
    let mut view = random_view(&mut random);
    let mut faults = 0;
    for round in 0..6 {
        faulty.set(Faults {
            errors: 100,
            short: 100,
            flips: 100,
            delays: 1,
            delay: Duration::from_millis(50),
        });
        for _ in 0..100 {
            random_step(&mut view, &mut random);
            faults += engine.advance(&[view]).unwrap().pages.faults;
        }
        engine.tree_mut().settle().unwrap();
        faulty.set(Faults::default());
        for _ in 0..500 {
            let report = engine.advance(&[view]).unwrap();
            faults += report.pages.faults;
            engine.tree_mut().settle().unwrap();
            if report.misses == 0 {
                break;
            }
        }
        assert_eq!(oracle.compare(&engine), None, "round {round}");
    }
    assert!(faults > 20 && faults == faulty.befallen(), "{faults} counted of {}", faulty.befallen());
}

/// What implicit dependencies amount to, by brute force: a node needs the parents of all vertices around its own at the
/// time of its collapse (see `dependencies.rs`).
struct Needs(Vec<Vec<u32>>);

impl Needs {
    fn new(log: &CollapseLog) -> Self {
        let forest = log.forest().unwrap();
        let mut triangles = log.mesh.triangles.clone();
        let mut around: Vec<Vec<usize>> = vec![Vec::new(); log.mesh.positions.len()];
        for (t, corners) in triangles.iter().enumerate() {
            corners.iter().for_each(|&v| around[v as usize].push(t));
        }
        // The node at which each vertex of the input stands now.
        let mut top = vec![NONE; log.mesh.positions.len()];
        let mut parent_of_leaf = vec![NONE; log.mesh.positions.len()];
        for (n, collapse) in log.collapses.iter().enumerate() {
            for v in [collapse.kept, collapse.removed] {
                if top[v as usize] == NONE {
                    parent_of_leaf[v as usize] = n as u32;
                }
                top[v as usize] = n as u32;
            }
        }
        top.fill(NONE);
        let mut needs = Vec::new();
        for (n, collapse) in (0..).zip(&log.collapses) {
            let (kept, removed) = (collapse.kept, collapse.removed);
            for t in std::mem::take(&mut around[removed as usize]) {
                triangles[t].iter_mut().filter(|v| **v == removed).for_each(|v| *v = kept);
                around[kept as usize].push(t);
            }
            let is_shown = |t: &usize| {
                let [a, b, c] = triangles[*t];
                a != b && b != c && c != a
            };
            around[kept as usize].sort_unstable();
            around[kept as usize].dedup();
            around[kept as usize].retain(is_shown);
            let neighbours = around[kept as usize].iter().flat_map(|&t| triangles[t]).filter(|&v| v != kept);
            let mut needed: Vec<u32> = neighbours
                .map(|v| match top[v as usize] {
                    NONE => parent_of_leaf[v as usize],
                    node => forest.parent[node as usize],
                })
                .filter(|&parent| parent != NONE && parent != n)
                .collect();
            needed.extend(Some(forest.parent[n as usize]).filter(|&parent| parent != NONE));
            needed.sort_unstable();
            needed.dedup();
            needs.push(needed);
            (top[kept as usize], top[removed as usize]) = (n, n);
        }
        Self(needs)
    }

    /// Prerequisites have larger numbers: one pass carries a flag all the way.
    fn close(&self, active: &[bool]) -> Vec<bool> {
        let mut closed = active.to_vec();
        for n in 0..closed.len() {
            if closed[n] {
                self.0[n].iter().for_each(|&needed| closed[needed as usize] = true);
            }
        }
        closed
    }
}

/// Displayed triangles that look the other way than in the input.
fn flipped(log: &CollapseLog, active: &[bool]) -> usize {
    let displayed = Displayed::new(log, active);
    let normal = |corners: [u32; 3]| {
        let [a, b, c] = corners.map(|v| glam::DVec3::from(log.mesh.positions[v as usize].map(f64::from)));
        (b - a).cross(c - a)
    };
    displayed
        .triangles
        .iter()
        .map(|&t| log.mesh.triangles[t as usize])
        .filter(|corners| normal(*corners).dot(normal(corners.map(|v| displayed.shown_at[v as usize]))) < 0.0)
        .count()
}

/// With `force` every strategy arrives at the closure in every frame; with `block` all strategies do the same, and what
/// that is depends on the way; with `off` it is what is wanted. Flipped triangles are counted with each.
#[test]
fn dependencies_force_block_and_off() {
    let logs =
        [Some(grid(50)), data::mesh("meshes/bunny.ply").map(data::log).map(|l| data::reduced(&l, 6000))];
    for log in logs.into_iter().flatten() {
        let file = meta_node_file(&log, &PAGES);
        let needs = Needs::new(&log);
        let center: [f32; 3] = {
            let (lo, hi) = log.mesh.bounding_box().unwrap();
            [0, 1, 2].map(|i| (lo[i] + hi[i]) / 2.0)
        };
        let (center, scale) = (glam::DVec3::from(center.map(f64::from)), log.mesh.extent() / 2.0);
        let mut counts = Vec::new();
        for dependencies in [Dependencies::Off, Dependencies::Block, Dependencies::Force] {
            let mut engines: Vec<_> = EXACT
                .map(|strategy| {
                    let paging = meta_node::Settings { dependencies, ..meta_node::Settings::default() };
                    let mut tree = MetaNodeTree::new(file.clone(), paging).unwrap();
                    tree.load_all();
                    tree.settle().unwrap();
                    let settings = Settings { rho: 0.02 * scale, ..settings(strategy) };
                    Engine::new(tree, NullSink, settings).unwrap()
                })
                .into();
            let mut oracle = Oracle::new(&log).unwrap();
            let mut random = Random(12);
            let mut view = random_view(&mut random);
            let (mut flips, mut forced, mut blocked, mut differ) = (0, 0, 0, 0);
            for frame in 0..400 {
                random_step(&mut view, &mut random);
                let placed = View { eye: center + scale * view.eye, ..view };
                let reports: Vec<_> = engines.iter_mut().map(|e| e.advance(&[placed]).unwrap()).collect();
                oracle.cut(engines[0].settings().criterion, &[placed]);
                let expected = match dependencies {
                    Dependencies::Force => needs.close(oracle.active()),
                    _ => oracle.active().to_vec(),
                };
                let mut active = vec![false; log.collapses.len()];
                let tree = engines[0].tree();
                engines[0].for_each_active(|node| active[tree.log_number(node) as usize] = true);
                for (strategy, report) in EXACT.iter().zip(&reports) {
                    let name = strategy.name();
                    assert_eq!(
                        report.cut_hash, reports[0].cut_hash,
                        "{dependencies:?}, {name}, frame {frame}"
                    );
                    assert_eq!(report.misses, 0, "{dependencies:?}, {name}, frame {frame}");
                }
                if dependencies == Dependencies::Block {
                    differ += usize::from(active != expected);
                } else {
                    let wrong = active.iter().zip(&expected).filter(|(a, b)| a != b).count();
                    assert_eq!(wrong, 0, "{dependencies:?}, frame {frame}: {} expected", expected.len());
                }
                forced += reports[0].forced;
                blocked += reports[0].blocked;
                if frame % 10 == 0 {
                    flips += flipped(&log, &active);
                }
            }
            eprintln!(
                "{dependencies:?}: {flips} flipped, {forced} forced, {blocked} blocked, {differ} frames differ"
            );
            counts.push((flips, forced, blocked, differ));
        }
        let [off, block, force] = counts[..] else { panic!() };
        assert_eq!((off.1, off.2, block.1, force.2), (0, 0, 0, 0));
        assert!(block.2 > 100 && block.3 > 10, "blocking blocks, and the cut lags: {block:?}");
        assert!(force.1 > 100, "forcing forces: {force:?}");
        assert!(
            force.0 <= block.0.max(off.0),
            "flipped triangles: off {off:?}, block {block:?}, force {force:?}"
        );
    }
}
