//! The camera, and what selection needs of it.
//!
//! Cameras and views are right by construction: whatever makes one checks it, and the error names the value that is
//! wrong. So nothing behind this module meets an eye or a tolerance that is not a number, for which every comparison
//! is false and a camera would seem to be at rest.

mod camera;
mod checks;
#[cfg(test)]
mod tests;

use glam::DVec3;

pub use camera::Camera;
pub use checks::ViewError;
pub(crate) use checks::check_origin;
pub use checks::{check_aspect, check_eye, check_fov, check_orientation};
use checks::{check_cone, check_k, unit};

/// Beyond this, the square root of 1 + x^2 is x.
const STEEP: f64 = 1e9;

/// The tolerance `theta` that `pixels` on an image of `lines` lines mean: a length's share of half the image's
/// height.
#[must_use]
pub fn theta_of_pixels(pixels: f64, lines: u32) -> f64 {
    2.0 * pixels / f64::from(lines)
}

/// What the refinement criterion sees of a camera: an eye and a cone of directions around the frustum, with the
/// tolerance folded in.
///
/// The cone's half-angle `beta` encloses the frustum: the corner of an image of half-height `tan(fov_y / 2)` lies
/// `tan(fov_y / 2) sqrt(1 + aspect^2)` from its middle, which is `tan(beta)`. (Zach & Karner use
/// `sqrt(2) fov / 2`, which is less than that for wide images.)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    eye: DVec3,
    direction: DVec3,
    cos_beta: f64,
    sin_beta: f64,
    k: f64,
}

impl View {
    /// The largest that a coordinate of an eye or of an origin may be. Squares of distances do not overflow then, and
    /// the spheres of nodes end at 3.4e38.
    pub const FARTHEST: f64 = checks::FARTHEST;

    /// The view of `camera` with tolerance `theta` (see [`theta_of_pixels`]).
    ///
    /// `k` is kept at 1 or above: a tolerance of the whole half-image and more makes no difference any more.
    ///
    /// # Errors
    /// [`ViewError::Tolerance`], and [`ViewError::TooFine`] where `1 / (tan(fov_y / 2) theta)` is not finite.
    pub fn new(camera: &Camera, theta: f64) -> Result<Self, ViewError> {
        if !(theta > 0.0 && theta.is_finite()) {
            return Err(ViewError::Tolerance { theta });
        }
        let tan_half_fov = libm::tan(check_fov(camera.fov_y())? / 2.0);
        let aspect = check_aspect(camera.aspect())?;
        // Neither square overflows: beyond, the 1 is lost anyway.
        let diagonal = if aspect > STEEP { aspect } else { (1.0 + aspect * aspect).sqrt() };
        let tan_beta = tan_half_fov * diagonal;
        let (cos_beta, sin_beta) = if tan_beta > STEEP {
            (1.0 / tan_beta, 1.0)
        } else {
            let secant = (1.0 + tan_beta * tan_beta).sqrt();
            (1.0 / secant, tan_beta / secant)
        };
        let k = 1.0 / (tan_half_fov * theta);
        if !k.is_finite() {
            return Err(ViewError::TooFine { theta, fov_y: camera.fov_y() });
        }
        Self::from_parts(camera.position(), camera.direction(), cos_beta, sin_beta, k.max(1.0))
    }

    /// The view from `eye` along `direction`, of length 1, through a cone of half-angle `beta` from 0 to 90 degrees, at
    /// a `k` that is finite and at least 1; see the methods of these names.
    ///
    /// A direction whose length is within a millionth of 1 is normalised, and kept to the bit where it has been before.
    ///
    /// # Errors
    /// [`ViewError`], which names what is wrong.
    pub fn from_parts(
        eye: DVec3,
        direction: DVec3,
        cos_beta: f64,
        sin_beta: f64,
        k: f64,
    ) -> Result<Self, ViewError> {
        check_cone(cos_beta, sin_beta)?;
        Ok(Self { eye: check_eye(eye)?, direction: unit(direction)?, cos_beta, sin_beta, k: check_k(k)? })
    }

    /// Eye position: in world coordinates for an engine, in those of the spheres for the criterion.
    #[inline(always)]
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.eye
    }

    /// Unit vector of the viewing direction.
    #[inline(always)]
    #[must_use]
    pub fn direction(&self) -> DVec3 {
        self.direction
    }

    /// Cosine of the cone's half-angle.
    #[inline(always)]
    #[must_use]
    pub fn cos_beta(&self) -> f64 {
        self.cos_beta
    }

    /// Sine of the cone's half-angle.
    #[inline(always)]
    #[must_use]
    pub fn sin_beta(&self) -> f64 {
        self.sin_beta
    }

    /// `1 / (tan(fov_y / 2) theta)`, at least 1 and finite: how many times its own size away a length may be before it
    /// falls below the tolerance.
    #[inline(always)]
    #[must_use]
    pub fn k(&self) -> f64 {
        self.k
    }

    /// The same view from elsewhere.
    ///
    /// # Errors
    /// [`ViewError::Eye`].
    pub fn with_eye(self, eye: DVec3) -> Result<Self, ViewError> {
        Ok(Self { eye: check_eye(eye)?, ..self })
    }

    /// The same view in another direction.
    ///
    /// # Errors
    /// [`ViewError::Direction`].
    pub fn with_direction(self, direction: DVec3) -> Result<Self, ViewError> {
        Ok(Self { direction: unit(direction)?, ..self })
    }

    /// The same view through another cone.
    ///
    /// # Errors
    /// [`ViewError::Cone`].
    pub fn with_cone(self, cos_beta: f64, sin_beta: f64) -> Result<Self, ViewError> {
        check_cone(cos_beta, sin_beta)?;
        Ok(Self { cos_beta, sin_beta, ..self })
    }

    /// The same view with another [`k`](Self::k).
    ///
    /// # Errors
    /// [`ViewError::Scale`].
    pub fn with_k(self, k: f64) -> Result<Self, ViewError> {
        Ok(Self { k: check_k(k)?, ..self })
    }

    /// The same view in coordinates about `origin`, in which a tree has its spheres.
    ///
    /// # Errors
    /// [`ViewError::Origin`], and [`ViewError::Eye`] where the difference is out of range.
    pub fn relative_to(self, origin: [f64; 3]) -> Result<Self, ViewError> {
        self.with_eye(self.eye - DVec3::from(check_origin(origin)?))
    }

    /// [`relative_to`](Self::relative_to) an origin that has been [checked](check_origin): a coordinate of the eye is at
    /// most `2 FARTHEST`, whose square is as finite as that of `FARTHEST`.
    #[inline]
    pub(crate) fn about(self, origin: [f64; 3]) -> Self {
        Self { eye: self.eye - DVec3::from(origin), ..self }
    }

    /// The same view with its tolerance multiplied by `factor`. `k` is kept at 1 or above, and finite.
    ///
    /// # Errors
    /// [`ViewError::Factor`] unless the factor is finite and above 0.
    pub fn coarser(self, factor: f64) -> Result<Self, ViewError> {
        if factor > 0.0 && factor.is_finite() {
            Ok(self.steered(factor))
        } else {
            Err(ViewError::Factor { factor })
        }
    }

    /// [`coarser`](Self::coarser) by a factor that is finite and above 0, as a budget's is.
    #[inline]
    pub(crate) fn steered(self, factor: f64) -> Self {
        Self { k: (self.k / factor).clamp(1.0, f64::MAX), ..self }
    }

    /// Whether two views look through the same cone, wherever it stands and points.
    #[must_use]
    pub fn same_cone(&self, other: &Self) -> bool {
        self.cos_beta == other.cos_beta && self.sin_beta == other.sin_beta
    }

    /// What no constructor makes, to see what comes of it.
    #[cfg(test)]
    pub(crate) fn unchecked(eye: DVec3, direction: DVec3, cos_beta: f64, sin_beta: f64, k: f64) -> Self {
        Self { eye, direction, cos_beta, sin_beta, k }
    }
}
