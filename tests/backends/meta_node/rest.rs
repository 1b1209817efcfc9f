//! What becomes of a camera that stops, on virtual time: the cut is reached when the store can have brought it, and where
//! memory does not hold it, all comes to rest.

use std::sync::Arc;
use std::time::Duration;

use foldfront::page_store::Simulated;
use foldfront::selection::engine::{Engine, FrameReport};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{Hierarchy, NodeId, NullSink, Prefetch};
use meta_node::{InUse, Io, MetaNodeFile, MetaNodeTree};

use super::{PAGES, grid, holder_bytes, settings};
use crate::common::backends::{combinations, meta_node_file};
use crate::common::{random_step, random_view, seeded};
use rand::RngExt;

const FRAME: Duration = Duration::from_millis(16);

fn engine(
    file: &Arc<MetaNodeFile>,
    page_memory: u64,
    in_use: InUse,
    (strategy, prefetch): (Strategy, Prefetch),
    store: Simulated,
) -> Engine<MetaNodeTree, NullSink> {
    let paging = meta_node::Settings {
        page_memory,
        in_use,
        prefetch,
        io: Io::Simulated(store),
        ..meta_node::Settings::default()
    };
    Engine::new(MetaNodeTree::new(file.clone(), paging).unwrap(), NullSink, settings(strategy)).unwrap()
}

fn advance(engine: &mut Engine<MetaNodeTree, NullSink>, view: View) -> FrameReport {
    let report = engine.advance(&[view]).unwrap();
    engine.tree_mut().pass(FRAME).unwrap();
    report
}

/// How many levels of pages there are.
fn page_depth(file: &Arc<MetaNodeFile>) -> u32 {
    let mut tree = MetaNodeTree::new(file.clone(), meta_node::Settings::default()).unwrap();
    tree.load_all();
    tree.settle().unwrap();
    tree.begin_frame(&mut Vec::new()).unwrap();
    let pages: u32 = file.facts().iter().find(|(fact, _)| *fact == "pages").unwrap().1.parse().unwrap();
    let slots = tree.node_limit() / pages;
    let mut stack: Vec<_> = tree.roots().iter().map(|&root| (root, 1)).collect();
    let mut depth = 0;
    while let Some((node, level)) = stack.pop() {
        depth = depth.max(level);
        let below = |child: NodeId| (child, level + u32::from(child.0 / slots != node.0 / slots));
        stack.extend(tree.children(node).map(below));
    }
    depth
}

/// With memory enough, from the moment at which the camera stops: latency for each level of pages, once, and the bytes that
/// are missing. Twice that is allowed, since requests are made at the end of frames only.
#[test]
fn a_camera_that_stops_gets_its_cut_in_time() {
    let log = grid(80);
    let file = meta_node_file(&log, &PAGES);
    let store = Simulated { latency: Duration::from_millis(40), bandwidth: Some(2_000_000), depth: 100_000 };
    let depth = page_depth(&file);
    assert!(depth > 3, "{depth}");
    let mut oracle = Oracle::new(&log).unwrap();
    for (strategy, prefetch) in combinations() {
        let mut engine = engine(&file, u64::MAX, InUse::Yields, (strategy, prefetch), store);
        let mut random = seeded(31);
        let mut waits = 0;
        for _ in 0..20 {
            let mut view = random_view(&mut random);
            for _ in 0..random.random_range(0..12) {
                random_step(&mut view, &mut random);
                advance(&mut engine, view);
            }
            let (mut frames, mut bytes) = (0, 0);
            loop {
                let report = advance(&mut engine, view);
                bytes += report.pages.read_bytes;
                if report.misses == 0 {
                    break;
                }
                frames += 1;
                assert!(frames < 10_000);
            }
            assert_eq!(oracle.compare(&engine), None);
            waits += frames;
            let transfer = Duration::from_secs_f64(bytes as f64 / 2e6);
            let limit = 2 * (store.latency * depth + transfer);
            assert!(
                FRAME * frames <= limit,
                "{strategy:?}, {prefetch:?}: {frames} frames, {limit:?} allowed"
            );
        }
        assert!(waits > 20, "{waits}: nothing was missing");
    }
}

/// With memory for a few pages and the camera at rest nothing is read and nothing changes any more after a while. Where
/// pages in use yield, the cut is the oracle's even so; where they stay, it is a coarser one, and the tree says why.
#[test]
fn a_camera_at_rest_comes_to_rest() {
    let log = grid(60);
    let file = meta_node_file(&log, &PAGES);
    let store = Simulated { latency: Duration::from_millis(5), bandwidth: Some(10_000_000), depth: 32 };
    let mut oracle = Oracle::new(&log).unwrap();
    for prefetch in Prefetch::ALL {
        for (in_use, holders) in
            [(InUse::Yields, 4), (InUse::Yields, 30), (InUse::Stays, 8), (InUse::Stays, 30)]
        {
            let name = format!("{}, {in_use:?}, {holders} place holders", prefetch.name());
            let how = (Strategy::Event, prefetch);
            let mut engine = engine(&file, holders * holder_bytes(&file), in_use, how, store);
            let mut random = seeded(41);
            let (mut no_room, mut coarser) = (0, 0);
            for _ in 0..8 {
                let mut view = random_view(&mut random);
                for _ in 0..30 {
                    random_step(&mut view, &mut random);
                    no_room += advance(&mut engine, view).pages.no_room;
                }
                let mut quiet = 0;
                for frame in 0.. {
                    let report = advance(&mut engine, view);
                    let moves = report.unfolds + report.folds + report.pages.reads > 0;
                    quiet = if moves { 0 } else { quiet + 1 };
                    if quiet == 60 {
                        // What is refused now is refused for want of room.
                        assert!(report.misses == 0 || report.pages.no_room > 0, "{name}: {report:?}");
                        break;
                    }
                    assert!(frame < 20_000, "{name}: no rest, {report:?}");
                }
                match in_use {
                    InUse::Yields => assert_eq!(oracle.compare(&engine), None, "{name}"),
                    InUse::Stays | InUse::Printed => coarser += u32::from(oracle.compare(&engine).is_some()),
                }
            }
            assert!(no_room > 0 || holders == 30, "{name}: {no_room}");
            assert!(coarser > 0 || in_use == InUse::Yields, "{name}");
        }
    }
}

/// The same replay has the same misses and reads.
#[test]
fn virtual_time_repeats_itself() {
    let file = meta_node_file(&grid(50), &PAGES);
    let store = Simulated { latency: Duration::from_millis(30), bandwidth: Some(500_000), depth: 4 };
    for prefetch in Prefetch::ALL {
        let replay = || {
            let how = (Strategy::Event, prefetch);
            let mut engine = engine(&file, 60 * holder_bytes(&file), InUse::Yields, how, store);
            let mut random = seeded(51);
            let mut view = random_view(&mut random);
            let frames: Vec<_> = (0..300)
                .map(|_| {
                    random_step(&mut view, &mut random);
                    let report = advance(&mut engine, view);
                    (report.misses, report.cut_hash, report.pages)
                })
                .collect();
            frames
        };
        let frames = replay();
        assert!(frames.iter().map(|frame| frame.0).sum::<u64>() > 100);
        assert_eq!(frames, replay(), "{}", prefetch.name());
    }
}
