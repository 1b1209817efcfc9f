//! What is compared, and how.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use meta_node::Dependencies;
use mt_partition::CacheMode;
use page_store::Simulated;

use super::error::CompareError;
use super::loading::Loading;
use crate::experiment::path::Path;
use selection::budget::{Budget, WorkCap};
use selection::criterion::Criterion;
use selection::engine::Settings;
use selection::motion::Speed;
use selection::refine::Strategy;
use selection::view::{View, theta_of_pixels};

/// What to replay, and how.
#[derive(Clone, Debug)]
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
    /// Full speed of the eye, in object units a frame, for the strategies that go by one; by default the path's 99th percentile.
    pub rho: Option<f64>,
    /// Full speed of turning, in radians a frame; by default the path's 99th percentile.
    pub omega: Option<f64>,
    /// Compare every frame of every exact strategy with the oracle.
    pub check: bool,
    /// What backends may use.
    pub paging: Paging,
    /// How pages are loaded, each in a replay of its own.
    pub prefetch: Vec<Loading>,
    /// How time passes.
    pub pace: Pace,
    /// Raised by whoever wants the comparison to end: it then gives the runs that it has finished.
    pub stop: Option<&'static AtomicBool>,
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
    /// [`Strategy::COMPARED`], screen error of 1 pixel at 1080 lines, no budget, speeds of the path, no check.
    fn default() -> Self {
        Self {
            strategies: Strategy::COMPARED.to_vec(),
            criterion: Criterion::default(),
            normal_cone: false,
            theta: theta_of_pixels(1.0, 1080),
            budget: Budget::None,
            work_cap: WorkCap::None,
            rho: None,
            omega: None,
            check: false,
            paging: Paging::default(),
            prefetch: vec![Loading::Paper],
            pace: Pace::Settled,
            stop: None,
        }
    }
}

impl Options {
    /// Whether somebody wants the comparison to end.
    pub(super) fn is_stopped(&self) -> bool {
        is_raised(self.stop)
    }

    /// How an engine refines along a path of this declared speed.
    pub(super) fn settings(&self, strategy: Strategy, speed: &Speed) -> Settings {
        Settings {
            strategy,
            criterion: self.criterion,
            normal_cone: self.normal_cone,
            rho: speed.rho,
            omega: speed.omega,
            budget: self.budget,
            work_cap: self.work_cap,
            ..Settings::default()
        }
    }

    /// The view of a frame of a path.
    pub(super) fn view(&self, path: &Path, frame: usize) -> Result<View, CompareError> {
        path.view(frame, self.theta).map_err(|source| CompareError::View {
            path: path.name.clone(),
            frame,
            source,
        })
    }

    /// The full speed that is declared for a path: what the options say, otherwise the 99th percentile of its motion, or
    /// where that is nothing, the largest.
    pub(super) fn declared_speed(&self, path: &Path) -> Speed {
        let (usual, largest) = (path.motion_percentile(99.0), path.motion_percentile(100.0));
        let or = |usual: f64, largest: f64| if usual > 0.0 { usual } else { largest };
        Speed {
            rho: self.rho.unwrap_or_else(|| or(usual.rho, largest.rho)),
            omega: self.omega.unwrap_or_else(|| or(usual.omega, largest.omega)),
            kappa: 0.0,
        }
    }
}

/// Whether there is a flag by which a comparison is to end, and it is raised.
pub(super) fn is_raised(stop: Option<&AtomicBool>) -> bool {
    stop.is_some_and(|stop| stop.load(Ordering::Relaxed))
}
