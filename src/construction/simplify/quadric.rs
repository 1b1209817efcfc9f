//! Quadric error: the sum of squared distances to a set of planes as one quadratic form.
//!
//! Garland & Heckbert, "Surface simplification using quadric error metrics" (1997). A plane with unit normal `n`
//! through the point `o` has squared distance `(n.(x - o))^2 = (x - o)^T (n n^T) (x - o)` from `x`. A sum of such
//! terms, each with a weight, is the form `d^T A d + 2 b.d + c` with `d = x - origin`.
//!
//! The origin is the vertex that carries the form, not the origin of object space. All planes of a vertex pass
//! close by it, so `b` and `c` stay small and nothing cancels: single precision is enough.

use glam::Vec3;

/// A quadratic form around the vertex that carries it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Quadric {
    /// The diagonal of `A`.
    diagonal: Vec3,
    /// The entries yz, zx and xy of `A`.
    off_diagonal: Vec3,
    b: Vec3,
    c: f32,
    /// Sum of the weights of the surface planes: an area.
    area: f32,
}

impl Quadric {
    /// Adds the plane through the carrying vertex with unit normal `n`. `area` says how much surface it stands for,
    /// and 0 makes it a constraint only, which adds to the error but not to the area that the error is averaged
    /// over.
    pub fn add_plane(&mut self, n: Vec3, weight: f32, area: f32) {
        self.diagonal += n * n * weight;
        self.off_diagonal += Vec3::new(n.y * n.z, n.z * n.x, n.x * n.y) * weight;
        self.area += area;
    }

    fn times(&self, d: Vec3) -> Vec3 {
        let (q, o) = (self.diagonal, self.off_diagonal);
        Vec3::new(
            q.x * d.x + o.z * d.y + o.y * d.z,
            o.z * d.x + q.y * d.y + o.x * d.z,
            o.y * d.x + o.x * d.y + q.z * d.z,
        )
    }

    /// The mean squared distance of the point at `d` from the carrying vertex to the planes, per area. Where that is too
    /// large for single precision, infinity.
    pub fn error(&self, d: Vec3) -> f32 {
        let sum = d.dot(self.times(d) + 2.0 * self.b) + self.c;
        if sum.is_nan() {
            return f32::INFINITY;
        }
        // Rounding can leave a sum of squares a little below zero.
        if self.area > 0.0 { sum.max(0.0) / self.area } else { sum.max(0.0) }
    }

    /// Adds the form carried by another vertex, from which this one's lies at `d`.
    ///
    /// With `x' = x + d` in the other's frame: `x'^T A x' + 2 b.x' + c = x^T A x + 2 (b + A d).x + (c + 2 b.d +
    /// d^T A d)`.
    pub fn absorb(&mut self, other: &Quadric, d: Vec3) {
        let ad = other.times(d);
        self.diagonal += other.diagonal;
        self.off_diagonal += other.off_diagonal;
        self.b += other.b + ad;
        self.c += other.c + d.dot(ad + 2.0 * other.b);
        self.area += other.area;
    }

    /// As numbers, to be put away.
    pub fn to_array(self) -> [f32; 11] {
        let ([a, b, c], [d, e, f], [g, h, i]) =
            (self.diagonal.to_array(), self.off_diagonal.to_array(), self.b.to_array());
        [a, b, c, d, e, f, g, h, i, self.c, self.area]
    }

    /// What [`to_array`](Self::to_array) has put away.
    pub fn from_array([a, b, c, d, e, f, g, h, i, j, area]: [f32; 11]) -> Quadric {
        Quadric {
            diagonal: Vec3::new(a, b, c),
            off_diagonal: Vec3::new(d, e, f),
            b: Vec3::new(g, h, i),
            c: j,
            area,
        }
    }
}
