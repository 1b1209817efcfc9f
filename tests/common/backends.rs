//! Every backend with every exact strategy, and what each of them must do: follow the brute-force cut.
//!
//! A new backend adds a line to [`BACKENDS`]; one whose nodes are not the collapses of the log, nor patches of them, is
//! compared with the brute-force cut of its own nodes.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use foldfront::CollapseLog;
use foldfront::page_store::source::MemorySource;
use foldfront::selection::budget::Budget;
use foldfront::selection::engine::{Engine, FrameReport, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::brute_force::BruteForce;
use foldfront::testing::cut::Displayed;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{Hierarchy, NullSink, Prefetch, Refine};
use in_memory::{InMemoryHierarchy, InMemoryTree};
use meta_node::{MetaNodeFile, MetaNodeTree};
use mt_partition::{BuildOptions, MtTree};

use super::graph_cut::{self, GraphCut};
use super::quadtree::PointTree;
use foldfront::selection::settled::Settled;

use super::detail_block as detail;

/// Opens a hierarchy once for each of the settings.
type Open = fn(&CollapseLog, &[Settings]) -> Vec<Box<dyn Follower>>;

/// The backends and how to open them.
const BACKENDS: [(&str, Open); 7] = [
    ("in-memory", |log, settings| {
        let hierarchy = Arc::new(InMemoryHierarchy::new(log).unwrap());
        follow(settings, || InMemoryTree::new(hierarchy.clone()))
    }),
    ("meta-node", |log, settings| {
        // With memory for everything, all of it there from the first frame on: every frame is settled. What paging does
        // to the cut is in `tests/backends/meta_node`.
        let file = meta_node_file(log, &meta_node::BuildOptions::default());
        follow(settings, || {
            let mut tree = MetaNodeTree::new(file.clone(), meta_node::Settings::default()).unwrap();
            tree.load_all();
            tree.settle().unwrap();
            tree
        })
    }),
    // The multi-triangulation as it is, whose nodes are the collapses, and reduced, where they are groups of them.
    ("mt-partition unreduced", |log, settings| {
        let file = graph_cut::file(log, &BuildOptions { patch: 0.0, ..BuildOptions::default() });
        follow(settings, || {
            Settled::new(MtTree::new(file.clone(), mt_partition::Settings::default()).unwrap())
        })
    }),
    ("mt-partition", |log, settings| {
        let file = graph_cut::file(log, &BuildOptions::default());
        let tree = || Settled::new(MtTree::new(file.clone(), mt_partition::Settings::default()).unwrap());
        let engine = |&settings: &Settings| Engine::new(tree(), NullSink, settings).unwrap();
        let cut = Rc::new(RefCell::new(GraphCut::new(&file)));
        let own = |settings| Own { engine: engine(settings), cut: cut.clone() };
        settings.iter().map(|settings| Box::new(own(settings)) as Box<dyn Follower>).collect()
    }),
    // As in the paper, where frames wait for blocks; and quantised, by an I/O thread that is waited for, with the
    // normal-cone test.
    ("detail-block", |log, settings| detail::follow(log, settings, false, false)),
    ("detail-block quantised, normal cone", |log, settings| detail::follow(log, settings, true, true)),
    // No mesh: the points of one, and refinement that adds.
    ("points", |log, settings| follow_own(settings, || PointTree::new(&log.mesh.positions))),
];

/// Every exact strategy with every way to fetch ahead.
pub fn combinations() -> impl Iterator<Item = (Strategy, Prefetch)> {
    let exact = Strategy::ALL.into_iter().filter(|strategy| strategy.is_exact());
    exact.flat_map(|strategy| Prefetch::ALL.map(|prefetch| (strategy, prefetch)))
}

/// The hierarchy as a file of meta-nodes, kept in memory.
pub fn meta_node_file(log: &CollapseLog, options: &meta_node::BuildOptions) -> Arc<MetaNodeFile> {
    Arc::new(
        MetaNodeFile::open(Arc::new(MemorySource::new("memory", meta_node_bytes(log, options)))).unwrap(),
    )
}

/// The bytes of a file of meta-nodes.
pub fn meta_node_bytes(log: &CollapseLog, options: &meta_node::BuildOptions) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree");
    meta_node::write(&path, log, options).unwrap();
    std::fs::read(path).unwrap()
}

fn follow<T: Refine<NullSink> + 'static>(
    settings: &[Settings],
    tree: impl Fn() -> T,
) -> Vec<Box<dyn Follower>> {
    let engine = |&settings: &Settings| Engine::new(tree(), NullSink, settings).unwrap();
    settings.iter().map(|settings| Box::new(engine(settings)) as Box<dyn Follower>).collect()
}

/// An engine, whatever its backend.
pub trait Follower {
    fn advance(&mut self, views: &[View]) -> FrameReport;
    fn assert_well_formed(&self);
    fn set_budget(&mut self, budget: Budget);
    fn strategy(&self) -> Strategy;
    /// The views of the last frame, as the budget made them.
    fn views(&self) -> &[View];
    /// How the front differs from the oracle's cut for the same views, in words.
    fn difference(&self, oracle: &mut Oracle) -> String;
    /// Hash, size and triangles of the cut that it should have by brute force, where it has nodes of its own.
    fn own_cut(&mut self) -> Option<(u64, u64, u64)> {
        None
    }
}

impl<T: Refine<NullSink>> Follower for Engine<T, NullSink> {
    fn advance(&mut self, views: &[View]) -> FrameReport {
        self.advance(views).unwrap()
    }

    fn assert_well_formed(&self) {
        self.assert_well_formed();
    }

    fn set_budget(&mut self, budget: Budget) {
        self.set_budget(budget);
    }

    fn strategy(&self) -> Strategy {
        self.settings().strategy
    }

    fn views(&self) -> &[View] {
        self.views()
    }

    fn difference(&self, oracle: &mut Oracle) -> String {
        format!("{:?}", oracle.compare(self))
    }
}

/// Engines over a hierarchy of its own, and its brute-force cut.
fn follow_own<T: Refine<NullSink> + 'static>(
    settings: &[Settings],
    tree: impl Fn() -> T,
) -> Vec<Box<dyn Follower>> {
    let mut whole = tree();
    whole.start(&mut NullSink).unwrap();
    let cut = Rc::new(RefCell::new(BruteForce::new(&mut whole).unwrap()));
    let engine = |&settings: &Settings| Engine::new(tree(), NullSink, settings).unwrap();
    let own = |settings| Own { engine: engine(settings), cut: cut.clone() };
    settings.iter().map(|settings| Box::new(own(settings)) as Box<dyn Follower>).collect()
}

/// The brute-force cut of a backend whose nodes are not the collapses of the log.
trait OwnCut<T> {
    /// Hash, size and what is displayed of the cut for an engine's views.
    fn cut(&mut self, engine: &Engine<T, NullSink>) -> (u64, u64, u64);
    /// How the front differs from it, in words.
    fn difference(&mut self, engine: &Engine<T, NullSink>) -> String;
}

impl<T: Refine<NullSink>> OwnCut<T> for GraphCut {
    fn cut(&mut self, engine: &Engine<T, NullSink>) -> (u64, u64, u64) {
        self.find(engine.settings().criterion, engine.views())
    }

    fn difference(&mut self, engine: &Engine<T, NullSink>) -> String {
        self.find(engine.settings().criterion, engine.views());
        format!("{:?}", GraphCut::difference(self, engine))
    }
}

impl<T: Refine<NullSink>> OwnCut<T> for BruteForce {
    fn cut(&mut self, engine: &Engine<T, NullSink>) -> (u64, u64, u64) {
        let cut = BruteForce::cut(self, engine.settings(), engine.views());
        (cut.hash, cut.nodes, cut.displayed)
    }

    fn difference(&mut self, engine: &Engine<T, NullSink>) -> String {
        match self.wrong(engine) {
            0 => "None".to_owned(),
            wrong => format!("{wrong} nodes are wrong"),
        }
    }
}

/// An engine over such a backend.
struct Own<T, C> {
    engine: Engine<T, NullSink>,
    /// Shared with the other strategies: it is found once for all of them.
    cut: Rc<RefCell<C>>,
}

impl<T: Refine<NullSink>, C: OwnCut<T>> Follower for Own<T, C> {
    fn advance(&mut self, views: &[View]) -> FrameReport {
        self.engine.advance(views).unwrap()
    }

    fn assert_well_formed(&self) {
        self.engine.assert_well_formed();
    }

    fn set_budget(&mut self, budget: Budget) {
        self.engine.set_budget(budget);
    }

    fn strategy(&self) -> Strategy {
        self.engine.settings().strategy
    }

    fn views(&self) -> &[View] {
        self.engine.views()
    }

    fn difference(&self, _: &mut Oracle) -> String {
        self.cut.borrow_mut().difference(&self.engine)
    }

    fn own_cut(&mut self) -> Option<(u64, u64, u64)> {
        Some(self.cut.borrow_mut().cut(&self.engine))
    }
}

/// What a walk amounted to, for tests to make sure that it was worth something.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    pub frames: u64,
    /// Unfolds and folds.
    pub changes: u64,
    /// Tests of the criterion that the event queue made.
    pub queue_tests: u64,
    /// Nodes that the oracle tested.
    pub oracle_tests: u64,
    /// The smallest and the largest number of triangles displayed.
    pub triangles: Option<(u64, u64)>,
}

/// All backends with all exact strategies, along one walk through one hierarchy.
pub struct Conformance<'a> {
    log: &'a CollapseLog,
    settings: Settings,
    oracle: Oracle,
    followers: Vec<(&'static str, Box<dyn Follower>)>,
    pub totals: Totals,
}

/// The triangles are counted by brute force once in so many frames.
const COUNT_EVERY: u64 = 251;

/// The state of all engines is checked in so many frames, and then that of each once in so many, in turns: a check takes
/// longer than a frame.
const EVERY_FRAME: u64 = 10;
const CHECK_EVERY: u64 = 29;

impl<'a> Conformance<'a> {
    pub fn new(log: &'a CollapseLog, settings: Settings) -> Self {
        let with = |strategy| Settings { strategy, ..settings };
        let exact = Strategy::COMPARED.into_iter().filter(|strategy| strategy.is_exact()).map(with);
        let exact: Vec<Settings> = exact.collect();
        // The queue alone is a part of the event strategy, and over one backend what it is over all.
        let first = [exact.as_slice(), &[with(Strategy::EventQueue)]].concat();
        let open = |(at, &(name, open)): (usize, &(&'static str, Open))| {
            let settings = if at == 0 { &first } else { &exact };
            open(log, settings).into_iter().map(move |follower| (name, follower))
        };
        Self {
            log,
            settings,
            oracle: Oracle::new(log).unwrap(),
            followers: BACKENDS.iter().enumerate().flat_map(open).collect(),
            totals: Totals::default(),
        }
    }

    /// Goes on with the first backend alone: for walks that are long for the sake of the engine.
    pub fn go_on_with_the_first(&mut self) {
        let first = self.followers[0].0;
        self.followers.retain(|&(backend, _)| backend == first);
    }

    pub fn set_budget(&mut self, budget: Budget) {
        self.followers.iter_mut().for_each(|(_, follower)| follower.set_budget(budget));
    }

    /// Moves all of them to these views. The cut of each must be that of the oracle for what its own budget made of
    /// them: a budget in time steers each its own way.
    #[track_caller]
    pub fn advance_each(&mut self, views: &[View]) {
        for (backend, follower) in &mut self.followers {
            let report = follower.advance(views);
            follower.assert_well_formed();
            let difference = follower.difference(&mut self.oracle);
            let frame = self.totals.frames;
            assert_eq!(difference, "None", "{backend}, {}, frame {frame}", follower.strategy().name());
            self.totals.changes += report.unfolds + report.folds;
        }
        self.totals.frames += 1;
    }

    /// Moves all of them to these views. The cut of each must be that of the oracle, which is asked once for all.
    #[track_caller]
    pub fn advance(&mut self, views: &[View]) {
        let Self { log, settings, oracle, followers, totals } = self;
        let reports: Vec<FrameReport> =
            followers.iter_mut().map(|(_, follower)| follower.advance(views)).collect();
        let turn = (totals.frames % CHECK_EVERY) as usize;
        let checked = if totals.frames < EVERY_FRAME { 0..followers.len() } else { turn..turn + 1 };
        let checked = followers.iter().take(checked.end).skip(checked.start);
        checked.for_each(|(_, follower)| follower.assert_well_formed());
        // A budget in triangles steers all alike.
        oracle.cut(settings.criterion, followers[0].1.views());
        let (hash, nodes) = (oracle.cut_hash(), oracle.active_nodes() as u64);
        let triangles = reports[0].displayed;
        let frame = totals.frames;
        for ((backend, follower), report) in followers.iter_mut().zip(&reports) {
            let (hash, nodes, triangles) = follower.own_cut().unwrap_or((hash, nodes, triangles));
            let name = || format!("{backend}, {}, frame {frame}", follower.strategy().name());
            assert_eq!(report.displayed, triangles, "{}: triangles", name());
            assert_eq!(
                report.misses + report.forced,
                0,
                "{}: nothing is missing here, nothing forced",
                name()
            );
            if (report.cut_hash, report.active_nodes) != (hash, nodes) {
                panic!("{}: {}; views {:?}", name(), follower.difference(oracle), follower.views());
            }
            if follower.strategy() == Strategy::EventQueue {
                totals.queue_tests += report.tests;
            }
        }
        if frame.is_multiple_of(COUNT_EVERY) {
            let expected = Displayed::new(log, oracle.active()).triangles.len() as u64;
            assert_eq!(triangles, expected, "frame {frame}: triangles displayed");
        }
        totals.frames += 1;
        totals.changes += reports[0].unfolds + reports[0].folds;
        totals.oracle_tests += oracle.active().len() as u64;
        let (least, most) = totals.triangles.unwrap_or((triangles, triangles));
        totals.triangles = Some((least.min(triangles), most.max(triangles)));
    }
}
