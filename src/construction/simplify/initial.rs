//! What there is to know of vertices and triangles before the first collapse.

use collapse_log::Mesh;
use glam::DVec3;

use super::marks::Marks;
use super::nodes::round_up;
use super::quadric::Quadric;
use super::surface::{Neighbour, Surface};

/// Weight of a plane that holds a boundary edge in place, per squared length of the edge.
const BOUNDARY_WEIGHT: f64 = 4.0;

/// A weight in single precision. The sums of a few thousand such weights, times a length, are finite still.
fn bounded_weight(weight: f64) -> f32 {
    weight.min(1e30) as f32
}

/// For each vertex in the new numbering, its distance to the farthest corner of its triangles, in object units.
pub(super) fn leaf_radii(mesh: &Mesh, number: &[u32]) -> Vec<f32> {
    let mut farthest = vec![0.0_f64; number.len()];
    let position = |v: u32| DVec3::from(mesh.positions[v as usize].map(f64::from));
    for &[a, b, c] in mesh.triangles.iter().filter(|t| !is_flat(**t)) {
        for (v, w) in [(a, b), (b, c), (c, a)] {
            let squared = position(v).distance_squared(position(w));
            for v in [v, w] {
                let farthest = &mut farthest[number[v as usize] as usize];
                *farthest = squared.max(*farthest);
            }
        }
    }
    farthest.into_iter().map(leaf_radius).collect()
}

/// The radius of a leaf's sphere from the squared distance to the farthest corner of its triangles.
pub(super) fn leaf_radius(squared: f64) -> f32 {
    round_up(squared.sqrt() * (1.0 + 1e-15))
}

/// Whether a triangle names a vertex twice, and so shows nothing.
pub(super) fn is_flat([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// The triangles with three different corners in the new numbering, in the order of their lowest vertices.
pub(super) fn coherent_triangles(triangles: &[[u32; 3]], number: &[u32]) -> Vec<[u32; 3]> {
    let renumbered = || triangles.iter().map(|t| t.map(|v| number[v as usize])).filter(|t| !is_flat(*t));
    let lowest = |[a, b, c]: [u32; 3]| a.min(b).min(c) as usize;
    let mut place = vec![0_usize; number.len() + 1];
    for t in renumbered() {
        place[lowest(t) + 1] += 1;
    }
    for v in 1..place.len() {
        place[v] += place[v - 1];
    }
    let mut ordered = vec![[0; 3]; place.last().copied().unwrap_or(0)];
    for t in renumbered() {
        let slot = &mut place[lowest(t)];
        ordered[*slot] = t;
        *slot += 1;
    }
    ordered
}

/// The planes of the triangles around `v`, weighted by area, and at edges that do not join exactly two triangles a plane
/// through the edge, upright on the triangle. Also whether the vertex has [such edges](Surface::special).
pub(super) fn initial_quadric(
    v: u32,
    surface: &Surface,
    marks: &mut Marks,
    neighbours: &mut Vec<Neighbour>,
) -> (Quadric, bool) {
    let unit = surface.unit;
    let (mut quadric, mut special) = (Quadric::default(), false);
    // In double precision no product of four lengths vanishes or overflows.
    let area = 0.5 / (unit * unit);
    for spoke in surface.spokes(v) {
        let [a, b, c] = surface.triangles[spoke.triangle as usize].corners;
        let normal = surface.normal(a, b, c);
        let length = normal.length();
        if length > 0.0 {
            let weight = bounded_weight(area * length);
            quadric.add_plane((normal / length).as_vec3(), weight, weight);
        }
    }
    if !surface.is_surrounded(v) {
        surface.neighbours(v, marks, neighbours);
        special = neighbours.iter().any(|n| !n.is_regular());
        marks.clear();
        for n in neighbours.iter().filter(|n| n.triangles != 2) {
            marks.set(n.vertex, 0);
        }
        for s in surface.spokes(v) {
            for w in [s.next, s.last].into_iter().filter(|&w| marks.get(w).is_some()) {
                let edge = surface.position(w).as_dvec3() - surface.position(v).as_dvec3();
                let weight = BOUNDARY_WEIGHT * edge.length_squared() / (unit * unit);
                let upright = edge.cross(surface.normal(v, s.next, s.last)).normalize_or_zero();
                quadric.add_plane(upright.as_vec3(), bounded_weight(weight), 0.0);
            }
        }
    }
    (quadric, special)
}
