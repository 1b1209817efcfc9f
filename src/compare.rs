//! The experiment runner: one hierarchy, one path, every strategy.
//!
//! Each strategy replays the path alone, from the base mesh on, with the displayed mesh kept as a renderer would;
//! nothing else runs between its frames, and the first frame, which unfolds the whole cut, counts like any other.
//! What checking costs would disturb the caches that are being measured, so the oracle is consulted in a second
//! replay.

pub mod csv;

use std::ops::Range;
use std::sync::Arc;

use in_memory::{Hierarchy, InMemoryTree};
use vertex_tree::{CollapseLog, LogError, NullSink, TreeError};

use crate::active_mesh::ActiveMesh;
use crate::budget::{Budget, WorkCap};
use crate::criterion::Criterion;
use crate::engine::{Engine, FrameReport, Settings};
use crate::motion::Speed;
use crate::oracle::{Difference, Oracle};
use crate::path::Path;
use crate::progress::Progress;
use crate::refine::Strategy;
use crate::view::{View, theta_of_pixels};

/// What to replay, and how.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// In this order.
    pub strategies: Vec<Strategy>,
    /// What "coarse" means.
    pub criterion: Criterion,
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
}

impl Default for Options {
    /// Every strategy, screen error of 1 pixel at 1080 lines, no budget, speeds of the path, no check.
    fn default() -> Self {
        Self {
            strategies: Strategy::ALL.to_vec(),
            criterion: Criterion::default(),
            theta: theta_of_pixels(1.0, 1080),
            budget: Budget::None,
            work_cap: WorkCap::None,
            rho: None,
            omega: None,
            check: false,
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
    pub prefetch: &'static str,
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
    /// The backend can not go on.
    #[error("{scene}: {source}")]
    Tree {
        /// What was looked at.
        scene: String,
        /// Why.
        source: TreeError,
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
    hierarchy: Arc<Hierarchy>,
    oracle: Oracle,
}

impl Subject {
    /// Arranges a log for replays.
    ///
    /// # Errors
    /// [`CompareError::Log`].
    pub fn new(name: &str, log: &CollapseLog) -> Result<Self, CompareError> {
        let wrap = |source| CompareError::Log { scene: name.to_owned(), source };
        Ok(Self {
            name: name.to_owned(),
            hierarchy: Arc::new(Hierarchy::new(log).map_err(wrap)?),
            oracle: Oracle::new(log).map_err(wrap)?,
        })
    }

    fn engine<M: vertex_tree::MeshSink>(
        &self,
        settings: Settings,
        sink: impl FnOnce(&InMemoryTree) -> M,
    ) -> Result<Engine<InMemoryTree, M>, CompareError> {
        let tree = InMemoryTree::new(self.hierarchy.clone());
        let mesh = sink(&tree);
        Engine::new(tree, mesh, settings).map_err(|source| self.tree_error(source))
    }

    fn tree_error(&self, source: TreeError) -> CompareError {
        CompareError::Tree { scene: self.name.clone(), source }
    }

    /// The displayed mesh of one frame, with the engine that has it.
    ///
    /// # Errors
    /// [`CompareError::Tree`].
    pub fn frame(
        &self,
        path: &Path,
        frame: usize,
        options: &Options,
    ) -> Result<Engine<InMemoryTree, ActiveMesh>, CompareError> {
        let settings =
            Settings { strategy: Strategy::TopDown, criterion: options.criterion, ..Settings::default() };
        let mut engine = self.engine(settings, |_| ActiveMesh::new())?;
        let view = View::new(&path.camera(frame), options.theta);
        engine.advance(&[view]).map_err(|source| self.tree_error(source))?;
        Ok(engine)
    }

    /// Replays `frames` of a path with every strategy of the options. `progress` counts frames.
    ///
    /// # Errors
    /// [`CompareError::Tree`], and [`CompareError::Wrong`] where the options ask for a check.
    pub fn replay(
        &mut self,
        path: &Path,
        frames: Range<usize>,
        options: &Options,
        progress: Progress,
    ) -> Result<Vec<Run>, CompareError> {
        let speed = declared_speed(path, options);
        let views: Vec<View> =
            frames.clone().map(|frame| View::new(&path.camera(frame), options.theta)).collect();
        let is_checked = |s: Strategy| options.check || !s.is_exact();
        let replays = options.strategies.iter().map(|&s| 1 + usize::from(is_checked(s))).sum::<usize>();
        let total = (replays * views.len()) as u64;
        let mut done = 0;

        let mut runs: Vec<Run> = Vec::new();
        for &strategy in &options.strategies {
            let settings = Settings {
                strategy,
                criterion: options.criterion,
                rho: speed.rho,
                omega: speed.omega,
                budget: options.budget,
                work_cap: options.work_cap,
            };
            let mut engine = self.engine(settings, |_| ActiveMesh::new())?;
            let mut rows = Vec::with_capacity(views.len());
            for (frame, view) in frames.clone().zip(&views) {
                let report = engine.advance(std::slice::from_ref(view)).map_err(|e| self.tree_error(e))?;
                engine.mesh_mut().clear_changes();
                rows.push(Row { frame, report, wrong: None });
                done += 1;
                progress(done, total);
            }
            drop(engine);
            if is_checked(strategy) {
                let mut engine = self.engine(settings, |_| NullSink)?;
                for (row, view) in rows.iter_mut().zip(&views) {
                    let report =
                        engine.advance(std::slice::from_ref(view)).map_err(|e| self.tree_error(e))?;
                    let difference = self.oracle.compare(&engine);
                    row.wrong = Some(difference.map_or(0, |d| d.count as u64));
                    // What is carried over is not wrong, it is late.
                    let is_exact = strategy.is_exact() && report.carried == 0;
                    if let Some(difference) = difference.filter(|_| is_exact) {
                        return Err(CompareError::Wrong(Box::new(WrongCut {
                            scene: self.name.clone(),
                            path: path.name.clone(),
                            frame: row.frame,
                            strategy,
                            difference,
                            views: engine.views().to_vec(),
                            criterion: options.criterion,
                        })));
                    }
                    done += 1;
                    progress(done, total);
                }
            }
            runs.push(Run {
                scene: self.name.clone(),
                path: path.name.clone(),
                backend: "in-memory",
                strategy,
                prefetch: "none",
                speed,
                rows,
            });
        }
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
