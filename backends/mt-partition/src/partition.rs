//! Layers, and partitions of nodes that are likely to be used together (Holst & Schumann 2007, section 4.2).

use std::collections::BinaryHeap;

use vertex_tree::NONE;

use crate::graph::Graph;

/// In which order pairs of partitions are merged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum QueueOrder {
    /// The pair with the fewest connecting arcs first, as printed: fuller partitions and fewer reads.
    #[default]
    Increasing,
    /// The pair with the most connecting arcs first, as the paper's second observation suggests. Partitions that are full
    /// early leave small ones between them.
    Decreasing,
}

/// The nodes of a partition, and what joins it to others.
#[derive(Clone, Debug)]
struct Partition {
    nodes: Vec<u32>,
    /// Least and largest layer.
    layers: [u32; 2],
    /// Connected partitions and by how many arcs, in ascending order.
    links: Vec<(u32, u32)>,
    stamp: u32,
}

/// A pair of connected partitions. The largest comes first.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Pair {
    /// By the connecting arcs, then by the layer span: the smaller the better.
    rank: (i64, std::cmp::Reverse<u32>),
    pair: std::cmp::Reverse<[u32; 2]>,
    stamps: [u32; 2],
}

/// Divides nodes into partitions of at most `limit`. Each is in the order of `nodes`, and so are their first nodes.
pub(crate) fn partitions(
    graph: &Graph,
    nodes: &[u32],
    layers: &[u32],
    limit: usize,
    order: QueueOrder,
) -> Vec<Vec<u32>> {
    let mut number = vec![NONE; graph.parents.len()];
    for (i, &node) in (0..).zip(nodes) {
        number[node as usize] = i;
    }
    let mut partitions: Vec<Partition> = nodes
        .iter()
        .map(|&node| {
            let (above, below) = (&graph.parents[node as usize], &graph.children[node as usize]);
            let mut links: Vec<(u32, u32)> =
                above.iter().chain(below).map(|arc| (number[arc.node as usize], 1)).collect();
            links.sort_unstable();
            let layer = layers[node as usize];
            Partition { nodes: vec![node], layers: [layer; 2], links, stamp: 0 }
        })
        .collect();
    let pair = |partitions: &[Partition], a: u32, b: u32, arcs: u32| {
        let [p, q] = [a, b].map(|p| &partitions[p as usize]);
        let span = p.layers[1].max(q.layers[1]) - p.layers[0].min(q.layers[0]);
        let sign = if order == QueueOrder::Increasing { -1 } else { 1 };
        Pair {
            rank: (sign * i64::from(arcs), std::cmp::Reverse(span)),
            pair: std::cmp::Reverse([a, b]),
            stamps: [p.stamp, q.stamp],
        }
    };
    let mut queue = BinaryHeap::new();
    for a in 0..partitions.len() as u32 {
        for &(b, arcs) in partitions[a as usize].links.iter().filter(|&&(b, _)| b > a) {
            queue.push(pair(&partitions, a, b, arcs));
        }
    }
    while let Some(Pair { pair: std::cmp::Reverse([a, b]), stamps, .. }) = queue.pop() {
        let (p, q) = (&partitions[a as usize], &partitions[b as usize]);
        if stamps != [p.stamp, q.stamp] || p.nodes.len() + q.nodes.len() > limit {
            continue;
        }
        merge(&mut partitions, a, b);
        let p = &partitions[a as usize];
        if p.nodes.len() < limit {
            let fresh: Vec<Pair> =
                p.links.iter().map(|&(c, arcs)| pair(&partitions, a.min(c), a.max(c), arcs)).collect();
            queue.extend(fresh);
        }
    }
    let mut result: Vec<Vec<u32>> =
        partitions.into_iter().map(|p| p.nodes).filter(|nodes| !nodes.is_empty()).collect();
    for nodes in &mut result {
        nodes.sort_unstable_by_key(|&n| number[n as usize]);
    }
    result.sort_unstable_by_key(|nodes| number[nodes[0] as usize]);
    result
}

/// Merges partition `b` into `a`.
fn merge(partitions: &mut [Partition], a: u32, b: u32) {
    let gone = std::mem::replace(
        &mut partitions[b as usize],
        Partition { nodes: Vec::new(), layers: [0; 2], links: Vec::new(), stamp: u32::MAX },
    );
    for &(c, arcs) in gone.links.iter().filter(|&&(c, _)| c != a) {
        let links = &mut partitions[c as usize].links;
        links.retain(|&(d, _)| d != b);
        match links.iter_mut().find(|(d, _)| *d == a) {
            Some((_, count)) => *count += arcs,
            None => links.push((a, arcs)),
        }
    }
    let p = &mut partitions[a as usize];
    p.links.retain(|&(c, _)| c != b);
    for (c, arcs) in gone.links.into_iter().filter(|&(c, _)| c != a) {
        match p.links.iter_mut().find(|(d, _)| *d == c) {
            Some((_, count)) => *count += arcs,
            None => p.links.push((c, arcs)),
        }
    }
    p.nodes.extend(gone.nodes);
    p.layers = [p.layers[0].min(gone.layers[0]), p.layers[1].max(gone.layers[1])];
    p.stamp += 1;
}
