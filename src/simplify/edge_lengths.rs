//! How long the edges of a mesh are, and the unit of length that follows.
//!
//! Keys and quadrics are single-precision numbers of up to four lengths multiplied. They neither overflow nor vanish as long
//! as lengths are within nine orders of magnitude of the unit, so this must not be the extent, which a single vertex far
//! out can make as large as it likes, but what most edges are like: a power of two near the median of their lengths.
//! Lengths are counted in classes, so that the result depends neither on their order nor on whether they are in memory.

use glam::Vec3;

/// Bits of a length that do not tell classes apart: those of one class differ by less than half a percent.
const DROPPED_BITS: u32 = 15;
const CLASSES: usize = (f32::INFINITY.to_bits() >> DROPPED_BITS) as usize;

/// Exponents of the least and of the largest unit: its reciprocal must be a single-precision number too.
const LEAST_EXPONENT: i32 = -100;
const LARGEST_EXPONENT: i32 = 100;

/// Numbers of edges in classes of nearly equal lengths.
#[derive(Clone, Debug)]
pub(super) struct EdgeLengths {
    counts: Vec<u64>,
    all: u64,
}

impl EdgeLengths {
    pub fn new() -> EdgeLengths {
        EdgeLengths { counts: vec![0; CLASSES], all: 0 }
    }

    /// Adds the edges of a triangle. Those without a length do not count.
    pub fn add(&mut self, [a, b, c]: [Vec3; 3]) {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            let length = (to.as_dvec3() - from.as_dvec3()).length().min(f64::from(f32::MAX)) as f32;
            if length > 0.0 {
                self.counts[(length.to_bits() >> DROPPED_BITS) as usize] += 1;
                self.all += 1;
            }
        }
    }

    /// The median, within half a percent; 0 where no edge has a length.
    pub fn median(&self) -> f32 {
        let mut below = 0;
        let class = self.counts.iter().position(|&count| {
            below += count;
            2 * below >= self.all && count > 0
        });
        class.map_or(0.0, |class| f32::from_bits((class as u32) << DROPPED_BITS | 1 << (DROPPED_BITS - 1)))
    }

    /// Length of a unit of the simplification in object units: a power of two.
    pub fn unit(&self) -> f64 {
        let median = f64::from(self.median());
        // Every single-precision number but 0 has an exponent of its own in double precision.
        let exponent = if median > 0.0 { (median.to_bits() >> 52) as i32 - 1023 } else { 0 };
        2.0_f64.powi(exponent.clamp(LEAST_EXPONENT, LARGEST_EXPONENT))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_is_near_the_median_edge_whatever_else_there_is() {
        let mut lengths = EdgeLengths::new();
        assert_eq!((lengths.median(), lengths.unit()), (0.0, 1.0));
        for i in 0..10 {
            lengths.add([Vec3::ZERO, Vec3::X, Vec3::Y].map(|p| p * 3e-20 + Vec3::Z * i as f32 * 1e-19));
        }
        lengths.add([Vec3::splat(1e30), Vec3::ZERO, Vec3::NEG_X * 1e30]);
        lengths.add([Vec3::ONE; 3]);
        assert!((lengths.median() / 3e-20 - 1.0).abs() < 0.005, "{}", lengths.median());
        assert!(lengths.unit() <= 3e-20 && lengths.unit() > 1.5e-20);
        let mut far = EdgeLengths::new();
        far.add([Vec3::splat(f32::MAX), Vec3::splat(-f32::MAX), Vec3::ZERO]);
        assert!(far.median().is_finite() && far.unit() == 2.0_f64.powi(100));
    }
}
