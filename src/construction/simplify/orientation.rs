//! Whether a collapse turns a triangle over.
//!
//! This is asked in terms of the star's own edges: where the mesh lies, how large it is, and what else there is makes no
//! difference. Positions are single-precision numbers, their differences exact in double precision unless one number is
//! 2^29 times the other, and no product of lengths between 10^-45 and 10^38 that is formed here leaves the range of double
//! precision.
//!
//! Most triangles turn by so little that single precision can tell, four of them at a time.

use glam::{DVec3, Vec3, Vec4};

use super::lanes::{self, Lanes};
use super::surface::{Spoke, Surface};

/// A triangle may turn by less than this: the square of the cosine of about 75 degrees, and of 88 where nothing else is left.
const COSINE_SQUARED: [f64; 2] = [0.0625, 0.001];
/// A triangle whose doubled area is less than this part of its longest squared edge at the vertex has no normal to
/// speak of; squared.
const FLAT_SQUARED: f64 = 1e-10;
/// A normal that is shorter than this part of the product of the edges it comes from may be nothing but rounding; squared.
///
/// With `u = 2^-53`, a component of a difference is wrong by at most `u` of itself, a product of two by `3 u`, and the
/// difference of two products by `4 u` of the sum of their sizes; so the vector is wrong by less than `8 u = 2^-50` of the
/// product of the lengths. A normal that is 2^-42 of it or longer is known to a part in 2^8, and two such normals, with a
/// cosine that seems to be above 2^-5, are less than a right angle apart.
const ROUNDING_SQUARED: f64 = 1.0 / (1_u128 << 84) as f64;

/// Whether no triangle of the star of `v` turns over, or loses its area, when `v` moves to where `u` is. If `leans`,
/// triangles may turn by nearly a right angle.
pub(super) fn keeps_orientation(v: u32, u: u32, star: &[Spoke], leans: bool, surface: &Surface) -> bool {
    let (from, to) = (surface.position(v), surface.position(u));
    if from == to || all_turn_little(u, from, to, star, surface) {
        return true;
    }
    let mut whole = None;
    for spoke in star {
        if spoke.touches(u) {
            continue;
        }
        let others = [spoke.next, spoke.last].map(|w| surface.position(w));
        if turns_less(from, to, others, COSINE_SQUARED[usize::from(leans)]) {
            continue;
        }
        // A triangle without area has no side to keep: it must not disagree with the star as a whole.
        let [a, b] = edges(from, others);
        let reach = a.length_squared().max(b.length_squared());
        if a.cross(b).length_squared() > FLAT_SQUARED * reach * reach {
            return false;
        }
        let whole = *whole.get_or_insert_with(|| {
            star.iter().fold(DVec3::ZERO, |sum, s| sum + surface.normal(v, s.next, s.last))
        });
        let [a, b] = edges(to, others);
        if a.cross(b).dot(whole) < 0.0 {
            return false;
        }
    }
    true
}

/// The two edges of a triangle from a place of its corner to the other corners.
fn edges(from: Vec3, others: [Vec3; 2]) -> [DVec3; 2] {
    others.map(|other| other.as_dvec3() - from.as_dvec3())
}

/// Whether a triangle turns by less than the angle with a cosine when its corner moves, beyond all doubt.
fn turns_less(from: Vec3, to: Vec3, others: [Vec3; 2], cosine_squared: f64) -> bool {
    let [before, after] = [from, to].map(|corner| Normal::of(edges(corner, others)));
    let dot = before.vector.dot(after.vector);
    // A quotient of squares first, so that no more than four lengths are ever multiplied.
    before.is_certain()
        && after.is_certain()
        && dot > 0.0
        && dot / before.squared * dot > cosine_squared * after.squared
}

/// Whether every triangle of a star that does not touch `u` turns by less than the smaller of the two angles, as far as single
/// precision can tell: of all these, [`turns_less`] says so too. Lengths are taken in units; triangles of much less than a
/// unit, or much longer than wide, it can not tell.
///
/// With `u = 2^-24`, normals are wrong by less than `8 u = 2^-21` of the product of the edges' lengths (see
/// [`ROUNDING_SQUARED`]) and what vanishes below 2^-126. Where edges are no longer than 2^30 and a normal no shorter than
/// 2^-30, edges are no shorter than 2^-60, so no square of them vanishes, and what does is less than 2^-50 of the normal.
/// A normal that is 2^-12 of the product or longer so has its direction within an angle of 2^-8, and two of these that seem
/// to make less than 73.7 degrees make less than 74.7, which is below the 75.5 that are asked for.
fn all_turn_little(u: u32, from: Vec3, to: Vec3, star: &[Spoke], surface: &Surface) -> bool {
    let corners = [from, to].map(lanes::splat);
    star.chunks(4).all(|four| {
        // The last one more than once, where there are fewer than four.
        let four: [Spoke; 4] = std::array::from_fn(|i| four[i.min(four.len() - 1)]);
        let others = [four.map(|s| s.next), four.map(|s| s.last)];
        let others = others.map(|others| lanes::gathered(others.map(|w| surface.position(w))));
        let touching = (0..).zip(four).fold(0, |bits, (i, s)| bits | u32::from(s.touches(u)) << i);
        turn_little(corners, others, surface.per_unit) | touching == 0b1111
    })
}

/// Which of four triangles turn by little, as bits.
fn turn_little([from, to]: [Lanes; 2], others: [Lanes; 2], per_unit: f32) -> u32 {
    const CERTAIN_SQUARED: f32 = 1.0 / (1 << 24) as f32;
    const LONGEST_SQUARED: f32 = (1_u64 << 60) as f32;
    const COSINE_SQUARED: f32 = 0.079;
    let edges = |corner: Lanes| others.map(|other| lanes::minus(other, corner).map(|x| x * per_unit));
    let ([a, b], [c, d]) = (edges(from), edges(to));
    let [aa, bb, cc, dd] = [a, b, c, d].map(|e| lanes::dot(e, e));
    let (before, after) = (lanes::cross(a, b), lanes::cross(c, d));
    let dot = lanes::dot(before, after);
    let (before_squared, after_squared) = (lanes::dot(before, before), lanes::dot(after, after));
    let least =
        |edges_squared: Vec4| (edges_squared * CERTAIN_SQUARED).max(Vec4::splat(1.0 / LONGEST_SQUARED));
    let is_near = dot.cmpgt(Vec4::ZERO) & (dot / before_squared * dot).cmpgt(after_squared * COSINE_SQUARED);
    let is_certain = before_squared.cmpgt(least(aa * bb)) & after_squared.cmpgt(least(cc * dd));
    let is_in_range = aa.max(bb).max(cc.max(dd)).cmple(Vec4::splat(LONGEST_SQUARED));
    (is_near & is_certain & is_in_range).bitmask()
}

/// The normal of a triangle, as long as twice its area.
struct Normal {
    vector: DVec3,
    squared: f64,
    /// The product of the squared lengths of the edges that it comes from.
    edges: f64,
}

impl Normal {
    fn of([a, b]: [DVec3; 2]) -> Normal {
        let vector = a.cross(b);
        Normal { vector, squared: vector.length_squared(), edges: a.length_squared() * b.length_squared() }
    }

    /// Whether it is more than rounding.
    fn is_certain(&self) -> bool {
        self.squared > ROUNDING_SQUARED * self.edges
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;

    /// What single precision says, double precision says: of triangles of all shapes and sizes, far out and near.
    #[test]
    fn single_precision_never_says_too_much() {
        let mut random = Pcg64Mcg::seed_from_u64(7);
        let mut yes = 0;
        for trial in 0..400_000 {
            let size = [1e-30, 1e-6, 1.0, 3.0, 1e7, 1e30][trial % 6];
            let center = Vec3::splat(size * [0.0, 1.0, 1e3, 1e6][trial / 6 % 4]);
            let flat = [1.0, 1e-2, 1e-4, 1e-6][trial / 24 % 4];
            let mut place = |height: f32| {
                let [x, y, z] = [1.0, flat, height].map(|side| side * random.random_range(-1.0..1.0_f32));
                center + size * Vec3::new(x, y, z)
            };
            let (from, to, others) = (place(flat), place(0.3 * flat), [place(flat), place(0.0)]);
            let lanes = others.map(|p| lanes::gathered([p; 4]));
            let per_unit = (1.0 / f64::from(size)) as f32;
            let little = turn_little([from, to].map(lanes::splat), lanes, per_unit);
            assert!(little == 0 || little == 0b1111, "the four are the same");
            if little != 0 {
                assert!(turns_less(from, to, others, COSINE_SQUARED[0]), "{from} {to} {others:?}");
                yes += 1;
            }
        }
        assert!(yes > 20_000, "{yes}");
    }
}
