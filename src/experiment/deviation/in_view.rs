//! What of a mesh is in view, and how large.

// The measured figures are off the selection path.
#![expect(clippy::disallowed_methods, reason = "off the selection path")]

use collapse_log::Mesh;
use glam::DVec3;
use rayon::prelude::*;

use crate::experiment::frustum::{Clipped, Frustum};
use selection::view::Camera;

/// Points and triangles are worked off in pieces of this many.
pub(super) const CHUNK: usize = 4096;

/// How much of a displayed triangle is in view.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Seen {
    Everything,
    Part,
    Nothing,
}

/// What the camera sees, and how large.
pub(super) struct View {
    pub frustum: Frustum,
    eye: DVec3,
    /// Pixels that a length equal to its distance from the eye takes in the image.
    pixels_per_angle: f64,
    /// Distances from the eye count as at least this much.
    near: f64,
}

pub(super) fn count_in_view(seen: &[Seen]) -> usize {
    seen.iter().filter(|&&seen| seen != Seen::Nothing).count()
}

impl View {
    /// How much of each triangle of a mesh is in view.
    pub fn all_seen(&self, mesh: &Mesh) -> Vec<Seen> {
        let triangles = (0..mesh.triangles.len()).into_par_iter().with_min_len(CHUNK);
        triangles.map(|t| self.seen(corners(mesh, t))).collect()
    }

    pub fn new(camera: &Camera, lines: u32, near: f64) -> Self {
        // A single point as original has no extent; any near plane will do for it.
        let near = near.max(f64::MIN_POSITIVE);
        let pixels_per_angle = 0.5 * f64::from(lines) / (0.5 * camera.fov_y()).tan();
        Self { frustum: Frustum::new(camera, near, 1.0), eye: camera.position(), pixels_per_angle, near }
    }

    pub fn seen(&self, corners: [DVec3; 3]) -> Seen {
        match self.frustum.clip(corners) {
            Clipped::Inside => Seen::Everything,
            Clipped::Partly(_) => Seen::Part,
            Clipped::Outside => Seen::Nothing,
        }
    }

    /// Pixels of the length `distance` at the place `at`.
    pub fn pixels(&self, distance: f64, at: DVec3) -> f64 {
        distance * self.pixels_per_angle / at.distance(self.eye).max(self.near)
    }
}

/// The corners of a triangle.
pub(super) fn corners(mesh: &Mesh, triangle: usize) -> [DVec3; 3] {
    mesh.triangles[triangle].map(|v| DVec3::from(mesh.positions[v as usize].map(f64::from)))
}
