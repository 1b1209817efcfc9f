//! Whether a collapse keeps the topology, and turns no triangle over.

use glam::Vec3;

use super::marks::Marks;
use super::surface::{Spoke, Surface};

/// A triangle may turn by less than this: the square of the cosine of about 75 degrees.
const COSINE_SQUARED: f32 = 0.0625;
/// A triangle whose doubled area is less than this part of its longest squared edge at the vertex has no normal to
/// speak of; squared.
const FLAT_SQUARED: f32 = 1e-10;

/// Whether `v` can merge into `u`. `star` is the star of `v`. Along a virtual edge, and where components have been
/// joined, the topology is no longer that of the input, and need not be kept.
pub(super) fn is_legal(v: u32, u: u32, star: &[Spoke], surface: &Surface, marks: &mut Marks) -> bool {
    let last_triangles = star.len() == surface.live_triangles && star.iter().all(|spoke| spoke.touches(u));
    !last_triangles
        && keeps_orientation(v, u, star, surface)
        && (surface.joined[v as usize]
            || surface.joined[u as usize]
            || !star.iter().any(|spoke| spoke.touches(u))
            || keeps_topology(v, u, star, surface, marks))
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
    let doubles = star
        .iter()
        .any(|s| !s.touches(u) && marks.get(s.next) == Some(APEX) && marks.get(s.last) == Some(APEX));
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
fn keeps_orientation(v: u32, u: u32, star: &[Spoke], surface: &Surface) -> bool {
    let (from, to) = (surface.position(v), surface.position(u));
    if from == to {
        return true;
    }
    for spoke in star {
        if spoke.touches(u) {
            continue;
        }
        let (next, last) = (surface.position(spoke.next), surface.position(spoke.last));
        let before = (next - from).cross(last - from);
        let after = (next - to).cross(last - to);
        let (before2, after2) = (before.length_squared(), after.length_squared());
        let dot = before.dot(after);
        if dot > 0.0 && dot * dot > COSINE_SQUARED * before2 * after2 && after2 > 0.0 {
            continue;
        }
        // A triangle without area has no side to keep: it must not disagree with the star as a whole.
        let reach = (next - from).length_squared().max((last - from).length_squared());
        if before2 > FLAT_SQUARED * reach * reach {
            return false;
        }
        let whole = star.iter().fold(Vec3::ZERO, |sum, s| sum + surface.normal(v, s.next, s.last));
        if after.dot(whole) < 0.0 {
            return false;
        }
    }
    true
}
