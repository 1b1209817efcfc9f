//! The experiment runner: one hierarchy, in whatever backend, one path, every strategy.
//!
//! Replays are *settled* by default: a backend that pages is waited for within each change, so that cuts can be compared
//! frame by frame; what remains is what it can not do in the memory that it has. In real time the clock runs instead, and
//! a page that has not come is a miss: on virtual time with a simulated store, so that a replay can be repeated, or by the
//! wall clock with the store that is there. See [`Pace`]. A viewer waits for the first frame, so that is settled too.
//!
//! Each strategy replays the path alone, from the base mesh on, with the displayed mesh kept as a renderer would;
//! nothing else runs between its frames, and the first frame, which unfolds the whole cut, counts like any other.
//! What checking costs would disturb the caches that are being measured, so the oracle is consulted in a second
//! replay.

pub mod csv;
mod replay;
mod scene;

use std::ops::{ControlFlow, Range};
use std::sync::Arc;
use std::time::Duration;

use detail_block::XfmTree;
use in_memory::{Hierarchy, InMemoryTree};
use meta_node::{Dependencies, MetaNodeTree};
use mt_partition::{CacheMode, Memory, MtTree};
use vertex_tree::simulated::Simulated;
use vertex_tree::{CollapseLog, LogError, Mesh, NullSink, Prefetch, TreeError, VertexTree};

use self::replay::Replay;
pub use self::scene::replay_scene;
use crate::active_mesh::ActiveMesh;
use crate::brute_force::{BruteForce, unfold_all};
use crate::budget::{Budget, WorkCap};
use crate::criterion::Criterion;
use crate::engine::{Engine, FrameReport, Settings};
use crate::motion::Speed;
use crate::objects::StoredSceneError;
use crate::oracle::{Difference, Oracle};
use crate::path::Path;
use crate::progress::Progress;
use crate::refine::Strategy;
use crate::settled::Settled;
use crate::store::{Backend, Store, StoreError};
use crate::view::{View, theta_of_pixels};

/// What to replay, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// In this order.
    pub strategies: Vec<Strategy>,
    /// What "coarse" means.
    pub criterion: Criterion,
    /// Whether what is seen from behind stays coarse, see [`Settings::normal_cone`].
    pub normal_cone: bool,
    /// Tolerance as a share of half the image's height.
    pub theta: f64,
    /// What a frame may cost.
    pub budget: Budget,
    /// What a frame may do.
    pub work_cap: WorkCap,
    /// Full speed of the eye, in object units a frame; by default the path's 99th percentile.
    pub rho: Option<f64>,
    /// Full speed of turning, in radians a frame; by default the path's 99th percentile.
    pub omega: Option<f64>,
    /// Compare every frame of every exact strategy with the oracle.
    pub check: bool,
    /// What backends may use.
    pub paging: Paging,
    /// What fetches pages ahead, each in a replay of its own.
    pub prefetch: Vec<Prefetch>,
    /// How time passes.
    pub pace: Pace,
}

/// How time passes in a replay.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Pace {
    /// Each frame waits until it has all that it asks for.
    #[default]
    Settled,
    /// So much virtual time passes from frame to frame, for a simulated store too.
    Simulated(Duration, Simulated),
    /// Frames come so much time after each other, and the store is the real one.
    WallClock(Duration),
}

/// What a backend that pages may use, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Paging {
    /// Bytes of pages in memory that are never exceeded.
    pub page_memory: u64,
    /// For detail blocks: bytes beyond which those are removed that have not been used for long.
    pub soft_quota: u64,
    /// For multi-triangulations: what is read at once, and what is kept.
    pub cache: CacheMode,
    /// For meta-nodes: what is done about neighbours that are too coarse or too fine.
    pub dependencies: Dependencies,
}

impl Paging {
    /// Memory for everything.
    pub const UNLIMITED: Self = Self {
        page_memory: u64::MAX,
        soft_quota: u64::MAX,
        cache: CacheMode::PC,
        dependencies: Dependencies::Off,
    };
}

impl Default for Paging {
    /// [`Paging::UNLIMITED`].
    fn default() -> Self {
        Self::UNLIMITED
    }
}

impl Default for Options {
    /// Every strategy, screen error of 1 pixel at 1080 lines, no budget, speeds of the path, no check.
    fn default() -> Self {
        Self {
            strategies: Strategy::ALL.to_vec(),
            criterion: Criterion::default(),
            normal_cone: false,
            theta: theta_of_pixels(1.0, 1080),
            budget: Budget::None,
            work_cap: WorkCap::None,
            rho: None,
            omega: None,
            check: false,
            paging: Paging::default(),
            prefetch: vec![Prefetch::Paper],
            pace: Pace::Settled,
        }
    }
}

impl Options {
    /// How an engine refines along a path of this declared speed.
    fn settings(&self, strategy: Strategy, speed: &Speed) -> Settings {
        Settings {
            strategy,
            criterion: self.criterion,
            normal_cone: self.normal_cone,
            rho: speed.rho,
            omega: speed.omega,
            budget: self.budget,
            work_cap: self.work_cap,
        }
    }
}

/// One frame of a replay.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Number of the frame in the path.
    pub frame: usize,
    /// What the engine reports.
    pub report: FrameReport,
    /// Nodes that differ from the oracle, where that was looked at.
    pub wrong: Option<u64>,
}

/// One strategy along one path.
#[derive(Clone, Debug)]
pub struct Run {
    /// What was looked at.
    pub scene: String,
    /// Name of the path.
    pub path: String,
    /// Where the hierarchy was kept.
    pub backend: &'static str,
    /// How the nodes that must change were found.
    pub strategy: Strategy,
    /// What fetched pages ahead.
    pub prefetch: Prefetch,
    /// Declared speed.
    pub speed: Speed,
    /// The frames.
    pub rows: Vec<Row>,
}

/// A comparison stopped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// The hierarchy is damaged.
    #[error("{scene}: {source}")]
    Log {
        /// What was looked at.
        scene: String,
        /// What does not fit.
        source: LogError,
    },
    /// A tree can not be opened.
    #[error("{scene}: {source}")]
    Store {
        /// What was looked at.
        scene: String,
        /// Why.
        source: StoreError,
    },
    /// A strategy's cut is not that of brute force over the backend's own nodes.
    #[error(
        "{scene}, path {path}, frame {frame}: {strategy} over {backend} differs from brute force in {wrong} nodes"
    )]
    Differs {
        /// What was looked at.
        scene: String,
        /// The path.
        path: String,
        /// Number of the frame in the path.
        frame: usize,
        /// The strategy.
        strategy: &'static str,
        /// The backend.
        backend: &'static str,
        /// How many nodes.
        wrong: u64,
    },
    /// The backend can not go on.
    #[error("{scene}: {source}")]
    Tree {
        /// What was looked at.
        scene: String,
        /// Why.
        source: TreeError,
    },
    /// A scene of several objects can not be opened, or one of its trees can not go on.
    #[error("{scene}: {source}")]
    Objects {
        /// The scene.
        scene: String,
        /// Why.
        source: StoredSceneError,
    },
    /// Two strategies have different cuts of a scene of several objects.
    #[error("{scene}, path {path}, frame {frame}: {} and {} have different cuts", strategies[0], strategies[1])]
    Disagree {
        /// The scene.
        scene: String,
        /// The path.
        path: String,
        /// Number of the frame in the path.
        frame: usize,
        /// The strategies.
        strategies: [&'static str; 2],
    },
    /// A strategy's cut is not the oracle's.
    #[error("{0}")]
    Wrong(Box<WrongCut>),
}

/// The first node found to differ from the oracle, and where it stands in the first view.
#[derive(Debug)]
pub struct WrongCut {
    scene: String,
    path: String,
    frame: usize,
    strategy: Strategy,
    difference: Difference,
    views: Vec<View>,
    criterion: Criterion,
}

impl std::fmt::Display for WrongCut {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Difference { node, bounds, active, count } = self.difference;
        let status = |active| if active { "unfolded" } else { "folded" };
        write!(
            f,
            "{}, path {}, frame {}: {} has node {node} {}, the oracle {}; {count} nodes differ; sphere at {:?}, radius \
             {}, eps {}",
            self.scene,
            self.path,
            self.frame,
            self.strategy.name(),
            status(!active),
            status(active),
            bounds.center,
            bounds.radius,
            bounds.eps,
        )?;
        for view in &self.views {
            let distance = view.eye.distance(glam::DVec3::from(bounds.center.map(f64::from)));
            let reach = self.criterion.reach_distance(&bounds, view.k);
            let unfold = self.criterion.unfold_for(view, &bounds);
            write!(f, "; at distance {distance}, coarse within {reach}, wanted: {unfold}")?;
        }
        Ok(())
    }
}

/// A hierarchy with what is needed to replay paths through it.
pub struct Subject {
    name: String,
    store: Store,
    /// What cuts are checked with, once that is asked for.
    check: Option<Check>,
}

/// Changes that [`Subject::outline`] makes: enough to tell how large a mesh is and whether it is flat.
pub const OUTLINE: usize = 1 << 18;

/// Brute force, over the collapse log or over a backend's own nodes.
enum Check {
    Log(Oracle),
    Nodes(BruteForce),
}

/// How trees are opened.
#[derive(Clone, Copy)]
struct Opening {
    paging: Paging,
    prefetch: Prefetch,
    pace: Pace,
}

impl Opening {
    /// With memory for everything, and time.
    const SETTLED: Self = Self { paging: Paging::UNLIMITED, prefetch: Prefetch::None, pace: Pace::Settled };

    fn simulated(&self) -> Option<Simulated> {
        match self.pace {
            Pace::Simulated(_, store) => Some(store),
            Pace::Settled | Pace::WallClock(_) => None,
        }
    }

    fn meta_node(&self) -> meta_node::Settings {
        let Paging { page_memory, dependencies, .. } = self.paging;
        let io = self.simulated().map_or(meta_node::Io::Thread, meta_node::Io::Simulated);
        meta_node::Settings { page_memory, dependencies, prefetch: self.prefetch, io, ..Default::default() }
    }

    fn detail_block(&self) -> detail_block::Settings {
        let Paging { page_memory: hard_quota, soft_quota, .. } = self.paging;
        let soft_quota = soft_quota.min(hard_quota);
        let io = self.simulated().map_or(detail_block::Io::Background, detail_block::Io::Simulated);
        detail_block::Settings { soft_quota, hard_quota, prefetch: self.prefetch, io, ..Default::default() }
    }

    fn mt_partition(&self) -> mt_partition::Settings {
        let Paging { page_memory, cache, .. } = self.paging;
        let reader = self.simulated().map(mt_partition::Reader::simulated);
        mt_partition::Settings { cache, memory: Memory::new(page_memory), reader, prefetch: self.prefetch }
    }

    fn wrap<T: VertexTree>(&self, tree: T) -> Settled<T> {
        match self.pace {
            Pace::Settled => Settled::new(tree),
            Pace::Simulated(..) | Pace::WallClock(_) => Settled::in_real_time(tree),
        }
    }
}

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
        let hierarchy = Arc::new(Hierarchy::new(log).map_err(wrap)?);
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

    /// Whether a node may wait for one that is neither above nor below it.
    fn has_dependencies(&self, paging: &Paging) -> bool {
        match self.backend() {
            Backend::InMemory | Backend::MtPartition => false,
            Backend::MetaNode => paging.dependencies != Dependencies::Off,
            Backend::DetailBlock => true,
        }
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
    /// [`CompareError::Store`], [`CompareError::Tree`].
    pub fn frame(&self, path: &Path, frame: usize, options: &Options) -> Result<Mesh, CompareError> {
        let strategy = Strategy::TopDown;
        let Options { criterion, normal_cone, .. } = *options;
        let settings = Settings { strategy, criterion, normal_cone, ..Settings::default() };
        let view = View::new(&path.camera(frame), options.theta);
        with_trees!(self, |open| {
            let opening = Opening { paging: options.paging, ..Opening::SETTLED };
            let mut engine =
                Engine::new(open(opening)?, ActiveMesh::new(), settings).map_err(|e| self.tree_error(e))?;
            engine.advance(&[view]).map_err(|e| self.tree_error(e))?;
            Ok(engine.mesh().to_mesh())
        })
    }

    /// Bytes of the hierarchy that the cut of a frame takes in memory, on the way straight from the base mesh to it. The
    /// largest of some frames.
    ///
    /// # Errors
    /// [`CompareError::Store`], [`CompareError::Tree`].
    pub fn needs(&self, path: &Path, frames: &[usize], options: &Options) -> Result<u64, CompareError> {
        let settings =
            Settings { strategy: Strategy::TopDown, criterion: options.criterion, ..Settings::default() };
        let mut most = 0;
        for &frame in frames {
            let view = View::new(&path.camera(frame), options.theta);
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
        self.unfolded(usize::MAX)
    }

    /// What the mesh is like as a whole: [`finest`](Self::finest), unless that takes more than [`OUTLINE`] changes.
    ///
    /// # Errors
    /// [`CompareError::Store`], [`CompareError::Tree`].
    pub fn outline(&self) -> Result<Mesh, CompareError> {
        self.unfolded(OUTLINE)
    }

    /// The mesh with so many nodes unfolded, those nearest to the roots.
    fn unfolded(&self, mut most: usize) -> Result<Mesh, CompareError> {
        if let Store::InMemory(_, log) = &self.store {
            return Ok(log.mesh.clone());
        }
        let mut mesh = ActiveMesh::new();
        with_trees!(self, |open| {
            let mut tree = open(Opening::SETTLED)?;
            tree.base_mesh(&mut mesh).map_err(|e| self.tree_error(e))?;
            let count = |_: &_, _| {
                most -= 1;
                if most == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            };
            unfold_all(&mut tree, &mut mesh, count).map_err(|e| self.tree_error(e))?;
        });
        Ok(mesh.to_mesh())
    }

    fn new_check(&self) -> Result<Check, CompareError> {
        if let Store::InMemory(_, log) = &self.store {
            let oracle = Oracle::new(log);
            return oracle
                .map(Check::Log)
                .map_err(|source| CompareError::Log { scene: self.name.clone(), source });
        }
        with_trees!(self, |open| {
            let mut tree = open(Opening::SETTLED)?;
            tree.base_mesh(&mut NullSink).map_err(|e| self.tree_error(e))?;
            BruteForce::new(&mut tree).map(Check::Nodes).map_err(|e| self.tree_error(e))
        })
    }

    /// Replays `frames` of a path with every strategy and every way to prefetch of the options. `progress` counts frames.
    ///
    /// # Errors
    /// [`CompareError::Store`], [`CompareError::Tree`], and [`CompareError::Wrong`] or [`CompareError::Differs`] where the
    /// options ask for a check.
    pub fn replay(
        &mut self,
        path: &Path,
        frames: Range<usize>,
        options: &Options,
        progress: Progress,
    ) -> Result<Vec<Run>, CompareError> {
        let mut check = self.check.take();
        if check.is_none() && options.check {
            check = Some(self.new_check()?);
        }
        let is_checked = |s: Strategy| options.check || !s.is_exact();
        let speed = declared_speed(path, options);
        let views: Vec<View> =
            frames.clone().map(|frame| View::new(&path.camera(frame), options.theta)).collect();
        // Without pages there is nothing to fetch.
        let prefetch =
            if self.backend() == Backend::InMemory { &[Prefetch::None][..] } else { &options.prefetch };
        let replays = options.strategies.iter().map(|&s| 1 + usize::from(is_checked(s))).sum::<usize>();
        let total = (prefetch.len() * replays * views.len()) as u64;
        let mut done = 0;
        let mut count = || {
            done += 1;
            progress(done, total);
        };

        let mut runs: Vec<Run> = Vec::new();
        for &prefetch in prefetch {
            let opening = Opening { paging: options.paging, prefetch, pace: options.pace };
            for &strategy in &options.strategies {
                let settings = options.settings(strategy, &speed);
                let frames = frames.clone();
                let replay = Replay { subject: self, path, frames, views: &views, settings, opening };
                let rows = with_trees!(self, |open| {
                    let mut rows = replay.measure(open(opening)?, &mut count)?;
                    match check.as_mut() {
                        _ if !is_checked(strategy) => {}
                        Some(check) => replay.check(open(opening)?, check, &mut rows, &mut count)?,
                        None => {
                            let beside = open(Opening { paging: options.paging, ..Opening::SETTLED })?;
                            replay.compare(open(opening)?, beside, &mut rows, &mut count)?;
                        }
                    }
                    rows
                });
                runs.push(Run {
                    scene: self.name.clone(),
                    path: path.name.clone(),
                    backend: self.backend().name(),
                    strategy,
                    prefetch,
                    speed,
                    rows,
                });
            }
        }
        self.check = check;
        Ok(runs)
    }
}

/// The full speed that is declared for a path: what the options say, otherwise the 99th percentile of its motion, or
/// where that is nothing, the largest.
fn declared_speed(path: &Path, options: &Options) -> Speed {
    let (usual, largest) = (path.motion_percentile(99.0), path.motion_percentile(100.0));
    let or = |usual: f64, largest: f64| if usual > 0.0 { usual } else { largest };
    Speed {
        rho: options.rho.unwrap_or_else(|| or(usual.rho, largest.rho)),
        omega: options.omega.unwrap_or_else(|| or(usual.omega, largest.omega)),
        kappa: 0.0,
    }
}
