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

/// Bits of a 32-bit length that do not tell its class: 7 of the mantissa are left, so that the middle of a class is within
/// 2^-8 of all lengths in it.
const CLASS_SHIFT: u32 = 16;

/// A histogram of the lengths of edges, for their median.
#[derive(Debug, Default)]
pub(crate) struct EdgeLengths {
    /// How many there are in each class; empty before the first.
    classes: Vec<u64>,
    all: u64,
}

impl EdgeLengths {
    /// Adds the three edges of a triangle.
    pub fn add(&mut self, corners: [[f64; 3]; 3]) {
        if self.classes.is_empty() {
            self.classes = vec![0; (f32::INFINITY.to_bits() >> CLASS_SHIFT) as usize + 1];
        }
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let squares: [f64; 3] = array::from_fn(|axis| (corners[to][axis] - corners[from][axis]).powi(2));
            let length = squares.iter().sum::<f64>().sqrt() as f32;
            self.classes[(length.to_bits() >> CLASS_SHIFT) as usize] += 1;
            self.all += 1;
        }
    }

    /// The median, within a hundredth; 0 where there is no edge.
    pub fn median(&self) -> f64 {
        let mut before = 0;
        let median = self.classes.iter().position(|&count| {
            before += count;
            2 * before >= self.all
        });
        match median {
            None | Some(0) => 0.0,
            Some(class) => f64::from(f32::from_bits((class as u32) << CLASS_SHIFT | 1 << (CLASS_SHIFT - 1))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_within_a_hundredth() {
        for scale in [1e-30, 1e-3, 1.0, 7e9] {
            let mut edges = EdgeLengths::default();
            let mut lengths = Vec::new();
            for i in 1..100 {
                // Sides 3, 4 and 5.
                let side = scale * f64::from(i);
                edges.add([[0.0; 3], [3.0 * side, 0.0, 0.0], [3.0 * side, 4.0 * side, 0.0]]);
                lengths.extend([3.0, 4.0, 5.0].map(|x| x * side));
            }
            lengths.sort_by(f64::total_cmp);
            let median = lengths[lengths.len() / 2];
            assert!((edges.median() / median - 1.0).abs() < 0.01, "{} {median}", edges.median());
        }
        assert_eq!(EdgeLengths::default().median(), 0.0);
    }
}
