//! Numbers of few bits, after QSplat (Rusinkiewicz & Levoy 2000): positions on a lattice, lengths as small floats that
//! are rounded up, normals on an octahedron.
//!
//! Decoding is a few exact or correctly rounded operations, the same everywhere; the builder computes with the decoded
//! values, so that spheres and cones are nested as stored.

use crate::cone::NO_CONE;

/// Bits of a coordinate.
const COORDINATE_BITS: u32 = 19;
const COORDINATE_MASK: u64 = (1 << COORDINATE_BITS) - 1;
/// Where the sine of the normal cone stands above the three coordinates.
const SINE_SHIFT: u32 = 3 * COORDINATE_BITS;
/// The sine of 1; above it is the code of no cone.
const SINE_ONE: u8 = 126;

/// Bits of a small float's mantissa; the rest of its 16 are the exponent.
const MANTISSA_BITS: u32 = 11;
const DROPPED: u32 = 23 - MANTISSA_BITS;
/// Powers of two that small floats span.
const OCTAVES: u32 = 1 << (16 - MANTISSA_BITS);

/// The lattice and the range of lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Scale {
    /// The lowest corner of the lattice and the distance of its points.
    pub low: [f32; 3],
    pub step: f32,
    /// The bits of the single-precision number below which small floats end.
    pub base: u32,
}

impl Scale {
    /// For a mesh whose coordinates span `low` to `high`.
    pub fn new(low: [f32; 3], high: [f32; 3]) -> Self {
        let side = (0..3).fold(0.0_f64, |side, i| side.max(f64::from(high[i]) - f64::from(low[i])));
        let mut step = (side / COORDINATE_MASK as f64) as f32;
        if f64::from(step) * (COORDINATE_MASK as f64) < side {
            step = step.next_up();
        }
        // Lengths reach 16 sides, which no radius comes near: it is at most a few extents, even where spheres are nested
        // along long paths.
        let top = ((16.0 * side) as f32).clamp(f32::MIN_POSITIVE * 1e10, f32::MAX).to_bits() >> 23;
        Self { low, step, base: (top + 1).saturating_sub(OCTAVES) << 23 }
    }

    /// The nearest lattice point.
    pub fn position(&self, position: [f32; 3]) -> u64 {
        let mut code = 0;
        for axis in 0..3 {
            let offset = f64::from(position[axis]) - f64::from(self.low[axis]);
            let steps = if self.step > 0.0 { (offset / f64::from(self.step)).round() } else { 0.0 };
            code |= (steps as u64).min(COORDINATE_MASK) << (COORDINATE_BITS * axis as u32);
        }
        code
    }

    /// Where a lattice point is; what stands above the coordinates does not matter.
    #[inline]
    pub fn point(&self, code: u64) -> [f32; 3] {
        std::array::from_fn(|axis| {
            let steps = code >> (COORDINATE_BITS * axis as u32) & COORDINATE_MASK;
            // A number of 19 bits is exact.
            self.low[axis] + steps as f32 * self.step
        })
    }

    /// The least small float that is not below `length`; `None` if it is too large for any.
    pub fn length(&self, length: f32) -> Option<u16> {
        if length <= 0.0 {
            return Some(0);
        }
        let above = length.to_bits().saturating_sub(self.base);
        let code = above.div_ceil(1 << DROPPED).max(1);
        u16::try_from(code).ok()
    }

    /// The length of a small float.
    #[inline]
    pub fn decode_length(&self, code: u16) -> f32 {
        if code == 0 { 0.0 } else { f32::from_bits(self.base + (u32::from(code) << DROPPED)) }
    }
}

/// A unit normal as two bytes (Meyer et al., On floating-point normal vectors, 2010).
pub(crate) fn normal(n: [f32; 3]) -> u16 {
    let sum = n.iter().map(|x| x.abs()).sum::<f32>();
    if sum == 0.0 {
        return normal([0.0, 0.0, 1.0]);
    }
    let [mut x, mut y] = [n[0] / sum, n[1] / sum];
    if n[2] < 0.0 {
        let flip = |a: f32, b: f32| (1.0 - b.abs()) * if a < 0.0 { -1.0 } else { 1.0 };
        (x, y) = (flip(x, y), flip(y, x));
    }
    let byte = |x: f32| (x * 127.0).round() as i8 as u8;
    u16::from_le_bytes([byte(x), byte(y)])
}

/// The unit normal of two bytes.
#[inline]
pub(crate) fn decode_normal(code: u16) -> [f32; 3] {
    let [x, y] = code.to_le_bytes().map(|b| (f32::from(b as i8) / 127.0).max(-1.0));
    let z = 1.0 - x.abs() - y.abs();
    let t = (-z).max(0.0);
    let pull = |a: f32| if a < 0.0 { a + t } else { a - t };
    let [x, y] = [pull(x), pull(y)];
    let length = (x * x + y * y + z * z).sqrt();
    if length > 0.0 { [x / length, y / length, z / length] } else { [0.0, 0.0, 1.0] }
}

/// A sine as seven bits above the coordinates, rounded up; anything above 1 is no cone.
pub(crate) fn sine(sine: f32) -> u64 {
    let code = if sine > 1.0 { SINE_ONE + 1 } else { (sine * f32::from(SINE_ONE)).ceil() as u8 };
    u64::from(code) << SINE_SHIFT
}

/// The sine that stands above the coordinates.
#[inline]
pub(crate) fn decode_sine(code: u64) -> f32 {
    let code = (code >> SINE_SHIFT) as u8;
    if code > SINE_ONE { NO_CONE } else { f32::from(code) / f32::from(SINE_ONE) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_rounded_up_by_less_than_a_two_thousandth() {
        let scale = Scale::new([-1.0, 0.0, 0.0], [2.0, 1.0, 0.5]);
        let mut x = 1e-7_f32;
        while x < 40.0 {
            let y = scale.decode_length(scale.length(x).unwrap());
            assert!(y >= x && y <= x * (1.0 + 1.0 / 2048.0), "{x} became {y}");
            assert_eq!(scale.decode_length(scale.length(y).unwrap()), y, "stored values stay");
            x *= 1.001;
        }
        assert_eq!(scale.decode_length(scale.length(0.0).unwrap()), 0.0);
        assert!(scale.decode_length(scale.length(1e-30).unwrap()) >= 1e-30);
        assert_eq!(scale.length(100.0), None);
    }

    #[test]
    fn positions_move_by_at_most_half_a_step() {
        let scale = Scale::new([-1.0, 5.0, 0.0], [2.0, 6.0, 0.0]);
        for i in 0..1000 {
            let t = i as f32 / 999.0;
            let p = [-1.0 + 3.0 * t, 5.0 + t * t, 0.0];
            let q = scale.point(scale.position(p));
            for axis in 0..3 {
                assert!((p[axis] - q[axis]).abs() <= 0.51 * scale.step + 1e-6, "{p:?} became {q:?}");
            }
            assert_eq!(scale.point(scale.position(q)), q);
        }
    }

    #[test]
    #[expect(clippy::disallowed_methods, reason = "normals all around")]
    fn normals_turn_by_less_than_two_degrees() {
        for i in 0..40 {
            for j in 0..80 {
                let (theta, phi) = (i as f32 * 0.0785, j as f32 * 0.0785);
                let n = [theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()];
                let m = decode_normal(normal(n));
                let cosine: f32 = (0..3).map(|axis| n[axis] * m[axis]).sum();
                assert!(cosine > 0.9994, "{n:?} became {m:?}");
            }
        }
        assert!((decode_normal(normal([0.0; 3]))[2] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn sines_are_rounded_up() {
        for i in 0..=1000 {
            let s = i as f32 / 1000.0;
            let t = decode_sine(sine(s));
            assert!(t >= s && t < s + 1.0 / 125.0);
        }
        assert!(decode_sine(sine(2.0)) > 1.0);
    }
}
