//! Noise and random numbers that are bit-identical on every platform.
//!
//! The generator is rand_pcg's. Noise is by hand: the bits of the scenes, and with them every frozen cut, depend on the order of
//! every operation in it.
//!
//! Only `+ - * /` and `sqrt` on f64, which IEEE 754 defines exactly, and integer hashing: no function of the
//! platform's mathematics library. Gradient noise after Perlin, "Improving Noise" (2002), with gradients hashed
//! instead of tabulated; ridged multifractal after Musgrave, in Ebert et al., "Texturing and Modeling" (1994).

use rand::Rng;
use rand_pcg::Pcg64;

/// A named, independent stream of random numbers.
pub(crate) struct Dice(Pcg64);

impl Dice {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Pcg64::new(u128::from(mix(seed)), u128::from(seed)))
    }

    /// Uniform in 0..1.
    pub(crate) fn unit(&mut self) -> f64 {
        fraction(self.0.next_u64())
    }

    /// Uniform in `low..high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }
}

/// Finaliser of SplitMix64 (Steele et al. 2014): every input bit changes every output bit with chance one half.
fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

fn hash(seed: u64, x: i64, y: i64) -> u64 {
    mix(mix(seed ^ mix(x as u64)).wrapping_add(y as u64))
}

fn fraction(bits: u64) -> f64 {
    (bits >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
}

/// White noise on the integer lattice, uniform in -1..1.
pub(crate) fn white(seed: u64, x: i64, y: i64) -> f64 {
    2.0 * fraction(hash(seed, x, y)) - 1.0
}

/// Gradient noise, within about -1..1, with features about 1 across. It is exactly 0 at integer points, which lets
/// a finer sampling of a lattice add detail without moving the samples it shares with the coarser one.
pub(crate) fn gradient(seed: u64, x: f64, y: f64) -> f64 {
    let (cell_x, cell_y) = (x.floor(), y.floor());
    let (fx, fy) = (x - cell_x, y - cell_y);
    let corner = |dx: i64, dy: i64| {
        let bits = hash(seed, cell_x as i64 + dx, cell_y as i64 + dy);
        let slope_x = (bits & 0xffff_ffff) as f64 / 2_147_483_648.0 - 1.0;
        let slope_y = (bits >> 32) as f64 / 2_147_483_648.0 - 1.0;
        slope_x * (fx - dx as f64) + slope_y * (fy - dy as f64)
    };
    let (u, v) = (fade(fx), fade(fy));
    let low = mix_linear(corner(0, 0), corner(1, 0), u);
    let high = mix_linear(corner(0, 1), corner(1, 1), u);
    1.4 * mix_linear(low, high, v)
}

/// Sum of octaves of gradient noise, each twice as fine and half as strong; within about -1..1.
pub(crate) fn fractal(seed: u64, x: f64, y: f64, octaves: u32) -> f64 {
    let (mut sum, mut strength, mut frequency) = (0.0, 0.6, 1.0);
    for octave in 0..octaves {
        sum += strength * gradient(seed + u64::from(octave), x * frequency, y * frequency);
        strength *= 0.5;
        frequency *= 2.0;
    }
    sum
}

/// Ridged multifractal, about 0..1: sharp crests where the noise changes sign, rough high up and smooth in valleys
/// because each octave is weighted by the one before.
pub(crate) fn ridged(seed: u64, x: f64, y: f64, octaves: u32) -> f64 {
    let (mut sum, mut strength, mut frequency, mut weight) = (0.0, 0.5, 1.0, 1.0);
    for octave in 0..octaves {
        let crest = 1.0 - gradient(seed + u64::from(octave), x * frequency, y * frequency).abs();
        let signal = crest * crest * weight;
        weight = (2.0 * signal).clamp(0.0, 1.0);
        sum += strength * signal;
        strength *= 0.5;
        frequency *= 2.0;
    }
    sum
}

/// Quintic step from 0 to 1 with two continuous derivatives.
fn fade(t: f64) -> f64 {
    t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
}

/// Smooth step from 0 at `low` to 1 at `high`.
pub(crate) fn smooth_step(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

pub(crate) fn mix_linear(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradient_noise_vanishes_on_the_lattice_and_only_there() {
        for i in -20..20 {
            assert_eq!(gradient(7, f64::from(i), f64::from(3 * i)), 0.0);
        }
        assert!(gradient(7, 0.4, 0.3) != 0.0);
    }

    #[test]
    fn noise_is_the_same_for_ever() {
        let bits =
            [white(1, 2, 3), gradient(1, 2.25, 3.5), fractal(1, 2.25, 3.5, 5), ridged(1, 2.25, 3.5, 5)]
                .map(f64::to_bits);
        assert_eq!(
            bits,
            [0x3fe9_bc67_295e_2f48, 0x3fe0_2876_84a6_b599, 0x3fcb_6796_8203_4d6f, 0x3fd5_7f1a_8d54_52e1]
        );
    }
}
