//! What is right in a camera and in a view, and what is said where something is not.

use glam::{DQuat, DVec3};

/// A camera or a view can not be made of what was given.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// A coordinate of an eye is not finite, or beyond [`View::FARTHEST`](super::View::FARTHEST).
    #[error("the eye {eye:?} is not finite, or farther away than {:e}", FARTHEST)]
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
    /// A coordinate of an origin is not finite, or beyond [`View::FARTHEST`](super::View::FARTHEST).
    #[error("the origin {origin:?} is not finite, or farther away than {:e}", FARTHEST)]
    Origin {
        /// As given.
        origin: [f64; 3],
    },
}

/// See [`View::FARTHEST`](super::View::FARTHEST).
pub(super) const FARTHEST: f64 = vertex_tree::Georeference::FARTHEST;

/// How far from 1 the square of a length may be that is meant to be 1.
const UNIT: f64 = 2e-6;
/// A vector whose square is within this of 1 has been normalised, and is kept to the bit.
pub(super) const NORMALISED: f64 = 1e-14;
/// How far from 1 the squares of a cosine and a sine may add up to.
const CONE: f64 = 1e-12;

fn is_place(place: DVec3) -> bool {
    place.abs().max_element() <= FARTHEST && place.is_finite()
}

/// What has been found to be an eye.
///
/// # Errors
/// It is none.
pub fn check_eye(eye: DVec3) -> Result<DVec3, ViewError> {
    if is_place(eye) { Ok(eye) } else { Err(ViewError::Eye { eye: eye.to_array() }) }
}

/// What has been found to be an origin.
pub(crate) fn check_origin(origin: [f64; 3]) -> Result<[f64; 3], ViewError> {
    if is_place(origin.into()) { Ok(origin) } else { Err(ViewError::Origin { origin }) }
}

/// What has been found to be a field of view.
///
/// # Errors
/// It is none.
pub fn check_fov(fov_y: f64) -> Result<f64, ViewError> {
    let fits = fov_y > 0.0 && fov_y < std::f64::consts::PI;
    if fits { Ok(fov_y) } else { Err(ViewError::FieldOfView { fov_y }) }
}

/// What has been found to be an aspect.
///
/// # Errors
/// It is none.
pub fn check_aspect(aspect: f64) -> Result<f64, ViewError> {
    if aspect > 0.0 && aspect.is_finite() { Ok(aspect) } else { Err(ViewError::Aspect { aspect }) }
}

/// What has been found to be a rotation.
///
/// # Errors
/// It is none.
pub fn check_orientation(orientation: DQuat) -> Result<DQuat, ViewError> {
    let fits = (orientation.length_squared() - 1.0).abs() <= UNIT;
    if fits { Ok(orientation) } else { Err(ViewError::Orientation { orientation: orientation.to_array() }) }
}

/// The direction at length 1, to the bit where it has been normalised before.
pub(super) fn unit(direction: DVec3) -> Result<DVec3, ViewError> {
    let squared = direction.length_squared();
    let off = (squared - 1.0).abs();
    match off {
        _ if off <= NORMALISED => Ok(direction),
        _ if off <= UNIT => Ok(direction / squared.sqrt()),
        _ => Err(ViewError::Direction { direction: direction.to_array() }),
    }
}

pub(super) fn check_cone(cos_beta: f64, sin_beta: f64) -> Result<(), ViewError> {
    let is_angle = (cos_beta * cos_beta + sin_beta * sin_beta - 1.0).abs() <= CONE;
    if is_angle && cos_beta >= 0.0 && sin_beta >= 0.0 {
        Ok(())
    } else {
        Err(ViewError::Cone { cos_beta, sin_beta })
    }
}

pub(super) fn check_k(k: f64) -> Result<f64, ViewError> {
    if k >= 1.0 && k.is_finite() { Ok(k) } else { Err(ViewError::Scale { k }) }
}
