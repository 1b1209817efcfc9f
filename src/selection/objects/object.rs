//! One object of a scene, and the report of several.

use std::time::Duration;

use vertex_tree::{PageStats, Refine, TreeError};

use super::placement::Placement;
use crate::engine::{Engine, FrameReport, Limit, Settings};
use crate::view::{View, ViewError};

/// A scene can not go on.
#[derive(Debug, thiserror::Error)]
pub enum ObjectsError {
    /// The backend of an object can not.
    #[error("object {object}: {source}")]
    Tree {
        /// Its number, from 0.
        object: usize,
        /// Why.
        source: TreeError,
    },
    /// A view of the scene is none of an object.
    #[error("object {object}: {source}")]
    View {
        /// Its number, from 0.
        object: usize,
        /// What is wrong with the view.
        source: ViewError,
    },
}

/// An object: its placement, and the engine that follows the views in its own space.
pub struct Object<T, S> {
    pub(super) placement: Placement,
    pub(super) engine: Engine<T, S>,
}

impl<T: Refine<S>, S> Object<T, S> {
    /// With the settings of the scene.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn new(tree: T, sink: S, placement: Placement, settings: Settings) -> Result<Self, TreeError> {
        let settings = Settings { rho: settings.rho / placement.scale, ..settings };
        Ok(Self { placement, engine: Engine::new(tree, sink, settings)? })
    }

    /// Where it is.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// Its engine; what is displayed is in the object's space.
    pub fn engine(&self) -> &Engine<T, S> {
        &self.engine
    }

    /// Its engine, to take what has changed or to reach the backend.
    pub fn engine_mut(&mut self) -> &mut Engine<T, S> {
        &mut self.engine
    }

    /// Moves it, which is the object of this number, to these views of the scene; `own` is room for its own.
    ///
    /// # Errors
    /// What the backend reports, or that a view is none in the object's space.
    pub fn advance(
        &mut self,
        object: usize,
        views: &[View],
        own: &mut Vec<View>,
    ) -> Result<FrameReport, ObjectsError> {
        own.clear();
        for view in views {
            own.push(self.placement.view(view).map_err(|source| ObjectsError::View { object, source })?);
        }
        self.engine.advance(own).map_err(|source| ObjectsError::Tree { object, source })
    }
}

/// The report of all objects, in their order, or the first error. All are looked at in any case.
///
/// # Errors
/// The first.
pub fn together(
    reports: impl Iterator<Item = Result<FrameReport, ObjectsError>>,
) -> Result<FrameReport, ObjectsError> {
    let (mut all, mut failure) = (nothing(), None);
    for (number, report) in (0..).zip(reports) {
        match report {
            Ok(report) => add(&mut all, &report, number),
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    failure.map_or(Ok(all), Err)
}

/// The report of no object.
fn nothing() -> FrameReport {
    FrameReport {
        select: Duration::ZERO,
        apply: Duration::ZERO,
        tests: 0,
        unfolds: 0,
        folds: 0,
        forced: 0,
        carried: 0,
        blocked: 0,
        misses: 0,
        foreseen: 0,
        active_nodes: 0,
        displayed: 0,
        cut_hash: 0,
        limit: Limit::Error,
        pages: PageStats::default(),
    }
}

/// Adds the report of an object to that of the scene.
fn add(all: &mut FrameReport, report: &FrameReport, number: u64) {
    all.select += report.select;
    all.apply += report.apply;
    all.tests += report.tests;
    all.unfolds += report.unfolds;
    all.folds += report.folds;
    all.forced += report.forced;
    all.carried += report.carried;
    all.blocked += report.blocked;
    all.misses += report.misses;
    all.foreseen += report.foreseen;
    all.active_nodes += report.active_nodes;
    all.displayed += report.displayed;
    // The same cut of another object counts as another.
    all.cut_hash = all.cut_hash.wrapping_add(report.cut_hash.wrapping_mul(2 * number + 1));
    if report.limit != Limit::Error {
        all.limit = report.limit;
    }
    all.pages = all.pages + report.pages;
}
