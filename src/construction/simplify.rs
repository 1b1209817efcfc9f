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
mod initial;
mod key_counts;
mod lanes;
mod legality;
mod marks;
mod nodes;
mod options;
mod order;
mod orientation;
mod out_of_core;
mod quadric;
mod remains;
mod report;
mod rounds;
mod samples;
mod spatial_order;
mod stall;
mod surface;
mod virtual_edges;

use rayon::prelude::*;
use std::convert::Infallible;
use std::ops::Range;
use std::time::Instant;

use collapse_log::{Collapse, CollapseLog, LogError, Mesh};
use glam::Vec3;

use crate::progress::Progress;
pub use options::Options;
pub use out_of_core::{LEAST_MEMORY, Limits, MOST_THREADS, OutOfCoreError, build_within};
pub use remains::Remains;
pub use report::{Report, Round};

use crate::edge_lengths::{EdgeLengths, power_of_two};
use initial::{coherent_triangles, initial_quadric, is_flat, leaf_radii};
use marks::Marks;
use nodes::Nodes;
use rounds::{AT_ONCE, Builder};
use stall::Stall;
use surface::Surface;

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
    let quadrics = surface.live.par_chunks(AT_ONCE).map(|live| {
        let (mut marks, mut neighbours) = (Marks::new(order.len()), Vec::new());
        let quadric = |&v: &u32| initial_quadric(v, &surface, &mut marks, &mut neighbours);
        live.iter().map(quadric).collect::<Vec<_>>()
    });
    for (i, (quadric, special)) in quadrics.collect::<Vec<_>>().into_iter().flatten().enumerate() {
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
