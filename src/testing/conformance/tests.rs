//! Cameras that do one thing at a time, around a tree and a graph: every exact strategy shows the brute-force cut in every frame,
//! and makes no more tests than it promises.

use glam::DVec3;
use selection::budget::{Budget, WorkCap};
use selection::criterion::Criterion;
use selection::engine::{Engine, FrameReport, Settings};
use selection::refine::Strategy;
use selection::view::View;
use vertex_tree::{Bounds, Hierarchy, NodeId, NullSink, Refine, Step, TreeError};

use crate::brute_force::BruteForce;
use crate::tests::{Lie, Strip};

/// A triangle of nodes, each with two children that it shares with its neighbours: those of row `n` are the parents of the `n + 1`
/// nodes of the next.
struct Lattice {
    roots: Vec<NodeId>,
    unfolded: u64,
}

const ROWS: u32 = 30;

impl Lattice {
    fn new() -> Self {
        Self { roots: vec![NodeId(0)], unfolded: 0 }
    }

    /// Row and place in it.
    fn place(NodeId(node): NodeId) -> [u32; 2] {
        let row = ((8 * node + 1).isqrt() - 1) / 2;
        [row, node - row * (row + 1) / 2]
    }

    fn node(row: u32, at: u32) -> NodeId {
        NodeId(row * (row + 1) / 2 + at)
    }
}

impl Hierarchy for Lattice {
    fn node_limit(&self) -> u32 {
        ROWS * (ROWS + 1) / 2
    }

    fn displayed(&self) -> u64 {
        1 + self.unfolded
    }

    fn roots(&self) -> &[NodeId] {
        &self.roots
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        let [row, at] = Self::place(node);
        let below = (ROWS - row) as f32;
        Bounds { center: [at as f32 - row as f32 / 2.0, 0.0, 0.0], radius: 0.75 * below, eps: 0.002 * below }
    }

    fn children(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let [row, at] = Self::place(node);
        [at, at + 1].into_iter().filter(move |_| row + 1 < ROWS).map(move |at| Self::node(row + 1, at))
    }

    fn parents(&self, node: NodeId) -> impl Iterator<Item = NodeId> {
        let [row, at] = Self::place(node);
        let above = row.checked_sub(1);
        let sides = [at.checked_sub(1), (at < row).then_some(at)].into_iter().flatten();
        sides.filter_map(move |at| Some(Self::node(above?, at)))
    }
}

impl Refine<NullSink> for Lattice {
    fn start(&mut self, _: &mut NullSink) -> Result<(), TreeError> {
        Ok(())
    }

    fn unfold_into(&mut self, _: NodeId, _: &mut NullSink) -> Result<Step, TreeError> {
        self.unfolded += 1;
        Ok(Step::Done)
    }

    fn fold_into(&mut self, _: NodeId, _: &mut NullSink) -> Result<Step, TreeError> {
        self.unfolded -= 1;
        Ok(Step::Done)
    }
}

/// What each strategy did in a frame, in the order of [`Strategy::ALL`]; the published one's cut may be another.
type Reports = [FrameReport; 5];

/// Flies along with every strategy; `views` are those of each frame.
#[track_caller]
fn fly<T: Refine<NullSink>>(
    open: impl Fn() -> T,
    settings: Settings,
    views: impl IntoIterator<Item = Vec<View>>,
) -> Vec<Reports> {
    let mut whole = open();
    whole.start(&mut NullSink).unwrap();
    let mut brute_force = BruteForce::new(&mut whole).unwrap();
    brute_force.assert_nested();
    let mut engines = Strategy::ALL
        .map(|strategy| Engine::new(open(), NullSink, Settings { strategy, ..settings }).unwrap());
    let mut all = Vec::new();
    for (number, views) in views.into_iter().enumerate() {
        let reports = [0, 1, 2, 3, 4].map(|at| {
            let report = engines[at].advance(&views).unwrap();
            // With a budget, each has a tolerance of its own.
            let cut = brute_force.cut(&settings, engines[at].views());
            let strategy = Strategy::ALL[at];
            if strategy.is_exact() && report.carried == 0 {
                let found = (report.cut_hash, report.active_nodes, report.displayed);
                assert_eq!(
                    found,
                    (cut.hash, cut.nodes, cut.displayed),
                    "{strategy:?}, frame {number}, {views:?}"
                );
            }
            if number % 10 == 0 {
                engines[at].assert_well_formed();
            }
            report
        });
        all.push(reports);
    }
    all
}

/// Tests of the strategies in some frames.
fn tests(frames: &[Reports]) -> [u64; 5] {
    [0, 1, 2, 3, 4].map(|at| frames.iter().map(|reports| reports[at].tests).sum())
}

fn changes(frames: &[Reports]) -> u64 {
    frames.iter().map(|reports| reports[0].unfolds + reports[0].folds).sum()
}

fn settings() -> Settings {
    Settings { rho: 0.02, omega: 0.01, clock: None, ..Settings::default() }
}

/// In front of the middle of the strip, which lies along x from 0 to 8, and looking at it.
fn view() -> View {
    View::from_parts(DVec3::new(4.0, 0.5, 3.0), DVec3::NEG_Z, 0.8, 0.6, 400.0).unwrap()
}

fn at(view: View, x: f64, y: f64, z: f64) -> View {
    view.with_eye(view.eye() + DVec3::new(x, y, z)).unwrap()
}

/// Turned about y by the angle whose half has this tangent.
fn turned(view: View, t: f64) -> View {
    let (sin, cos) = (2.0 * t / (1.0 + t * t), (1.0 - t * t) / (1.0 + t * t));
    view.with_direction(DVec3::new(sin, 0.0, -cos)).unwrap()
}

fn strip() -> Strip {
    Strip::new(Lie::Nothing)
}

/// Moving alone: there and back again, along the strip and towards it, and a step after a rest.
fn slides() -> Vec<Vec<View>> {
    let there = (0..200).map(|n| at(view(), 0.02 * f64::from(n), 0.0, 0.0));
    let back = (0..150).map(|n| at(view(), 4.0 - 0.02 * f64::from(n), 0.0, -0.01 * f64::from(n)));
    let rest = (0..20).map(|_| at(view(), 1.0, 0.0, -1.5));
    let away = (0..200).map(|n| at(view(), 1.0, 0.0, 0.03 * f64::from(n) - 1.5));
    there.chain(back).chain(rest).chain(away).map(|view| vec![view]).collect()
}

/// Turning alone, one way and the other.
fn turns() -> Vec<Vec<View>> {
    let there = (0..200).map(|n| turned(view(), 0.004 * f64::from(n)));
    let back = (0..300).map(|n| turned(view(), 0.8 - 0.005 * f64::from(n)));
    there.chain(back).map(|view| vec![view]).collect()
}

/// Everything else that can happen: leaps, a finer and a coarser tolerance, more and fewer views, none.
fn leaps() -> Vec<Vec<View>> {
    let mut frames: Vec<Vec<View>> = Vec::new();
    for n in 0..120 {
        let slow = at(view(), 0.01 * f64::from(n), 0.0, 0.0);
        let far = at(view(), -3.0, 0.0, 2.0);
        frames.push(match n {
            0..20 => vec![slow],
            20 | 40 => vec![],
            30 => vec![far],
            21..40 => vec![slow],
            41..60 => vec![slow, far],
            60..80 => vec![slow.with_k(400.0 + 10.0 * f64::from(n)).unwrap()],
            80..90 => vec![slow.with_cone(0.6, 0.8).unwrap(); 9],
            90..100 => vec![turned(slow, f64::from(n - 90))],
            100..110 => vec![at(far, 0.0, 0.0, 30.0 * f64::from(n % 2))],
            _ => (0..3).map(|eye| at(slow, 0.06 * f64::from(eye), 0.0, 0.0)).collect(),
        });
    }
    frames
}

#[test]
fn every_flight_shows_the_brute_force_cut() {
    for criterion in [Criterion::ScreenError, Criterion::SphereSize] {
        for normal_cone in [false, true] {
            let settings = Settings { criterion, normal_cone, ..settings() };
            for views in [slides(), turns(), leaps()] {
                let frames = fly(strip, settings, views.clone());
                assert!(changes(&frames) > 500, "{} changes", changes(&frames));
                if !normal_cone {
                    let frames = fly(Lattice::new, settings, views);
                    assert!(changes(&frames) > 300, "{} changes", changes(&frames));
                }
            }
        }
    }
}

/// What a strategy is for. Top-down tests all nodes in play; the scan those at the front, and what comes to be one; the queue
/// those that the camera can have changed, at rest none.
#[test]
fn each_strategy_tests_what_it_promises() {
    for (open_tree, views) in [(true, slides()), (true, turns()), (false, slides()), (false, turns())] {
        let count = views.len();
        let rests: Vec<bool> = (0..count).map(|n| n > 0 && views[n] == views[n - 1]).collect();
        let frames =
            if open_tree { fly(strip, settings(), views) } else { fly(Lattice::new, settings(), views) };
        for (n, reports) in frames.iter().enumerate() {
            let [top_down, front, event, _, queue] = reports.each_ref().map(|report| report.tests);
            if rests[n] {
                assert_eq!([event, queue], [0, 0], "frame {n}: at rest");
            }
            // Each change brings a node or two into play, and each is tested, and once more where it is watched.
            let changes = reports[0].unfolds + reports[0].folds;
            let active = reports[0].active_nodes;
            let most = 2 * active + 1 + 4 * changes + 4;
            assert!(
                top_down >= active && top_down <= most,
                "frame {n}: {top_down} tests, {active} active nodes"
            );
            assert!(front <= top_down + 2 * changes, "frame {n}: {front} tests, {top_down}");
        }
        let [top_down, front, event, published, queue] = tests(&frames);
        assert!(front < top_down, "{front} by scanning, {top_down}");
        assert!(queue < front / 3, "{queue} by the queue, {front}");
        assert!(event < 2 * front, "{event} by queue and scan, {front}");
        assert!(published < top_down, "{published} as published, {top_down}");
    }
}

/// Slower by half, in as many frames more: about as many tests, as the clock runs on distance travelled.
#[test]
fn tests_are_a_matter_of_distance() {
    let flight = |frames: u32| {
        let way = (0..frames).map(|n| vec![at(view(), 3.0 * f64::from(n) / f64::from(frames), 0.0, 0.0)]);
        tests(&fly(strip, settings(), way))
    };
    let ([top_down, front, _, _, slow], [_, _, _, _, fast]) = (flight(1_200), flight(300));
    assert!(slow < 2 * fast, "{slow} tests in 1200 frames, {fast} in 300");
    assert!(slow < front / 8 && front < top_down, "{slow}, {front}, {top_down}");
}

/// A budget steers the tolerance, which is a speed of its own; the cut is exact at whatever tolerance there is.
#[test]
fn a_budget_is_kept_to_and_the_cut_is_exact() {
    for most in [10, 40, 150] {
        let settings = Settings { budget: Budget::Displayed(most), ..settings() };
        let rest = (0..100).map(|_| vec![at(view(), 1.0, 0.0, 0.0)]);
        let way: Vec<_> =
            (0..150).map(|n| vec![at(view(), 0.02 * f64::from(n) - 2.0, 0.0, 0.0)]).chain(rest).collect();
        let count = way.len();
        let frames = fly(strip, settings, way);
        for reports in &frames[count - 10..] {
            assert!(reports[..3].iter().all(|report| report.displayed <= most), "{reports:?}");
            assert!(reports[2].displayed > most / 4, "{reports:?}");
        }
        let [_, front, _, _, queue] = tests(&frames[50..]);
        assert!(queue < front, "{queue} by the queue, {front}");
    }
}

/// With a cap on work a front gets there in the end, whichever strategy it is, and all of them in as many frames.
#[test]
fn a_cap_on_work_puts_off_and_loses_nothing() {
    let settings = Settings { work_cap: WorkCap::Changes(7), ..settings() };
    let frames = fly(strip, settings, (0..120).map(|n| vec![at(view(), f64::from(n / 60), 0.0, 0.0)]));
    for reports in &frames {
        assert!(reports.iter().all(|report| report.unfolds + report.folds <= 7));
        let each = reports.each_ref().map(|report| (report.carried, report.cut_hash));
        assert!(each[..3].iter().all(|one| *one == each[0]), "{each:?}");
    }
    let carried = frames.iter().filter(|reports| reports[0].carried > 0).count();
    assert!((10..100).contains(&carried) && frames[119][0].carried == 0, "{carried} frames");
}

/// The published bounds hold while the camera does what they are about: it does not turn, and nothing comes into view or
/// leaves it but by being approached. Then the published strategy is right.
#[test]
fn the_published_bounds_hold_for_what_they_are_about() {
    // Towards the strip from far away, all of it in view.
    let settings = Settings { rho: 0.12, ..settings() };
    let view = at(view().with_cone(0.28, 0.96).unwrap(), 0.0, 0.0, 60.0);
    let frames = fly(strip, settings, (0..500).map(|n| vec![at(view, 0.0, 0.0, -0.12 * f64::from(n))]));
    assert!(changes(&frames) > 50);
    for (n, reports) in frames.iter().enumerate() {
        assert_eq!(reports[3].cut_hash, reports[0].cut_hash, "frame {n}");
    }
    let [_, front, _, published, _] = tests(&frames);
    assert!(published < front / 2, "{published} as published, {front} by scanning");
}
