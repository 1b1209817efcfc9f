//! Meta-node trees under an engine: little memory, faults, dependencies, and the displayed mesh.

mod dependencies;
mod lying;
mod rest;

use std::sync::Arc;
use std::time::Duration;

use crate::common::backends::{meta_node_bytes, meta_node_file};
use crate::common::{bumpy_grid, random_log, random_step, random_view, seeded};
use crate::needs::{EXACT, PAGES};
use foldfront::collapse_log::CollapseLog;
use foldfront::construction::simplify;
use foldfront::page_store::source::{Faults, Faulty, MemorySource};
use foldfront::selection::engine::{Engine, FrameReport, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::cut::Displayed;
use foldfront::testing::oracle::Oracle;
use foldfront::testing::strict_mesh::StrictMesh;
use foldfront::vertex_tree::{Hierarchy, MeshSink, NullSink};
use in_memory::{InMemoryHierarchy, InMemoryTree};
use meta_node::{Dependencies, InUse, MetaNodeFile, MetaNodeTree};
use rand::RngExt;

/// A simplified mesh with good triangles.
fn grid(side: usize) -> CollapseLog {
    let mesh = bumpy_grid(side, &mut seeded(3));
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
    panic!("the camera has stopped, and the cut is not reached: {:?}", engine.take_fault());
}

/// A long walk with memory for almost nothing, frames that do not wait, and every now and then a rest: then the cut is the
/// oracle's, whatever the strategy, and memory has never been more than allowed.
#[test]
fn a_camera_that_stops_always_gets_its_cut() {
    let mut random = seeded(1);
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
            let mut random = seeded(9);
            let mut view = random_view(&mut random);
            let mut misses = 0;
            for round in 0..40 {
                for _ in 0..random.random_range(0..40) {
                    random_step(&mut view, &mut random);
                    let report = engine.advance(&[view]).unwrap();
                    engine.assert_well_formed();
                    assert!(report.pages.resident_bytes <= page_memory, "{:?}", report.pages);
                    misses += report.misses;
                }
                settle(&mut engine, &[view]);
                engine.assert_well_formed();
                assert_eq!(oracle.compare(&engine), None, "{}, round {round}", strategy.name());
                let displayed = Displayed::new(&log, oracle.active()).triangles.len() as u64;
                assert_eq!(engine.tree().displayed(), displayed);
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
    let mut random = seeded(4);
    let mut view = random_view(&mut random);
    for round in 0..60 {
        let holders = if round % 5 == 0 { 100_000 } else { random.random_range(4..64) };
        // Nothing is being read, and what is allowed holds from the first frame on.
        engine.tree_mut().settle().unwrap();
        engine.advance(&[view]).unwrap();
        engine.assert_well_formed();
        engine.tree_mut().settle().unwrap();
        engine.tree_mut().set_page_memory(holders * each).unwrap();
        for _ in 0..20 {
            random_step(&mut view, &mut random);
            let report = engine.advance(&[view]).unwrap();
            engine.assert_well_formed();
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
    let mut random = seeded(4);
    let mut view = random_view(&mut random);
    let mut coarser = 0;
    for _ in 0..40 {
        for _ in 0..30 {
            random_step(&mut view, &mut random);
            engine.advance(&[view]).unwrap();
            engine.assert_well_formed();
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
        let far = view.with_eye(view.eye() * 1000.0).unwrap();
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
    let hierarchy = Arc::new(InMemoryHierarchy::new(&log).unwrap());
    for (dependencies, holders) in
        [(Dependencies::Off, 4), (Dependencies::Off, 12), (Dependencies::Force, 1_000_000)]
    {
        let page_memory = holders * holder_bytes(&file);
        let paging = meta_node::Settings { page_memory, dependencies, ..meta_node::Settings::default() };
        let tree = MetaNodeTree::new(file.clone(), paging).unwrap();
        let mut engine = Engine::new(tree, StrictMesh::default(), settings(Strategy::Event)).unwrap();
        let reference = InMemoryTree::new(hierarchy.clone());
        let mut reference = Engine::new(reference, StrictMesh::default(), settings(Strategy::Event)).unwrap();
        let mut random = seeded(6);
        let mut view = random_view(&mut random);
        let mut equal = 0;
        for _ in 0..60 {
            for _ in 0..5 {
                random_step(&mut view, &mut random);
                engine.advance(&[view]).unwrap();
                engine.assert_well_formed();
                reference.advance(&[view]).unwrap();
            }
            settle(&mut engine, &[view]);
            if engine.front().cut_hash() == reference.front().cut_hash() {
                assert_eq!(places(engine.sink()), places(reference.sink()));
                equal += 1;
            }
            assert_eq!(engine.sink().triangles.len() as u64, engine.tree().displayed());
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
    let mut random = seeded(8);
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
