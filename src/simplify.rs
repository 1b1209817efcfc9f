//! Builds the hierarchy: simplifies a mesh in memory and records every step.

mod ball;
mod candidates;
mod closest;
mod legality;
mod nodes;
mod quadric;
mod rounds;
mod samples;
mod spatial_order;
mod surface;

use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};
use vertex_tree::{Collapse, CollapseLog, LogError, Mesh};

use crate::progress::Progress;
use nodes::{Nodes, round_up};
use quadric::Quadric;
use rounds::Builder;
use surface::Surface;

/// How to simplify.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Also merge vertices of different components that are near each other, so that many separate objects end in
    /// few roots.
    pub merge_components: bool,
}

/// What a simplification did.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Triangles of the input.
    pub triangles: usize,
    /// Collapses made.
    pub collapses: usize,
    /// Rounds of independent collapses.
    pub rounds: u32,
    /// Roots of the forest.
    pub roots: usize,
    /// Depth of the forest.
    pub tree_depth: u32,
    /// Length of the longest chain of nodes each of which must be folded before the next.
    pub dependency_depth: u32,
    /// Triangles of the base mesh.
    pub base_triangles: usize,
    /// The largest error of a node, in object units.
    pub largest_eps: f32,
    /// Collapses whose key was less than that of an earlier one.
    pub inversions: u32,
    /// Time to prepare: renumbering, quadrics.
    pub preparation: Duration,
    /// Time of the rounds.
    pub simplification: Duration,
    /// Time to make the log and to check it.
    pub conclusion: Duration,
}

/// Simplifies a mesh until no legal collapse is left.
///
/// # Errors
/// If a triangle names a vertex that is not there or a coordinate is not finite.
pub fn build(mesh: Mesh, _options: &Options, progress: Progress) -> Result<(CollapseLog, Report), LogError> {
    let start = Instant::now();
    let mut log = CollapseLog { mesh, collapses: Vec::new() };
    log.forest()?;
    let mesh = &log.mesh;
    let extent = mesh.extent();
    // Work in units in which the mesh is about as large as 1. A power of two changes no bit of the mantissas.
    let largest = mesh.positions.iter().flatten().fold(0.0_f32, |m, x| m.max(x.abs()));
    let exponent = if largest > 0.0 { f64::from(largest).log2().ceil() as i32 } else { 0 };
    let scale = 2.0_f64.powi(exponent);
    let scaled: Vec<Vec3> =
        mesh.positions.iter().map(|&p| (DVec3::from(p.map(f64::from)) / scale).as_vec3()).collect();

    // `order[new] = input number`.
    let order = spatial_order::spatial_order(&scaled);
    let mut number = vec![0; order.len()];
    for (new, &old) in (0..).zip(&order) {
        number[old as usize] = new;
    }
    let positions: Vec<Vec3> = order.iter().map(|&old| scaled[old as usize]).collect();
    let mut leaf_radius = vec![0.0_f32; positions.len()];
    let mut corners: Vec<[u32; 3]> = Vec::with_capacity(mesh.triangles.len());
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|v| number[v as usize]);
        for (v, w) in [(a, b), (b, c), (c, a)] {
            let length =
                positions[v as usize].as_dvec3().distance(positions[w as usize].as_dvec3()) * (1.0 + 1e-15);
            let length = round_up(length);
            leaf_radius[v as usize] = leaf_radius[v as usize].max(length);
            leaf_radius[w as usize] = leaf_radius[w as usize].max(length);
        }
        if a != b && b != c && c != a {
            corners.push([a, b, c]);
        }
    }
    corners.sort_by_key(|&[a, b, c]| a.min(b).min(c));
    let surface = Surface::new(positions, corners.iter().copied());
    drop(corners);
    let quadrics = initial_quadrics(&surface);
    let nodes = Nodes::new(leaf_radius, extent / scale);
    let mut builder = Builder::new(surface, quadrics, nodes);
    let preparation = start.elapsed();

    let start = Instant::now();
    builder.run(progress);
    let simplification = start.elapsed();

    let start = Instant::now();
    let back = |v: u32| order[v as usize];
    let unscale = |x: f32| (f64::from(x) * scale) as f32;
    let clamped = |x: f32| unscale(x).min(f32::MAX);
    log.collapses = builder
        .nodes
        .collapses
        .iter()
        .map(|c| {
            let mut bounds = c.bounds;
            bounds.center = bounds.center.map(unscale);
            bounds.radius = clamped(bounds.radius);
            bounds.eps = clamped(bounds.eps);
            Collapse { removed: back(c.removed), kept: back(c.kept), bounds }
        })
        .collect();
    let forest = log.forest()?;
    let report = Report {
        triangles: log.mesh.triangles.len(),
        collapses: log.collapses.len(),
        rounds: builder.rounds,
        roots: forest.roots().count(),
        tree_depth: forest.depth(),
        dependency_depth: builder.nodes.depth.iter().copied().max().unwrap_or(0),
        base_triangles: builder.surface.triangles.len(),
        largest_eps: log.collapses.iter().fold(0.0, |m, c| m.max(c.bounds.eps)),
        inversions: builder.inversions,
        preparation,
        simplification,
        conclusion: start.elapsed(),
    };
    Ok((log, report))
}

/// Weight of a plane that holds a boundary edge in place, per squared length of the edge.
const BOUNDARY_WEIGHT: f32 = 4.0;

/// The planes of the triangles around each vertex, weighted by area, and at edges that do not join exactly two
/// triangles a plane through the edge, upright on the triangle.
fn initial_quadrics(surface: &Surface) -> Vec<Quadric> {
    let mut quadrics = vec![Quadric::default(); surface.positions.len()];
    for t in &surface.triangles {
        let [a, b, c] = t.corners;
        let normal = surface.normal(a, b, c);
        let length = normal.length();
        if length <= 0.0 {
            continue;
        }
        let unit = normal / length;
        for v in t.corners {
            quadrics[v as usize].add_plane(unit, 0.5 * length, 0.5 * length);
        }
        for (v, w) in [(a, b), (b, c), (c, a)] {
            // Of a pair of triangles at an edge, one lists its vertices in ascending order as a rule.
            let count = surface.spokes(v).filter(|s| s.next == w || s.last == w).count();
            if count != 2 {
                let edge = surface.position(w) - surface.position(v);
                let upright = edge.cross(unit).normalize_or_zero();
                let weight = BOUNDARY_WEIGHT * edge.length_squared();
                quadrics[v as usize].add_plane(upright, weight, 0.0);
                quadrics[w as usize].add_plane(upright, weight, 0.0);
            }
        }
    }
    quadrics
}
