//! The engine over a backend that does everything the trait allows: several parents, dependencies beyond structure,
//! pages that are not there, a store that fails.

mod graph;

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use crate::common::foreseen::Foreseen;
use crate::common::{direction, random_step, random_view, seeded};
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::front::mix;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::NullSink;
use graph::{Call, Graph, GraphTree, Log, Paging, Shape};
use rand::RngExt;
use rand_pcg::Pcg64;

const EXACT: [Strategy; 3] = [Strategy::TopDown, Strategy::Front, Strategy::Event];

/// An engine over a graph, and what its backend sees.
struct Walker {
    strategy: Strategy,
    graph: Rc<Graph>,
    engine: Engine<GraphTree, NullSink>,
    log: Rc<RefCell<Log>>,
}

impl Walker {
    fn new(graph: &Rc<Graph>, paging: Option<Paging>, strategy: Strategy) -> Self {
        let tree = GraphTree::new(graph.clone(), paging);
        let log = tree.log.clone();
        let settings = Settings { strategy, rho: 0.02, ..Settings::default() };
        let engine = Engine::new(tree, NullSink, settings).unwrap();
        Self { strategy, graph: graph.clone(), engine, log }
    }

    fn all(graph: &Rc<Graph>, paging: Option<Paging>) -> Vec<Self> {
        EXACT.map(|strategy| Self::new(graph, paging, strategy)).into()
    }

    /// Nodes that are wrongly folded and nodes that are wrongly unfolded.
    fn wrong(&self, views: &[View]) -> (Vec<usize>, Vec<usize>) {
        let expected = self.graph.cut(self.engine.settings().criterion, views);
        let active = &self.log.borrow().active;
        let differ = |is: bool| (0..active.len()).filter(|&n| active[n] == is && expected[n] != is).collect();
        (differ(false), differ(true))
    }

    /// Nodes whose fold is refused for want of a page, and that something has come to need since.
    fn needed_meanwhile(&self) -> u64 {
        let log = self.log.borrow();
        let is_needed = |n: usize| self.graph.needed_by[n].iter().any(|&by| log.active[by.index()]);
        log.refused.iter().filter(|&&n| log.active[n as usize] && is_needed(n as usize)).count() as u64
    }

    /// The engine's front is what the backend has done, and a valid one.
    fn assert_valid(&self, what: &str) {
        let log = self.log.borrow();
        let front = self.engine.front();
        let mut active = vec![false; log.active.len()];
        self.engine.for_each_active(|node| active[node.index()] = true);
        assert_eq!(active, log.active, "{:?}, {what}: the front is not what the backend did", self.strategy);
        let numbers = (0..active.len()).filter(|&n| active[n]).map(|n| (active.len() - 1 - n) as u32);
        let hash = numbers.clone().map(mix).fold(0, u64::wrapping_add);
        assert_eq!((front.cut_hash(), front.active_nodes()), (hash, numbers.count()), "{:?}", self.strategy);
        for n in (0..active.len()).filter(|&n| active[n]) {
            let prerequisites = || self.graph.parents[n].iter().chain(&self.graph.needs[n]);
            let holds = prerequisites().all(|p| active[p.index()]);
            assert!(holds, "{:?}, {what}: {n} is unfolded without what it needs", self.strategy);
        }
    }
}

/// One frame of a walk that rests, hurries and teleports; what wants more than one view gets it now and then.
fn step(views: &mut Vec<View>, random: &mut Pcg64) {
    for view in views.iter_mut() {
        random_step(view, random);
    }
    match random.random_range(0..100) {
        0 => views.push(random_view(random).with_k(40.0).unwrap()),
        1 if views.len() > 1 => drop(views.pop()),
        _ => {}
    }
}

fn shapes(needing: usize) -> impl Iterator<Item = (u64, Rc<Graph>)> {
    (0..12).map(move |seed| {
        let mut random = seeded(seed);
        let shape = Shape { nodes: 60 + 60 * seed as usize, parents: 1 + seed as usize % 4, needing };
        (seed, Rc::new(Graph::random(shape, &mut random)))
    })
}

/// Every frame of a walk, without paging: the cut is the closure of what the views want.
fn assert_exact(needing: usize) -> (u64, u64, u64) {
    let (mut forced, mut named, mut still_needed) = (0, 0, 0);
    for (seed, graph) in shapes(needing) {
        for mut walker in Walker::all(&graph, None) {
            let mut random = seeded(seed + 100);
            let mut views = vec![random_view(&mut random)];
            for frame in 0..400 {
                step(&mut views, &mut random);
                let report = walker.engine.advance(&views).unwrap();
                walker.engine.assert_well_formed();
                let what = format!("seed {seed}, frame {frame}");
                let name = walker.strategy.name();
                assert_eq!(report.misses, 0, "{name}, {what}: nothing was refused");
                let wrong = walker.wrong(&views);
                assert_eq!(wrong, (vec![], vec![]), "{name}, {what}: wrongly folded, wrongly unfolded");
                walker.assert_valid(&what);
                forced += report.forced;
            }
            named += walker.log.borrow().named;
            still_needed += walker.log.borrow().still_needed;
        }
    }
    (forced, named, still_needed)
}

#[test]
fn a_node_may_have_several_parents() {
    assert_eq!(assert_exact(0), (0, 0, 0), "nothing is needed beyond structure");
}

#[test]
fn what_a_node_needs_is_forced_and_folds_when_nothing_needs_it() {
    let (forced, named, still_needed) = assert_exact(30);
    assert!(forced > 1000 && named > 1000 && still_needed > 100, "{forced}, {named}, {still_needed}");
}

/// Where nodes have several parents, each is named once, at the first instant at which it is wrong, whatever leads to it;
/// and a camera that goes on as it did is foreseen exactly.
#[test]
fn what_several_parents_lead_to_is_foreseen_once() {
    let (mut right, mut wrong) = (0, 0);
    for (seed, graph) in shapes(0) {
        for strategy in EXACT {
            let settings = Settings { strategy, rho: 0.02, ..Settings::default() };
            let tree = Foreseen::new(GraphTree::new(graph.clone(), None), 4);
            let mut engine = Engine::new(tree, NullSink, settings).unwrap();
            let mut random = seeded(seed + 300);
            let start = random_view(&mut random);
            let step = direction(&mut random) * 0.01;
            let at = |frame: u32| start.with_eye(start.eye() + step * f64::from(frame)).unwrap();
            for frame in 0..80 {
                engine.advance(&[at(frame)]).unwrap();
                let named: BTreeMap<u32, u32> =
                    engine.tree().named.iter().map(|&(node, frames)| (node.0, frames)).collect();
                assert_eq!(named.len(), engine.tree().named.len(), "{}: named twice", strategy.name());
                let cut = |frame| graph.cut(settings.criterion, &[at(frame)]);
                let now = cut(frame);
                let mut expected = BTreeMap::new();
                for instant in [1, 2, 4] {
                    let then = cut(frame + instant);
                    for n in (0..now.len()).filter(|&n| then[n] != now[n]) {
                        expected.entry(n as u32).or_insert(instant);
                    }
                }
                if frame >= 3 {
                    right += named.iter().filter(|(node, frames)| expected.get(node) == Some(frames)).count();
                    wrong += named.iter().filter(|(node, frames)| expected.get(node) != Some(frames)).count();
                    wrong += expected.keys().filter(|node| !named.contains_key(node)).count();
                }
            }
        }
    }
    assert!(right > 1000 && wrong * 1000 <= right, "{right} foreseen, {wrong} not or wrongly");
}

/// Pages come late. The cut may lag behind, but not after a rest, and nothing that was refused is forgotten.
#[test]
fn pages_that_come_late_are_waited_for_and_counted() {
    for (needing, missing) in [(0, 10), (0, 60), (20, 10), (20, 60)] {
        let paging = Paging { missing, latency: 4 };
        for (seed, graph) in shapes(needing) {
            for mut walker in Walker::all(&graph, Some(paging)) {
                let mut random = seeded(seed + 100);
                let mut views = vec![random_view(&mut random)];
                let (mut lagging, mut misses) = (0, 0);
                for round in 0..25 {
                    let what =
                        format!("{needing} % needing, {missing} % missing, seed {seed}, round {round}");
                    for _ in 0..12 {
                        step(&mut views, &mut random);
                        let report = walker.engine.advance(&views).unwrap();
                        walker.engine.assert_well_formed();
                        walker.assert_valid(&what);
                        let refused = walker.log.borrow().refused.len() as u64;
                        let name = walker.strategy.name();
                        assert_eq!(report.misses, refused, "{name}, {what}: misses, each node once a frame");
                        lagging += u64::from(walker.wrong(&views) != (vec![], vec![]));
                        misses += report.misses;
                    }
                    let mut rest = 0;
                    while walker.wrong(&views) != (vec![], vec![]) {
                        assert!(rest < 400, "{:?}, {what}: {:?}", walker.strategy, walker.wrong(&views));
                        misses += walker.engine.advance(&views).unwrap().misses;
                        rest += 1;
                    }
                    // Nothing is left to do, and nothing is asked for any more.
                    for _ in 0..3 {
                        let report = walker.engine.advance(&views).unwrap();
                        walker.engine.assert_well_formed();
                        // A fold that waits for its page is counted until that comes, although something needs the node by
                        // now: only the backend knows of that.
                        let needed = walker.needed_meanwhile();
                        assert_eq!((report.misses, report.unfolds, report.folds), (needed, 0, 0), "{what}");
                        misses += report.misses;
                    }
                }
                let log = walker.log.borrow();
                assert_eq!(misses, log.refusals);
                assert!(needing > 0 || log.in_vain == 0, "what is under way is not asked for again");
                assert!(lagging > 10 || missing < 50, "the store was never late");
            }
        }
    }
}

/// A store that fails leaves a valid front, and if it recovers, the front goes on to where it should be.
fn assert_recovers(call: Call, needing: usize) {
    let mut failures = 0;
    for (seed, graph) in shapes(needing) {
        for mut walker in Walker::all(&graph, None) {
            let mut random = seeded(seed + 100);
            let mut views = vec![random_view(&mut random)];
            for frame in 0..200 {
                let what = format!("{call:?}, seed {seed}, frame {frame}");
                step(&mut views, &mut random);
                if random.random_ratio(1, 3) {
                    walker.log.borrow_mut().fail = Some((call, random.random_range(0..4)));
                }
                if walker.engine.advance(&views).is_err() {
                    failures += 1;
                    walker.assert_valid(&what);
                    // The same views again, or others.
                    if random.random() {
                        step(&mut views, &mut random);
                    }
                    walker.log.borrow_mut().fail = None;
                    walker.engine.advance(&views).unwrap();
                }
                walker.assert_valid(&what);
                let name = walker.strategy.name();
                assert_eq!(
                    walker.wrong(&views),
                    (vec![], vec![]),
                    "{name}, {what}: wrongly folded, unfolded"
                );
            }
        }
    }
    assert!(failures > 100, "the store failed {failures} times only");
}

#[test]
fn a_store_that_fails_at_the_start_of_a_frame_costs_nothing_but_time() {
    assert_recovers(Call::Begin, 0);
}

#[test]
fn a_store_that_fails_at_a_change_costs_nothing_but_time() {
    assert_recovers(Call::Change, 0);
}

#[test]
fn a_store_that_fails_at_the_end_of_a_frame_costs_nothing_but_time() {
    assert_recovers(Call::End, 0);
}
