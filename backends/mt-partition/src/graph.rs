//! The directed acyclic graph of a multi-triangulation, with how many triangles lie on each arc.

use vertex_tree::NONE;

use crate::versions::Versions;

/// One end of an arc: the node at the other end, and how many triangles lie on the arc. None lie on an arc that is a
/// dependency and nothing else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Arc {
    pub node: u32,
    pub triangles: u32,
}

/// Nodes are collapses, numbered as in the log. Arcs lead from a later collapse to an earlier one, from coarse to fine.
#[derive(Clone, Debug, Default)]
pub(crate) struct Graph {
    pub parents: Vec<Vec<Arc>>,
    pub children: Vec<Vec<Arc>>,
    /// Triangles on the arc from the source, which holds the base mesh.
    pub from_source: Vec<u32>,
    /// Triangles on the arc to the drain, which holds the input.
    pub to_drain: Vec<u32>,
    /// Triangles on the arc from the source to the drain.
    pub untouched: u32,
}

impl Graph {
    pub fn new(nodes: usize, versions: &Versions) -> Self {
        let mut graph = Self {
            parents: vec![Vec::new(); nodes],
            children: vec![Vec::new(); nodes],
            from_source: vec![0; nodes],
            to_drain: vec![0; nodes],
            untouched: 0,
        };
        let key = |above: u32, below: u32| u64::from(above) << 32 | u64::from(below);
        let mut arcs: Vec<u64> = Vec::with_capacity(versions.triangles.len() + versions.bare.len());
        for t in &versions.triangles {
            match (t.above, t.below) {
                (NONE, NONE) => graph.untouched += 1,
                (NONE, below) => graph.from_source[below as usize] += 1,
                (above, NONE) => graph.to_drain[above as usize] += 1,
                (above, below) => arcs.push(key(above, below)),
            }
        }
        arcs.sort_unstable();
        let mut bare: Vec<u64> = versions.bare.iter().map(|&(above, below)| key(above, below)).collect();
        bare.sort_unstable();
        bare.dedup();
        bare.retain(|arc| arcs.binary_search(arc).is_err());
        let counted = arcs.chunk_by(|a, b| a == b).map(|same| (same[0], same.len() as u32));
        for (arc, triangles) in counted.chain(bare.into_iter().map(|arc| (arc, 0))) {
            let (above, below) = ((arc >> 32) as u32, arc as u32);
            graph.children[above as usize].push(Arc { node: below, triangles });
            graph.parents[below as usize].push(Arc { node: above, triangles });
        }
        graph
    }

    /// Arcs and the triangles on them, those of the source and the drain included.
    pub fn totals(&self) -> (u64, u64) {
        let ends = self.from_source.iter().chain(&self.to_drain).chain([&self.untouched]);
        let inner = self.children.iter().flatten().map(|arc| (1, u64::from(arc.triangles)));
        inner
            .chain(ends.filter(|&&t| t > 0).map(|&t| (1, u64::from(t))))
            .fold((0, 0), |(arcs, triangles), (a, t)| (arcs + a, triangles + t))
    }

    /// Triangles on the ingoing arcs of a node: what is shown while it is folded.
    pub fn coarse(&self, node: u32) -> u32 {
        let node = node as usize;
        self.parents[node].iter().map(|arc| arc.triangles).sum::<u32>() + self.from_source[node]
    }

    /// Triangles on the outgoing arcs of a node: what it shows while everything below is folded.
    pub fn fine(&self, node: u32) -> u32 {
        let node = node as usize;
        self.children[node].iter().map(|arc| arc.triangles).sum::<u32>() + self.to_drain[node]
    }
}
