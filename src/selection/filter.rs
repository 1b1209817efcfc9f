//! A vectorised filter in f32 before the canonical predicate: which nodes are certain to be wanted, or not to be.
//!
//! The filter evaluates the criterion (see [`criterion`](crate::criterion)) for a whole [`Block`] in single precision
//! and is certain only outside of an error band. Everything inside the band goes on to the canonical predicate in f64,
//! so the outcome is the predicate's, whatever vector instructions the processor has.
//!
//! # The error band
//!
//! Let `u = 2^-24`, `M = |e|` and let a hat mark what is computed. Rounding the eye and the difference displaces the
//! centre by at most `2u (M + d)`, and rounding the direction turns it by `u`. With that, `|d^ - d| <= 5u (M + d)`,
//! `|a^ - a| <= 6u (M + d)`, `|R^ - R| <= 3u R`, and `b = r + a sin beta` is good to `9u (M + d + r)`.
//!
//! `p = |D x v|`, as in the predicate, and that is `|D - a v|` with three operations less. The displacement, `a^` and the
//! turn put this vector off by `9u (M + d)`, rounding of the products and of the differences by `2u d`; the squares,
//! their sum and the root lose `2.5u` of what they are. So `|p^ - p| <= 14u (M + d)`, and `p cos beta` is good to
//! `16u (M + d)`, also where it is squared and compared with a square, which takes another `u` from either. `p cos beta`
//! and `b` differ from the truth by less than `27u (M + d + r)` together, and so do `p cos beta - a sin beta` and
//! `q = a cos beta + p sin beta`. The half widths used,
//!
//! ```text
//! margin       = 16u (M + d^ + r)       of differences of lengths
//! coarse band  = margin + 16u R^        of d - R
//! cone band    = 2 margin               of p cos beta - b, of f - r and of q
//! ```
//!
//! leave room for their own rounding. A tiny constant in the margin covers what underflows; what overflows is infinite or
//! not a number, for which no comparison below is certain; a `k` that single precision can not hold is made so. `p^` can
//! overflow where `d^` does not: it is never longer, and is kept so.

use crate::criterion::Criterion;
use crate::motion::Course;
use crate::packed::{Block, LANES};
use crate::view::View;

/// `16u`.
const MARGIN: f32 = 16.0 / 16_777_216.0;
/// The square of this is a normal number, and products of it with the factors above are not lost among the
/// subnormal ones.
const TINY: f32 = 1e-18;
/// Far from the subnormal numbers, and from infinity.
const TINIEST: f32 = 1e-30;
const HUGEST: f32 = 1e30;

/// A view rounded to f32, with the criterion's form of `R = r k_radius + eps k_eps`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    eye: [f32; 3],
    direction: [f32; 3],
    cos2_beta: f32,
    cos_beta: f32,
    sin_beta: f32,
    k_radius: f32,
    k_eps: f32,
    /// `dR/dk` likewise.
    slope_radius: f32,
    slope_eps: f32,
    /// The margin at the eye.
    margin: f32,
}

impl Lens {
    pub fn new(criterion: Criterion, view: &View) -> Self {
        let eye = view.eye().as_vec3().to_array();
        // An infinite one would make R infinite, also of the smallest error.
        let k = Some(view.k() as f32).filter(|k| k.is_finite()).unwrap_or(f32::NAN);
        let (k_radius, k_eps, slope_radius, slope_eps) = match criterion {
            Criterion::ScreenError => (1.0, k, 0.0, 1.0),
            Criterion::SphereSize => (k, 0.0, 1.0, 0.0),
        };
        Self {
            eye,
            direction: view.direction().as_vec3().to_array(),
            cos2_beta: (view.cos_beta() * view.cos_beta()) as f32,
            cos_beta: view.cos_beta() as f32,
            sin_beta: view.sin_beta() as f32,
            k_radius,
            k_eps,
            slope_radius,
            slope_eps,
            margin: MARGIN * (view.eye().length() as f32).next_up() + TINY,
        }
    }
}

/// For each entry of a block whether the filter is certain, 1 or 0: that some view wants the node if `WANTED`, that
/// none does if not.
#[inline(always)]
pub(crate) fn certainly<const WANTED: bool>(block: &Block, lenses: &[Lens]) -> [u32; LANES] {
    let mut certain = [u32::from(!WANTED); LANES];
    for lens in lenses {
        for i in 0..LANES {
            let (x, y, z) = (block.x[i] - lens.eye[0], block.y[i] - lens.eye[1], block.z[i] - lens.eye[2]);
            let (r, eps) = (block.radius[i], block.eps[i]);
            let d2 = x * x + y * y + z * z;
            let d = d2.sqrt();
            let reach = r * lens.k_radius + eps * lens.k_eps;
            let margin = MARGIN * (d + r) + lens.margin;
            let a = x * lens.direction[0] + y * lens.direction[1] + z * lens.direction[2];
            let p2_cos2 = smaller(squared_across([x, y, z], a, lens.direction), d2) * lens.cos2_beta;
            let b = r + a * lens.sin_beta;
            let cone_band = 2.0 * margin;
            if WANTED {
                let low = b - cone_band;
                let coarse = d + margin <= reach * (1.0 - MARGIN);
                let inside = d + margin <= r;
                // Ahead of the eye the line that bounds the cone is its nearest part.
                let visible = (a >= margin) & (low >= 0.0) & (p2_cos2 <= low * low);
                certain[i] |= u32::from(coarse & (inside | visible));
            } else {
                let high = b + cone_band;
                let fine = d > reach * (1.0 + MARGIN) + margin;
                // The line is at most as far away as the cone, so this holds behind the apex too.
                let invisible = (high < 0.0) | (p2_cos2 > high * high);
                certain[i] &= u32::from(fine | invisible);
            }
        }
    }
    certain
}

/// A course in f32, with speeds rounded up: one that f32 can not hold would be none at all.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rates {
    heading: [f32; 3],
    rho: f32,
    stray: f32,
    /// `rho + stray`.
    any: f32,
    omega: f32,
    kappa: f32,
}

impl Rates {
    pub fn new(course: &Course) -> Self {
        let up = |x: f64| if x > 0.0 { (x as f32).next_up() } else { 0.0 };
        let &Course { heading, rho, stray, omega, kappa } = course;
        Self {
            heading: heading.as_vec3().to_array(),
            rho: up(rho),
            stray: up(stray),
            any: up(rho + stray),
            omega: up(omega),
            kappa: up(kappa),
        }
    }
}

/// For each entry of a block, how many frames on a course must pass before its status can have to change: a boundary
/// node's where the tag is even, otherwise a collapsible one's. Never late; 0 where the filter can not say.
///
/// The time bounds of [`Criterion::earliest_unfold`] and [`Criterion::earliest_fold`], taken at that end of the error
/// band which makes them earlier: for an unfolding the nearer one, for a folding the farther one. Whether the apex or the
/// line is the nearest part of the cone is certain where `q = a cos beta + p sin beta` is out of the band around 0.
///
/// Rates that depend on the heading are multiplied by `d`, or rather a little less, so that one division serves.
#[inline(always)]
pub(crate) fn earliest(block: &Block, lenses: &[Lens], rates: &Rates) -> [f32; LANES] {
    let &Rates { heading, rho, stray, any, omega, kappa } = rates;
    let per_any = (1.0 - 1.0 / 1_048_576.0) / rate(any);
    let mut earliest: [f32; LANES] =
        std::array::from_fn(|i| if block.tag[i] & 1 == 0 { f32::INFINITY } else { 0.0 });
    for lens in lenses {
        for i in 0..LANES {
            let unfolds = block.tag[i] & 1 == 0;
            let (x, y, z) = (block.x[i] - lens.eye[0], block.y[i] - lens.eye[1], block.z[i] - lens.eye[2]);
            let (r, eps) = (block.radius[i], block.eps[i]);
            let d2 = x * x + y * y + z * z;
            let d = d2.sqrt();
            let reach = r * lens.k_radius + eps * lens.k_eps;
            let steered = kappa * (r * lens.slope_radius + eps * lens.slope_eps);
            let margin = MARGIN * (d + r) + lens.margin;
            let coarse_band = margin + MARGIN * reach;
            let a = x * lens.direction[0] + y * lens.direction[1] + z * lens.direction[2];
            let p = smaller(squared_across([x, y, z], a, lens.direction), d2).sqrt();
            let cone_band = 2.0 * margin;
            // Behind the apex, the distance from the cone is that from the eye, and never less than that from its line.
            let line = p * lens.cos_beta - a * lens.sin_beta;
            let q = a * lens.cos_beta + p * lens.sin_beta;
            let is_line = if unfolds { q >= -cone_band } else { q > cone_band };
            let f = if is_line { line } else { d };

            let sign = if unfolds { 1.0 } else { -1.0 };
            let sideways = frames(sign * (f - r) - cone_band, rate(any + omega * (d + margin)));

            let near = larger(d - margin, TINY);
            let along = sign * (x * heading[0] + y * heading[1] + z * heading[2]) + margin;
            let towards = rho * smaller(larger(along, 0.0), near) + (stray + steered) * near;
            let slack = larger(sign * (d - reach) - 2.0 * coarse_band, 0.0) * near;
            // Of a product near the ends of what f32 can hold, too little is left to say anything.
            let slack = if (slack > TINIEST) & (slack < HUGEST) { slack } else { 0.0 };
            // sqrt(b^2 + 4cw) <= b + 2 sqrt(cw), which can not get lost.
            let bending = if unfolds { 0.0 } else { 0.5 * any * (2.0 * slack).sqrt() };
            let radial = frames(slack, rate(smaller(towards + bending, (any + steered) * near)));

            let outside = (r - d - 2.0 * margin) * per_any;
            let both = larger(sideways, radial);
            let either = larger(outside, smaller(sideways, radial));
            // What is not a number says nothing.
            let least = larger(if unfolds { both } else { either }, 0.0);
            earliest[i] = if unfolds { smaller(earliest[i], least) } else { larger(earliest[i], least) };
        }
    }
    // It may be the division that has overflown, not the time that is infinite.
    earliest.map(|frames| smaller(frames, f32::MAX))
}

/// `|D x v|^2 = |D - a v|^2`.
#[inline(always)]
fn squared_across([x, y, z]: [f32; 3], a: f32, [vx, vy, vz]: [f32; 3]) -> f32 {
    let (px, py, pz) = (x - a * vx, y - a * vy, z - a * vz);
    px * px + py * py + pz * pz
}

/// A rate, and more than its computation and a division by it can have lost, also to underflow.
#[inline(always)]
fn rate(rate: f32) -> f32 {
    rate * (1.0 + 1.0 / 1_048_576.0) + f32::MIN_POSITIVE
}

/// 0 also for what is not a number.
#[inline(always)]
fn frames(distance: f32, rate: f32) -> f32 {
    if distance > 0.0 { distance / rate } else { 0.0 }
}

/// Comparisons as the processor has them, without care for what is not a number.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The lenses of some views.
pub(crate) struct Lenses {
    lenses: [Lens; MOST_VIEWS],
    count: usize,
}

/// Views that the filter takes: two eyes and the cascades of a shadow map.
pub(crate) const MOST_VIEWS: usize = 8;

impl Lenses {
    /// `None` for more than [`MOST_VIEWS`] views.
    pub fn new(criterion: Criterion, views: &[View]) -> Option<Self> {
        let blank = Lens {
            eye: [0.0; 3],
            direction: [0.0; 3],
            cos2_beta: 0.0,
            cos_beta: 0.0,
            sin_beta: 0.0,
            k_radius: 0.0,
            k_eps: 0.0,
            slope_radius: 0.0,
            slope_eps: 0.0,
            margin: 0.0,
        };
        let mut lenses = [blank; MOST_VIEWS];
        for (i, view) in views.iter().enumerate() {
            *lenses.get_mut(i)? = Lens::new(criterion, view);
        }
        Some(Self { lenses, count: views.len() })
    }

    #[inline(always)]
    pub fn as_slice(&self) -> &[Lens] {
        &self.lenses[..self.count]
    }
}

/// The entries among the first `used` that are not certain, as a bit mask.
#[inline(always)]
pub(crate) fn doubtful(certain: &[u32; LANES], used: usize) -> u32 {
    // Seldom is any.
    if certain.iter().fold(1, |all, c| all & c) == 1 {
        return 0;
    }
    let mask = (0..LANES).fold(0, |mask, i| mask | (u32::from(certain[i] == 0) << i));
    mask & ((1_u32 << used) - 1)
}

/// Calls `f` with each bit that is set.
#[inline(always)]
pub(crate) fn for_each_bit(mut mask: u32, mut f: impl FnMut(usize)) {
    while mask != 0 {
        f(mask.trailing_zeros() as usize);
        mask &= mask - 1;
    }
}

#[cfg(test)]
mod tests;
