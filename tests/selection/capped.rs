//! Caps on a frame's work: what is left over is carried, nothing is lost, and every frame makes progress. All in frames and
//! changes, never in seconds.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;
use std::time::Duration;

use crate::common::{bumpy_grid, direction, graph_cut, random_log, random_step, random_view, seeded};
use foldfront::CollapseLog;
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::budget::WorkCap;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::{Engine, FrameReport, Limit, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::settled::Settled;
use foldfront::selection::view::View;
use foldfront::testing::oracle::Oracle;
use foldfront::testing::walk::turned;
use foldfront::vertex_tree::{Bounds, Hierarchy, NodeId, NullSink, Refine};
use glam::DVec3;
use in_memory::{InMemoryHierarchy, InMemoryTree};
use mt_partition::MtTree;
use rand_pcg::Pcg64;

const EXACT: [Strategy; 3] = [Strategy::TopDown, Strategy::Front, Strategy::Event];

fn log(side: usize, random: &mut Pcg64) -> CollapseLog {
    random_log(bumpy_grid(side, random), random)
}

fn settings(strategy: Strategy, work_cap: WorkCap) -> Settings {
    Settings { strategy, work_cap, rho: 0.01, omega: 0.01, ..Settings::default() }
}

fn engine(log: &CollapseLog, strategy: Strategy, work_cap: WorkCap) -> Engine<InMemoryTree, ActiveMesh> {
    let tree = InMemoryTree::new(Arc::new(InMemoryHierarchy::new(log).unwrap()));
    Engine::new(tree, ActiveMesh::new(), settings(strategy, work_cap)).unwrap()
}

fn moved(view: &mut View, by: DVec3) {
    *view = view.with_eye(view.eye() + by).unwrap();
}

fn active<T: Refine<S>, S>(engine: &Engine<T, S>) -> BTreeSet<NodeId> {
    let mut active = BTreeSet::new();
    engine.for_each_active(|node| {
        active.insert(node);
    });
    active
}

fn changes(report: &FrameReport) -> u64 {
    report.unfolds + report.folds
}

/// A cap spreads the work of a teleport over frames: most urgent first, no more than allowed, nothing lost.
#[test]
fn capped_work_is_carried_and_ends_at_the_cut() {
    let mut random = seeded(17);
    let log = log(40, &mut random);
    let mut oracle = Oracle::new(&log).unwrap();
    const CAP: u64 = 40;
    let mut engines = EXACT.map(|strategy| engine(&log, strategy, WorkCap::Changes(CAP)));
    let (mut carried, mut most) = (0, 0);
    for _ in 0..12 {
        // A teleport, a walk at a pace that the cap can not follow, and a rest.
        let mut view = random_view(&mut random);
        for frame in 0..400 {
            if frame < 30 {
                moved(&mut view, direction(&mut random) * 0.02);
                view = turned(view, 0.02, &mut random);
            }
            let reports = engines.each_mut().map(|engine| engine.advance(&[view]).unwrap());
            if frame < 50 {
                engines.iter().for_each(Engine::assert_well_formed);
            }
            let report = reports[0];
            for other in &reports {
                assert_eq!((other.cut_hash, other.carried), (report.cut_hash, report.carried));
            }
            assert!(changes(&report) <= CAP, "{report:?}");
            assert_eq!(report.limit == Limit::Work, report.carried > 0);
            let is_exact = oracle.compare(&engines[0]).is_none();
            assert!(is_exact || report.carried > 0, "frame {frame}");
            if report.carried > 0 {
                assert_eq!(changes(&report), CAP, "work is left, and so is room for it: {report:?}");
                // In the end all that waits has been looked at in these views.
                assert!(!is_exact || frame < 38, "frame {frame}: {report:?}");
            }
            (carried, most) = (carried + report.carried, most.max(report.carried));
        }
        assert!(engines.iter().all(|engine| oracle.compare(engine).is_none()), "something was lost");
        // At rest, and with nothing left, nothing is tested.
        let reports = engines.each_mut().map(|engine| engine.advance(&[view]).unwrap());
        assert_eq!(reports[2].tests, 0);
    }
    assert!(carried > 5000 && most > 5 * CAP, "{carried} carried, at most {most}");
}

#[test]
fn the_most_urgent_changes_are_made_first() {
    let mut random = seeded(23);
    let log = log(40, &mut random);
    let view = random_view(&mut random);
    let mut engine = engine(&log, Strategy::Event, WorkCap::Changes(50));
    let urgency = |engine: &Engine<InMemoryTree, ActiveMesh>, node| {
        let bounds = log.collapses[engine.tree().log_number(node) as usize].bounds;
        Criterion::ScreenError.urgency(&[view], &bounds)
    };
    let mut ends = 0;
    while engine.advance(&[view]).unwrap().carried > 0 {
        // Whatever could have been unfolded instead was less urgent than what was.
        let active = active(&engine);
        let tree = engine.tree();
        let least = active.iter().map(|&node| urgency(&engine, node)).fold(f64::INFINITY, f64::min);
        let waiting = boundary(tree, &active).map(|node| urgency(&engine, node)).fold(0.0, f64::max);
        assert!(least >= 1.0 && waiting <= least * 1.000_001, "{waiting} waits, {least} does not");
        ends += 1;
    }
    assert!(ends > 5, "{ends} frames with something left");
}

fn boundary<'a>(tree: &'a InMemoryTree, active: &'a BTreeSet<NodeId>) -> impl Iterator<Item = NodeId> + 'a {
    let below = active.iter().flat_map(|&node| tree.children(node));
    below.chain(tree.roots().iter().copied()).filter(|node| !active.contains(node))
}

/// A cap of nothing is one of a change a frame, in time as in changes. From one cut to the next it takes as many frames as
/// nodes differ.
#[test]
fn every_frame_makes_a_change() {
    for cap in [WorkCap::Time(Duration::ZERO), WorkCap::Changes(0), WorkCap::Changes(1)] {
        for strategy in Strategy::ALL {
            let mut random = seeded(19);
            let log = log(30, &mut random);
            let mut oracle = Oracle::new(&log).unwrap();
            let mut engine = engine(&log, strategy, cap);
            let (mut folds, mut unfolds) = (0, 0);
            for round in 0..6 {
                let what = format!("{cap:?}, {}, round {round}", strategy.name());
                let mut view = random_view(&mut random);
                // On the way there is always something to do, and it is done.
                for frame in 0..30 {
                    moved(&mut view, direction(&mut random) * 0.01);
                    let report = engine.advance(&[view]).unwrap();
                    engine.assert_well_formed();
                    assert!(
                        changes(&report) == 1 || report.carried == 0,
                        "{what}, frame {frame}: {report:?}"
                    );
                }
                if !strategy.is_exact() {
                    continue;
                }
                oracle.cut(Criterion::ScreenError, &[view]);
                let mut differ = vec![false; log.collapses.len()];
                engine.for_each_active(|node| differ[engine.tree().log_number(node) as usize] = true);
                let differ = differ.iter().zip(oracle.active()).filter(|(a, b)| a != b).count();
                for left in (0..differ).rev() {
                    let report = engine.advance(&[view]).unwrap();
                    assert_eq!(changes(&report), 1, "{what}: {left} to go, {report:?}");
                    assert!(report.carried > 0 || left == 0, "{what}: {left} to go");
                    (folds, unfolds) = (folds + report.folds, unfolds + report.unfolds);
                }
                assert_eq!(oracle.compare(&engine), None, "{what}");
                let report = engine.advance(&[view]).unwrap();
                assert_eq!((report.carried, changes(&report)), (0, 0), "{what}");
            }
            assert!(!strategy.is_exact() || folds > 100 && unfolds > 100, "{folds} folds, {unfolds} unfolds");
        }
    }
}

/// Where both wait, one change in four is a fold, however small the cap.
#[test]
fn folds_have_their_share() {
    for cap in [WorkCap::Changes(1), WorkCap::Changes(3), WorkCap::Changes(8), WorkCap::Time(Duration::ZERO)]
    {
        let mut random = seeded(20);
        let log = log(40, &mut random);
        let mut engine = engine(&log, Strategy::Event, WorkCap::None);
        let eye = DVec3::new(0.2, 0.1, 0.6);
        let view = |direction: DVec3| {
            let mut view = random_view(&mut seeded(1));
            let by = eye - view.eye();
            moved(&mut view, by);
            view = view.with_direction(direction.normalize()).unwrap();
            view
        };
        engine.advance(&[view(DVec3::new(1.0, 0.0, -0.5))]).unwrap();
        engine.set_work_cap(cap);
        let (mut folds, mut all) = (0, 0);
        for _ in 0..24 {
            let report = engine.advance(&[view(DVec3::new(-1.0, 0.0, -0.5))]).unwrap();
            (folds, all) = (folds + report.folds, all + changes(&report));
        }
        assert!(engine.advance(&[view(DVec3::new(-1.0, 0.0, -0.5))]).unwrap().carried > 0);
        assert_eq!(4 * folds, all, "{cap:?}");
    }
}

/// Time enough is as no cap at all; little time, and the cut is reached all the same.
#[test]
fn a_cap_in_time_ends_at_the_cut() {
    for strategy in EXACT {
        let mut random = seeded(21);
        let log = log(30, &mut random);
        let mut oracle = Oracle::new(&log).unwrap();
        let mut ample = engine(&log, strategy, WorkCap::Time(Duration::from_secs(3600)));
        let mut little = engine(&log, strategy, WorkCap::Time(Duration::from_nanos(1)));
        for round in 0..10 {
            let view = random_view(&mut random);
            let report = ample.advance(&[view]).unwrap();
            ample.assert_well_formed();
            assert_eq!((report.carried, oracle.compare(&ample)), (0, None), "{strategy:?}, round {round}");
            let mut frames = 0;
            loop {
                let report = little.advance(&[view]).unwrap();
                little.assert_well_formed();
                if report.carried == 0 {
                    break;
                }
                assert!(changes(&report) > 0, "{report:?}");
                frames += 1;
                assert!(frames <= log.collapses.len(), "{frames} frames");
            }
            assert_eq!(oracle.compare(&little), None, "{strategy:?}, round {round}");
        }
    }
}

/// What is carried was wanted when it was found. By the time of its turn it may not be, and is not made then.
#[test]
fn no_change_is_made_that_its_frame_does_not_ask_for() {
    for cap in [WorkCap::Changes(5), WorkCap::Time(Duration::ZERO)] {
        for strategy in EXACT {
            let mut random = seeded(22);
            let log = log(30, &mut random);
            let mut engine = engine(&log, strategy, cap);
            let mut view = random_view(&mut random);
            let mut before = BTreeSet::new();
            let mut made = 0;
            for frame in 0..800 {
                random_step(&mut view, &mut random);
                engine.advance(&[view]).unwrap();
                engine.assert_well_formed();
                let after = active(&engine);
                let wanted = |node: &NodeId| {
                    let bounds = log.collapses[engine.tree().log_number(*node) as usize].bounds;
                    Criterion::ScreenError.unfold(&[view], &bounds)
                };
                assert!(after.difference(&before).all(wanted), "{strategy:?}, frame {frame}: unfolds");
                assert!(!before.difference(&after).any(wanted), "{strategy:?}, frame {frame}: folds");
                made += after.symmetric_difference(&before).count();
                before = after;
            }
            assert!(made > 500, "{made} changes");
        }
    }
}

/// What was found long ago and has become urgent since is not overlooked: of what waits, urgencies are known as they were at
/// most eight frames ago.
#[test]
fn urgencies_are_at_most_eight_frames_old() {
    let mut random = seeded(23);
    let log = log(60, &mut random);
    let mut engine = engine(&log, Strategy::Event, WorkCap::Changes(4));
    let bounds = |engine: &Engine<InMemoryTree, ActiveMesh>, node| -> Bounds {
        log.collapses[engine.tree().log_number(node) as usize].bounds
    };
    // Down on the grid from where the eye is in no sphere but the largest, which are unfolded first.
    let mut view = random_view(&mut random);
    let by = DVec3::new(-1.5, 0.3, 1.2) - view.eye();
    moved(&mut view, by);
    view = view.with_direction(-DVec3::Z).unwrap();
    engine.set_work_cap(WorkCap::None);
    engine.advance(&[view]).unwrap();
    engine.set_work_cap(WorkCap::Changes(4));
    let mut views: VecDeque<View> = VecDeque::new();
    let (mut before, mut compared) = (active(&engine), 0);
    for frame in 0..150 {
        // Across the grid, so that what was far comes near and what was near stays behind.
        moved(&mut view, DVec3::new(0.02, 0.0, 0.0));
        engine.advance(&[view]).unwrap();
        views.push_front(view);
        views.truncate(9);
        let after = active(&engine);
        let urgencies = |node| {
            let bounds = bounds(&engine, node);
            let urgency = move |view: &View| Criterion::ScreenError.urgency(&[*view], &bounds);
            views.iter().map(urgency)
        };
        let made = after.difference(&before);
        let least = made.map(|&node| urgencies(node).fold(0.0, f64::max)).fold(f64::INFINITY, f64::min);
        // Those that had been boundary nodes for so long, and wanted.
        for node in boundary(engine.tree(), &before).filter(|node| !after.contains(node)) {
            let waits = urgencies(node).fold(f64::INFINITY, f64::min);
            if waits >= 1.0 && waits.is_finite() && least.is_finite() && frame > 8 {
                assert!(waits <= least, "frame {frame}: {waits} waits, {least} does not");
                compared += 1;
            }
        }
        before = after;
    }
    assert!(compared > 1000, "{compared}");
}

#[test]
fn without_a_cap_what_was_carried_takes_its_turn() {
    for strategy in EXACT {
        let mut random = seeded(24);
        let log = log(30, &mut random);
        let mut oracle = Oracle::new(&log).unwrap();
        let mut engine = engine(&log, strategy, WorkCap::Changes(3));
        let mut most = 0;
        for _ in 0..20 {
            let mut view = random_view(&mut random);
            engine.set_work_cap(WorkCap::Changes(3));
            for _ in 0..10 {
                moved(&mut view, direction(&mut random) * 0.02);
                most = most.max(engine.advance(&[view]).unwrap().carried);
            }
            // In the same views, and in others.
            for by in [0.0, 0.1] {
                moved(&mut view, direction(&mut random) * by);
                engine.set_work_cap(WorkCap::None);
                assert_eq!(engine.advance(&[view]).unwrap().carried, 0);
                engine.assert_well_formed();
                assert_eq!(oracle.compare(&engine), None, "{strategy:?}");
                engine.set_work_cap(WorkCap::Changes(1));
                engine.advance(&[random_view(&mut random)]).unwrap();
            }
        }
        assert!(most > 100, "{most} carried");
    }
}

/// Nodes with several parents: a change makes others boundary nodes and collapsible, or ends that, in other ways.
#[test]
fn a_graph_under_a_cap() {
    let mut random = seeded(25);
    let options = mt_partition::BuildOptions { patch: 0.0, ..mt_partition::BuildOptions::default() };
    let file = graph_cut::file(&log(20, &mut random), &options);
    let tree = || Settled::new(MtTree::new(file.clone(), mt_partition::Settings::default()).unwrap());
    let mut free = Engine::new(tree(), NullSink, settings(Strategy::TopDown, WorkCap::None)).unwrap();
    for cap in [WorkCap::Changes(2), WorkCap::Time(Duration::ZERO)] {
        for strategy in EXACT {
            let mut engine = Engine::new(tree(), NullSink, settings(strategy, cap)).unwrap();
            let mut most = 0;
            for round in 0..6 {
                let mut view = random_view(&mut random);
                for _ in 0..40 {
                    random_step(&mut view, &mut random);
                    most = most.max(engine.advance(&[view]).unwrap().carried);
                    engine.assert_well_formed();
                }
                let wanted = free.advance(&[view]).unwrap();
                let mut last = engine.advance(&[view]).unwrap();
                while last.carried > 0 {
                    last = engine.advance(&[view]).unwrap();
                    engine.assert_well_formed();
                    assert!(changes(&last) > 0 || last.carried == 0, "{last:?}");
                }
                assert_eq!(last.cut_hash, wanted.cut_hash, "{cap:?}, {strategy:?}, round {round}");
            }
            assert!(most > 5, "{cap:?}, {strategy:?}: {most} carried");
        }
    }
}
