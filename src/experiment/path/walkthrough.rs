//! A camera recorded frame by frame.

use glam::{DQuat, DVec3};

use selection::view::{Camera, View, ViewError};

/// A recorded walkthrough. What [`Path::read`] returns has at least one frame, strictly increasing finite times, and
/// cameras that are right.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Name for tables and file names.
    pub name: String,
    /// Unit of length of the positions, as in `m`.
    pub units: String,
    /// Full vertical field of view, in radians, above 0 and below pi.
    pub fov_y: f64,
    /// Width over height of the image.
    pub aspect: f64,
    /// The frames, in order of time.
    pub frames: Vec<Pose>,
}

/// The camera at one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Seconds.
    pub time: f64,
    /// Eye position, in world coordinates: object space plus the origin of the mesh's georeference.
    pub position: DVec3,
    /// Rotation from camera space to object space; the camera looks along its -z with y up.
    pub orientation: DQuat,
}

impl Pose {
    /// Unit vector of the viewing direction.
    #[must_use]
    pub fn direction(&self) -> DVec3 {
        (self.orientation * DVec3::NEG_Z).normalize()
    }
}

impl Path {
    /// The camera at a frame.
    ///
    /// # Errors
    /// What is wrong with it; nothing is in a path that was read, imported or generated.
    ///
    /// # Panics
    ///
    /// If there is no such frame.
    pub fn camera(&self, frame: usize) -> Result<Camera, ViewError> {
        let Pose { position, orientation, .. } = self.frames[frame];
        Camera::new(position, orientation, self.fov_y, self.aspect)
    }

    /// What selection needs of the camera at a frame, with tolerance `theta`.
    ///
    /// # Errors
    /// Those of [`camera`](Self::camera) and of [`View::new`].
    ///
    /// # Panics
    ///
    /// If there is no such frame.
    pub fn view(&self, frame: usize, theta: f64) -> Result<View, ViewError> {
        View::new(&self.camera(frame)?, theta)
    }
}
