//! How pages are loaded as the papers print it: DeCoro & Pajarola's and Holst & Schumann's frames that wait, and El-Sana &
//! Chiang's rules to the letter. What is asynchronous is in `foresight.rs`, `slow_store.rs` and the backends' own tests.

use std::time::Duration;

use crate::common::backends::meta_node_file;
use crate::common::detail_block as detail;
use crate::common::{bumpy_grid, graph_cut, seeded};
use detail_block::Arrangement;
use foldfront::CollapseLog;
use foldfront::construction::simplify;
use foldfront::experiment::compare::{CompareError, Loading, Options, Pace, Paging, Row, Run, Subject};
use foldfront::experiment::path::{Path, around};
use foldfront::experiment::store::{Backend, Store};
use foldfront::page_store::Simulated;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::settled::Settled;
use foldfront::selection::view::theta_of_pixels;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{Hierarchy, NullSink, Prefetch};
use meta_node::{InUse, Io, MetaNodeFile, MetaNodeTree};

use crate::workplace::Workplace;

const FRAME: Duration = Duration::from_micros(16_667);
const LATENCY: Duration = Duration::from_millis(20);
const FRAMES: usize = 150;

fn log() -> CollapseLog {
    let mesh = bumpy_grid(90, &mut seeded(17));
    simplify::build(mesh, &simplify::Options::default(), &mut |_, _| ()).unwrap().0
}

/// The three backends that page, with small pages.
fn stores(log: &CollapseLog) -> [Store; 3] {
    let options = meta_node::BuildOptions { levels: Some(3), page_bytes: 700 };
    let arrangement = Arrangement::new(log, &detail::options(false, true)).unwrap();
    let graph = mt_partition::BuildOptions { patch: 4.0, partition: 6, ..Default::default() };
    [
        Store::MetaNode(meta_node_file(log, &options)),
        Store::DetailBlock(detail::file(&arrangement)),
        Store::MtPartition(graph_cut::file(log, &graph)),
    ]
}

fn options(prefetch: &[Loading], pace: Pace) -> Options {
    Options {
        strategies: Strategy::COMPARED.into_iter().filter(|strategy| strategy.is_exact()).collect(),
        theta: theta_of_pixels(4.0, 1080),
        check: true,
        prefetch: prefetch.to_vec(),
        pace,
        ..Options::default()
    }
}

fn virtual_time(latency: Duration) -> Pace {
    Pace::Simulated(FRAME, Simulated::with_latency(latency))
}

fn replay(store: &Store, path: &Path, options: &Options) -> Vec<Run> {
    let mut subject = Subject::of_store("grid", store.clone());
    subject.replay(path, 0..FRAMES, options, &mut |_, _| ()).unwrap()
}

fn fact(file: &MetaNodeFile, name: &str) -> u64 {
    file.facts().iter().find(|(fact, _)| *fact == name).unwrap().1.parse().unwrap()
}

/// Bytes of a place holder as printed.
fn holder_bytes(file: &MetaNodeFile) -> u64 {
    fact(file, "largest page, bytes")
}

fn total<T: std::iter::Sum>(run: &Run, of: impl Fn(&Row) -> T) -> T {
    run.rows.iter().map(of).sum()
}

fn cuts(run: &Run) -> Vec<u64> {
    run.rows.iter().map(|row| row.report.cut_hash).collect()
}

/// Enough for what the path shows at once, not for the file: pages come and go.
fn tight(store: &Store, path: &Path) -> Paging {
    let subject = Subject::of_store("grid", store.clone());
    let frames: Vec<usize> = (0..FRAMES).step_by(10).collect();
    let needs = subject.needs(path, &frames, &options(&[Loading::None], Pace::Settled)).unwrap();
    Paging { page_memory: needs * 5 / 4, ..Paging::default() }
}

/// Cuts are those of brute force in every frame, nothing is missed, and what that costs is time.
#[test]
fn frames_that_wait_miss_nothing() {
    let log = log();
    let path = around(&log.mesh).unwrap();
    for store in stores(&log) {
        let backend = store.backend().name();
        let settled = replay(&store, &path, &options(&[Loading::None], Pace::Settled));
        for paging in [Paging::default(), tight(&store, &path)] {
            let options = Options { paging, ..options(&[Loading::Blocking], virtual_time(LATENCY)) };
            let runs = replay(&store, &path, &options);
            let again = replay(&store, &path, &options);
            for ((run, again), settled) in runs.iter().zip(&again).zip(&settled) {
                let what = format!("{backend}, {}, {paging:?}", run.strategy.name());
                assert_eq!(run.prefetch, Loading::Blocking);
                assert_eq!(total(run, |row| row.report.misses), 0, "{what}");
                assert_eq!(total(run, |row| row.wrong.unwrap()), 0, "{what}");
                assert_eq!(cuts(run), cuts(settled), "{what}");
                for (row, again) in run.rows.iter().zip(&again.rows) {
                    let (pages, frame) = (row.report.pages, row.frame);
                    assert_eq!(pages, again.report.pages, "{what}, frame {frame}: a replay differs");
                    // A read after the other: each takes the latency, those asked for together take it once.
                    assert_eq!(pages.stalled.as_nanos() % LATENCY.as_nanos(), 0, "{what}: {pages:?}");
                    assert_eq!(pages.stalled > Duration::ZERO, pages.reads > 0, "{what}: {pages:?}");
                    assert!(pages.stalled <= LATENCY * pages.reads as u32, "{what}: {pages:?}");
                    assert_eq!((pages.ahead, pages.faults), (0, 0), "{what}: {pages:?}");
                }
                let later = run.rows[1..].iter().filter(|row| !row.report.pages.stalled.is_zero()).count();
                assert!(later > 10, "{what}: {later} frames have waited");
            }
        }
    }
}

/// In real time nothing else waits, and on a store that takes no time there is nothing to wait for.
#[test]
fn only_blocking_waits_in_real_time() {
    let log = log();
    let path = around(&log.mesh).unwrap();
    for store in stores(&log) {
        let backend = store.backend().name();
        let others = [Loading::Paper, Loading::Schedule, Loading::None];
        for run in replay(&store, &path, &options(&others, virtual_time(LATENCY))) {
            assert!(
                run.rows.iter().all(|row| row.report.pages.stalled.is_zero()),
                "{backend}: {:?}",
                run.prefetch
            );
        }
        for run in replay(&store, &path, &options(&[Loading::Blocking], virtual_time(Duration::ZERO))) {
            assert!(total(&run, |row| row.report.pages.reads) > 0);
            assert!(total(&run, |row| row.report.pages.stalled).is_zero(), "{backend}");
        }
        // Settled, all wait, and it is real time, of which the whole step has at least as much.
        for run in replay(&store, &path, &options(&[Loading::Blocking, Loading::None], Pace::Settled)) {
            assert!(!total(&run, |row| row.report.pages.stalled).is_zero(), "{backend}: {:?}", run.prefetch);
            assert!(run.rows.iter().all(|row| row.report.pages.stalled <= row.report.select), "{backend}");
        }
    }
}

/// The clock runs while a frame waits, and the path does not: all frames are replayed, late.
#[test]
fn by_the_wall_clock_the_path_waits_too() {
    let log = log();
    let path = around(&log.mesh).unwrap();
    let pace = Pace::WallClock(Duration::from_micros(10));
    let options = Options { strategies: vec![Strategy::Event], ..options(&[Loading::Blocking], pace) };
    for store in stores(&log) {
        for run in replay(&store, &path, &options) {
            assert_eq!(run.rows.len(), FRAMES);
            assert_eq!(total(&run, |row| row.report.misses + row.wrong.unwrap()), 0);
            assert!(!total(&run, |row| row.report.pages.stalled).is_zero());
        }
    }
}

/// What `compare` does, done by whoever embeds the engine.
#[test]
fn an_engine_over_a_settled_tree_waits() {
    let log = log();
    let path = around(&log.mesh).unwrap();
    let [store, ..] = stores(&log);
    let Store::MetaNode(file) = store else { panic!("a file of meta-nodes") };
    let io = Io::Simulated(Simulated::with_latency(LATENCY));
    let paging = meta_node::Settings { prefetch: Prefetch::None, io, ..Default::default() };
    let tree = MetaNodeTree::new(file, paging).unwrap();
    let mut engine = Engine::new(Settled::new(tree), NullSink, Settings::default()).unwrap();
    let mut oracle = Oracle::new(&log).unwrap();
    let mut stalled = Duration::ZERO;
    for frame in 0..FRAMES {
        let report = engine.advance(&[path.view(frame, theta_of_pixels(4.0, 1080)).unwrap()]).unwrap();
        assert_eq!(report.misses, 0);
        assert_eq!(oracle.compare(&engine), None, "frame {frame}");
        stalled += report.pages.stalled;
        engine.assert_well_formed();
        engine.tree_mut().pass(FRAME).unwrap();
    }
    assert!(stalled > 20 * LATENCY, "{stalled:?}");
}

/// With room for everything the printed rules lead to every cut. With less they lead to coarser ones, and memory holds as
/// many of the largest pages and no more; what differs from brute force has been refused.
#[test]
fn the_printed_rules_of_meta_nodes() {
    let log = log();
    let path = around(&log.mesh).unwrap();
    let [store, ..] = stores(&log);
    let Store::MetaNode(file) = &store else { panic!("a file of meta-nodes") };
    let settled = replay(&store, &path, &options(&[Loading::Printed, Loading::None], Pace::Settled));
    let (printed, none) = settled.split_at(3);
    for (printed, none) in printed.iter().zip(none) {
        assert_eq!(total(printed, |row| row.report.misses + row.wrong.unwrap()), 0);
        assert_eq!(cuts(printed), cuts(none));
    }

    let largest = holder_bytes(file);
    let holders = fact(file, "pages") / 12;
    let paging = Paging { page_memory: holders * largest, ..Paging::default() };
    let how = Options { paging, ..options(&[Loading::Printed, Loading::Paper], virtual_time(LATENCY)) };
    let runs = replay(&store, &path, &how);
    assert!(
        runs.iter().zip(replay(&store, &path, &how)).all(|(a, b)| cuts(a) == cuts(&b)),
        "a replay differs"
    );
    let (printed, paper) = runs.split_at(3);
    for (printed, paper) in printed.iter().zip(paper) {
        let what = printed.strategy.name();
        for row in &printed.rows {
            let resident = row.report.pages.resident_bytes;
            assert!(resident <= holders * largest && resident % largest == 0, "{what}: {resident}");
        }
        let misses = |run: &Run| total(run, |row| row.report.misses);
        assert!(misses(printed) > 2 * misses(paper), "{what}: {} and {}", misses(printed), misses(paper));
        let no_room = total(printed, |row| row.report.pages.no_room);
        assert!(no_room > 0, "{what}: three place holders were always free");
        assert!(total(printed, |row| row.wrong.unwrap()) > 0, "{what}: no cut is coarser");
    }
}

/// The camera goes away and the front follows it up, however little memory there is: it is never all in use.
#[test]
fn with_the_printed_rules_a_front_comes_back() {
    let log = log();
    let path = around(&log.mesh).unwrap();
    let [store, ..] = stores(&log);
    let Store::MetaNode(file) = store else { panic!("a file of meta-nodes") };
    for holders in [6, 12, 30] {
        let io = Io::Simulated(Simulated::with_latency(LATENCY));
        let page_memory = holders * holder_bytes(&file);
        let paging = meta_node::Settings { page_memory, in_use: InUse::Printed, io, ..Default::default() };
        let tree = MetaNodeTree::new(file.clone(), paging).unwrap();
        let mut engine = Engine::new(tree, NullSink, Settings::default()).unwrap();
        let mut deepest = 0;
        for frame in 0..FRAMES {
            let report = engine.advance(&[path.view(frame, theta_of_pixels(1.0, 1080)).unwrap()]).unwrap();
            deepest = deepest.max(report.active_nodes);
            assert!(report.pages.resident_bytes <= page_memory);
            engine.assert_well_formed();
            engine.tree_mut().pass(FRAME).unwrap();
        }
        assert!(deepest > 2 * holders, "{holders} place holders: {deepest} nodes");
        let mut frames = 0;
        while engine.front().active_nodes() > 0 {
            engine.advance(&[]).unwrap();
            engine.assert_well_formed();
            engine.tree_mut().pass(FRAME).unwrap();
            frames += 1;
            assert!(frames < 5_000, "{holders} place holders: {} nodes stay", engine.front().active_nodes());
        }
    }
}

#[test]
fn other_backends_have_no_printed_rules() {
    let log = log();
    let path = around(&log.mesh).unwrap();
    let [_, blocks, graph] = stores(&log);
    for store in [blocks, graph, Store::in_memory(log.into()).unwrap()] {
        let backend = store.backend();
        let mut subject = Subject::of_store("grid", store);
        let replayed =
            subject.replay(&path, 0..3, &options(&[Loading::Printed], Pace::Settled), &mut |_, _| ());
        match replayed {
            Err(CompareError::NotPrinted { scene, prefetch, backend: named }) => {
                assert_eq!((scene.as_str(), prefetch, named), ("grid", Loading::Printed, backend));
            }
            other => panic!("{}: {other:?}", backend.name()),
        }
    }
}

/// The same through the command line: one line and exit code 2 before any work, and columns in their places.
#[test]
fn the_command_line_has_them() {
    let place = Workplace::new();
    for backend in ["in-memory", "detail-block", "mt-partition"] {
        let said = ["printed", "meta-node", backend];
        place.fail(&format!("compare grid.ply --backend {backend} --prefetch printed"), 2, &said);
        place.succeed(&format!("build grid.ply --backend {backend} -o grid.{backend}"));
        place.fail(&format!("compare grid.{backend} --prefetch paper,printed"), 2, &said);
        place.write("one.scene", format!("grid.{backend} 1 0 0 0 0 1 0 0 0 0 1 0\n"));
        place.fail("compare one.scene --path descent.path --prefetch printed", 2, &said);
    }
    place.fail("compare grid.ply --prefetch printed", 2, &["printed", "meta-node", "in-memory"]);
    let several = "compare grid.ply --backend meta-node,detail-block --prefetch printed";
    place.fail(several, 2, &["printed", "meta-node", "detail-block"]);

    place.succeed("build grid.ply --backend meta-node --levels 2 -o grid.meta");
    place.succeed(
        "compare grid.meta --path descent.path --pixels 5 --fps 60 --store-latency 20ms --check --strategy event \
         --prefetch printed,blocking,none --out results",
    );
    for (file, stall) in [("results/frames.csv", 23), ("results/summary.csv", 18)] {
        let text = place.text(file);
        let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(rows[0][stall..stall + 2], ["stall_ns", "faults"], "{file}");
        for prefetch in ["printed", "blocking", "none"] {
            let of = rows.iter().filter(|row| row[4] == prefetch);
            let waited: u64 = of.map(|row| row[stall].parse::<u64>().unwrap()).sum();
            assert_eq!(waited > 0, prefetch == "blocking", "{file}, {prefetch}: {waited}");
            assert_eq!(waited % 20_000_000, 0, "{file}: {waited}");
        }
    }
    assert_eq!(Backend::ALL.into_iter().filter(|&backend| Loading::Printed.is_for(backend)).count(), 1);
}
