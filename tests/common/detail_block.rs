//! Trees of detail blocks for the tests: their files, their brute-force cut, and how they follow a walk.
//!
//! Their bounds and, where the input is not manifold, their collapses are not those of the log they are built from, so
//! they have a log and an oracle of their own.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use detail_block::{Arrangement, BuildOptions, Io, XfmFile, XfmTree};
use foldfront::CollapseLog;
use foldfront::page_store::source::MemorySource;
use foldfront::selection::budget::Budget;
use foldfront::selection::engine::{Engine, FrameReport, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{Hierarchy, NONE, NullSink};

use super::backends::Follower;

/// Options with these values, and the rest as usual.
pub fn options(quantize: bool, nest_needs: bool) -> BuildOptions {
    BuildOptions { quantize, nest_needs, ..BuildOptions::default() }
}

/// Settings of a tree that reads in this way, without quotas.
pub fn reading(io: Io) -> detail_block::Settings {
    detail_block::Settings { io, ..detail_block::Settings::default() }
}

/// The file that an arrangement makes.
pub fn file(arrangement: &Arrangement) -> Arc<XfmFile> {
    let mut bytes = Vec::new();
    arrangement.write_to(&mut bytes).unwrap();
    Arc::new(XfmFile::open(Arc::new(MemorySource::new("memory", bytes))).unwrap())
}

/// The brute-force cut of a tree's own log.
pub struct OwnCut {
    pub oracle: Oracle,
    /// For each node, how many triangles are there only while it is active.
    brought: Vec<u64>,
    base: u64,
    /// For which views it was found last.
    found: Option<(Vec<View>, (u64, u64, u64))>,
}

impl OwnCut {
    pub fn new(log: &CollapseLog) -> Self {
        let forest = log.forest().unwrap();
        let mut lowest = vec![NONE; log.mesh.positions.len()];
        for (n, c) in (0..).zip(&log.collapses) {
            for v in [c.removed, c.kept] {
                if lowest[v as usize] == NONE {
                    lowest[v as usize] = n;
                }
            }
        }
        let parent = |n: u32| if n == NONE { NONE } else { forest.parent[n as usize] };
        // Two corners become one at the first node that is above both: parents have larger numbers.
        let meet = |a: u32, b: u32| {
            let (mut a, mut b) = (lowest[a as usize], lowest[b as usize]);
            while a != b {
                if a < b { a = parent(a) } else { b = parent(b) }
            }
            a
        };
        let mut brought = vec![0; log.collapses.len()];
        let mut base = 0;
        for &[a, b, c] in log.mesh.triangles.iter().filter(|&&[a, b, c]| a != b && b != c && c != a) {
            match meet(a, b).min(meet(b, c)).min(meet(c, a)) {
                NONE => base += 1,
                n => brought[n as usize] += 1,
            }
        }
        Self { oracle: Oracle::new(log).unwrap(), brought, base, found: None }
    }

    /// Hash, nodes and triangles.
    pub fn find(&mut self, settings: &Settings, views: &[View]) -> (u64, u64, u64) {
        if let Some((seen, found)) = &self.found
            && seen == views
        {
            return *found;
        }
        let active = self.oracle.cut(settings.criterion, views);
        let brought = active.iter().zip(&self.brought).filter(|&(&active, _)| active).map(|(_, n)| n);
        let triangles = self.base + brought.sum::<u64>();
        let found = (self.oracle.cut_hash(), self.oracle.active_nodes() as u64, triangles);
        self.found = Some((views.to_vec(), found));
        found
    }
}

struct Own {
    engine: Engine<XfmTree, NullSink>,
    cut: Rc<RefCell<OwnCut>>,
}

/// Trees over one file, one for each of the settings.
pub fn follow(
    log: &CollapseLog,
    settings: &[Settings],
    quantize: bool,
    normal_cone: bool,
) -> Vec<Box<dyn Follower>> {
    let arrangement = Arrangement::new(log, &options(quantize, true)).unwrap();
    let file = file(&arrangement);
    let mut cut = OwnCut::new(&arrangement.effective_log());
    if normal_cone {
        cut.oracle = cut.oracle.with_cones(arrangement.cones());
    }
    let cut = Rc::new(RefCell::new(cut));
    let how = reading(if quantize { Io::Background } else { Io::Blocking });
    let own = |&settings: &Settings| Own {
        engine: Engine::new(
            XfmTree::new(file.clone(), how).unwrap(),
            NullSink,
            Settings { normal_cone, ..settings },
        )
        .unwrap(),
        cut: cut.clone(),
    };
    settings.iter().map(|settings| Box::new(own(settings)) as Box<dyn Follower>).collect()
}

/// Advances until nothing is missing: each time, what has been asked for is waited for.
pub fn advance_settled<M: foldfront::vertex_tree::MeshSink>(
    engine: &mut Engine<XfmTree, M>,
    views: &[View],
) -> FrameReport {
    let (mut unfolds, mut folds) = (0, 0);
    for _ in 0..1000 {
        let report = engine.advance(views).unwrap();
        (unfolds, folds) = (unfolds + report.unfolds, folds + report.folds);
        if report.misses == 0 {
            return FrameReport { unfolds, folds, ..report };
        }
        engine.tree_mut().settle().unwrap();
    }
    panic!("something is missing that never comes");
}

impl Follower for Own {
    fn advance(&mut self, views: &[View]) -> FrameReport {
        advance_settled(&mut self.engine, views)
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
        format!("{:?}", self.cut.borrow_mut().oracle.compare(&self.engine))
    }

    fn own_cut(&mut self) -> Option<(u64, u64, u64)> {
        Some(self.cut.borrow_mut().find(self.engine.settings(), self.engine.views()))
    }
}
