//! Squared distance from a point to a triangle or a segment.
//!
//! Ericson, "Real-time collision detection" (2005), section 5.1.5: find the Voronoi region of the triangle (a corner,
//! an edge or the inside) in which the point lies, by signs of dot products alone.

use glam::Vec3;

/// A triangle prepared for many distance queries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Face {
    a: Vec3,
    ab: Vec3,
    ac: Vec3,
    /// Dot products ab.ab, ab.ac, ac.ac.
    bb: f32,
    bc: f32,
    cc: f32,
}

impl Face {
    pub fn new(a: Vec3, b: Vec3, c: Vec3) -> Face {
        let (ab, ac) = (b - a, c - a);
        Face { a, ab, ac, bb: ab.dot(ab), bc: ab.dot(ac), cc: ac.dot(ac) }
    }

    /// Squared distance to the nearest point of the triangle. Triangles without area are segments or points.
    pub fn distance_squared(&self, p: Vec3) -> f32 {
        let ap = p - self.a;
        // With `q = a + s ab + t ac`, the dot products of the edges with p - a, p - b and p - c follow from two.
        let (d1, d2) = (self.ab.dot(ap), self.ac.dot(ap));
        if d1 <= 0.0 && d2 <= 0.0 {
            return ap.length_squared();
        }
        let (d3, d4) = (d1 - self.bb, d2 - self.bc);
        if d3 >= 0.0 && d4 <= d3 {
            return (ap - self.ab).length_squared();
        }
        let (d5, d6) = (d1 - self.bc, d2 - self.cc);
        if d6 >= 0.0 && d5 <= d6 {
            return (ap - self.ac).length_squared();
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
            return (ap - self.ab * ratio(d1, d1 - d3)).length_squared();
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
            return (ap - self.ac * ratio(d2, d2 - d6)).length_squared();
        }
        let va = d3 * d6 - d5 * d4;
        if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
            let t = ratio(d4 - d3, (d4 - d3) + (d5 - d6));
            return (ap - self.ab - (self.ac - self.ab) * t).length_squared();
        }
        let sum = va + vb + vc;
        (ap - self.ab * (vb / sum) - self.ac * (vc / sum)).length_squared()
    }
}

/// Squared distance from `p` to the segment from `a` to `b`.
pub(super) fn segment_distance_squared(p: Vec3, a: Vec3, b: Vec3) -> f32 {
    let (ab, ap) = (b - a, p - a);
    let t = ratio(ab.dot(ap), ab.length_squared()).clamp(0.0, 1.0);
    (ap - ab * t).length_squared()
}

/// `x / y`, and 0 where the edge that both were taken from has no length.
fn ratio(x: f32, y: f32) -> f32 {
    if y > 0.0 { x / y } else { 0.0 }
}
