//! The camera, and the view that a frame is refined for.

use glam::{DQuat, DVec3};

/// A perspective camera: as recorded in a path, and as a renderer has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Eye position, in object space.
    pub position: DVec3,
    /// Rotation from camera space to object space. The camera looks along its -z with y up. A unit quaternion.
    pub orientation: DQuat,
    /// Full vertical field of view, in radians, above 0 and below pi.
    pub fov_y: f64,
    /// Width over height of the image.
    pub aspect: f64,
}

impl Camera {
    /// Unit vector of the viewing direction.
    #[must_use]
    pub fn direction(&self) -> DVec3 {
        (self.orientation * DVec3::NEG_Z).normalize()
    }

    /// Unit vector to the right of the image.
    #[must_use]
    pub fn right(&self) -> DVec3 {
        (self.orientation * DVec3::X).normalize()
    }

    /// Unit vector to the top of the image.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        (self.orientation * DVec3::Y).normalize()
    }
}
