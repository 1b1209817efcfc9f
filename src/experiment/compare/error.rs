//! Why a comparison stops.

use collapse_log::LogError;
use vertex_tree::TreeError;

use super::loading::Loading;
use crate::experiment::store::{Backend, StoreError};
use crate::experiment::stored_scene::StoredSceneError;
use selection::criterion::Criterion;
use selection::refine::Strategy;
use selection::view::{View, ViewError};
use testing::oracle::Difference;

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
    /// The rules of a paper that is not the backend's are asked for.
    #[error("{scene}: prefetch {} is for {}, not for {}", prefetch.name(), Backend::MetaNode.name(), backend.name())]
    NotPrinted {
        /// What was to be looked at.
        scene: String,
        /// What was asked for.
        prefetch: Loading,
        /// The backend.
        backend: Backend,
    },
    /// A frame of a path has no view at the tolerance.
    #[error("path {path}, frame {frame}: {source}")]
    View {
        /// The path.
        path: String,
        /// Number of the frame in the path.
        frame: usize,
        /// What is wrong with it.
        source: ViewError,
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
        source: Box<StoredSceneError>,
    },
    /// [`Options::stop`](super::Options::stop) was raised.
    #[error("interrupted")]
    Interrupted,
    /// A strategy's cut is not the oracle's.
    #[error("{0}")]
    Wrong(Box<WrongCut>),
}

/// The first node found to differ from the oracle, and where it stands in the first view.
#[derive(Debug)]
pub struct WrongCut {
    pub(super) scene: String,
    pub(super) path: String,
    pub(super) frame: usize,
    pub(super) strategy: Strategy,
    pub(super) difference: Difference,
    pub(super) views: Vec<View>,
    pub(super) criterion: Criterion,
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
            let distance = view.eye().distance(glam::DVec3::from(bounds.center.map(f64::from)));
            let reach = self.criterion.reach_distance(&bounds, view.k());
            let unfold = self.criterion.unfold_for(view, &bounds);
            write!(f, "; at distance {distance}, coarse within {reach}, wanted: {unfold}")?;
        }
        Ok(())
    }
}
