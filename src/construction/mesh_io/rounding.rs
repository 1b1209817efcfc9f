//! World coordinates, which are f64, as 32-bit positions about an origin.

use std::array;

/// The coordinates in 32 bits, if these hold them exactly; -0 stays what it is.
pub(crate) fn exact(position: [f64; 3]) -> Option<[f32; 3]> {
    let short = position.map(|x| x as f32);
    (short.map(f64::from) == position).then_some(short)
}

/// An axis-aligned box around points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
    low: [f64; 3],
    high: [f64; 3],
}

impl Default for Bounds {
    fn default() -> Self {
        Self { low: [f64::INFINITY; 3], high: [f64::NEG_INFINITY; 3] }
    }
}

impl Bounds {
    pub fn include(&mut self, p: [f64; 3]) {
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(p[axis]);
            self.high[axis] = self.high[axis].max(p[axis]);
        }
    }
}

/// Makes positions about the middle of a box.
///
/// No coordinate is further from the middle than half the extent along its axis, and 32 bits keep it within 2^-24 of that:
/// none moves by more than 2^-25 of the extent (or by 2^-150, where the extent is smaller than 32-bit numbers can be). World
/// coordinates are within the range of 32 bits, so half an extent is as well.
#[derive(Debug)]
pub(crate) struct Placing {
    pub origin: [f64; 3],
    /// The largest difference between a coordinate and what has been made of it.
    pub largest_move: f64,
}

impl Placing {
    pub fn new(bounds: &Bounds) -> Self {
        let origin = array::from_fn(|axis| f64::midpoint(bounds.low[axis], bounds.high[axis]));
        Self { origin, largest_move: 0.0 }
    }

    pub fn place(&mut self, world: [f64; 3]) -> [f32; 3] {
        array::from_fn(|axis| {
            let local = world[axis] - self.origin[axis];
            let position = local as f32;
            self.largest_move = self.largest_move.max((local - f64::from(position)).abs());
            position
        })
    }
}
