//! Nested bounds, layers, partitions, and the numbers of the nodes in the file.
//!
//! Nodes that are left are put in topological order; from then on, and until they have their numbers in the file, they
//! are known by their *rank* in it. Bounds are found from the last node to the first, layers from the first to the last,
//! each from the arcs in that order. Partitions are made in regions that fit in memory: along the curve, as many nodes as
//! there is room for.

use std::io;

use collapse_log::LogError;
use collapse_log::external::{Array, Paged, Sorter, Spool, too_few};
use vertex_tree::{Bounds, NONE};

use super::arcs::{ARC_BYTES, NODE_BYTES};
use super::history::State;
use super::rounds::Rounds;
use super::work::{Failure, Work};
use crate::bounds::around;
use crate::graph::Graph;
use crate::options::BuildOptions;
use crate::partition::partitions;

/// The graph as it will be written.
pub(super) struct Arranged {
    /// By vertex: what becomes of it.
    pub fates: Paged<3>,
    /// By place: the number of the node that the collapse is part of.
    pub numbers: Array<u32>,
    /// In order of their numbers: collapse, centre, radius, error and layer of each node.
    pub nodes: Spool<7>,
    /// The first node of each partition.
    pub partitions: Spool<1>,
    /// Arcs in the order of the file: node above, node below, triangles.
    pub arcs: Spool<3>,
    pub totals: (u64, u64),
    pub unreduced: (u64, u64),
    pub refused: u64,
    pub inflation: [f64; 2],
}

impl Arranged {
    pub fn new(
        work: Work<'_>,
        options: &BuildOptions,
        fates: Spool<3>,
        rounds: Rounds<'_>,
    ) -> Result<Self, Failure> {
        let Rounds { mut states, mut into, arcs, unreduced, refused, .. } = rounds;
        let (totals, mut arcs) = (arcs.totals, arcs.spool);
        let (share, scratch) = (work.memory / 8, work.scratch);
        let (mut tops, mut ranks) = rank(work, &mut states, &mut into)?;
        let nodes = tops.len() as u32;
        drop(states);
        let mut arcs = renumber(work, &mut arcs, &mut ranks)?;
        let mut fates = fates.into_paged(work.memory / 4)?;
        let (mut bounds, inflation) = nested(work, &mut arcs, nodes, &mut fates, &mut ranks)?;
        let mut layers = layers(work, &mut arcs, nodes)?;
        let mut divided = divide(work, options, &mut arcs, &mut tops, &mut layers)?;

        let mut number_of = Array::new(scratch, nodes as usize, NONE, share);
        let mut stored = scratch.spool()?;
        let mut firsts = scratch.spool()?;
        let mut first = NONE;
        for (number, node) in (0..).zip(divided.read()?) {
            let [first_rank, rank] = node?;
            if first_rank != first {
                first = first_rank;
                firsts.push([number])?;
            }
            number_of.set(rank as usize, number)?;
            let [x, y, z, radius, eps] = bounds.get(rank as usize)?;
            let [collapse, _] = tops.get(rank as usize)?;
            stored.push([collapse, x, y, z, radius, eps, layers.get(rank as usize)?])?;
        }
        let arcs = renumber(work, &mut arcs, &mut number_of)?;
        for place in 0..ranks.len() {
            work.check()?;
            let rank = ranks.get_mut(place)?;
            *rank = number_of.get(*rank as usize)?;
        }
        Ok(Self {
            fates,
            numbers: ranks,
            nodes: stored,
            partitions: firsts,
            arcs,
            totals,
            unreduced,
            refused,
            inflation,
        })
    }
}

/// The nodes that are left in topological order, collapse and place of each; and by place the rank of the node that a
/// collapse is part of.
fn rank(
    work: Work<'_>,
    states: &mut Array<State>,
    into: &mut Array<u32>,
) -> io::Result<(Array<[u32; 2]>, Array<u32>)> {
    let share = work.memory / 8;
    let mut sorted = Sorter::<3>::new(work.scratch, share);
    for place in 0..into.len() {
        work.check()?;
        // Who has been merged points at who it was merged into in that round, and so on: no more steps than rounds.
        let mut top = into.get(place)?;
        loop {
            let above = into.get(top as usize)?;
            if above == top {
                break;
            }
            top = above;
        }
        into.set(place, top)?;
        if top as usize == place {
            let State { position, collapse, .. } = states.get(place)?;
            sorted.push([position, collapse, place as u32])?;
        }
    }
    let mut tops = Array::new(work.scratch, 0, [NONE; 2], share / 2);
    let mut ranks = Array::new(work.scratch, into.len(), NONE, share);
    sorted.finish(|[_, collapse, place]| {
        ranks.set(place as usize, tops.len() as u32)?;
        tops.push([collapse, place])
    })?;
    for place in 0..into.len() {
        work.check()?;
        let top = into.get(place)? as usize;
        if top != place {
            let rank = ranks.get(top)?;
            ranks.set(place, rank)?;
        }
    }
    Ok((tops, ranks))
}

/// Arcs between nodes that are called otherwise, sorted.
fn renumber(work: Work<'_>, arcs: &mut Spool<3>, numbers: &mut Array<u32>) -> io::Result<Spool<3>> {
    let mut sorted = Sorter::<3>::new(work.scratch, work.memory / 8);
    let mut number = |node: u32| if node == NONE { Ok(NONE) } else { numbers.get(node as usize) };
    for arc in arcs.read()? {
        work.check()?;
        let [above, below, triangles] = arc?;
        sorted.push([number(above)?, number(below)?, triangles])?;
    }
    let mut renumbered = work.scratch.spool()?;
    sorted.finish(|arc| renumbered.push(arc))?;
    Ok(renumbered)
}

/// Bounds by rank, nested over the graph, and by how much radii have grown: mean and maximum.
fn nested(
    work: Work<'_>,
    arcs: &mut Spool<3>,
    nodes: u32,
    fates: &mut Paged<3>,
    ranks: &mut Array<u32>,
) -> Result<(Array<[u32; 5]>, [f64; 2]), Failure> {
    // The collapses of each node, of the last node first.
    let mut members = Sorter::<7>::new(work.scratch, work.memory / 8);
    for (n, c) in (0..).zip(work.log.collapses()) {
        work.check()?;
        let c = c?;
        let [.., place] = fates.get(c.removed.into())?;
        let rank = ranks.get(place as usize)?;
        let [x, y, z, radius, eps] = words(&c.bounds);
        members.push([nodes - 1 - rank, n, x, y, z, radius, eps])?;
    }
    let mut bounds = Array::new(work.scratch, nodes as usize, [0; 5], work.memory / 8);
    let mut arcs = arcs.read_back()?;
    let mut next = arcs.next().transpose()?;
    let (mut sum, mut most) = (0.0, 1.0_f64);
    let (mut parts, mut children, mut beyond) = (Vec::new(), Vec::new(), None);
    let mut finish = |node: u32, collapse: u32, parts: &mut Vec<Bounds>| {
        while next.is_some_and(|[above, ..]| above == NONE || above > node) {
            next = arcs.next().transpose()?;
        }
        children.clear();
        while let Some([_, below, _]) = next.filter(|arc| arc[0] == node) {
            children.extend(Some(below).filter(|&below| below != NONE));
            next = arcs.next().transpose()?;
        }
        let largest = parts.iter().map(|b| b.radius).fold(0.0, f32::max);
        for &child in children.iter().rev() {
            parts.push(bounds_of(bounds.get(child as usize)?));
        }
        let nested = around(parts);
        if !nested.is_sane() {
            beyond = Some((collapse, nested));
        }
        bounds.set(node as usize, words(&nested))?;
        let inflation = f64::from(nested.radius) / f64::from(largest.max(f32::MIN_POSITIVE));
        sum += inflation;
        most = most.max(inflation);
        parts.clear();
        io::Result::Ok(())
    };
    let (mut node, mut last) = (nodes.wrapping_sub(1), 0);
    members.finish(|[back, n, x, y, z, radius, eps]| {
        work.check()?;
        if nodes - 1 - back != node {
            finish(node, last, &mut parts)?;
            node = nodes - 1 - back;
        }
        last = n;
        parts.push(bounds_of([x, y, z, radius, eps]));
        Ok(())
    })?;
    if nodes > 0 {
        finish(node, last, &mut parts)?;
    }
    // Spheres in the range of 32 bits need not have one around them that is.
    if let Some((collapse, bounds)) = beyond {
        return Err(LogError::BadBounds { collapse: collapse as usize, bounds }.into());
    }
    Ok((bounds, [sum / f64::from(nodes.max(1)), most]))
}

pub(super) fn words(bounds: &Bounds) -> [u32; 5] {
    let Bounds { center: [x, y, z], radius, eps } = *bounds;
    [x, y, z, radius, eps].map(f32::to_bits)
}

pub(super) fn bounds_of(words: [u32; 5]) -> Bounds {
    let [x, y, z, radius, eps] = words.map(f32::from_bits);
    Bounds { center: [x, y, z], radius, eps }
}

/// By rank, the number of arcs on the longest path from the source: see `crate::partition::layers`.
fn layers(work: Work<'_>, arcs: &mut Spool<3>, nodes: u32) -> io::Result<Array<u32>> {
    // First that of the lowest parent, from when its parents have been gone through.
    let mut layers = Array::new(work.scratch, nodes as usize, 0_u32, work.memory / 16);
    let mut arcs = arcs.read()?;
    let mut next = arcs.next().transpose()?;
    for node in 0..nodes {
        work.check()?;
        let layer = layers.get_mut(node as usize)?;
        *layer += 1;
        let layer = *layer;
        while let Some([_, below, _]) = next.filter(|arc| arc[0] == node) {
            if below != NONE {
                let above = layers.get_mut(below as usize)?;
                *above = layer.max(*above);
            }
            next = arcs.next().transpose()?;
        }
    }
    Ok(layers)
}

/// Divides the nodes into partitions: for each node, in the order of the file, the rank of the first of its partition and its
/// own.
fn divide(
    work: Work<'_>,
    options: &BuildOptions,
    arcs: &mut Spool<3>,
    tops: &mut Array<[u32; 2]>,
    layers: &mut Array<u32>,
) -> io::Result<Spool<2>> {
    let (scratch, share) = (work.scratch, work.memory / 16);
    // With pairs of partitions in a heap, a region takes about twice what its graph does.
    let most = (work.memory as u64 / 8 / (NODE_BYTES + 4 * ARC_BYTES)).max(1 << 8);
    // Nodes along the curve, cut into regions.
    let mut along = Sorter::<2>::new(scratch, share);
    for rank in 0..tops.len() {
        let [_, place] = tops.get(rank)?;
        along.push([place, rank as u32])?;
    }
    let mut region_of = Array::new(scratch, tops.len(), 0_u32, share);
    let mut number = 0_u64;
    along.finish(|[_, rank]| {
        region_of.set(rank as usize, (number / most) as u32)?;
        number += 1;
        Ok(())
    })?;
    let regions = number.div_ceil(most) as usize;
    let mut nodes = Sorter::<3>::new(scratch, share);
    let mut counts = vec![[0_u64; 2]; regions];
    for rank in 0..tops.len() {
        let region = region_of.get(rank)?;
        counts[region as usize][0] += 1;
        nodes.push([region, rank as u32, layers.get(rank)?])?;
    }
    let mut inner = Sorter::<3>::new(scratch, share);
    for arc in arcs.read()? {
        work.check()?;
        let [above, below, _] = arc?;
        if above != NONE && below != NONE {
            let region = region_of.get(above as usize)?;
            if region == region_of.get(below as usize)? {
                counts[region as usize][1] += 1;
                inner.push([region, above, below])?;
            }
        }
    }
    drop(region_of);
    let (mut node_spool, mut arc_spool) = (scratch.spool()?, scratch.spool()?);
    nodes.finish(|[_, rank, layer]| node_spool.push([rank, layer]))?;
    inner.finish(|[_, above, below]| arc_spool.push([above, below]))?;
    let (mut nodes, mut inner) = (node_spool.read()?, arc_spool.read()?);
    let mut divided = Sorter::<2>::new(scratch, share);
    for [node_count, arc_count] in counts {
        work.check()?;
        let (mut ranks, mut layers, mut local) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..node_count {
            let [rank, layer] = nodes.next().ok_or_else(too_few)??;
            ranks.push(rank);
            layers.push(layer);
        }
        for _ in 0..arc_count {
            let ends = inner.next().ok_or_else(too_few)??;
            let [above, below] = ends.map(|end| ranks.partition_point(|&rank| rank < end) as u32);
            local.push([above, below, 1]);
        }
        let graph = Graph::of_arcs(ranks.len(), &local);
        drop(local);
        let all: Vec<u32> = (0..ranks.len() as u32).collect();
        let limit = options.partition.max(1) as usize;
        for partition in partitions(&graph, &all, &layers, limit, options.order) {
            for &node in &partition {
                divided.push([ranks[partition[0] as usize], ranks[node as usize]])?;
            }
        }
    }
    let mut sorted = scratch.spool()?;
    divided.finish(|node| sorted.push(node))?;
    Ok(sorted)
}
