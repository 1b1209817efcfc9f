//! The directed acyclic graph of a multi-triangulation, with how many triangles lie on each arc.

use vertex_tree::NONE;

/// One end of an arc: the node at the other end, and how many triangles lie on the arc. None lie on an arc that is a
/// dependency and nothing else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Arc {
    pub node: u32,
    pub triangles: u32,
}

/// Nodes are numbered in the order of the log. Arcs lead from a later collapse to an earlier one, from coarse to fine.
#[derive(Clone, Debug, Default)]
pub(crate) struct Graph {
    pub parents: Vec<Vec<Arc>>,
    pub children: Vec<Vec<Arc>>,
    /// Triangles on the arc from the source, which holds the base mesh.
    pub from_source: Vec<u32>,
    /// Triangles on the arc to the drain, which holds the input.
    pub to_drain: Vec<u32>,
}

impl Graph {
    /// A graph with the given arcs, in ascending order: node above, node below, triangles. [`NONE`] is the source above and
    /// the drain below. In the lists of the nodes those without triangles come last.
    pub fn of_arcs(nodes: usize, arcs: &[[u32; 3]]) -> Self {
        let mut graph = Self {
            parents: vec![Vec::new(); nodes],
            children: vec![Vec::new(); nodes],
            from_source: vec![0; nodes],
            to_drain: vec![0; nodes],
        };
        for is_bare in [false, true] {
            for &[above, below, triangles] in arcs.iter().filter(|arc| (arc[2] == 0) == is_bare) {
                match (above, below) {
                    (NONE, NONE) => {}
                    (NONE, below) => graph.from_source[below as usize] += triangles,
                    (above, NONE) => graph.to_drain[above as usize] += triangles,
                    (above, below) => {
                        graph.children[above as usize].push(Arc { node: below, triangles });
                        graph.parents[below as usize].push(Arc { node: above, triangles });
                    }
                }
            }
        }
        graph
    }
}
