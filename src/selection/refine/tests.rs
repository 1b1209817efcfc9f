//! Every strategy over nodes that have nothing to do with each other: what must flip is found, in the frame in which it must,
//! and no more is tested than each of them promises.

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vertex_tree::{Hierarchy, NodeId, NormalCone};

use super::*;
use crate::criterion::Criterion;
use crate::motion::{Motion, Odometer, Speed, Travel};
use crate::normal_cone::{self, Cones};

#[test]
fn strategies_have_names() {
    let names = Strategy::ALL.map(Strategy::name);
    assert_eq!(names, ["top-down", "front", "event", "event-published", "event-queue"]);
    assert_eq!(Strategy::ALL.map(Strategy::is_exact), [true, true, true, false, true]);
}

/// Roots without children.
struct Roots {
    all: Vec<NodeId>,
    bounds: Vec<Bounds>,
}

impl Hierarchy for Roots {
    const IS_TREE: bool = true;

    fn node_limit(&self) -> u32 {
        self.all.len() as u32
    }

    fn displayed(&self) -> u64 {
        0
    }

    fn roots(&self) -> &[NodeId] {
        &self.all
    }

    fn bounds(&self, node: NodeId) -> Bounds {
        self.bounds[node.index()]
    }

    fn children(&self, _: NodeId) -> impl Iterator<Item = NodeId> {
        std::iter::empty()
    }

    fn parents(&self, _: NodeId) -> impl Iterator<Item = NodeId> {
        std::iter::empty()
    }
}

const NODES: u32 = 301;

fn unit(random: &mut Pcg64Mcg) -> DVec3 {
    loop {
        let v = DVec3::from([0; 3].map(|_| random.random_range(-1.0..1.0)));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

impl Roots {
    fn new(random: &mut Pcg64Mcg) -> Self {
        let bounds = (0..NODES).map(|_| Bounds {
            center: (unit(random) * random.random_range(0.0..40.0)).as_vec3().to_array(),
            radius: random.random_range(0.1..3.0),
            eps: random.random_range(0.1..2.0),
        });
        Self { all: (0..NODES).map(NodeId).collect(), bounds: bounds.collect() }
    }
}

/// A strategy, and what the engine does with what it finds.
struct Follower<'a> {
    roots: &'a Roots,
    front: Front,
    finder: Finder,
}

/// What was found in a frame, in order of slots, and the tests that it took.
#[derive(Debug, PartialEq)]
struct Found {
    unfold: Vec<Slot>,
    fold: Vec<Slot>,
    tests: u64,
}

impl<'a> Follower<'a> {
    fn new(strategy: Strategy, roots: &'a Roots) -> Self {
        Self { roots, front: Front::new(roots), finder: Finder::new(strategy) }
    }

    fn watch_roots(&mut self, frame: &Frame) {
        for root in self.front.roots() {
            let bounds = self.front.bounds(root);
            self.finder.watch(frame, root, Kind::Unfold, bounds);
        }
    }

    /// What must flip.
    fn wrong(&self, frame: &Frame) -> [Vec<Slot>; 2] {
        let is_wanted = |slot: Slot| {
            let bounds = self.front.bounds(slot);
            match frame.cones {
                Some(cones) => normal_cone::unfold(frame.criterion, frame.views, &bounds, &cones.of(slot)),
                None => frame.criterion.unfold(frame.views, &bounds),
            }
        };
        [true, false].map(|wanted| {
            let slots = self.front.roots().filter(|&slot| self.front.record(slot).is_active() != wanted);
            slots.filter(|&slot| is_wanted(slot) == wanted).collect()
        })
    }

    /// A frame, in which one in so many changes is refused.
    fn advance(&mut self, frame: &Frame, before: &[View], refuses: usize) -> Found {
        let mut flips = Flips { tests: 5, ..Flips::default() };
        self.finder.find(frame, before, &self.front, &mut flips);
        let Flips { mut unfold, mut fold, tests } = flips;
        unfold.sort_unstable();
        fold.sort_unstable();
        for (slots, kind) in [(&unfold, Kind::Unfold), (&fold, Kind::Fold)] {
            for (at, &slot) in slots.iter().enumerate() {
                let bounds = self.front.bounds(slot);
                let is_refused = at % refuses == refuses - 1;
                match kind {
                    _ if is_refused => {}
                    Kind::Unfold => self.front.set_active(self.roots, slot),
                    Kind::Fold => self.front.set_folded(self.roots, slot),
                }
                let other = if kind == Kind::Fold { Kind::Unfold } else { Kind::Fold };
                self.finder.prefetch(slot);
                if is_refused {
                    self.finder.unwatch(slot);
                    self.finder.refused(slot, kind, bounds);
                } else {
                    self.finder.changed(slot);
                    self.finder.watch(frame, slot, other, bounds);
                }
            }
        }
        let tests = tests - 5 + self.finder.settle(frame);
        Found { unfold, fold, tests }
    }

    #[track_caller]
    fn assert_watches_all(&self) {
        self.finder.assert_well_formed();
        let mut watched = Vec::new();
        self.finder.for_each_watched(&self.front, &mut |slot, kind, bounds| {
            assert_eq!(*bounds, self.front.bounds(slot));
            watched.push((slot, kind == Kind::Fold));
        });
        watched.sort_unstable();
        let all = self.front.roots().map(|slot| (slot, self.front.record(slot).is_active()));
        assert_eq!(watched, all.collect::<Vec<_>>());
    }
}

const SPEED: Speed = Speed { rho: 0.1, omega: 0.01, kappa: 0.0 };

fn view(random: &mut Pcg64Mcg) -> View {
    View::from_parts(unit(random) * 20.0, unit(random), 0.6, 0.8, 12.0).unwrap()
}

/// A view turned by about so many radians.
fn turned(view: View, angle: f64) -> View {
    let across = view.direction().any_orthonormal_vector();
    view.with_direction((view.direction() + across * angle).normalize()).unwrap()
}

/// The views of a frame of a walk that does one thing for 40 frames, and then another.
fn step(frame: u32, views: &mut Vec<View>, random: &mut Pcg64Mcg) {
    if frame.is_multiple_of(40) {
        let count = [1, 1, 1, 2, 1, 9, 1, 0][frame as usize / 40 % 8];
        *views = (0..count).map(|_| view(random)).collect();
    }
    for view in views.iter_mut() {
        *view = match frame / 40 % 8 {
            // Straight on, slower and faster than declared.
            0 => view
                .with_eye(view.eye() + view.direction() * if frame % 40 < 20 { 0.05 } else { 0.5 })
                .unwrap(),
            // Sideways, and then at rest.
            1 if frame % 40 < 20 => {
                view.with_eye(view.eye() + view.direction().any_orthonormal_vector() * 0.1).unwrap()
            }
            2 => turned(*view, 0.005),
            // All sorts of things.
            3 | 5 | 6 => turned(view.with_eye(view.eye() + unit(random) * 0.1).unwrap(), 0.01),
            // The tolerance changes, which nobody has declared.
            4 => view.with_k(view.k() + 0.1).unwrap(),
            _ => *view,
        };
    }
}

/// Walks for 640 frames and calls `check` with what every strategy has to find and has found.
fn walk(
    seed: u64,
    criterion: Criterion,
    has_cones: bool,
    refuses: usize,
    mut check: impl FnMut(Strategy, &Frame, [Vec<Slot>; 2], Found),
) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let roots = Roots::new(&mut random);
    let mut all = Strategy::ALL.map(|strategy| (strategy, Follower::new(strategy, &roots)));
    let cones = Cones::default();
    for slot in all[0].1.front.roots() {
        let axis = unit(&mut random).as_vec3().to_array();
        cones.set(slot, NormalCone { axis, sine: random.random_range(0.0..1.1) });
    }
    let (mut before, mut views, mut clock) = (Vec::new(), Vec::new(), Odometer::default());
    for number in 0..640 {
        step(number, &mut views, &mut random);
        let travel = Travel::between(&before, &views);
        let motion = clock.advance_by(&SPEED.into(), travel.as_ref());
        let cones = has_cones.then_some(&cones);
        let frame =
            Frame { criterion, views: &views, speed: SPEED, motion, travel, looks_ahead: false, cones };
        for (strategy, follower) in &mut all {
            if number == 0 {
                follower.watch_roots(&frame);
            }
            let wrong = follower.wrong(&frame);
            let found = follower.advance(&frame, &before, refuses);
            check(*strategy, &frame, wrong, found);
            if number % 16 == 0 {
                follower.assert_watches_all();
            }
        }
        before.clone_from(&views);
    }
}

#[test]
fn what_must_flip_is_found_in_the_frame_in_which_it_must() {
    for (seed, criterion, has_cones, refuses) in [
        (1, Criterion::ScreenError, false, usize::MAX),
        (2, Criterion::SphereSize, false, usize::MAX),
        (3, Criterion::ScreenError, true, usize::MAX),
        (4, Criterion::ScreenError, false, 3),
        (5, Criterion::ScreenError, true, 2),
    ] {
        let mut flips = 0;
        walk(seed, criterion, has_cones, refuses, |strategy, frame, [unfold, fold], found| {
            if strategy.is_exact() {
                flips += found.unfold.len() + found.fold.len();
                assert_eq!([&found.unfold, &found.fold], [&unfold, &fold], "{strategy:?}, {:?}", frame.views);
            } else {
                // What it finds is right, though it may be late.
                assert!(found.unfold.iter().all(|slot| unfold.contains(slot)));
                assert!(found.fold.iter().all(|slot| fold.contains(slot)));
            }
        });
        assert!(flips > 1_000, "{flips} flips");
    }
}

/// Walk and scan look at every node once; the queue at none while the camera rests, and at few while it moves as declared. With
/// a scan of what is near, none is looked at more than twice, and once more where it has flipped.
#[test]
fn as_many_are_tested_as_a_strategy_promises() {
    let mut frames = 0;
    let mut tests = [0; 2];
    walk(6, Criterion::ScreenError, false, usize::MAX, |strategy, frame, _, found| match strategy {
        Strategy::TopDown | Strategy::Front => assert_eq!(found.tests, u64::from(NODES)),
        Strategy::Event => {
            let flipped = (found.unfold.len() + found.fold.len()) as u64;
            let most = if frame.motion == Motion::Rest { 0 } else { 2 * u64::from(NODES) + flipped };
            assert!(found.tests <= most, "{} of {most} tests", found.tests);
        }
        Strategy::EventQueue => match frame.motion {
            Motion::Rest => assert_eq!(found.tests, 0),
            // All of them, and those that have flipped once more.
            Motion::Unbounded => {
                // The roots besides, which were watched before the first frame.
                let flipped = (found.unfold.len() + found.fold.len()) as u64;
                let first = if frames == 0 { u64::from(NODES) } else { 0 };
                assert_eq!(found.tests, u64::from(NODES) + flipped + first);
                frames += 1;
            }
            Motion::Frames(_) => {
                frames += 1;
                tests[0] += found.tests;
                tests[1] += u64::from(NODES);
            }
        },
        Strategy::EventPublished => {
            let most = 2 * u64::from(NODES) + (found.unfold.len() + found.fold.len()) as u64;
            assert!(found.tests <= most);
        }
    });
    assert!(tests[1] > 50_000 && tests[0] < tests[1] / 8, "{tests:?}");
}

/// Of what is to unfold that of most error comes first, of what is to fold that of least.
#[test]
fn what_is_seen_most_unfolds_first_and_folds_last() {
    let views = [View::from_parts(DVec3::ZERO, DVec3::X, 0.6, 0.8, 10.0).unwrap()];
    let frame = Frame {
        criterion: Criterion::ScreenError,
        views: &views,
        speed: SPEED,
        motion: Motion::Rest,
        travel: None,
        looks_ahead: false,
        cones: None,
    };
    // An error of 1 is what is tolerated from 10 away, where the sphere begins.
    let at = |x: f32| Bounds { center: [x, 0.0, 0.0], radius: 1.0, eps: 1.0 };
    let urgency = |kind: Kind| [6.0, 11.0, 21.0, -5.0].map(|x| frame.urgency(kind, &at(x)));
    assert_eq!(urgency(Kind::Unfold), [2.0, 1.0, 0.5, 0.0]);
    assert_eq!(urgency(Kind::Fold), [0.0, 0.0, 0.5, 1.0]);
    // Other views want other nodes, and a cone may say that they see the back of one.
    let cones = Cones::default();
    cones.set(Slot(5), NormalCone { axis: [1.0, 0.0, 0.0], sine: 0.1 });
    let with_cones = Frame { cones: Some(&cones), ..frame };
    let other = [views[0].with_direction(DVec3::NEG_X).unwrap()];
    let wanted = |frame: &Frame, x: f32, slot: u32| frame.unfold_in(&other, Slot(slot), &at(x));
    assert!(wanted(&frame, -6.0, 5) && !wanted(&frame, 6.0, 5) && !wanted(&frame, -21.0, 5));
    assert!(wanted(&with_cones, -6.0, 5) && !wanted(&with_cones, 6.0, 5));
    cones.set(Slot(6), NormalCone { axis: [-1.0, 0.0, 0.0], sine: 0.1 });
    assert!(!wanted(&with_cones, -6.0, 6) && wanted(&with_cones, -6.0, 7));
}
