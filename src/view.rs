//! The camera, and what selection needs of it.

use glam::{DMat3, DQuat, DVec3};

/// A perspective camera: as recorded in a path, and as a renderer has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Eye position, in world coordinates.
    pub position: DVec3,
    /// Rotation from camera space to the world. The camera looks along its -z with y up. A unit quaternion.
    pub orientation: DQuat,
    /// Full vertical field of view, in radians, above 0 and below pi.
    pub fov_y: f64,
    /// Width over height of the image.
    pub aspect: f64,
}

impl Camera {
    /// A camera at `position` that looks at `target` with `up` upwards in the image, as far as that can be. `target`
    /// must be elsewhere.
    #[must_use]
    pub fn look_at(position: DVec3, target: DVec3, up: DVec3, fov_y: f64, aspect: f64) -> Self {
        let back = (position - target).normalize();
        let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
        let orientation = DQuat::from_mat3(&DMat3::from_cols(right, back.cross(right), back)).normalize();
        Self { position, orientation, fov_y, aspect }
    }

    /// The same camera in coordinates about `origin`, in which a mesh has its positions.
    #[must_use]
    pub fn relative_to(&self, origin: [f64; 3]) -> Self {
        Self { position: self.position - DVec3::from(origin), ..*self }
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
    /// Eye position: in world coordinates for an engine, in those of the spheres for the criterion.
    pub eye: DVec3,
    /// Unit vector of the viewing direction.
    pub direction: DVec3,
    /// Cosine of the cone's half-angle.
    pub cos_beta: f64,
    /// Sine of the cone's half-angle.
    pub sin_beta: f64,
    /// `1 / (tan(fov_y / 2) theta)`, at least 1: how many times its own size away a length may be before it falls
    /// below the tolerance.
    pub k: f64,
}

impl View {
    /// The view of `camera` with tolerance `theta` (see [`theta_of_pixels`]).
    ///
    /// `k` is kept at 1 or above: a tolerance of the whole half-image and more makes no difference any more.
    #[must_use]
    pub fn new(camera: &Camera, theta: f64) -> Self {
        let tan_half_fov = (camera.fov_y / 2.0).tan();
        let tan_beta = tan_half_fov * (1.0 + camera.aspect * camera.aspect).sqrt();
        let secant = (1.0 + tan_beta * tan_beta).sqrt();
        Self {
            eye: camera.position,
            direction: camera.direction(),
            cos_beta: 1.0 / secant,
            sin_beta: tan_beta / secant,
            k: (1.0 / (tan_half_fov * theta)).max(1.0),
        }
    }

    /// The same view in coordinates about `origin`, in which a tree has its spheres.
    #[must_use]
    pub fn relative_to(mut self, origin: [f64; 3]) -> Self {
        self.eye -= DVec3::from(origin);
        self
    }

    /// The same view with its tolerance multiplied by `factor`.
    #[must_use]
    pub fn coarser(mut self, factor: f64) -> Self {
        self.k = (self.k / factor).max(1.0);
        self
    }

    /// Whether two views look through the same cone, wherever it stands and points.
    #[must_use]
    pub fn same_cone(&self, other: &Self) -> bool {
        self.cos_beta == other.cos_beta && self.sin_beta == other.sin_beta
    }
}
