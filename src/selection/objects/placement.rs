//! Where an object is in its scene.

use glam::{DMat3, DQuat, DVec3};

use crate::view::{View, ViewError};

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
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlacementError {
    /// A number is not finite.
    #[error("number {number} of the matrix is {value}, which is not finite")]
    NotFinite {
        /// Which of the twelve, from 1.
        number: usize,
        /// As given, in the words of `f64`: one that is not a number equals none, not even itself.
        value: String,
    },
    /// The matrix flattens the object.
    #[error("the matrix has no volume: its determinant is {determinant:?}")]
    Flat {
        /// As found.
        determinant: f64,
    },
    /// The matrix mirrors the object, which would turn its triangles over.
    #[error("the matrix mirrors: its determinant is {determinant:?}")]
    Mirrored {
        /// As found.
        determinant: f64,
    },
    /// The matrix stretches or shears the object.
    #[error(
        "the matrix stretches or shears by {by:?}: only one scale, a rotation and a translation are allowed"
    )]
    Stretched {
        /// Largest deviation from a rotation, as a share of the scale.
        by: f64,
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
        if let Some(at) = rows.iter().position(|x| !x.is_finite()) {
            return Err(PlacementError::NotFinite { number: at + 1, value: rows[at].to_string() });
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
