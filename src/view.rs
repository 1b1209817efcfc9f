//! The camera, and what selection needs of it.
//!
//! Cameras and views are right by construction: whatever makes one checks it, and the error names the value that is
//! wrong. So nothing behind this module meets an eye or a tolerance that is not a number, for which every comparison
//! is false and a camera would seem to be at rest.

use glam::{DMat3, DQuat, DVec3};

/// A camera or a view can not be made of what was given.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A coordinate of an eye is not finite, or beyond [`View::FARTHEST`].
    #[error("the eye {eye:?} is not finite, or farther away than {:e}", View::FARTHEST)]
    Eye {
        /// As given.
        eye: [f64; 3],
    },
    /// A viewing direction is not of length 1, give or take a millionth.
    #[error("the viewing direction {direction:?} is not of length 1")]
    Direction {
        /// As given.
        direction: [f64; 3],
    },
    /// An orientation is not of length 1, give or take a millionth.
    #[error("the orientation {orientation:?} is not a quaternion of length 1")]
    Orientation {
        /// x, y, z and w.
        orientation: [f64; 4],
    },
    /// A camera is to look at something from there.
    #[error(
        "a camera at {position:?} can not look at {target:?}: there is no direction from one to the other"
    )]
    Target {
        /// Where the camera is.
        position: [f64; 3],
        /// What it is to look at.
        target: [f64; 3],
    },
    /// A field of view is not above 0 and below pi.
    #[error("the field of view of {fov_y} radians is not above 0 and below pi")]
    FieldOfView {
        /// As given, in radians.
        fov_y: f64,
    },
    /// An aspect is not a finite number above 0.
    #[error("the aspect {aspect} is not a finite number above 0")]
    Aspect {
        /// As given.
        aspect: f64,
    },
    /// Cosine and sine are not those of one angle from 0 to 90 degrees.
    #[error("{cos_beta} and {sin_beta} are not cosine and sine of an angle from 0 to 90 degrees")]
    Cone {
        /// The cosine.
        cos_beta: f64,
        /// The sine.
        sin_beta: f64,
    },
    /// A tolerance is not a finite number above 0.
    #[error("the tolerance {theta} is not a finite number above 0")]
    Tolerance {
        /// As given.
        theta: f64,
    },
    /// A tolerance is so small for a field of view that `k` is not finite.
    #[error("the tolerance {theta} is too small for a field of view of {fov_y} radians")]
    TooFine {
        /// The tolerance.
        theta: f64,
        /// The field of view, in radians.
        fov_y: f64,
    },
    /// A `k` is not finite, or less than 1.
    #[error("k = {k} is not a finite number of at least 1")]
    Scale {
        /// As given.
        k: f64,
    },
    /// A factor on the tolerance is not a finite number above 0.
    #[error("the factor {factor} on the tolerance is not a finite number above 0")]
    Factor {
        /// As given.
        factor: f64,
    },
    /// A coordinate of an origin is not finite, or beyond [`View::FARTHEST`].
    #[error("the origin {origin:?} is not finite, or farther away than {:e}", View::FARTHEST)]
    Origin {
        /// As given.
        origin: [f64; 3],
    },
}

/// How far from 1 the square of a length may be that is meant to be 1.
const UNIT: f64 = 2e-6;
/// A vector whose square is within this of 1 has been normalised, and is kept to the bit.
const NORMALISED: f64 = 1e-14;
/// How far from 1 the squares of a cosine and a sine may add up to.
const CONE: f64 = 1e-12;

/// Beyond this, the square root of 1 + x^2 is x.
const STEEP: f64 = 1e9;

fn is_place(place: DVec3) -> bool {
    place.abs().max_element() <= View::FARTHEST && place.is_finite()
}

/// What has been found to be an eye.
pub(crate) fn check_eye(eye: DVec3) -> Result<DVec3, ViewError> {
    if is_place(eye) { Ok(eye) } else { Err(ViewError::Eye { eye: eye.to_array() }) }
}

/// What has been found to be an origin.
pub(crate) fn check_origin(origin: [f64; 3]) -> Result<[f64; 3], ViewError> {
    if is_place(origin.into()) { Ok(origin) } else { Err(ViewError::Origin { origin }) }
}

/// What has been found to be a field of view.
pub(crate) fn check_fov(fov_y: f64) -> Result<f64, ViewError> {
    let fits = fov_y > 0.0 && fov_y < std::f64::consts::PI;
    if fits { Ok(fov_y) } else { Err(ViewError::FieldOfView { fov_y }) }
}

/// What has been found to be an aspect.
pub(crate) fn check_aspect(aspect: f64) -> Result<f64, ViewError> {
    if aspect > 0.0 && aspect.is_finite() { Ok(aspect) } else { Err(ViewError::Aspect { aspect }) }
}

/// What has been found to be a rotation.
pub(crate) fn check_orientation(orientation: DQuat) -> Result<DQuat, ViewError> {
    let fits = (orientation.length_squared() - 1.0).abs() <= UNIT;
    if fits { Ok(orientation) } else { Err(ViewError::Orientation { orientation: orientation.to_array() }) }
}

/// The direction at length 1, to the bit where it has been normalised before.
fn unit(direction: DVec3) -> Result<DVec3, ViewError> {
    let squared = direction.length_squared();
    let off = (squared - 1.0).abs();
    match off {
        _ if off <= NORMALISED => Ok(direction),
        _ if off <= UNIT => Ok(direction / squared.sqrt()),
        _ => Err(ViewError::Direction { direction: direction.to_array() }),
    }
}

fn check_cone(cos_beta: f64, sin_beta: f64) -> Result<(), ViewError> {
    let is_angle = (cos_beta * cos_beta + sin_beta * sin_beta - 1.0).abs() <= CONE;
    if is_angle && cos_beta >= 0.0 && sin_beta >= 0.0 {
        Ok(())
    } else {
        Err(ViewError::Cone { cos_beta, sin_beta })
    }
}

fn check_k(k: f64) -> Result<f64, ViewError> {
    if k >= 1.0 && k.is_finite() { Ok(k) } else { Err(ViewError::Scale { k }) }
}

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

    /// For pictures, which take what comes; [`View::new`] looks at everything again.
    pub(crate) fn unchecked(position: DVec3, orientation: DQuat, fov_y: f64, aspect: f64) -> Self {
        Self { position, orientation, fov_y, aspect }
    }

    /// The same camera in coordinates about `origin`, in which a mesh has its positions: for pictures.
    pub(crate) fn about(&self, origin: [f64; 3]) -> Self {
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
    pub const FARTHEST: f64 = 1e150;

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
        let tan_half_fov = libm::tan(check_fov(camera.fov_y)? / 2.0);
        let aspect = check_aspect(camera.aspect)?;
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
            return Err(ViewError::TooFine { theta, fov_y: camera.fov_y });
        }
        Self::from_parts(camera.position, camera.direction(), cos_beta, sin_beta, k.max(1.0))
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const WRONG: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

    fn camera(fov_y: f64, aspect: f64) -> Result<Camera, ViewError> {
        Camera::new(DVec3::ONE, DQuat::IDENTITY, fov_y, aspect)
    }

    #[test]
    fn a_camera_names_what_is_wrong() {
        let right = camera(1.0, 1.5).unwrap();
        assert_eq!((right.position(), right.orientation()), (DVec3::ONE, DQuat::IDENTITY));
        assert_eq!((right.fov_y(), right.aspect()), (1.0, 1.5));
        for x in WRONG.into_iter().chain([1.1e150]) {
            for axis in 0..3 {
                let mut eye = DVec3::ONE;
                eye[axis] = x;
                let error = Camera::new(eye, DQuat::IDENTITY, 1.0, 1.0).unwrap_err();
                assert!(matches!(error, ViewError::Eye { eye } if eye[axis].to_bits() == x.to_bits()));
                let error = Camera::look_at(eye, DVec3::ZERO, DVec3::Y, 1.0, 1.0).unwrap_err();
                assert!(matches!(error, ViewError::Eye { .. }), "{error}");
            }
        }
        for orientation in [
            DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0),
            DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0),
            DQuat::from_xyzw(0.0, 0.0, 0.0, 1.1),
            DQuat::from_xyzw(0.0, f64::INFINITY, 0.0, 1.0),
        ] {
            let error = Camera::new(DVec3::ONE, orientation, 1.0, 1.0).unwrap_err();
            assert!(matches!(error, ViewError::Orientation { .. }), "{error}");
        }
        for fov_y in WRONG.into_iter().chain([0.0, -1.0, PI, 4.0]) {
            assert!(matches!(camera(fov_y, 1.0), Err(ViewError::FieldOfView { .. })), "{fov_y}");
        }
        for aspect in WRONG.into_iter().chain([0.0, -1.0]) {
            assert!(matches!(camera(1.0, aspect), Err(ViewError::Aspect { .. })), "{aspect}");
        }
    }

    #[test]
    fn a_camera_looks_at_something_else_than_its_own_place() {
        let (p, tiny) = (DVec3::new(1.0, 2.0, 3.0), DVec3::splat(1e-320));
        for (position, target) in [(p, p), (DVec3::ZERO, tiny), (p, DVec3::NAN), (p, DVec3::INFINITY)] {
            let error = Camera::look_at(position, target, DVec3::Z, 1.0, 1.5).unwrap_err();
            assert!(matches!(error, ViewError::Target { .. }), "{error}");
        }
        let error = Camera::look_at(p, p, DVec3::Z, 1.0, 1.5).unwrap_err().to_string();
        assert!(error.contains("[1.0, 2.0, 3.0]"), "{error}");
        // Whatever is said of up.
        for up in [DVec3::X, DVec3::ZERO, DVec3::NAN] {
            let camera = Camera::look_at(DVec3::X, DVec3::ZERO, up, 1.0, 1.5).unwrap();
            assert!(camera.direction().distance(DVec3::NEG_X) < 1e-12);
        }
    }

    #[test]
    fn a_view_names_what_is_wrong() {
        let right = View::from_parts(DVec3::ONE, DVec3::X, 0.8, 0.6, 5.0).unwrap();
        assert_eq!((right.eye(), right.direction()), (DVec3::ONE, DVec3::X));
        assert_eq!((right.cos_beta(), right.sin_beta(), right.k()), (0.8, 0.6, 5.0));
        for x in WRONG {
            assert!(matches!(right.with_eye(DVec3::new(0.0, x, 0.0)), Err(ViewError::Eye { .. })));
            assert!(matches!(right.with_direction(DVec3::splat(x)), Err(ViewError::Direction { .. })));
            assert!(matches!(right.with_k(x), Err(ViewError::Scale { .. })));
            assert!(matches!(right.with_cone(x, 0.6), Err(ViewError::Cone { .. })));
            assert!(matches!(right.with_cone(0.8, x), Err(ViewError::Cone { .. })));
            assert!(matches!(right.coarser(x), Err(ViewError::Factor { .. })));
            assert!(matches!(right.relative_to([0.0, 0.0, x]), Err(ViewError::Origin { .. })));
            for theta in [x, 0.0, -1.0] {
                let error = View::new(&camera(1.0, 1.0).unwrap(), theta).unwrap_err();
                assert!(matches!(error, ViewError::Tolerance { .. }), "{error}");
            }
        }
        assert!(matches!(right.with_direction(DVec3::X * 1.1), Err(ViewError::Direction { .. })));
        assert!(matches!(right.with_direction(DVec3::ZERO), Err(ViewError::Direction { .. })));
        assert!(matches!(right.with_k(0.999), Err(ViewError::Scale { k: 0.999 })));
        for (cos_beta, sin_beta) in [(-0.8, 0.6), (0.8, -0.6), (0.8, 0.7), (0.0, 0.0)] {
            assert_eq!(right.with_cone(cos_beta, sin_beta), Err(ViewError::Cone { cos_beta, sin_beta }));
        }
        // Where the difference is too large, though neither is.
        let far = right.with_eye(DVec3::X * View::FARTHEST).unwrap();
        let error = far.relative_to([-View::FARTHEST, 0.0, 0.0]).unwrap_err();
        assert!(matches!(error, ViewError::Eye { .. }), "{error}");
        assert!(far.about([-View::FARTHEST, 0.0, 0.0]).eye().length_squared().is_finite());
    }

    #[test]
    fn a_tolerance_may_be_small_but_not_too_small_for_k() {
        let lens = |fov_y| camera(fov_y, 1.5).unwrap();
        let k = View::new(&lens(PI / 3.0), theta_of_pixels(1e-6, 1080)).unwrap().k();
        assert!((k / 935_307_436.0 - 1.0).abs() < 1e-6, "{k}");
        assert!(View::new(&lens(PI / 3.0), 1e-307).unwrap().k().is_finite());
        for (fov_y, theta) in [(PI / 3.0, 1e-320), (1e-320, 0.001), (1e-160, 1e-160)] {
            assert_eq!(View::new(&lens(fov_y), theta), Err(ViewError::TooFine { theta, fov_y }));
        }
        // A tolerance of more than everything is one of everything.
        assert_eq!(View::new(&lens(1.0), 1e300).unwrap().k(), 1.0);
    }

    #[test]
    fn every_lens_has_a_cone() {
        let widest = PI.next_down();
        for fov_y in [1e-300, 1e-8, 1.0, 3.1, 3.14 + 1.5e-3, widest] {
            for aspect in [1e-300, 1e-9, 1.0, 16.0 / 9.0, 1e8, 1e160, 1e300] {
                let view = View::new(&camera(fov_y, aspect).unwrap(), 1e-3).map(|v| (v.cos_beta, v.sin_beta));
                let (cos, sin) = view.unwrap();
                assert!((0.0..=1.0).contains(&cos) && (0.0..=1.0).contains(&sin), "{fov_y} {aspect}");
            }
        }
    }

    /// A direction that a view has given back is the same to the bit: a camera at rest stays so.
    #[test]
    fn what_is_normalised_is_kept_to_the_bit() {
        let mut x = 0.1_f64;
        for _ in 0..1000 {
            x = (x * 3.9 * (1.0 - x)).clamp(1e-3, 0.999);
            let direction = DVec3::new(x, 1.0 - x, 0.5 - x).normalize() * (1.0 + 1e-7 * (x - 0.5));
            let view = View::from_parts(DVec3::ZERO, direction, 0.8, 0.6, 2.0).unwrap();
            assert!((view.direction().length_squared() - 1.0).abs() <= NORMALISED);
            assert_eq!(view.with_direction(view.direction()), Ok(view));
        }
    }

    #[test]
    fn a_budget_keeps_k_in_range() {
        let view = View::from_parts(DVec3::ZERO, DVec3::X, 0.8, 0.6, 1e308).unwrap();
        assert_eq!(view.coarser(1.0 / 256.0).unwrap().k(), f64::MAX);
        assert_eq!(view.coarser(f64::MAX).unwrap().k(), 1.0);
        assert_eq!(view.coarser(f64::MIN_POSITIVE).unwrap().k(), f64::MAX);
        assert_eq!(view.coarser(2.0).unwrap().k(), 5e307);
        assert!(matches!(view.coarser(0.0), Err(ViewError::Factor { factor: 0.0 })));
    }
}
