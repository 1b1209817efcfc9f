//! Several objects in one scene, each with a hierarchy and a placement of its own, over any backend.
//!
//! Every object keeps its own space, and an engine of its own: it is the views that are brought to the objects. That is
//! exact, as views are in double precision, and a similarity changes nothing that the criterion asks: distances, radii and
//! errors are scaled alike, angles stay. One tree over all objects would have to bring spheres to the scene instead, and
//! spheres are in single precision. Rounding moves a centre by up to a few units in its last place, which is more than the
//! room that construction leaves between nested spheres, a millionth of the radius, unless the radius is more than about a
//! tenth of the distance from the scene's origin. Nearly every child would stick out of its parent, and the front would
//! depend on its history.
//!
//! What the objects share is up to their backends: trees of `mt-partition` take clones of one memory budget and one reader.
//!
//! [`Objects`] are for one backend, as an engine is. The objects of a `.scene` file may be of several: [`StoredScene`].

#[cfg(all(feature = "in-memory", feature = "meta-node", feature = "detail-block", feature = "mt-partition"))]
mod any;
mod scene_file;
#[cfg(all(feature = "in-memory", feature = "meta-node", feature = "detail-block", feature = "mt-partition"))]
mod stored;

use std::time::Duration;

use glam::{DMat3, DQuat, DVec3};
use vertex_tree::{PageStats, Refine, TreeError};

use crate::engine::{Engine, FrameReport, Limit, Settings};
use crate::view::{View, ViewError};

pub use scene_file::{SceneFileError, read_scene};
#[cfg(all(
    feature = "in-memory",
    feature = "meta-node",
    feature = "detail-block",
    feature = "mt-partition"
))]
pub use {
    any::StoredObjects,
    stored::{ObjectLine, ScenePaging, StoredObject, StoredScene, StoredSceneError},
};

/// Where an object is in the scene: scaled, then turned, then moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// How much larger the object is in the scene, above 0.
    pub scale: f64,
    /// How it is turned.
    pub rotation: DQuat,
    /// Where its origin is, in units of the scene.
    pub translation: DVec3,
}

/// A matrix does not place an object.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlacementError {
    /// A number is not finite.
    #[error("the matrix has a number that is not finite")]
    NotFinite,
    /// The matrix flattens the object.
    #[error("the matrix has no volume: its determinant is {determinant}")]
    Flat {
        /// As found.
        determinant: f64,
    },
    /// The matrix mirrors the object, which would turn its triangles over.
    #[error("the matrix mirrors: its determinant is {determinant}")]
    Mirrored {
        /// As found.
        determinant: f64,
    },
    /// The matrix stretches or shears the object.
    #[error(
        "the matrix stretches or shears by {by}: only one scale, a rotation and a translation are allowed"
    )]
    Stretched {
        /// Largest deviation from a rotation, as a share of the scale.
        by: f64,
    },
}

/// A scene can not go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
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

/// What a matrix written as text may be away from a rotation.
const TOLERANCE: f64 = 1e-4;

impl Placement {
    /// The object where it was modelled.
    pub const IDENTITY: Self = Self { scale: 1.0, rotation: DQuat::IDENTITY, translation: DVec3::ZERO };

    /// Takes a 3 by 4 matrix, row by row: the linear part in the first three columns, the translation in the last.
    ///
    /// # Errors
    /// Unless the linear part is a rotation times a scale, up to what text rounds away.
    pub fn from_rows(rows: [f64; 12]) -> Result<Self, PlacementError> {
        if !rows.iter().all(|x| x.is_finite()) {
            return Err(PlacementError::NotFinite);
        }
        let column = |i: usize| DVec3::new(rows[i], rows[4 + i], rows[8 + i]);
        let linear = DMat3::from_cols(column(0), column(1), column(2));
        let determinant = linear.determinant();
        let size = linear.to_cols_array().iter().fold(0.0_f64, |size, x| size.max(x.abs()));
        if determinant.abs() <= size * size * size * TOLERANCE {
            return Err(PlacementError::Flat { determinant });
        }
        if determinant < 0.0 {
            return Err(PlacementError::Mirrored { determinant });
        }
        let scale = libm::cbrt(determinant);
        let turned = linear * (1.0 / scale);
        let off = turned.transpose() * turned - DMat3::IDENTITY;
        let by = off.to_cols_array().iter().fold(0.0_f64, |by, x| by.max(x.abs()));
        if by > TOLERANCE {
            return Err(PlacementError::Stretched { by });
        }
        Ok(Self { scale, rotation: DQuat::from_mat3(&turned).normalize(), translation: column(3) })
    }

    /// Where a point of the object is in the scene.
    #[must_use]
    pub fn place(&self, point: DVec3) -> DVec3 {
        self.translation + self.rotation * (self.scale * point)
    }

    /// A view of the scene as a view of the object.
    ///
    /// # Errors
    /// Where the eye comes to lie out of range, or the placement is none.
    pub fn view(&self, view: &View) -> Result<View, ViewError> {
        let back = self.rotation.conjugate();
        view.with_eye(back * (view.eye() - self.translation) / self.scale)?
            .with_direction((back * view.direction()).normalize())
    }
}

/// An object: its placement, and the engine that follows the views in its own space.
pub struct Object<T, S> {
    placement: Placement,
    engine: Engine<T, S>,
}

impl<T: Refine<S>, S> Object<T, S> {
    /// With the settings of the scene.
    fn new(tree: T, sink: S, placement: Placement, settings: Settings) -> Result<Self, TreeError> {
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
    fn advance(
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

/// The objects of a scene.
pub struct Objects<T, S> {
    objects: Vec<Object<T, S>>,
    views: Vec<View>,
}

impl<T: Refine<S>, S> Objects<T, S> {
    /// Starts with every object at its coarsest. The settings are those of the scene, with `rho` in its units; a budget
    /// would be each object's own.
    ///
    /// # Errors
    /// What a backend reports.
    pub fn new(
        parts: impl IntoIterator<Item = (T, S, Placement)>,
        settings: Settings,
    ) -> Result<Self, ObjectsError> {
        let object = |(number, (tree, sink, placement)): (usize, (T, S, Placement))| {
            Object::new(tree, sink, placement, settings)
                .map_err(|source| ObjectsError::Tree { object: number, source })
        };
        let objects = parts.into_iter().enumerate().map(object).collect::<Result<_, _>>()?;
        Ok(Self { objects, views: Vec::new() })
    }

    /// The objects, in order.
    pub fn objects(&self) -> &[Object<T, S>] {
        &self.objects
    }

    /// The objects, in order.
    pub fn objects_mut(&mut self) -> &mut [Object<T, S>] {
        &mut self.objects
    }

    /// Moves the front of every object to where these views of the scene want it; the report is that of all of them
    /// together.
    ///
    /// # Errors
    /// The first of an object. The others have been moved all the same.
    pub fn advance(&mut self, views: &[View]) -> Result<FrameReport, ObjectsError> {
        let Self { objects, views: own } = self;
        together(objects.iter_mut().enumerate().map(|(number, object)| object.advance(number, views, own)))
    }

    /// Lets time pass for stores on virtual time.
    ///
    /// # Errors
    /// The first that a backend reports.
    pub fn pass(&mut self, time: Duration) -> Result<(), ObjectsError> {
        self.for_each_tree(|tree| tree.pass(time))
    }

    /// Waits until every page that has been asked for has arrived or failed.
    ///
    /// # Errors
    /// The first that a backend reports.
    pub fn settle(&mut self) -> Result<(), ObjectsError> {
        self.for_each_tree(|tree| tree.settle().map(drop))
    }

    fn for_each_tree(&mut self, f: impl Fn(&mut T) -> Result<(), TreeError>) -> Result<(), ObjectsError> {
        let f = |(object, it): (usize, &mut Object<T, S>)| {
            f(it.engine.tree_mut()).map_err(|source| ObjectsError::Tree { object, source })
        };
        self.objects.iter_mut().enumerate().try_for_each(f)
    }
}

/// The report of all objects, in their order, or the first error. All are looked at in any case.
fn together(
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
    all.pages.reads += report.pages.reads;
    all.pages.read_bytes += report.pages.read_bytes;
    all.pages.resident_bytes += report.pages.resident_bytes;
    all.pages.faults += report.pages.faults;
    all.pages.ahead += report.pages.ahead;
    all.pages.ahead_used += report.pages.ahead_used;
    all.pages.no_room += report.pages.no_room;
    all.pages.stalled += report.pages.stalled;
}
