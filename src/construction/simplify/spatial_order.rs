//! Vertex numbers that are close where the vertices are close.
//!
//! Vertices are sorted along the Z-order curve (Morton 1966) through a grid of 1024 cells a side over the bounding
//! box, so that a star, and the stars around it, share cache lines whatever the order of the input.

use collapse_log::z_order;
use glam::Vec3;

/// The curve through a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Curve {
    low: Vec3,
    /// Cells a unit of length.
    cells: f32,
}

impl Curve {
    pub fn new(low: Vec3, high: Vec3) -> Curve {
        let side = (high - low).max_element();
        Curve { low, cells: if side > 0.0 { 1023.99 / side } else { 0.0 } }
    }

    /// How far along the curve a point of the box lies.
    pub fn key(&self, p: Vec3) -> u32 {
        let cell = (p - self.low) * self.cells;
        z_order(cell.to_array().map(|x| x as u32))
    }
}

/// The input numbers of the vertices in spatial order.
pub(super) fn spatial_order(positions: &[Vec3]) -> Vec<u32> {
    let low = positions.iter().fold(Vec3::INFINITY, |low, &p| low.min(p));
    let high = positions.iter().fold(Vec3::NEG_INFINITY, |high, &p| high.max(p));
    let curve = Curve::new(low, high);
    let mut order: Vec<u64> =
        (0_u64..).zip(positions).map(|(v, &p)| u64::from(curve.key(p)) << 32 | v).collect();
    order.sort_unstable();
    order.into_iter().map(|entry| entry as u32).collect()
}
