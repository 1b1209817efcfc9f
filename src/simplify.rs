//! Builds the hierarchy: simplifies a mesh in memory and records every step.
//!
//! Why it ends, whatever the mesh:
//!
//! * A round (`rounds`) takes up each candidate once. A round that collapses leaves a vertex less, so there are fewer such
//!   rounds than vertices.
//! * Between two collapses there are at most 64 (`stall::MOST_IDLE`) rounds, and then as many as there are candidates:
//!   after a round that changed no node, key or state, and after `MOST_IDLE` rounds without a collapse whatever they have
//!   changed, each round gives up the candidates that come up in vain. At least one does, as the limit of a round is the key
//!   of a candidate; and one that has been given up comes up no more before there is another collapse.
//! * When no candidate is left, the vertices without a legal edge are looked at once more, then the reach for other components
//!   is doubled up to a limit, then triangles may turn further, once. Each happens once between two collapses at most.
//! * A vertex with thousands of triangles does not make rounds of its own: several collapses of a round may follow one
//!   another there, as long as it only loses triangles (`Builder::may_follow`).
//!
//! Out of core the rounds are passes, and end as they do in memory (`out_of_core`).
//!
//! Legality (`legality`), measured errors (`samples`) and keys are in terms of a star's own edges and of the median edge:
//! nothing depends on where the mesh lies, or on what else there is.

mod ball;
mod candidates;
mod faces;
mod key_counts;
mod lanes;
mod legality;
mod marks;
mod nodes;
mod order;
mod orientation;
mod out_of_core;
mod quadric;
mod remains;
mod rounds;
mod samples;
mod spatial_order;
mod stall;
mod surface;
mod virtual_edges;

use std::convert::Infallible;
use std::ops::Range;
use std::time::{Duration, Instant};

use collapse_log::{Collapse, CollapseLog, LogError, Mesh};
use container::Georeference;
use glam::{DVec3, Vec3};

use crate::parallel;
use crate::progress::Progress;
pub use out_of_core::{LEAST_MEMORY, Limits, MOST_THREADS, OutOfCoreError, build_within};
pub use remains::Remains;

use crate::edge_lengths::{EdgeLengths, power_of_two};
use marks::Marks;
use nodes::{Nodes, round_up};
use quadric::Quadric;
use rounds::Builder;
use stall::Stall;
use surface::{Neighbour, Surface};

/// How to simplify.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Also merge vertices of different components that are near each other, so that many separate objects end in
    /// few roots.
    pub merge_components: bool,
}

/// A round of independent collapses, which is a pass where the mesh is larger than memory.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Round {
    /// The largest key that was taken up.
    pub limit: f32,
    /// Collapses made, and the keys of the first and of the last of them.
    pub collapses: usize,
    /// See [`collapses`](Self::collapses).
    pub keys: [f32; 2],
}

impl Round {
    /// Puts a collapse behind the others.
    fn push(&mut self, key: f32) {
        if self.collapses == 0 {
            self.keys[0] = key;
        }
        self.keys[1] = key;
        self.collapses += 1;
    }
}

/// What a simplification did.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Triangles of the input.
    pub triangles: usize,
    /// Collapses made.
    pub collapses: usize,
    /// Rounds of independent collapses, in order.
    pub rounds: Vec<Round>,
    /// Collapses that depend on another of their round: those at vertices with very many triangles, of which a round may take
    /// away more than one.
    pub followers: usize,
    /// Rounds in all, with those in which candidates were found illegal or dearer than they seemed, and none was collapsed.
    pub attempted_rounds: usize,
    /// Roots of the forest.
    pub roots: usize,
    /// Depth of the forest.
    pub tree_depth: u32,
    /// Length of the longest chain of nodes each of which must be folded before the next.
    pub dependency_depth: u32,
    /// Triangles of the base mesh.
    pub base_triangles: usize,
    /// Why these are not simplified further.
    pub remains: Remains,
    /// The largest error of a node, in object units.
    pub largest_eps: f32,
    /// Collapses whose key was less than that of an earlier one.
    pub inversions: usize,
    /// Parts of the mesh that have been loaded, one after the other, and the vertices in them; 0 if the mesh was in memory
    /// from the beginning.
    pub windows: u64,
    /// See [`windows`](Self::windows).
    pub loaded: u64,
    /// Where the mesh lies in the world.
    pub georeference: Georeference,
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
pub fn build(mesh: Mesh, options: &Options, progress: Progress) -> Result<(CollapseLog, Report), LogError> {
    let start = Instant::now();
    let mut log = CollapseLog { mesh, collapses: Vec::new() };
    log.forest()?;
    let mesh = &log.mesh;
    let extent = mesh.extent();
    let given: Vec<Vec3> = mesh.positions.iter().map(|&p| p.into()).collect();
    let mut lengths = EdgeLengths::default();
    for t in mesh.triangles.iter().filter(|t| !is_flat(**t)) {
        lengths.add(t.map(|v| mesh.positions[v as usize].map(f64::from)));
    }
    // Keys and quadrics are single-precision numbers of up to four lengths multiplied. They neither overflow nor vanish as
    // long as lengths are within nine orders of magnitude of the unit, so this is what most edges are like, and not the
    // extent, which a single vertex far out can make as large as it likes.
    let unit = power_of_two(lengths.median());

    // `order[new] = input number`.
    let order = spatial_order::spatial_order(&given);
    let mut number = vec![0; order.len()];
    for (new, &old) in (0..).zip(&order) {
        number[old as usize] = new;
    }
    let positions: Vec<Vec3> = order.iter().map(|&old| given[old as usize]).collect();
    drop(given);
    let leaf_radius = leaf_radii(mesh, &number);
    let mut surface = Surface::new(positions, &coherent_triangles(&mesh.triangles, &number), unit);
    let quadrics = parallel::map_chunks(surface.live.len(), AT_ONCE, |range| {
        let (mut marks, mut neighbours) = (Marks::new(order.len()), Vec::new());
        let quadric = |&v: &u32| initial_quadric(v, &surface, &mut marks, &mut neighbours);
        surface.live[range].iter().map(quadric).collect::<Vec<_>>()
    });
    for (i, (quadric, special)) in quadrics.into_iter().flatten().enumerate() {
        let v = surface.live[i] as usize;
        (surface.quadrics[v], surface.special[v]) = (quadric, special);
    }
    let nodes = Nodes::new(leaf_radius, extent, unit);
    let mut builder = Builder::new(surface, nodes, Marks::new(order.len()), options.merge_components);
    builder.begin();
    let preparation = start.elapsed();

    let start = Instant::now();
    let all = builder.surface.live.len();
    let mut rounds = Vec::new();
    let run = builder.run(
        Stall::default(),
        all,
        order.len() as u32,
        |v| v,
        |builder, nodes, limit| {
            rounds.push((nodes, limit));
            progress((all - builder.surface.live.len()) as u64, all as u64);
            Ok::<(), Infallible>(())
        },
    );
    let Ok(attempted_rounds) = run;
    let simplification = start.elapsed();

    let start = Instant::now();
    let remains = builder.remains();
    let nodes = &builder.nodes;
    let (sequence, rounds, inversions) = sequence(&nodes.keys, &rounds);
    let collapses = sequence.iter().map(|&node| {
        let c = nodes.collapses[node as usize];
        Collapse { removed: order[c.removed as usize], kept: order[c.kept as usize], ..c }
    });
    log.collapses = collapses.collect();
    let forest = log.forest()?;
    let report = Report {
        triangles: log.mesh.triangles.len(),
        collapses: log.collapses.len(),
        rounds,
        followers: nodes.followers,
        attempted_rounds,
        roots: forest.roots().count(),
        tree_depth: forest.depth(),
        dependency_depth: nodes.depth.iter().copied().max().unwrap_or(0),
        base_triangles: builder.surface.live_triangles,
        remains,
        largest_eps: log.collapses.iter().fold(0.0, |largest, c| c.bounds.eps.max(largest)),
        inversions,
        windows: 0,
        loaded: 0,
        georeference: log.mesh.georeference.clone(),
        preparation,
        simplification,
        conclusion: start.elapsed(),
    };
    Ok((log, report))
}

/// The nodes of each round in ascending order of keys, what the rounds did, and the number of nodes whose key is less
/// than an earlier one's. The rounds are given by their nodes and limits.
fn sequence(keys: &[f32], rounds: &[(Range<u32>, f32)]) -> (Vec<u32>, Vec<Round>, usize) {
    let mut sequence: Vec<u32> = (0..keys.len() as u32).collect();
    let (mut highest, mut inversions) = (0.0, 0);
    let mut done = Vec::with_capacity(rounds.len());
    for (nodes, limit) in rounds {
        let nodes = &mut sequence[nodes.start as usize..nodes.end as usize];
        nodes.sort_unstable_by(|&a, &b| keys[a as usize].total_cmp(&keys[b as usize]).then(a.cmp(&b)));
        let mut round = Round { limit: *limit, ..Round::default() };
        for &node in &*nodes {
            let key = keys[node as usize];
            round.push(key);
            inversions += usize::from(key < highest);
            highest = key.max(highest);
        }
        done.push(round);
    }
    (sequence, done, inversions)
}

/// Vertices that a thread prepares at once.
const AT_ONCE: usize = 1 << 15;

/// Weight of a plane that holds a boundary edge in place, per squared length of the edge.
const BOUNDARY_WEIGHT: f64 = 4.0;

/// A weight in single precision. The sums of a few thousand such weights, times a length, are finite still.
fn bounded_weight(weight: f64) -> f32 {
    weight.min(1e30) as f32
}

/// For each vertex in the new numbering, its distance to the farthest corner of its triangles, in object units.
fn leaf_radii(mesh: &Mesh, number: &[u32]) -> Vec<f32> {
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
fn leaf_radius(squared: f64) -> f32 {
    round_up(squared.sqrt() * (1.0 + 1e-15))
}

/// Whether a triangle names a vertex twice, and so shows nothing.
fn is_flat([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

/// The triangles with three different corners in the new numbering, in the order of their lowest vertices.
fn coherent_triangles(triangles: &[[u32; 3]], number: &[u32]) -> Vec<[u32; 3]> {
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
fn initial_quadric(
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
