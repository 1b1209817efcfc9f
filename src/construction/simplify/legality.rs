//! Whether a collapse keeps the topology, and turns no triangle over.

use super::marks::Marks;
use super::orientation::keeps_orientation;
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
    if !keeps_orientation(v, u, star, leans, surface) {
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
