//! What the engine foresees against what comes.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use crate::common::foreseen::Foreseen;
use crate::common::{bumpy_grid, direction, random_log, random_step, random_view, seeded};
use foldfront::CollapseLog;
use foldfront::experiment::path::Path;
use foldfront::experiment::scene::Scene;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::motion::{Course, Speed};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::{View, theta_of_pixels};
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{Hierarchy, NodeId, NullSink};
use glam::{DQuat, DVec3};
use in_memory::{InMemoryHierarchy, InMemoryTree};

const EXACT: [Strategy; 3] = [Strategy::TopDown, Strategy::Front, Strategy::Event];

type Walker = Engine<Foreseen<InMemoryTree>, NullSink>;

fn walker(hierarchy: &Arc<InMemoryHierarchy>, settings: Settings, look_ahead: u32) -> Walker {
    let tree = Foreseen::new(InMemoryTree::new(hierarchy.clone()), look_ahead);
    Engine::new(tree, NullSink, settings).unwrap()
}

fn hierarchy(seed: u64, side: usize) -> (CollapseLog, Arc<InMemoryHierarchy>) {
    let mut random = seeded(seed);
    let log = random_log(bumpy_grid(side, &mut random), &mut random);
    let hierarchy = Arc::new(InMemoryHierarchy::new(&log).unwrap());
    (log, hierarchy)
}

/// Node by number in the log, and the frames until its change.
fn named(engine: &Walker) -> BTreeMap<u32, u32> {
    let tree = engine.tree();
    let named: BTreeMap<u32, u32> =
        tree.named.iter().map(|&(node, frames)| (tree.log_number(node), frames)).collect();
    assert_eq!(named.len(), tree.named.len(), "no node is named twice in a tree");
    named
}

/// While the camera goes on as it did, what is foreseen is what comes, and nothing else.
#[test]
fn a_steady_camera_is_foreseen_exactly() {
    let (log, hierarchy) = hierarchy(3, 60);
    let mut oracle = Oracle::new(&log).unwrap();
    for strategy in EXACT {
        for (look_ahead, instants) in [(1, &[1][..]), (2, &[1, 2]), (5, &[1, 2, 4, 5]), (8, &[1, 2, 4, 8])] {
            let settings = Settings { strategy, rho: 0.02, omega: 0.02, ..Settings::default() };
            let mut engine = walker(&hierarchy, settings, look_ahead);
            let mut random = seeded(7);
            let start = random_view(&mut random);
            // About an axis across the direction, which is how a rotation is carried on.
            let (step, axis) =
                (direction(&mut random) * 0.015, start.direction().cross(direction(&mut random)));
            let turn = DQuat::from_axis_angle(axis.normalize(), 0.01);
            let at = |frame: u32| {
                let turn = (0..frame).fold(DQuat::IDENTITY, |all, _| turn * all);
                let view = start.with_eye(start.eye() + step * f64::from(frame)).unwrap();
                view.with_direction(turn * start.direction()).unwrap()
            };
            let (mut right, mut wrong) = (0, 0);
            for frame in 0..60 {
                engine.advance(&[at(frame)]).unwrap();
                engine.assert_well_formed();
                if frame < 3 {
                    continue;
                }
                let now = oracle.cut(Criterion::ScreenError, &[at(frame)]).to_vec();
                let mut expected = BTreeMap::new();
                for &instant in instants {
                    for (n, &then) in
                        oracle.cut(Criterion::ScreenError, &[at(frame + instant)]).iter().enumerate()
                    {
                        if then != now[n] {
                            expected.entry(n as u32).or_insert(instant);
                        }
                    }
                }
                let named = named(&engine);
                right += named.iter().filter(|&(node, frames)| expected.get(node) == Some(frames)).count();
                wrong += named.iter().filter(|&(node, frames)| expected.get(node) != Some(frames)).count();
                wrong += expected.keys().filter(|node| !named.contains_key(node)).count();
            }
            // A view that is computed another way differs in its last bits, and a node may be on the mark.
            let what = format!("{}, {look_ahead} frames ahead", strategy.name());
            assert!(right > 500 && wrong * 1000 <= right, "{what}: {right} foreseen, {wrong} not or wrongly");
        }
    }
}

/// Whatever the camera does, nothing is named that can not be due by then at the declared speed, or at the camera's own;
/// and every way to find what can be due leads to the same.
#[test]
fn nothing_is_named_that_can_not_be_due() {
    let (mut total, mut deep) = (0, 0);
    for seed in 0..4 {
        let (log, hierarchy) = hierarchy(seed, 40);
        let settings = |strategy| Settings { strategy, rho: 0.01, omega: 0.01, ..Settings::default() };
        let mut engines = EXACT.map(|strategy| walker(&hierarchy, settings(strategy), 3));
        let mut random = seeded(seed + 50);
        let mut views = vec![random_view(&mut random)];
        for frame in 0..500 {
            let before = views.clone();
            views.iter_mut().for_each(|view| random_step(view, &mut random));
            if frame % 100 == 60 {
                views.push(random_view(&mut random));
            } else if frame % 100 == 90 {
                views.pop();
            }
            let all = engines.each_mut().map(|engine| {
                engine.advance(&views).unwrap();
                engine.assert_well_formed();
                named(engine)
            });
            assert_eq!(all[0], all[1], "seed {seed}, frame {frame}: top-down and front");
            assert_eq!(all[0], all[2], "seed {seed}, frame {frame}: top-down and event");
            let moved = |(b, a): (&View, &View)| b.eye().distance(a.eye());
            let turned = |(b, a): (&View, &View)| b.direction().angle_between(a.direction());
            let pairs = || before.iter().zip(&views);
            let course = Course::from(Speed {
                rho: pairs().map(moved).fold(0.01, f64::max),
                omega: pairs().map(turned).fold(0.01, f64::max),
                kappa: 0.0,
            });
            let mut active = vec![false; log.collapses.len()];
            engines[0].for_each_active(|node| active[engines[0].tree().log_number(node) as usize] = true);
            let forest = log.forest().unwrap();
            for (&node, &frames) in &all[0] {
                let bounds = &log.collapses[node as usize].bounds;
                let earliest = if active[node as usize] {
                    Criterion::ScreenError.earliest_fold(&views, &course, bounds)
                } else {
                    Criterion::ScreenError.earliest_unfold(&views, &course, bounds)
                };
                let what = format!("seed {seed}, frame {frame}, node {node}");
                assert!(earliest <= f64::from(frames) * (1.0 + 1e-6), "{what}: {earliest} > {frames}");
                total += 1;
                let parent = forest.parent[node as usize] as usize;
                deep += u32::from(active.get(parent) == Some(&false));
            }
        }
    }
    assert!(total > 5000 && deep > 100, "{total} named, {deep} of them below the front");
}

/// A camera that rests foresees nothing, and a backend that asks for nothing is told nothing.
#[test]
fn nothing_is_foreseen_without_need() {
    let (_, hierarchy) = hierarchy(9, 40);
    for strategy in Strategy::ALL {
        let settings = Settings { strategy, rho: 0.01, omega: 0.01, ..Settings::default() };
        let mut engine = walker(&hierarchy, settings, 4);
        let mut random = seeded(2);
        let mut view = random_view(&mut random);
        let mut foreseen = 0;
        for _ in 0..50 {
            view = view.with_eye(view.eye() - view.eye() * 0.004).unwrap();
            foreseen += engine.advance(&[view]).unwrap().foreseen;
        }
        assert!(foreseen > 20, "{}: {foreseen}", strategy.name());
        for rest in 0..5 {
            let report = engine.advance(&[view]).unwrap();
            engine.assert_well_formed();
            assert_eq!((report.foreseen, engine.tree().named.len()), (0, 0), "{}, {rest}", strategy.name());
        }
        engine.tree_mut().look_ahead = 0;
        for _ in 0..50 {
            view = view.with_eye(view.eye() + view.eye() * 0.004).unwrap();
            assert_eq!(engine.advance(&[view]).unwrap().foreseen, 0);
        }
    }
}

/// A camera that jumps, and one that starts, is not expected to go on like that.
#[test]
fn a_jump_is_not_carried_on() {
    let (_, hierarchy) = hierarchy(4, 60);
    let settings = Settings { rho: 0.01, omega: 0.01, ..Settings::default() };
    let mut engine = walker(&hierarchy, settings, 4);
    let view = |eye: DVec3| {
        random_view(&mut seeded(1)).with_eye(eye).and_then(|v| v.with_direction(-eye.normalize())).unwrap()
    };
    let eye = DVec3::new(0.3, 0.4, 1.1);
    engine.advance(&[view(eye)]).unwrap();
    engine.advance(&[view(eye)]).unwrap();
    let usual = {
        let mut engine = walker(&hierarchy, settings, 4);
        (0..4).map(|i| engine.advance(&[view(eye * (1.0 - 0.01 * f64::from(i)))]).unwrap().foreseen).last()
    };
    let report = engine.advance(&[view(-eye)]).unwrap();
    assert!(report.unfolds + report.folds > 400, "the jump shows something else: {report:?}");
    assert!(
        report.foreseen <= usual.unwrap(),
        "{} foreseen after a jump, {usual:?} usually",
        report.foreseen
    );
}

/// Along a recorded path, most of what changes was named in the frame before, and most of what is named changes soon.
#[test]
fn most_of_a_recorded_path_is_foreseen() {
    let log = crate::common::data::log(Scene::parse("scene:city").unwrap().mesh(&mut |_, _| ()));
    let hierarchy = Arc::new(InMemoryHierarchy::new(&log).unwrap());
    for (name, least_recall, least_precision) in [("city-calm", 0.98, 0.94), ("city-wild", 0.85, 0.94)] {
        let file = format!("{}/paths/{name}.path", env!("CARGO_MANIFEST_DIR"));
        let path = Path::read(std::path::Path::new(&file)).unwrap();
        let speed = path.motion_percentile(99.0);
        for look_ahead in [2, 4] {
            let settings = Settings { rho: speed.rho, omega: speed.omega, ..Settings::default() };
            let mut engine = walker(&hierarchy, settings, look_ahead);
            let score = score(&mut engine, &path, 600);
            let what = format!("{name}, {look_ahead} frames ahead: {score:?}");
            assert!(score.recall() >= least_recall, "{what}");
            assert!(score.precision() >= least_precision, "{what}");
        }
    }
}

#[derive(Debug, Default)]
struct Score {
    changes: u64,
    /// Of these, those named in the frame before.
    recalled: u64,
    /// Runs of frames in which a node was named, and of these, those that ended in a change.
    named: u64,
    borne_out: u64,
}

impl Score {
    fn recall(&self) -> f64 {
        self.recalled as f64 / self.changes as f64
    }
    fn precision(&self) -> f64 {
        self.borne_out as f64 / self.named as f64
    }
}

fn score(engine: &mut Walker, path: &Path, frames: usize) -> Score {
    let mut score = Score::default();
    let mut expected: HashMap<NodeId, usize> = HashMap::new();
    for frame in 0..frames.min(path.frames.len()) {
        let view = path.view(frame, theta_of_pixels(1.0, 1080)).unwrap();
        engine.advance(&[view]).unwrap();
        let tree = engine.tree();
        if frame > 0 {
            for node in &tree.changed {
                let named = expected.remove(node);
                score.changes += 1;
                score.recalled += u64::from(named.is_some_and(|last| last + 1 == frame));
                score.named += u64::from(named.is_some());
                score.borne_out += u64::from(named.is_some());
            }
        }
        expected.extend(tree.named.iter().map(|&(node, _)| (node, frame)));
        // A page that has come is used a little later too.
        expected.retain(|_, last| {
            let lapsed = *last + 4 < frame;
            score.named += u64::from(lapsed);
            !lapsed
        });
    }
    score
}
