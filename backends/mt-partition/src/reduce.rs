//! The reduction of the graph by arc collapses (Holst & Schumann 2006; 2007, section 3.1).
//!
//! An arc collapse merges a node with one of its children. The triangles on the arc between them are never shown again,
//! arcs that now join the same two nodes become one, and arcs come to hold more triangles. It is possible only where the
//! arc is the sole path between the two: otherwise the graph would have a cycle.
//!
//! The paper takes the order of arc collapses from a predecessor that gives it for another error metric. Here it follows
//! from what a merge costs and what it gains, see [`Reduction::key`].

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use vertex_tree::{Bounds, NONE};

use crate::graph::{Arc, Graph};
use crate::order::Order;

/// A tolerance of one pixel in an image of 1080 lines with a field of view of 60 degrees makes a node of error `eps`
/// coarse within `radius + eps * REACH`.
const REACH: f64 = 935.0;

/// How far away a viewer is at most to see a node refined.
pub(crate) fn reach(bounds: &Bounds) -> f32 {
    (f64::from(bounds.radius) + REACH * f64::from(bounds.eps)) as f32
}

/// A graph whose nodes are groups of collapses.
#[derive(Debug)]
pub(crate) struct Reduction {
    pub graph: Graph,
    pub order: Order,
    /// For each collapse, the node that it went into; itself, if it stands for a node.
    into: Vec<u32>,
    reach: Vec<f32>,
    /// For each node, the triangles on its outgoing and on its ingoing arcs.
    sizes: Vec<[u32; 2]>,
    stamp: Vec<u32>,
    arcs: u64,
    triangles: u64,
    /// Arc collapses that were given up because of another path.
    pub refused: u64,
}

/// A possible arc collapse; the one with the least key comes first.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    /// Bits of a number that is not negative: they are in the same order.
    key: u64,
    upper: u32,
    lower: u32,
    stamps: [u32; 2],
}

impl Reduction {
    /// Before anything is merged. Reaches and sizes are given for each node, and arcs and triangles in the end have to
    /// be to each other as those of a larger graph, with `totals`, of which this one is a part.
    pub fn new(
        graph: Graph,
        order: Order,
        reach: Vec<f32>,
        sizes: Vec<[u32; 2]>,
        (arcs, triangles): (u64, u64),
    ) -> Self {
        let nodes = graph.children.len();
        let (into, stamp) = ((0..nodes as u32).collect(), vec![0; nodes]);
        Self { graph, order, into, reach, sizes, stamp, arcs, triangles, refused: 0 }
    }

    /// Arcs and triangles that are left.
    pub fn totals(&self) -> (u64, u64) {
        (self.arcs, self.triangles)
    }

    /// Of a node: its reach, and the triangles on its outgoing and ingoing arcs.
    pub fn node(&self, node: u32) -> (f32, [u32; 2]) {
        (self.reach[node as usize], self.sizes[node as usize])
    }

    fn is_reduced(&self, patch: f64) -> bool {
        self.triangles as f64 >= patch * self.arcs as f64
    }

    /// Merges nodes until arcs hold `patch` triangles on average, or no candidate is left whose key is at most `limit`.
    /// Returns the least key of those that are, if any. Nodes whose positions are fixed are not merged.
    pub fn run(&mut self, patch: f64, limit: f64) -> Option<f64> {
        if self.is_reduced(patch) {
            return None;
        }
        let mut queue = BinaryHeap::new();
        for upper in (0..self.into.len() as u32).filter(|&n| !self.order.is_fixed(n)) {
            for at in 0..self.graph.children[upper as usize].len() {
                let lower = self.graph.children[upper as usize][at].node;
                if !self.order.is_fixed(lower) {
                    queue.push(Reverse(self.candidate(upper, lower)));
                }
            }
        }
        let mut most = 2 * queue.len();
        while !self.is_reduced(patch) {
            if queue.len() > most {
                // Those that are out of date would never come up, and make the way of the others longer.
                queue.retain(|Reverse(candidate)| self.is_current(candidate));
                most = (2 * queue.len()).max(LEAST);
            }
            let Some(Reverse(candidate)) = queue.pop() else { break };
            if !self.is_current(&candidate) {
                continue;
            }
            let key = f64::from_bits(candidate.key);
            if key > limit {
                return Some(key);
            }
            let Candidate { upper, lower, .. } = candidate;
            if !self.order.merge(&self.graph, upper, lower) {
                self.refused += 1;
                continue;
            }
            self.merge(upper, lower);
            for at in 0..self.graph.children[upper as usize].len() {
                let child = self.graph.children[upper as usize][at].node;
                if !self.order.is_fixed(child) {
                    queue.push(Reverse(self.candidate(upper, child)));
                }
            }
            for at in 0..self.graph.parents[upper as usize].len() {
                let parent = self.graph.parents[upper as usize][at].node;
                if !self.order.is_fixed(parent) {
                    queue.push(Reverse(self.candidate(parent, upper)));
                }
            }
        }
        None
    }

    fn is_current(&self, candidate: &Candidate) -> bool {
        [candidate.upper, candidate.lower].map(|n| self.stamp[n as usize]) == candidate.stamps
    }

    fn candidate(&self, upper: u32, lower: u32) -> Candidate {
        let stamps = [upper, lower].map(|n| self.stamp[n as usize]);
        Candidate { key: self.key(upper, lower).to_bits(), upper, lower, stamps }
    }

    /// What merging a node with its child costs, in triangles that are shown too early.
    ///
    /// The merged node unfolds when the upper one does, or its own bounds would not be nested: the lower node's
    /// triangles appear within the upper one's reach already, not only within their own. So do those of the lower
    /// node's other parents, whose bounds must grow. With viewers at distances whose logarithms are spread evenly, a
    /// node that brings `g` triangles more than it takes and whose reach grows from `a` to `b` shows `g ln(b / a)` more.
    ///
    /// That alone would let some nodes grow without end where the surface is even. So what the merged node holds counts
    /// too: large nodes make coarse steps.
    fn key(&self, upper: u32, lower: u32) -> f64 {
        let reach = f64::from(self.reach[upper as usize]);
        let extra = |node: u32| {
            let [fine, coarse] = self.sizes[node as usize].map(f64::from);
            let gain = fine - coarse;
            let growth = reach / f64::from(self.reach[node as usize]).max(f64::MIN_POSITIVE);
            // The logarithm, near enough for an order and the same on every machine.
            let growth = growth.max(1.0);
            gain.max(0.0) * (growth - 1.0) / growth.sqrt()
        };
        let others = self.graph.parents[lower as usize].iter().filter(|p| p.node != upper);
        let cost: f64 = extra(lower) + others.clone().map(|p| extra(p.node)).sum::<f64>();
        let size = f64::from(self.sizes[upper as usize][0]) + f64::from(self.sizes[lower as usize][0]);
        cost + SIZE * size
    }

    fn merge(&mut self, upper: u32, lower: u32) {
        let (u, l) = (upper as usize, lower as usize);
        self.into[l] = upper;
        self.stamp[u] += 1;
        self.stamp[l] += 1;
        self.reach[u] = self.reach[u].max(self.reach[l]);
        // What lies between the two is on an outgoing arc of the one and on an ingoing one of the other.
        let between =
            self.graph.parents[l].iter().find(|arc| arc.node == upper).map_or(0, |arc| arc.triangles);
        self.sizes[u] = [0, 1].map(|i| self.sizes[u][i] + self.sizes[l][i] - between);
        let graph = &mut self.graph;
        self.arcs -= 1;
        let children = std::mem::take(&mut graph.children[l]);
        let parents = std::mem::take(&mut graph.parents[l]);
        for arc in parents {
            let above = &mut graph.children[arc.node as usize];
            above.retain(|a| a.node != lower);
            if arc.node == upper {
                self.triangles -= u64::from(arc.triangles);
            } else {
                let fresh = add(above, upper, arc.triangles);
                add(&mut graph.parents[u], arc.node, arc.triangles);
                self.arcs -= u64::from(!fresh);
            }
        }
        for arc in children {
            let below = &mut graph.parents[arc.node as usize];
            below.retain(|a| a.node != lower);
            let fresh = add(below, upper, arc.triangles);
            add(&mut graph.children[u], arc.node, arc.triangles);
            self.arcs -= u64::from(!fresh);
        }
        for end in [&mut graph.from_source, &mut graph.to_drain] {
            let moved = std::mem::take(&mut end[l]);
            self.arcs -= u64::from(moved > 0 && end[u] > 0);
            end[u] += moved;
        }
    }

    /// For each collapse, the node that it is part of: a collapse that is part of itself.
    pub fn nodes(&self) -> Vec<u32> {
        let mut nodes = self.into.clone();
        for n in 0..nodes.len() {
            let mut top = n;
            while nodes[top] as usize != top {
                top = nodes[top] as usize;
            }
            // Everything on the way points at the top from now on.
            let mut at = n;
            while nodes[at] as usize != top {
                at = std::mem::replace(&mut nodes[at], top as u32) as usize;
            }
        }
        nodes
    }
}

/// Candidates below which it is not worth looking for those that are out of date.
const LEAST: usize = 1 << 12;

/// Weight of a triangle of the merged node against one that is shown too early: see DESIGN.md for what others gave.
pub(crate) const SIZE: f64 = 0.05;

/// Adds triangles to the arc to `node`, and says whether there was none.
fn add(arcs: &mut Vec<Arc>, node: u32, triangles: u32) -> bool {
    match arcs.iter_mut().find(|arc| arc.node == node) {
        Some(arc) => {
            arc.triangles += triangles;
            false
        }
        None => {
            debug_assert_ne!(node, NONE);
            arcs.push(Arc { node, triangles });
            true
        }
    }
}
