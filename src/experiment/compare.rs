//! The experiment runner: one hierarchy, in whatever backend, one path, every strategy.
//!
//! Replays are *settled* by default: a backend that pages is waited for within each change, so that cuts can be compared
//! frame by frame; what remains is what it can not do in the memory that it has. In real time the clock runs instead, and
//! a page that has not come is a miss: on virtual time with a simulated store, so that a replay can be repeated, or by the
//! wall clock with the store that is there. See [`Pace`]. A viewer waits for the first frame, so that is settled too.
//! How pages are loaded ([`Loading`]) is a matter of its own: with [`Loading::Blocking`] changes wait in real time as well, the
//! clock runs on while they do, and the path does not.
//!
//! `stall_ns` is what changes have waited for the store. On virtual time only `blocking` waits, and it is virtual time, the
//! same in every replay. In a settled replay all wait, whatever the way to load: it is the real time that reading took, a part of
//! `select_ns`.
//!
//! Each strategy replays the path alone, from the base mesh on, with the displayed mesh kept as a renderer would;
//! nothing else runs between its frames, and the first frame, which unfolds the whole cut, counts like any other.
//! What checking costs would disturb the caches that are being measured, so the oracle is consulted in a second
//! replay.

mod any;
pub mod csv;
mod error;
mod loading;
mod opening;
mod options;
mod replay;
mod run;
mod scene;

use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::{Arc, mpsc};

use collapse_log::{CollapseLog, Mesh};
use detail_block::XfmTree;
use in_memory::{InMemoryHierarchy, InMemoryTree};
use meta_node::MetaNodeTree;
use mt_partition::MtTree;
use vertex_tree::{NullSink, Refine, TreeError};

pub use self::any::replay_any;
pub use self::error::{CompareError, WrongCut};
pub use self::loading::Loading;
use self::opening::Opening;
pub use self::options::{Options, Pace, Paging};
pub use self::replay::Named;
use self::replay::Replay;
use self::run::Check;
pub use self::run::{Row, Run};
pub use self::scene::replay_scene;
use crate::experiment::path::Path;
use crate::experiment::store::{AnyTree, Backend, Store, StoreError, TreeSettings};
use construction::progress::Progress;
use selection::active_mesh::ActiveMesh;
use selection::engine::{Engine, Settings};
use selection::refine::Strategy;
use selection::settled::Settled;
use selection::view::View;
use testing::brute_force::{BruteForce, unfold_all, unfold_what_can_be};
use testing::oracle::Oracle;

/// A hierarchy with what is needed to replay paths through it.
pub struct Subject {
    name: String,
    store: Store,
    /// What cuts are checked with, once that is asked for.
    check: Option<Check>,
}

/// Changes that [`Subject::outline`] makes: enough to tell how large a mesh is and whether it is flat, and few enough for the
/// memory of any page file.
pub const OUTLINE: usize = 1 << 12;

/// Calls a generic function with a way to open trees of the subject's backend.
macro_rules! with_trees {
    ($subject:expr, |$open:ident| $body:expr) => {{
        let subject: &Subject = $subject;
        match &subject.store {
            Store::InMemory(hierarchy, _) => {
                let $open = |opening: Opening| Ok(opening.wrap(InMemoryTree::new(hierarchy.clone())));
                $body
            }
            Store::MetaNode(file) => {
                let $open = |opening: Opening| {
                    let tree = MetaNodeTree::new(file.clone(), opening.meta_node());
                    tree.map(|tree| opening.wrap(tree)).map_err(|e| subject.store_error(e.into()))
                };
                $body
            }
            Store::DetailBlock(file) => {
                let $open = |opening: Opening| {
                    let tree = XfmTree::new(file.clone(), opening.detail_block());
                    tree.map(|tree| opening.wrap(tree)).map_err(|e| subject.store_error(e.into()))
                };
                $body
            }
            Store::MtPartition(file) => {
                let $open = |opening: Opening| {
                    let tree = MtTree::new(file.clone(), opening.mt_partition());
                    tree.map(|tree| opening.wrap(tree)).map_err(|e| subject.store_error(e.into()))
                };
                $body
            }
        }
    }};
}

impl Subject {
    /// Arranges a log for replays with the in-memory tree.
    ///
    /// # Errors
    /// [`CompareError::Log`].
    pub fn new(name: &str, log: &CollapseLog) -> Result<Self, CompareError> {
        let wrap = |source| CompareError::Log { scene: name.to_owned(), source };
        let hierarchy = Arc::new(InMemoryHierarchy::new(log).map_err(wrap)?);
        let check = Some(Check::Log(Oracle::new(log).map_err(wrap)?));
        Ok(Self { name: name.to_owned(), store: Store::InMemory(hierarchy, Arc::new(log.clone())), check })
    }

    /// Replays through what has been opened.
    #[must_use]
    pub fn of_store(name: &str, store: Store) -> Self {
        Self { name: name.to_owned(), store, check: None }
    }

    /// What it is called.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Triangles of the input.
    #[must_use]
    pub fn triangles(&self) -> u64 {
        self.store.triangles()
    }

    /// Where the hierarchy is kept.
    #[must_use]
    pub fn backend(&self) -> Backend {
        self.store.backend()
    }

    fn store_error(&self, source: StoreError) -> CompareError {
        CompareError::Store { scene: self.name.clone(), source }
    }

    fn tree_error(&self, source: TreeError) -> CompareError {
        CompareError::Tree { scene: self.name.clone(), source }
    }

    /// The displayed mesh of one frame.
    ///
    /// # Errors
    /// A fault that keeps a node back is one: what is damaged is not displayed without a word.
    /// [`CompareError::View`], [`CompareError::Store`], [`CompareError::Tree`].
    pub fn frame(&self, path: &Path, frame: usize, options: &Options) -> Result<Mesh, CompareError> {
        let strategy = Strategy::TopDown;
        let Options { criterion, normal_cone, .. } = *options;
        let settings = Settings { strategy, criterion, normal_cone, ..Settings::default() };
        let view = options.view(path, frame)?;
        let tree = self.tree(&Opening { paging: options.paging, ..Opening::SETTLED })?;
        let mut engine = Engine::new(tree, ActiveMesh::new(), settings).map_err(|e| self.tree_error(e))?;
        let report = engine.advance(&[view]).map_err(|e| self.tree_error(e))?;
        if report.misses > 0
            && let Some(fault) = engine.take_fault()
        {
            return Err(self.tree_error(fault));
        }
        Ok(self.placed(engine.sink()))
    }

    /// Bytes of the hierarchy that the cut of a frame takes in memory, on the way straight from the base mesh to it. The
    /// largest of some frames.
    ///
    /// # Errors
    /// [`CompareError::View`], [`CompareError::Store`], [`CompareError::Tree`].
    pub fn needs(&self, path: &Path, frames: &[usize], options: &Options) -> Result<u64, CompareError> {
        let settings =
            Settings { strategy: Strategy::TopDown, criterion: options.criterion, ..Settings::default() };
        let mut most = 0;
        for &frame in frames {
            let view = options.view(path, frame)?;
            with_trees!(self, |open| {
                let tree = open(Opening { paging: options.paging, ..Opening::SETTLED })?;
                let mut engine = Engine::new(tree, NullSink, settings).map_err(|e| self.tree_error(e))?;
                let report = engine.advance(&[view]).map_err(|e| self.tree_error(e))?;
                most = most.max(report.pages.resident_bytes);
            });
        }
        Ok(most)
    }

    /// The mesh with everything unfolded: the input, as the backend gives it back.
    ///
    /// # Errors
    /// [`CompareError::Store`], [`CompareError::Tree`].
    pub fn finest(&self) -> Result<Mesh, CompareError> {
        self.unfolded(Paging::UNLIMITED, |tree, mesh| {
            unfold_all(tree, mesh, |_, _| ControlFlow::Continue(()))
        })
    }

    /// What the mesh is like as a whole: [`finest`](Self::finest), but for what a fault keeps back or memory has no room for, and
    /// unless that takes more than [`OUTLINE`] changes.
    ///
    /// # Errors
    /// [`CompareError::Store`], [`CompareError::Tree`].
    pub fn outline(&self, paging: Paging) -> Result<Mesh, CompareError> {
        let mut left = OUTLINE;
        let count = |_: &_, _| {
            left -= 1;
            if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        self.unfolded(paging, |tree, mesh| unfold_what_can_be(tree, mesh, count).map(|_| ()))
    }

    /// The mesh with those nodes unfolded that `unfold` unfolds.
    fn unfolded(
        &self,
        paging: Paging,
        unfold: impl FnOnce(&mut Settled<AnyTree>, &mut ActiveMesh) -> Result<(), TreeError>,
    ) -> Result<Mesh, CompareError> {
        if let Store::InMemory(_, log) = &self.store {
            return Ok(log.mesh.clone());
        }
        let mut mesh = ActiveMesh::new();
        let mut tree = self.tree(&Opening { paging, ..Opening::SETTLED })?;
        tree.start(&mut mesh).map_err(|e| self.tree_error(e))?;
        unfold(&mut tree, &mut mesh).map_err(|e| self.tree_error(e))?;
        Ok(self.placed(&mesh))
    }

    /// A copy of the displayed mesh at its place in the world.
    fn placed(&self, displayed: &ActiveMesh) -> Mesh {
        let (positions, triangles) = displayed.gathered();
        Mesh { positions, triangles, georeference: self.store.georeference() }
    }

    fn new_check(&self) -> Result<Check, CompareError> {
        if let Store::InMemory(_, log) = &self.store {
            let oracle = Oracle::new(log);
            return oracle
                .map(Check::Log)
                .map_err(|source| CompareError::Log { scene: self.name.clone(), source });
        }
        let mut tree = self.tree(&Opening::SETTLED)?;
        tree.start(&mut NullSink).map_err(|e| self.tree_error(e))?;
        BruteForce::new(&mut tree).map(Check::Nodes).map_err(|e| self.tree_error(e))
    }

    /// A tree for what is not timed.
    fn tree(&self, opening: &Opening) -> Result<Settled<AnyTree>, CompareError> {
        let settings = TreeSettings {
            meta_node: opening.meta_node(),
            detail_block: opening.detail_block(),
            mt_partition: opening.mt_partition(),
        };
        let tree = self.store.tree(&settings).map_err(|error| self.store_error(error))?;
        Ok(opening.wrap(tree))
    }

    /// Replays `frames` of a path with every strategy and every way to load of the options. `progress` counts frames. If that is
    /// [stopped](Options::stop), the runs are those that were finished.
    ///
    /// # Errors
    /// [`CompareError::NotPrinted`] before anything is done,
    /// [`CompareError::View`], [`CompareError::Store`], [`CompareError::Tree`], and [`CompareError::Wrong`] or [`CompareError::Differs`] where the
    /// options ask for a check.
    pub fn replay(
        &mut self,
        path: &Path,
        frames: Range<usize>,
        options: &Options,
        progress: Progress,
    ) -> Result<Vec<Run>, CompareError> {
        let backend = self.backend();
        if let Some(&prefetch) = options.prefetch.iter().find(|prefetch| !prefetch.is_for(backend)) {
            return Err(CompareError::NotPrinted { scene: self.name.clone(), prefetch, backend });
        }
        let mut check = self.check.take();
        if check.is_none() && options.check {
            check = Some(self.new_check()?);
        }
        let is_checked = |s: Strategy| options.check || !s.is_exact();
        let speed = options.declared_speed(path);
        let views: Vec<View> =
            frames.clone().map(|frame| options.view(path, frame)).collect::<Result<_, _>>()?;
        // Without pages there is nothing to fetch.
        let prefetch = if backend == Backend::InMemory { &[Loading::None][..] } else { &options.prefetch };
        let replays = options.strategies.iter().map(|&s| 1 + usize::from(is_checked(s))).sum::<usize>();
        let total = (prefetch.len() * replays * views.len()) as u64;
        let mut done = 0;
        let mut count = || {
            done += 1;
            progress(done, total);
        };

        let named = Named {
            scene: &self.name,
            backend: backend.name(),
            has_dependencies: backend.has_dependencies(options.paging.dependencies),
        };
        let mut runs: Vec<Run> = Vec::new();
        // Those that are yet to be compared with an exact strategy.
        let mut uncompared = Vec::new();
        'replays: for &prefetch in prefetch {
            let opening = Opening { paging: options.paging, prefetch, pace: options.pace };
            for &strategy in &options.strategies {
                let settings = options.settings(strategy, &speed);
                let frames = frames.clone();
                let replay =
                    Replay { named, path, frames, views: &views, settings, opening, stop: options.stop };
                let mut measure = || {
                    with_trees!(self, |open| {
                        let mut measured = replay.measure(open(opening)?, &mut count)?;
                        if let Some(check) = check.as_mut().filter(|_| is_checked(strategy)) {
                            replay.check(open(opening)?, check, &mut measured.rows, &mut count)?;
                        }
                        Ok(measured)
                    })
                };
                let measured = match measure() {
                    Err(CompareError::Interrupted) => break 'replays,
                    measured => measured?,
                };
                runs.push(replay.run_of(prefetch, speed, measured));
                if is_checked(strategy) && check.is_none() {
                    uncompared.push((runs.len() - 1, replay));
                }
            }
        }
        let places: Vec<usize> = uncompared.iter().map(|&(at, _)| at).collect();
        match self.compare(uncompared, &mut count) {
            Ok(all) => {
                for (at, wrong) in all {
                    runs[at].rows.iter_mut().zip(wrong).for_each(|(row, wrong)| row.wrong = Some(wrong));
                }
            }
            // What has not been compared is not finished.
            Err(CompareError::Interrupted) => {
                places.iter().rev().for_each(|&at| drop(runs.remove(at)));
            }
            Err(error) => return Err(error),
        }
        self.check = check;
        Ok(runs)
    }

    /// For each replay, how many nodes differ from the cut of an exact strategy that waits for its pages, in every frame.
    /// Nothing is timed here: on virtual time, or settled, several are made at once.
    fn compare(
        &self,
        replays: Vec<(usize, Replay)>,
        count: &mut impl FnMut(),
    ) -> Result<Vec<(usize, Vec<u64>)>, CompareError> {
        let (tick, ticks) = mpsc::channel();
        let each = move |(at, replay): (usize, Replay)| {
            // Whoever counts is there until all are done: that is, until this closure is dropped.
            let mut count = || {
                let _ = tick.send(());
            };
            let wrong = with_trees!(self, |open| {
                let beside = open(Opening { paging: replay.opening.paging, ..Opening::SETTLED })?;
                replay.compare(open(replay.opening)?, beside, &mut count)?
            });
            Ok((at, wrong))
        };
        let is_timed = replays.iter().any(|(_, replay)| matches!(replay.opening.pace, Pace::WallClock(_)));
        std::thread::scope(|scope| {
            let all = scope.spawn(move || match is_timed {
                true => replays.into_iter().map(each).collect(),
                false => replays.into_par_iter().map(each).collect::<Vec<_>>().into_iter().collect(),
            });
            ticks.iter().for_each(|()| count());
            all.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }
}
