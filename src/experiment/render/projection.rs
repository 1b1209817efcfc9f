//! From object space to samples of the picture.

use glam::DVec3;

use super::style::{LARGEST, Style};
use crate::experiment::frustum::{Clipped, Frustum};
use selection::view::Camera;

/// Samples along each side of a pixel.
pub(super) const SAMPLES: u32 = 2;
/// Triangles are clipped to a frustum that is larger than the picture, so that the cuts stay out of it.
const GUARD: f64 = 1.25;
/// Corners are moved to multiples of this fraction of a sample. Edge functions are then exact in `f64`: coordinates
/// stay below 2^16 samples, their products below 2^48 steps.
const STEPS: f64 = 256.0;

/// A corner in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Corner {
    /// In samples from the left.
    pub(super) x: f64,
    /// In samples from the top.
    pub(super) y: f64,
    /// One over the depth along the viewing direction: linear over a projected triangle, greater where nearer.
    pub(super) inverse_depth: f64,
}

/// Corners of a triangle, or of a part of it, in the picture, with the barycentric coordinates of each.
pub(super) type Part = ([Corner; 3], [DVec3; 3]);

/// A camera and a picture size.
pub(super) struct Projection {
    /// Size of the picture in pixels.
    pub(super) width: u32,
    pub(super) height: u32,
    camera: Camera,
    /// Right, up and backwards in object space.
    axes: [DVec3; 3],
    /// Samples per unit of x / depth and of y / depth.
    scale: [f64; 2],
    near: f64,
    guard: Frustum,
}

impl Projection {
    pub(super) fn new(camera: &Camera, style: &Style, near: f64) -> Self {
        let near = near.max(f64::MIN_POSITIVE);
        let width = style.width.clamp(1, LARGEST);
        // A conversion from float to integer saturates, and makes 0 of what is not a number.
        let height = ((f64::from(width) / camera.aspect()).round() as u32).clamp(1, LARGEST);
        let half_height = (0.5 * camera.fov_y()).tan();
        Self {
            width,
            height,
            camera: *camera,
            axes: [camera.right(), camera.up(), -camera.direction()],
            scale: [
                0.5 * f64::from(width * SAMPLES) / (half_height * camera.aspect()),
                0.5 * f64::from(height * SAMPLES) / half_height,
            ],
            near,
            guard: Frustum::new(camera, near, GUARD),
        }
    }

    pub(super) fn eye(&self) -> DVec3 {
        self.camera.position()
    }

    /// Turns a vector from camera space to object space.
    pub(super) fn to_object(&self, v: DVec3) -> DVec3 {
        self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z
    }

    /// The triangle in the picture, in parts if it is clipped; none if nothing of it is in view.
    pub(super) fn triangle(&self, corners: [DVec3; 3]) -> Vec<Part> {
        let part = |weights: [DVec3; 3]| {
            let at = |w: DVec3| self.corner(corners[0] * w.x + corners[1] * w.y + corners[2] * w.z);
            (weights.map(at), weights)
        };
        let mut parts = match self.guard.clip(corners) {
            Clipped::Outside => Vec::new(),
            Clipped::Inside => vec![part(DVec3::AXES)],
            Clipped::Partly(polygon) => {
                let polygon = polygon.corners();
                polygon[1..].windows(2).map(|pair| part([polygon[0], pair[0], pair[1]])).collect()
            }
        };
        // Only an impossible camera makes such.
        parts.retain(|(corners, _)| corners.iter().all(|c| c.x.is_finite() && c.y.is_finite()));
        parts
    }

    /// The part of a segment beyond the near plane.
    pub(super) fn segment(&self, [from, to]: [DVec3; 2]) -> Option<[Corner; 2]> {
        let depth = |p: DVec3| self.camera.direction().dot(p - self.eye()) - self.near;
        let (d_from, d_to) = (depth(from), depth(to));
        let cut = || (to * d_from - from * d_to) / (d_from - d_to);
        let ends = match (d_from > 0.0, d_to > 0.0) {
            (true, true) => [from, to],
            (true, false) => [from, cut()],
            (false, true) => [cut(), to],
            (false, false) => return None,
        };
        Some(ends.map(|end| self.corner(end)))
    }

    fn corner(&self, point: DVec3) -> Corner {
        let from_eye = point - self.eye();
        let inverse_depth = -1.0 / self.axes[2].dot(from_eye);
        let [x, y] = [0, 1].map(|axis| self.axes[axis].dot(from_eye) * inverse_depth * self.scale[axis]);
        let snap = |v: f64| (v * STEPS).round() / STEPS;
        Corner {
            x: snap(0.5 * f64::from(self.width * SAMPLES) + x),
            y: snap(0.5 * f64::from(self.height * SAMPLES) - y),
            inverse_depth,
        }
    }
}
