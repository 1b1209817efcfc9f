//! Squared distance from a point to triangles around a common corner.
//!
//! The nearest point of a triangle is the foot of the perpendicular, if that lies inside, or else on one of the three
//! edges. With the corner at the origin, edges `b` and `c` from it and normal `n = b x c`, a point is
//! `p = s b + t c + h n`, and
//!
//! ```text
//! p.(c x n) = s n.n      p.(n x b) = t n.n      (p.n)^2 / n.n = squared height
//! ```
//!
//! so the foot lies inside where both products are positive and their sum is less than `n.n`. Everything is computed
//! without branches for four triangles at a time, which compilers turn into vector instructions: the case
//! distinction by regions (Ericson, "Real-time collision detection", 2005, 5.1.5) is cheaper in operations, but as
//! good as random.

use glam::Vec3;

const LANES: usize = 4;
type Lanes = [f32; LANES];

/// Four triangles, one coordinate after the other. Lanes that are not in use hold triangles that are a single point,
/// the common corner, and are never nearer than the others.
#[derive(Clone, Copy, Debug, Default)]
struct Four {
    b: [Lanes; 3],
    c: [Lanes; 3],
    n: [Lanes; 3],
    c_cross_n: [Lanes; 3],
    n_cross_b: [Lanes; 3],
    nn: Lanes,
    /// Reciprocals of the squared lengths of `n`, `b`, `c` and `c - b`; 0 for 0.
    per_nn: Lanes,
    per_bb: Lanes,
    per_cc: Lanes,
    per_ee: Lanes,
}

/// A sliver whose height is less than this part of its length is measured by its edges alone; squared.
const SLIVER: f32 = 1e-10;

/// Triangles around a common corner.
#[derive(Debug, Default)]
pub(super) struct Fan {
    corner: Vec3,
    count: usize,
    fours: Vec<Four>,
}

impl Fan {
    /// Starts over.
    pub fn clear(&mut self, corner: Vec3) {
        self.corner = corner;
        self.count = 0;
        self.fours.clear();
    }

    /// Adds the triangle of the corner, `b` and `c`.
    pub fn push(&mut self, b: Vec3, c: Vec3) {
        let lane = self.count % LANES;
        if lane == 0 {
            self.fours.push(Four::default());
        }
        self.count += 1;
        if let Some(four) = self.fours.last_mut() {
            let (b, c) = (b - self.corner, c - self.corner);
            for axis in 0..3 {
                four.b[axis][lane] = b[axis];
                four.c[axis][lane] = c[axis];
            }
        }
    }

    /// Makes ready for queries.
    pub fn prepare(&mut self) {
        self.fours.iter_mut().for_each(Four::prepare);
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.count
    }

    /// The nearest triangle, the first one if several are, and its squared distance. For a fan without triangles, 0
    /// and infinity.
    pub fn nearest(&self, p: Vec3) -> (u32, f32) {
        let p = p - self.corner;
        let mut nearest = (0, f32::INFINITY);
        let mut number = 0;
        for four in &self.fours {
            for distance_squared in four.distances_squared(p) {
                if distance_squared < nearest.1 {
                    nearest = (number, distance_squared);
                }
                number += 1;
            }
        }
        nearest
    }

    /// Squared distance to the nearest triangle, or any value up to `enough` once one has been found that near.
    pub fn distance_squared(&self, p: Vec3, enough: f32) -> f32 {
        let p = p - self.corner;
        let mut nearest = f32::INFINITY;
        for four in &self.fours {
            nearest = four.distances_squared(p).into_iter().fold(nearest, f32::min);
            if nearest <= enough {
                break;
            }
        }
        nearest
    }
}

impl Four {
    fn prepare(&mut self) {
        for i in 0..LANES {
            let b = [self.b[0][i], self.b[1][i], self.b[2][i]];
            let c = [self.c[0][i], self.c[1][i], self.c[2][i]];
            let e = [c[0] - b[0], c[1] - b[1], c[2] - b[2]];
            let (bb, cc, ee) = (dot(b, b), dot(c, c), dot(e, e));
            let n = cross(b, c);
            let nn = dot(n, n);
            let flat = if nn > SLIVER * bb * cc { 1.0 } else { 0.0 };
            let n = n.map(|x| x * flat);
            let nn = nn * flat;
            let (c_cross_n, n_cross_b) = (cross(c, n), cross(n, b));
            for axis in 0..3 {
                self.n[axis][i] = n[axis];
                self.c_cross_n[axis][i] = c_cross_n[axis];
                self.n_cross_b[axis][i] = n_cross_b[axis];
            }
            self.nn[i] = nn;
            self.per_nn[i] = reciprocal(nn);
            self.per_bb[i] = reciprocal(bb);
            self.per_cc[i] = reciprocal(cc);
            self.per_ee[i] = reciprocal(ee);
        }
    }

    fn distances_squared(&self, p: Vec3) -> Lanes {
        let p = p.to_array();
        let mut result = [0.0; LANES];
        for i in 0..LANES {
            let b = [self.b[0][i], self.b[1][i], self.b[2][i]];
            let c = [self.c[0][i], self.c[1][i], self.c[2][i]];
            let e = [c[0] - b[0], c[1] - b[1], c[2] - b[2]];
            let q = [p[0] - b[0], p[1] - b[1], p[2] - b[2]];
            let to_b = past_edge(p, b, self.per_bb[i]);
            let to_c = past_edge(p, c, self.per_cc[i]);
            let to_e = past_edge(q, e, self.per_ee[i]);
            let edges = to_b.min(to_c).min(to_e);
            let n = [self.n[0][i], self.n[1][i], self.n[2][i]];
            let height = dot(p, n);
            let s = dot(p, [self.c_cross_n[0][i], self.c_cross_n[1][i], self.c_cross_n[2][i]]);
            let t = dot(p, [self.n_cross_b[0][i], self.n_cross_b[1][i], self.n_cross_b[2][i]]);
            let inside = (s > 0.0) & (t > 0.0) & (s + t < self.nn[i]);
            result[i] = if inside { height * height * self.per_nn[i] } else { edges };
        }
        result
    }
}

/// Squared distance from `p` to the segment from the origin to `e`.
fn past_edge(p: [f32; 3], e: [f32; 3], per_ee: f32) -> f32 {
    let t = (dot(p, e) * per_ee).max(0.0).min(1.0);
    let d = [p[0] - t * e[0], p[1] - t * e[1], p[2] - t * e[2]];
    dot(d, d)
}

/// Squared distance from `p` to the segment from `a` to `b`.
pub(super) fn segment_distance_squared(p: Vec3, a: Vec3, b: Vec3) -> f32 {
    let e = b - a;
    past_edge((p - a).to_array(), e.to_array(), reciprocal(e.length_squared()))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn reciprocal(x: f32) -> f32 {
    if x > 0.0 { 1.0 / x } else { 0.0 }
}
