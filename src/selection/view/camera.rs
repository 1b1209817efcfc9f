//! The camera.

use glam::{DMat3, DQuat, DVec3};

use super::checks::ViewError;
use super::checks::{check_aspect, check_eye, check_fov, check_orientation};

/// A perspective camera: as recorded in a path, and as a renderer has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    position: DVec3,
    orientation: DQuat,
    fov_y: f64,
    aspect: f64,
}

impl Camera {
    /// A camera at `position`, in world coordinates. `orientation` is the rotation from camera space to the world: the
    /// camera looks along its -z with y up. `fov_y` is the full vertical field of view in radians, above 0 and below pi,
    /// and `aspect` the width over the height of the image.
    ///
    /// # Errors
    /// [`ViewError`], which names what is wrong.
    pub fn new(position: DVec3, orientation: DQuat, fov_y: f64, aspect: f64) -> Result<Self, ViewError> {
        Ok(Self {
            position: check_eye(position)?,
            orientation: check_orientation(orientation)?,
            fov_y: check_fov(fov_y)?,
            aspect: check_aspect(aspect)?,
        })
    }

    /// A camera at `position` that looks at `target` with `up` upwards in the image, as far as that can be.
    ///
    /// # Errors
    /// [`ViewError::Target`] where the target is the position, or so near that there is no direction, and those of
    /// [`new`](Self::new).
    pub fn look_at(
        position: DVec3,
        target: DVec3,
        up: DVec3,
        fov_y: f64,
        aspect: f64,
    ) -> Result<Self, ViewError> {
        check_eye(position)?;
        let no_direction = ViewError::Target { position: position.to_array(), target: target.to_array() };
        let back = (position - target).try_normalize().ok_or(no_direction)?;
        let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
        let orientation = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back)).normalize();
        Self::new(position, orientation, fov_y, aspect)
    }

    /// A camera that is whatever it is, for pictures; [`View::new`](super::View::new) looks at everything again.
    #[must_use]
    pub fn unchecked(position: DVec3, orientation: DQuat, fov_y: f64, aspect: f64) -> Self {
        Self { position, orientation, fov_y, aspect }
    }

    /// The same camera in coordinates about `origin`, in which a mesh has its positions: for pictures.
    #[must_use]
    pub fn about(&self, origin: [f64; 3]) -> Self {
        Self { position: self.position - DVec3::from(origin), ..*self }
    }

    /// Eye position, in world coordinates.
    #[must_use]
    pub fn position(&self) -> DVec3 {
        self.position
    }

    /// Rotation from camera space to the world. The camera looks along its -z with y up.
    #[must_use]
    pub fn orientation(&self) -> DQuat {
        self.orientation
    }

    /// Full vertical field of view, in radians, above 0 and below pi.
    #[must_use]
    pub fn fov_y(&self) -> f64 {
        self.fov_y
    }

    /// Width over height of the image.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        self.aspect
    }

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
