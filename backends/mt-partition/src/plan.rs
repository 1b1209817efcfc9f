//! What goes where in a file: the reduced graph, its bounds, layers, and nodes numbered partition by partition.

use vertex_tree::{Bounds, CollapseLog, NONE};

use crate::BuildOptions;
use crate::bounds;
use crate::graph::Graph;
use crate::partition::{layers, partitions};
use crate::reduce::Reduction;
use crate::versions::{Version, versions};

/// The multi-triangulation of a log, arranged for a file.
#[derive(Debug)]
pub(crate) struct Plan {
    /// The nodes in the order of the file: number in the log (of the collapse that stands for the node), bounds, layer.
    pub nodes: Vec<PlannedNode>,
    /// The first node of each partition.
    pub partitions: Vec<u32>,
    /// The triangles, sorted by the node above; those of the base mesh, with [`NONE`] above, last. Nodes are numbered as
    /// in `nodes`.
    pub triangles: Vec<Version>,
    /// Dependencies without triangles, as (above, below), sorted.
    pub bare: Vec<(u32, u32)>,
    pub stored: u64,
    pub arcs: u64,
    /// Triangles and arcs before the reduction.
    pub unreduced: (u64, u64),
    /// By how much the radius of a node exceeds the largest of its collapses', mean and maximum.
    pub inflation: [f64; 2],
    pub refused: u64,
}

/// A node of the reduced graph.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlannedNode {
    pub collapse: u32,
    pub bounds: Bounds,
    pub layer: u32,
}

impl Plan {
    /// Arranges a log that [`CollapseLog::forest`] accepts.
    pub fn new(log: &CollapseLog, options: &BuildOptions) -> Self {
        let mut found = versions(log);
        let graph = Graph::new(log.collapses.len(), &found);
        let (arcs, triangles) = graph.totals();
        let unreduced = (triangles, arcs);
        let reduction = Reduction::new(log, graph, options.patch);
        let group = reduction.nodes();
        let mut nodes: Vec<u32> = (0..).zip(&group).filter(|&(n, &g)| n == g).map(|(n, _)| n).collect();
        nodes.sort_unstable_by_key(|&n| reduction.order.position(n));
        let (bounds, inflation) = nested(log, &reduction.graph, &group, &nodes);
        let layers = layers(&reduction.graph, &nodes);
        let limit = options.partition.max(1) as usize;
        let divided = partitions(&reduction.graph, &nodes, &layers, limit, options.order);

        let mut number = vec![NONE; group.len()];
        let mut firsts = Vec::with_capacity(divided.len());
        let mut planned = Vec::with_capacity(nodes.len());
        for partition in &divided {
            firsts.push(planned.len() as u32);
            for &n in partition {
                number[n as usize] = planned.len() as u32;
                planned.push(PlannedNode {
                    collapse: n,
                    bounds: bounds[n as usize],
                    layer: layers[n as usize],
                });
            }
        }
        let renumber = |n: u32| if n == NONE { NONE } else { number[group[n as usize] as usize] };
        found.triangles.retain_mut(|t| {
            [t.above, t.below] = [t.above, t.below].map(renumber);
            t.above != t.below || t.above == NONE
        });
        found.triangles.sort_by_key(|t| (t.above, t.below));
        let mut bare: Vec<(u32, u32)> = (found.bare.iter())
            .map(|&(a, b)| (renumber(a), renumber(b)))
            .filter(|&(a, b)| {
                let same = |t: &Version| (t.above, t.below).cmp(&(a, b));
                a != b && found.triangles.binary_search_by(same).is_err()
            })
            .collect();
        bare.sort_unstable();
        bare.dedup();
        let (arcs, stored) = reduction.graph.totals();
        debug_assert_eq!(stored, found.triangles.len() as u64);
        Self {
            nodes: planned,
            partitions: firsts,
            triangles: found.triangles,
            bare,
            stored,
            arcs,
            unreduced,
            inflation,
            refused: reduction.refused,
        }
    }
}

/// Bounds of each node (a collapse that stands for its group), nested over the graph, and by how much radii have grown.
fn nested(log: &CollapseLog, graph: &Graph, group: &[u32], nodes: &[u32]) -> (Vec<Bounds>, [f64; 2]) {
    // The collapses of each group, one after the other.
    let mut start = vec![0_u32; group.len() + 1];
    for &g in group {
        start[g as usize + 1] += 1;
    }
    for g in 0..group.len() {
        start[g + 1] += start[g];
    }
    let mut members = vec![0_u32; group.len()];
    let mut next = start.clone();
    for (n, &g) in (0..).zip(group) {
        members[next[g as usize] as usize] = n;
        next[g as usize] += 1;
    }
    let mut bounds: Vec<Bounds> = log.collapses.iter().map(|c| c.bounds).collect();
    let (mut sum, mut most) = (0.0, 1.0_f64);
    let mut parts = Vec::new();
    for &node in nodes.iter().rev() {
        let n = node as usize;
        let own = &members[start[n] as usize..start[n + 1] as usize];
        parts.clear();
        parts.extend(own.iter().map(|&m| log.collapses[m as usize].bounds));
        let largest = parts.iter().map(|b| b.radius).fold(0.0, f32::max);
        parts.extend(graph.children[n].iter().map(|c| bounds[c.node as usize]));
        bounds[n] = bounds::around(&parts);
        let inflation = f64::from(bounds[n].radius) / f64::from(largest.max(f32::MIN_POSITIVE));
        sum += inflation;
        most = most.max(inflation);
    }
    (bounds, [sum / nodes.len().max(1) as f64, most])
}
