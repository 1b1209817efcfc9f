//! Whether a collapse keeps the topology, and turns no triangle over.
//!
//! Both are asked in terms of the star's own edges: where the mesh lies, how large it is, and what else there is makes no
//! difference. Positions are single-precision numbers, their differences exact in double precision unless one number is
//! 2^29 times the other, and no product of lengths between 10^-45 and 10^38 that is formed here leaves the range of double
//! precision.

use glam::DVec3;

use super::marks::Marks;
use super::surface::{Spoke, Surface};

/// What forbids a collapse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Obstacle {
    /// Nothing would be left to be seen.
    LastTriangles,
    /// A triangle would turn over or lose its area.
    Orientation,
    /// The topology would change.
    Topology,
}

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

/// What forbids that `v` merges into `u`, if anything does. `star` is the star of `v`. Along a virtual edge, and where
/// components have been joined, the topology is no longer that of the input, and need not be kept. If `leans`, triangles may
/// turn by nearly a right angle.
pub(super) fn obstacle(
    v: u32,
    u: u32,
    star: &[Spoke],
    leans: bool,
    surface: &Surface,
    marks: &mut Marks,
) -> Option<Obstacle> {
    if star.len() == surface.live_triangles && star.iter().all(|spoke| spoke.touches(u)) {
        return Some(Obstacle::LastTriangles);
    }
    if !keeps_orientation(v, u, star, COSINE_SQUARED[usize::from(leans)], surface) {
        return Some(Obstacle::Orientation);
    }
    let is_free = surface.joined[v as usize]
        || surface.joined[u as usize]
        || !star.iter().any(|spoke| spoke.touches(u));
    (!is_free && !keeps_topology(v, u, star, surface, marks)).then_some(Obstacle::Topology)
}

/// Whether `v` can merge into `u` without a change of topology. `star` is the star of `v`.
///
/// The link condition (Dey, Edelsbrunner, Guha & Nekhayev 1999, "Topology preserving edge contraction"): the two
/// vertices have no common neighbour but the third corners of the triangles at their edge, and no triangle that the
/// collapse makes is there already. That `v` leaves a boundary only along it is seen to by the choice of candidates.
/// The last triangle of a component is kept.
fn keeps_topology(v: u32, u: u32, star: &[Spoke], surface: &Surface, marks: &mut Marks) -> bool {
    const NEIGHBOUR: u32 = 0;
    const APEX: u32 = 1;
    marks.clear();
    for spoke in star {
        for w in [spoke.next, spoke.last] {
            if marks.get(w).is_none() {
                marks.set(w, NEIGHBOUR);
            }
        }
    }
    let mut vanishing = 0;
    for spoke in star {
        let apex = if spoke.next == u {
            spoke.last
        } else if spoke.last == u {
            spoke.next
        } else {
            continue;
        };
        marks.set(apex, APEX);
        vanishing += 1;
    }
    marks.set(u, APEX);
    let is_apex = |w: u32| marks.get(w) == Some(APEX);
    let remaining = || star.iter().filter(|s| !s.touches(u));
    if surface.is_hub(u) && star.len() < surface.star_length(u) {
        // What a hub has in common with the other neighbours of `v` is mostly found sooner in their stars.
        let is_common = |w: u32| surface.triangles_between(w, u).any(|s| !s.touches(v));
        let is_doubled = |s: &Spoke| {
            is_apex(s.next)
                && is_apex(s.last)
                && surface.triangles_between(s.next, u).any(|t| t.touches(s.last) && !t.touches(v))
        };
        return !remaining().flat_map(|s| [s.next, s.last]).any(|w| !is_apex(w) && is_common(w))
            && !remaining().any(is_doubled)
            && (star.len() > vanishing || surface.spokes(u).any(|s| !s.touches(v)));
    }
    let doubles = remaining().any(|s| is_apex(s.next) && is_apex(s.last));
    let mut others = 0;
    for spoke in surface.spokes(u) {
        if spoke.touches(v) {
            continue;
        }
        others += 1;
        let (a, b) = (marks.get(spoke.next), marks.get(spoke.last));
        if a == Some(NEIGHBOUR) || b == Some(NEIGHBOUR) {
            return false;
        }
        if doubles && a == Some(APEX) && b == Some(APEX) {
            return false;
        }
    }
    star.len() > vanishing || others > 0
}

/// Whether no triangle of the star of `v` turns over, or loses its area, when `v` moves to where `u` is.
fn keeps_orientation(v: u32, u: u32, star: &[Spoke], cosine_squared: f64, surface: &Surface) -> bool {
    let position = |v: u32| surface.position(v).as_dvec3();
    let (from, to) = (position(v), position(u));
    if from == to {
        return true;
    }
    let mut whole = None;
    for spoke in star {
        if spoke.touches(u) {
            continue;
        }
        let (next, last) = (position(spoke.next), position(spoke.last));
        let edges = [next - from, last - from];
        let before = Normal::of(edges);
        let after = Normal::of([next - to, last - to]);
        let dot = before.vector.dot(after.vector);
        // A quotient of squares first, so that no more than four lengths are ever multiplied.
        if before.is_certain()
            && after.is_certain()
            && dot > 0.0
            && dot / before.squared * dot > cosine_squared * after.squared
        {
            continue;
        }
        // A triangle without area has no side to keep: it must not disagree with the star as a whole.
        let reach = edges[0].length_squared().max(edges[1].length_squared());
        if before.squared > FLAT_SQUARED * reach * reach {
            return false;
        }
        let whole = *whole.get_or_insert_with(|| {
            star.iter().fold(DVec3::ZERO, |sum, s| sum + surface.normal(v, s.next, s.last))
        });
        if after.vector.dot(whole) < 0.0 {
            return false;
        }
    }
    true
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
