//! How long the edges of a mesh are: counted in classes, so that the median depends neither on their order nor on whether
//! they are in memory.

use std::array;

/// Bits of a squared length that do not tell its class: 6 of the mantissa are left, so that the middle of a class is within
/// 2^-7 of all squares in it, and its root within 2^-8 of all lengths.
const CLASS_SHIFT: u32 = 46;

/// Squares of lengths that are less than any difference of single-precision numbers, or more than all of them, need no classes.
const LEAST: f64 = 1e-92;
const MOST: f64 = 1e78;

/// A histogram of the lengths of edges, for their median.
#[derive(Debug, Default)]
pub(crate) struct EdgeLengths {
    /// How many there are in each class; empty before the first.
    classes: Vec<u64>,
    all: u64,
}

impl EdgeLengths {
    /// Adds the three edges of a triangle. Those without a length do not count.
    pub fn add(&mut self, corners: [[f64; 3]; 3]) {
        if self.classes.is_empty() {
            self.classes = vec![0; class(MOST) + 1];
        }
        for (from, to) in [(0, 1), (1, 2), (2, 0)] {
            let [x, y, z]: [f64; 3] = array::from_fn(|axis| corners[to][axis] - corners[from][axis]);
            let squared = x * x + y * y + z * z;
            if squared >= LEAST {
                self.classes[class(squared.min(MOST))] += 1;
                self.all += 1;
            }
        }
    }

    /// The median, within a hundredth; 0 where there is no edge.
    pub fn median(&self) -> f64 {
        let mut before = 0;
        let median = self.classes.iter().position(|&count| {
            before += count;
            count > 0 && 2 * before >= self.all
        });
        match median {
            None => 0.0,
            Some(class) => {
                let least = class as u64 + (LEAST.to_bits() >> CLASS_SHIFT);
                f64::from_bits(least << CLASS_SHIFT | 1 << (CLASS_SHIFT - 1)).sqrt()
            }
        }
    }
}

/// The class of a square between the least and the most.
fn class(squared: f64) -> usize {
    (squared.to_bits() >> CLASS_SHIFT) as usize - (LEAST.to_bits() >> CLASS_SHIFT) as usize
}

/// The power of two at or below a length, and 1 for 0: between 2^-100 and 2^100, so that its reciprocal is a single-precision
/// number too.
pub(crate) fn power_of_two(length: f64) -> f64 {
    // Every single-precision number but 0 has an exponent of its own in double precision.
    let exponent = if length > 0.0 { (length.to_bits() >> 52) as i32 - 1023 } else { 0 };
    f64::from_bits(((exponent.clamp(-100, 100) + 1023) as u64) << 52)
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

    #[test]
    fn the_median_knows_nothing_of_what_is_far_out() {
        let mut edges = EdgeLengths::default();
        for i in 0..10 {
            let z = f64::from(i) * 1e-19;
            edges.add([[0.0, 0.0, z], [3e-20, 0.0, z], [0.0, 3e-20, z]]);
        }
        edges.add([[1e30; 3], [0.0; 3], [-1e30, 0.0, 0.0]]);
        edges.add([[1.0; 3]; 3]);
        assert!((edges.median() / 3e-20 - 1.0).abs() < 0.01, "{}", edges.median());
        let mut far = EdgeLengths::default();
        far.add([[f64::from(f32::MAX); 3], [f64::from(-f32::MAX); 3], [0.0; 3]]);
        assert!(far.median().is_finite());
    }

    #[test]
    fn powers_of_two_are_in_range() {
        const LARGE: f64 = (1_u128 << 100) as f64;
        for (length, power) in [(0.0, 1.0), (1.0, 1.0), (1.9, 1.0), (0.3, 0.25), (1e-45, 1.0 / LARGE)] {
            assert_eq!(power_of_two(length), power);
        }
        assert_eq!(power_of_two(1e38), LARGE);
    }
}
