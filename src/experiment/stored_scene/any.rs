//! Objects of several backends in one scene, told apart once a frame and nowhere else.

use std::time::Duration;

use vertex_tree::{NullSink, Refine, TreeError};

use super::stored_error::{ObjectLine, StoredSceneError};
use selection::engine::FrameReport;
use selection::objects::{Object, ObjectsError, together};
use selection::view::View;
use testing::brute_force::BruteForce;

/// An object, whatever its backend.
pub(super) trait AnyObject {
    fn advance(
        &mut self,
        number: usize,
        views: &[View],
        own: &mut Vec<View>,
    ) -> Result<FrameReport, ObjectsError>;
    fn pass(&mut self, time: Duration) -> Result<(), TreeError>;
    fn settle(&mut self) -> Result<Duration, TreeError>;
    fn take_fault(&mut self) -> Option<TreeError>;
    /// Nodes that brute force would have otherwise, and that no refused change explains.
    fn wrong(&self, brute_force: &mut BruteForce) -> [u64; 2];
    /// What the cut is by brute force. The object is of no use afterwards.
    fn brute_force(&mut self, at: &ObjectLine) -> Result<BruteForce, StoredSceneError>;
    fn assert_well_formed(&self);
}

/// With whether nodes depend on others than those above and below.
impl<S, T: Refine<S> + Refine<NullSink>> AnyObject for (Object<T, S>, bool) {
    fn advance(
        &mut self,
        number: usize,
        views: &[View],
        own: &mut Vec<View>,
    ) -> Result<FrameReport, ObjectsError> {
        self.0.advance(number, views, own)
    }

    fn pass(&mut self, time: Duration) -> Result<(), TreeError> {
        self.0.engine_mut().tree_mut().pass(time)
    }

    fn settle(&mut self) -> Result<Duration, TreeError> {
        self.0.engine_mut().tree_mut().settle()
    }

    fn take_fault(&mut self) -> Option<TreeError> {
        self.0.engine_mut().take_fault()
    }

    fn wrong(&self, brute_force: &mut BruteForce) -> [u64; 2] {
        brute_force.judge(self.0.engine(), self.1)
    }

    fn brute_force(&mut self, at: &ObjectLine) -> Result<BruteForce, StoredSceneError> {
        let all = BruteForce::new(self.0.engine_mut().tree_mut());
        all.map_err(|source| StoredSceneError::Tree { at: Box::new(at.clone()), source })
    }

    fn assert_well_formed(&self) {
        self.0.engine().assert_well_formed();
    }
}

/// The objects of a `.scene` file, each with an engine.
pub struct StoredObjects {
    objects: Vec<Box<dyn AnyObject>>,
    lines: Vec<ObjectLine>,
    views: Vec<View>,
}

impl StoredObjects {
    pub(super) fn new(objects: Vec<Box<dyn AnyObject>>, lines: Vec<ObjectLine>) -> Self {
        Self { objects, lines, views: Vec::new() }
    }

    fn tree_error(&self, object: usize, source: TreeError) -> StoredSceneError {
        StoredSceneError::Tree { at: Box::new(self.lines[object].clone()), source }
    }

    /// Moves the front of every object to where these views of the scene want it; the report is that of all of them
    /// together.
    ///
    /// # Errors
    /// The first of an object. The others have been moved all the same.
    pub fn advance(&mut self, views: &[View]) -> Result<FrameReport, StoredSceneError> {
        let Self { objects, views: own, .. } = self;
        let reports = objects.iter_mut().enumerate();
        together(reports.map(|(number, object)| object.advance(number, views, own))).map_err(|error| {
            match error {
                ObjectsError::Tree { object, source } => self.tree_error(object, source),
                ObjectsError::View { object, source } => {
                    StoredSceneError::View { at: Box::new(self.lines[object].clone()), source }
                }
            }
        })
    }

    /// Lets time pass for stores on virtual time.
    ///
    /// # Errors
    /// The first of an object.
    pub fn pass(&mut self, time: Duration) -> Result<(), StoredSceneError> {
        for number in 0..self.objects.len() {
            self.objects[number].pass(time).map_err(|source| self.tree_error(number, source))?;
        }
        Ok(())
    }

    /// Waits until every page that has been asked for has arrived or failed, one object after the other. Returns how long that
    /// took.
    ///
    /// # Errors
    /// The first of an object.
    pub fn settle(&mut self) -> Result<Duration, StoredSceneError> {
        let mut waited = Duration::ZERO;
        for number in 0..self.objects.len() {
            waited += self.objects[number].settle().map_err(|source| self.tree_error(number, source))?;
        }
        Ok(waited)
    }

    /// Takes the first fault of an object since the last call.
    pub fn take_fault(&mut self) -> Option<StoredSceneError> {
        let faults = self.objects.iter_mut().map(|object| object.take_fault()).enumerate();
        let (object, fault) = faults.filter_map(|(object, fault)| Some((object, fault?))).next()?;
        Some(self.tree_error(object, fault))
    }

    /// How many nodes of all fronts have not the status that brute force gives them, and how many of these no change explains
    /// that has been refused; with what [`StoredScene::brute_force`](super::StoredScene::brute_force) has found.
    pub fn wrong(&self, brute_force: &mut [BruteForce]) -> [u64; 2] {
        let mut all = [0; 2];
        for (object, brute_force) in self.objects.iter().zip(brute_force) {
            let [wrong, unexplained] = object.wrong(brute_force);
            all = [all[0] + wrong, all[1] + unexplained];
        }
        all
    }

    /// Checks the state of every engine, see [`Engine::assert_well_formed`](selection::engine::Engine::assert_well_formed).
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        self.objects.iter().for_each(|object| object.assert_well_formed());
    }
}
