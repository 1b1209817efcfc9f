//! Squared distance from a point to the nearest of a few triangles.
//!
//! The nearest point of a triangle is the foot of the perpendicular, if that lies inside, or else on one of the three
//! edges. With one corner at the origin, edges `b` and `c` from it and normal `n = b x c`, a point is
//! `p = s b + t c + h n`, and
//!
//! ```text
//! p.(c x n) = s n.n      p.(n x b) = t n.n      (p.n)^2 / n.n = squared height
//! ```
//!
//! so the foot lies inside where both products are positive and their sum is less than `n.n`. Everything is computed for
//! four triangles at a time and without branches. To tell first in which region around the triangle the point lies
//! (Ericson, "Real-time collision detection", 2005, 5.1.5) takes fewer operations, but no processor can guess the way.

use std::ops::Range;

use glam::{Vec3, Vec4};

use super::lanes::{Lanes, cross, dot, minus, set, splat};

/// Four triangles, a coordinate in each `Vec4`. Lanes that are not in use hold triangles that are a single point, a
/// corner of the first, and are never nearer than that.
#[derive(Clone, Copy, Debug, Default)]
struct Four {
    /// One corner, and the edges from it to the others.
    a: Lanes,
    b: Lanes,
    c: Lanes,
    n: Lanes,
    c_cross_n: Lanes,
    n_cross_b: Lanes,
    nn: Vec4,
    /// Reciprocals of the squared lengths of `n`, `b`, `c` and `c - b`; 0 for 0.
    per_nn: Vec4,
    per_bb: Vec4,
    per_cc: Vec4,
    per_ee: Vec4,
}

/// A sliver whose height is less than this part of its length is measured by its edges alone; squared.
const SLIVER: f32 = 1e-10;

/// With more triangles than this, not all are looked at for each of thousands of points, but those of so many fours on
/// either side in their order, which is one in space.
const MANY: usize = 128;
const BESIDE: usize = 4;

/// A few triangles.
#[derive(Debug, Default)]
pub(super) struct Faces {
    count: usize,
    fours: Vec<Four>,
}

impl Faces {
    pub fn clear(&mut self) {
        self.count = 0;
        self.fours.clear();
    }

    pub fn push(&mut self, [a, b, c]: [Vec3; 3]) {
        let lane = self.count % 4;
        if lane == 0 {
            self.fours.push(Four { a: splat(a), ..Four::default() });
        }
        self.count += 1;
        if let Some(four) = self.fours.last_mut() {
            let (b, c) = (b - a, c - a);
            set(&mut four.a, lane, a);
            set(&mut four.b, lane, b);
            set(&mut four.c, lane, c);
        }
    }

    /// Makes ready for queries.
    pub fn prepare(&mut self) {
        self.fours.iter_mut().for_each(Four::prepare);
    }

    /// Of more triangles than [`MANY`], which of the fours are looked at for a point beside one of them.
    fn range(&self, beside: Option<usize>) -> Range<usize> {
        match beside {
            Some(beside) if self.count > MANY => {
                let middle = (beside / 4).min(self.fours.len() - 1);
                middle.saturating_sub(BESIDE)..(middle + BESIDE + 1).min(self.fours.len())
            }
            _ => 0..self.fours.len(),
        }
    }

    /// The nearest triangle, the first one if several are, and its squared distance. Without triangles, 0
    /// and infinity. Of many triangles those in the order near the one with number `beside`, if that is given: what is nearest
    /// is no farther away.
    pub fn nearest(&self, p: Vec3, beside: Option<usize>) -> (u32, f32) {
        let range = self.range(beside);
        let mut nearest = (4 * range.start as u32, f32::INFINITY);
        let mut number = nearest.0;
        for four in &self.fours[range] {
            for distance_squared in four.distances_squared(p).to_array() {
                if distance_squared < nearest.1 {
                    nearest = (number, distance_squared);
                }
                number += 1;
            }
        }
        nearest
    }

    /// Squared distance to the nearest triangle, or any value up to `enough` once one has been found that near. Of many
    /// triangles only some are looked at, as in [`nearest`](Self::nearest).
    pub fn distance_squared(&self, p: Vec3, enough: f32, beside: usize) -> f32 {
        let mut nearest = f32::INFINITY;
        for four in &self.fours[self.range(Some(beside))] {
            nearest = nearest.min(four.distances_squared(p).min_element());
            if nearest <= enough {
                break;
            }
        }
        nearest
    }
}

impl Four {
    fn prepare(&mut self) {
        let (b, c) = (self.b, self.c);
        let e = minus(c, b);
        let (bb, cc) = (dot(b, b), dot(c, c));
        let n = cross(b, c);
        let nn = dot(n, n);
        // Without a normal there is no inside.
        let flat = Vec4::select(nn.cmpgt(SLIVER * bb * cc), Vec4::ONE, Vec4::ZERO);
        self.n = n.map(|x| x * flat);
        self.nn = nn * flat;
        self.c_cross_n = cross(c, self.n);
        self.n_cross_b = cross(self.n, b);
        self.per_nn = reciprocal(self.nn);
        self.per_bb = reciprocal(bb);
        self.per_cc = reciprocal(cc);
        self.per_ee = reciprocal(dot(e, e));
    }

    fn distances_squared(&self, p: Vec3) -> Vec4 {
        let p = minus(splat(p), self.a);
        let (b, c) = (self.b, self.c);
        let edges = past_edge(p, b, self.per_bb).min(past_edge(p, c, self.per_cc)).min(past_edge(
            minus(p, b),
            minus(c, b),
            self.per_ee,
        ));
        let (s, t) = (dot(p, self.c_cross_n), dot(p, self.n_cross_b));
        let inside = s.cmpgt(Vec4::ZERO) & t.cmpgt(Vec4::ZERO) & (s + t).cmplt(self.nn);
        let height = dot(p, self.n);
        Vec4::select(inside, height * height * self.per_nn, edges)
    }
}

/// Squared distance from `p` to the segment from the origin to `e`.
fn past_edge(p: Lanes, e: Lanes, per_ee: Vec4) -> Vec4 {
    let t = (dot(p, e) * per_ee).max(Vec4::ZERO).min(Vec4::ONE);
    let d = minus(p, e.map(|x| x * t));
    dot(d, d)
}

fn reciprocal(x: Vec4) -> Vec4 {
    Vec4::select(x.cmpgt(Vec4::ZERO), x.recip(), Vec4::ZERO)
}

/// Squared distance from `p` to the segment from `a` to `b`.
pub(super) fn segment_distance_squared(p: Vec3, a: Vec3, b: Vec3) -> f32 {
    let (e, p) = (b - a, p - a);
    let ee = e.length_squared();
    let t = if ee > 0.0 { (p.dot(e) / ee).clamp(0.0, 1.0) } else { 0.0 };
    p.distance_squared(e * t)
}
