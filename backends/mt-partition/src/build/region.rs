//! A region of the graph in memory.

use std::io;

use collapse_log::external::Array;
use vertex_tree::NONE;

use super::history::State;
use super::work::Work;
use crate::graph::Graph;
use crate::order::Order;
use crate::reduce::Reduction;

/// Says which ends of an arc are in a region.
pub(super) const ABOVE: u32 = 1;
pub(super) const BELOW: u32 = 2;

/// What a round, or a region of it, has come to.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outcome {
    pub merged: u64,
    pub refused: u64,
    /// The least key of a candidate that was above the limit.
    pub left: Option<f64>,
}

/// Nodes of a region and their neighbours in others, in the order of their collapses.
pub(super) struct Region {
    /// The place of each.
    places: Vec<u32>,
    reduction: Reduction,
}

impl Region {
    /// Loads the nodes of `arcs`, which are all that begin or end in the region, and which are used up: node above, node
    /// below, triangles, and which of the two are in the region. Those in others may have been merged in this round already.
    pub fn load(
        work: Work<'_>,
        arcs: &mut Vec<[u32; 4]>,
        states: &mut Array<State>,
        into: &mut Array<u32>,
        totals: (u64, u64),
    ) -> io::Result<Self> {
        let mut places = Vec::new();
        for [above, below, _, own] in arcs.iter_mut() {
            for (end, side) in [(above, ABOVE), (below, BELOW)] {
                let is_own = *own & side > 0;
                if *end != NONE && !is_own {
                    *end = into.get(*end as usize)?;
                }
                if *end != NONE && places.last() != Some(&(*end, is_own)) {
                    places.push((*end, is_own));
                }
            }
        }
        places.sort_unstable();
        places.dedup();
        let mut loaded = Vec::with_capacity(places.len());
        for (i, &(place, _)) in (0..).zip(&places) {
            loaded.push((states.get(place as usize)?, i));
        }
        work.check()?;
        loaded.sort_unstable_by_key(|(state, _)| state.collapse);
        let mut local = vec![0; places.len()];
        for (number, &(_, i)) in (0..).zip(&loaded) {
            local[i as usize] = number;
        }
        let mut local_arcs: Vec<[u32; 3]> = Vec::with_capacity(arcs.len());
        let number = |end: u32| match end {
            NONE => NONE,
            end => local[places.partition_point(|&(place, _)| place < end)],
        };
        local_arcs.extend(arcs.iter().map(|&[above, below, t, _]| [number(above), number(below), t]));
        *arcs = Vec::new();
        local_arcs.sort_unstable();
        local_arcs.dedup_by(|arc, before| {
            let same = arc[..2] == before[..2];
            before[2] += if same { arc[2] } else { 0 };
            same
        });
        let graph = Graph::of_arcs(places.len(), &local_arcs);
        drop(local_arcs);
        let fixed = if places.iter().all(|&(_, is_own)| is_own) {
            Vec::new()
        } else {
            loaded.iter().map(|&(_, i)| !places[i as usize].1).collect()
        };
        let order = Order::new(loaded.iter().map(|(state, _)| state.position).collect(), fixed);
        let reach = loaded.iter().map(|(state, _)| state.reach).collect();
        let sizes = loaded.iter().map(|(state, _)| state.sizes).collect();
        let places = loaded.iter().map(|&(_, i)| places[i as usize].0).collect();
        Ok(Self { places, reduction: Reduction::new(graph, order, reach, sizes, totals) })
    }

    /// Merges nodes up to a limit, and stores what has become of them.
    pub fn reduce(
        &mut self,
        patch: f64,
        limit: f64,
        states: &mut Array<State>,
        into: &mut Array<u32>,
    ) -> io::Result<Outcome> {
        let left = self.reduction.run(patch, limit);
        let tops = self.reduction.nodes();
        let mut merged = 0;
        for (node, (&top, &place)) in (0..).zip(tops.iter().zip(&self.places)) {
            if top != node {
                into.set(place as usize, self.places[top as usize])?;
                merged += 1;
            } else if !self.reduction.order.is_fixed(node) {
                let state = states.get_mut(place as usize)?;
                (state.reach, state.sizes) = self.reduction.node(node);
                state.position = self.reduction.order.position(node);
            }
        }
        Ok(Outcome { merged, refused: self.reduction.refused, left })
    }

    /// Arcs and triangles of the whole graph, as far as the region knows.
    pub fn totals(&self) -> (u64, u64) {
        self.reduction.totals()
    }
}
