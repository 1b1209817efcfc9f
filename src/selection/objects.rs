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
//! [`Objects`] are for one backend, as an engine is. The objects of a `.scene` file, which are experiments, may be of several.

mod object;
mod placement;

use std::time::Duration;

use vertex_tree::{Refine, TreeError};

use crate::engine::{FrameReport, Settings};
use crate::view::View;

pub use object::{Object, ObjectsError, together};
pub use placement::{Placement, PlacementError};
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
