//! Every strategy against the brute-force cut, on hierarchies and motions that are as nasty as random can make them.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::cell::Cell;
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use crate::common::{bumpy_grid, direction, random_log, random_step, random_view, seeded};
use foldfront::CollapseLog;
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::budget::{Budget, WorkCap};
use foldfront::selection::clock::Clock;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::oracle::Oracle;
use foldfront::testing::walk::turned;
use foldfront::vertex_tree::NullSink;
use in_memory::{InMemoryHierarchy, InMemoryTree};

fn engine(log: &CollapseLog, settings: Settings) -> Engine<InMemoryTree, ActiveMesh> {
    let tree = InMemoryTree::new(Arc::new(InMemoryHierarchy::new(log).unwrap()));
    let mesh = ActiveMesh::new();
    Engine::new(tree, mesh, settings).unwrap()
}

/// The displayed triangles by definition: for each input triangle the vertices that its corners are merged into by
/// the folded nodes, if they are three.
fn displayed(log: &CollapseLog, active: &[bool]) -> BTreeSet<(u32, [u32; 3])> {
    let mut into: Vec<u32> = (0..log.mesh.positions.len() as u32).collect();
    // Later collapses are higher up: resolve from the top.
    for (c, _) in log.collapses.iter().zip(active).rev().filter(|&(_, &active)| !active) {
        into[c.removed as usize] = into[c.kept as usize];
    }
    (0..)
        .zip(&log.mesh.triangles)
        .map(|(t, corners)| (t, corners.map(|v| into[v as usize])))
        .filter(|(_, [a, b, c])| a != b && b != c && c != a)
        .collect()
}

fn shown(engine: &Engine<InMemoryTree, ActiveMesh>) -> BTreeSet<(u32, [u32; 3])> {
    let tree = engine.tree();
    let vertex = |slot| tree.input_vertex(slot).expect("a triangle names a hole in the vertex buffer");
    engine
        .sink()
        .displayed_triangles()
        .map(|(slot, corners)| (tree.input_triangle(slot).unwrap(), corners.map(vertex)))
        .collect()
}

#[test]
fn all_strategies_agree_with_the_oracle_and_show_its_mesh() {
    for seed in 0..12 {
        let mut random = seeded(seed);
        let log = random_log(bumpy_grid(18, &mut random), &mut random);
        let mut oracle = Oracle::new(&log).unwrap();
        let criterion = if seed % 3 == 0 { Criterion::SphereSize } else { Criterion::ScreenError };
        let k = if criterion == Criterion::SphereSize { 4.0 } else { 150.0 };
        let speed = [(0.02, 0.02), (1e-4, 1e-4), (0.0, 0.02), (0.3, 0.0)][seed as usize % 4];
        let settings = Settings { criterion, rho: speed.0, omega: speed.1, ..Settings::default() };
        let mut engines: Vec<_> =
            Strategy::ALL.iter().map(|&strategy| engine(&log, Settings { strategy, ..settings })).collect();
        let mut views = vec![random_view(&mut random).with_k(k).unwrap()];
        for frame in 0..400 {
            for view in &mut views {
                random_step(view, &mut random);
            }
            match frame {
                // A second eye for a while, none at all for a moment, another lens, another tolerance.
                100 => views.push(random_view(&mut random).with_k(k / 3.0).unwrap()),
                200 => views.clear(),
                201 => views.push(random_view(&mut random).with_k(k).unwrap()),
                250 => views[0] = views[0].with_cone(0.8, 0.6).unwrap(),
                300 => views[0] = views[0].with_k(3.0 * views[0].k()).unwrap(),
                _ => {}
            }
            for engine in &mut engines {
                let strategy = engine.settings().strategy;
                let report = engine.advance(&views).unwrap();
                engine.assert_well_formed();
                if strategy.is_exact() {
                    let difference = oracle.compare(engine);
                    assert_eq!(difference, None, "{strategy:?}, seed {seed}, frame {frame}");
                }
                assert_eq!(report.displayed, engine.sink().displayed() as u64);
                if frame % 16 == 0 {
                    let mut active = vec![false; log.collapses.len()];
                    let hierarchy = engine.tree().hierarchy();
                    engine.for_each_active(|n| active[hierarchy.log_number(n) as usize] = true);
                    assert_eq!(
                        shown(engine),
                        displayed(&log, &active),
                        "{strategy:?}, seed {seed}, frame {frame}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_slow_pan_flips_every_node_in_its_frame() {
    // 1e-5 radians a frame: the arc cosine of an f32 dot product would not see it.
    let mut random = seeded(7);
    let log = random_log(bumpy_grid(24, &mut random), &mut random);
    let mut oracle = Oracle::new(&log).unwrap();
    let tree = InMemoryTree::new(Arc::new(InMemoryHierarchy::new(&log).unwrap()));
    let mut engine = Engine::new(tree, NullSink, Settings { rho: 0.05, ..Settings::default() }).unwrap();
    let mut view = random_view(&mut random);
    let axis = view.direction().any_orthogonal_vector().normalize();
    let (mut changes, mut tests) = (0, 0);
    for frame in 0..1_000_000 {
        view = view
            .with_direction((glam::DQuat::from_axis_angle(axis, 1e-5) * view.direction()).normalize())
            .unwrap();
        let report = engine.advance(&[view]).unwrap();
        changes += report.unfolds + report.folds;
        tests += report.tests;
        assert_eq!(oracle.compare(&engine), None, "frame {frame}");
    }
    assert!(changes > 100, "only {changes} changes in more than a full turn");
    assert!(
        tests < 1_000_000 * log.collapses.len() as u64 / 20,
        "{tests} tests: the schedule spares nothing"
    );
}

#[test]
fn nothing_is_tested_at_rest() {
    let mut random = seeded(3);
    let log = random_log(bumpy_grid(20, &mut random), &mut random);
    let mut engine = engine(&log, Settings::default());
    let view = random_view(&mut random);
    assert!(engine.advance(&[view]).unwrap().tests > 0);
    for _ in 0..10 {
        assert_eq!(engine.advance(&[view]).unwrap().tests, 0);
    }
}

#[test]
fn a_triangle_budget_is_met_and_the_cut_stays_exact() {
    for strategy in [Strategy::TopDown, Strategy::Front, Strategy::Event] {
        let mut random = seeded(11);
        let log = random_log(bumpy_grid(40, &mut random), &mut random);
        let mut oracle = Oracle::new(&log).unwrap();
        let settings =
            Settings { strategy, rho: 0.02, budget: Budget::Displayed(600), ..Settings::default() };
        let mut engine = engine(&log, settings);
        // From outside of every sphere: what the eye is inside of is shown at any tolerance.
        let eye = 5.0 * direction(&mut random);
        let view = random_view(&mut random).with_eye(eye).unwrap();
        let mut view = view.with_direction(-eye.normalize()).unwrap();
        for (budget, frames) in [(600, 500), (200, 500), (1500, 500)] {
            engine.set_budget(Budget::Displayed(budget));
            let mut last = 0;
            for frame in 0..frames {
                // Moves gently for a while, then lets the tolerance settle.
                if frame < frames / 2 {
                    view = turned(view, 0.002, &mut random);
                }
                last = engine.advance(&[view]).unwrap().displayed;
                engine.assert_well_formed();
                assert_eq!(oracle.compare(&engine), None, "{strategy:?}, budget {budget}, frame {frame}");
            }
            assert!(last <= budget && last > budget * 3 / 4, "{strategy:?}: {last} triangles of {budget}");
        }
        engine.set_budget(Budget::None);
        engine.advance(&[view]).unwrap();
        engine.assert_well_formed();
        assert_eq!(engine.views(), &[view]);
        assert_eq!(oracle.compare(&engine), None);
    }
}

#[test]
fn unfolding_everything_gives_the_input_and_folding_everything_the_base_mesh() {
    let mut random = seeded(5);
    let log = random_log(bumpy_grid(25, &mut random), &mut random);
    let mut engine = engine(&log, Settings::default());
    let base = shown(&engine);
    assert_eq!(base, displayed(&log, &vec![false; log.collapses.len()]));
    let near = random_view(&mut random).with_k(1e12).unwrap();
    // Looking every way at once.
    let everywhere: Vec<View> =
        (0..6).map(|i| near.with_direction([1.0, -1.0][i % 2] * glam::DVec3::AXES[i / 2]).unwrap()).collect();
    let report = engine.advance(&everywhere).unwrap();
    engine.assert_well_formed();
    assert_eq!(report.active_nodes, log.collapses.len() as u64);
    let all: BTreeSet<_> = (0..).zip(log.mesh.triangles.iter().copied()).collect();
    assert_eq!(shown(&engine), all);
    engine.advance(&[]).unwrap();
    engine.assert_well_formed();
    assert_eq!(shown(&engine), base);
}

#[test]
fn a_renderer_that_patches_only_what_changed_has_the_same_buffers() {
    let mut random = seeded(9);
    let log = random_log(bumpy_grid(25, &mut random), &mut random);
    let mut engine = engine(&log, Settings { rho: 0.02, ..Settings::default() });
    let mut view = random_view(&mut random);
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for _ in 0..500 {
        random_step(&mut view, &mut random);
        engine.advance(&[view]).unwrap();
        engine.assert_well_formed();
        let mesh = engine.sink_mut();
        vertices.resize(mesh.positions().len(), [0.0; 3]);
        triangles.resize(triangles.len().max(mesh.triangles().len()), [0; 3]);
        for &slot in mesh.changed_vertices() {
            vertices[slot as usize] = mesh.positions()[slot as usize];
        }
        for &slot in mesh.changed_triangles() {
            if let Some(&triangle) = mesh.triangles().get(slot as usize) {
                triangles[slot as usize] = triangle;
            }
        }
        mesh.clear_changes();
        assert_eq!(&triangles[..mesh.triangles().len()], mesh.triangles());
        for &vertex in triangles[..mesh.triangles().len()].as_flattened() {
            assert_eq!(vertices[vertex as usize], mesh.positions()[vertex as usize]);
        }
    }
}

/// What the published bounds leave out is that a moving eye changes the angle at which a node is seen. While the camera only
/// turns, no faster than declared, they miss nothing.
#[test]
fn as_published_a_pan_is_followed_exactly() {
    let mut random = seeded(12);
    let log = random_log(bumpy_grid(30, &mut random), &mut random);
    let mut oracle = Oracle::new(&log).unwrap();
    let strategy = Strategy::EventPublished;
    let mut engine = engine(&log, Settings { strategy, rho: 0.02, omega: 0.01, ..Settings::default() });
    let (mut changes, mut tests) = (0, 0);
    for _ in 0..10 {
        let mut view = random_view(&mut random);
        // No view at all, so that the first one is compared with none.
        engine.advance(&[]).unwrap();
        for frame in 0..300 {
            let report = engine.advance(&[view]).unwrap();
            engine.assert_well_formed();
            assert_eq!(oracle.compare(&engine), None, "frame {frame}");
            view = turned(view, 0.0099, &mut random);
            (changes, tests) = (changes + report.unfolds + report.folds, tests + report.tests);
        }
    }
    assert!(changes > 2000, "{changes} changes");
    assert!(tests < 3000 * log.collapses.len() as u64 / 4, "{tests} tests");
}

/// Each look at it takes a millisecond.
fn a_millisecond_a_look() -> Duration {
    thread_local! {
        static LOOKS: Cell<u32> = const { Cell::new(0) };
    }
    LOOKS.set(LOOKS.get() + 1);
    Duration::from_millis(LOOKS.get().into())
}

#[test]
fn the_time_is_the_callers() {
    let mut random = seeded(3);
    let mesh = bumpy_grid(30, &mut random);
    let hierarchy = Arc::new(InMemoryHierarchy::new(&random_log(mesh, &mut random)).unwrap());
    let view = random_view(&mut random);
    let engine = |clock, work_cap| {
        let settings = Settings { clock, work_cap, ..Settings::default() };
        Engine::new(InMemoryTree::new(hierarchy.clone()), NullSink, settings).unwrap()
    };
    let clock = Some(Clock::new(a_millisecond_a_look));
    let whole = engine(clock, WorkCap::None).advance(&[view]).unwrap();
    // A look at the start, one before and one after the changes, and one at the end.
    assert_eq!((whole.select, whole.apply), (Duration::from_millis(3), Duration::from_millis(1)));
    assert!(whole.unfolds > 100, "{whole:?}");
    // A cap of a few looks lets a few changes pass.
    let capped = engine(clock, WorkCap::Time(Duration::from_millis(12))).advance(&[view]).unwrap();
    assert!((1..whole.unfolds / 4).contains(&capped.unfolds) && capped.carried > 0, "{capped:?}");
    // Without a clock no time passes: nothing is capped, and nothing reported.
    let timeless = engine(None, WorkCap::Time(Duration::from_nanos(1))).advance(&[view]).unwrap();
    assert_eq!((timeless.select, timeless.apply), (Duration::ZERO, Duration::ZERO));
    assert_eq!(timeless.cut_hash, whole.cut_hash);
}
