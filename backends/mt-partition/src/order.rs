//! A topological order that is kept while nodes are merged.
//!
//! After Pearce & Kelly (A Dynamic Topological Sort Algorithm for Directed Acyclic Graphs, 2006): only what lies between
//! the two nodes in the order is looked at. Between them, what is reached from the upper node must come after the merged
//! node and what reaches the lower node must come before it; a node that is both lies on a second path from one to the
//! other, and merging them would close a cycle.

use crate::graph::Graph;

/// Nodes looked at before a merge is given up.
const LIMIT: usize = 2048;

/// Positions of nodes; parents have smaller ones than their children.
#[derive(Debug)]
pub(crate) struct Order {
    position: Vec<u32>,
    /// Nodes that keep their positions, as others may rely on them; empty if there is none.
    fixed: Vec<bool>,
    mark: Vec<u32>,
    round: u32,
    stack: Vec<u32>,
    above: Vec<u32>,
    below: Vec<u32>,
    places: Vec<u32>,
}

impl Order {
    /// An order that is known. The positions of some nodes are fixed.
    pub fn new(position: Vec<u32>, fixed: Vec<bool>) -> Self {
        Self {
            mark: vec![0; position.len()],
            position,
            fixed,
            round: 0,
            stack: Vec::new(),
            above: Vec::new(),
            below: Vec::new(),
            places: Vec::new(),
        }
    }

    /// For sorting: smaller for parents than for their children.
    pub fn position(&self, node: u32) -> u32 {
        self.position[node as usize]
    }

    pub fn is_fixed(&self, node: u32) -> bool {
        self.fixed.get(node as usize).is_some_and(|&fixed| fixed)
    }

    /// Makes room for `upper` and `lower`, its child, to become one node, `upper`. Says whether that is possible: not if
    /// there is another path from one to the other, or if it takes too long to find out, or if a node would have to move
    /// that is fixed. What leads on from a fixed node need not be known: none is passed.
    pub fn merge(&mut self, graph: &Graph, upper: u32, lower: u32) -> bool {
        let (start, end) = (self.position(upper), self.position(lower));
        self.round += 1;
        let round = self.round;
        self.below.clear();
        self.above.clear();
        self.stack.clear();
        self.stack.push(upper);
        while let Some(node) = self.stack.pop() {
            for child in &graph.children[node as usize] {
                let position = self.position[child.node as usize];
                if child.node == lower {
                    if node != upper {
                        return false;
                    }
                } else if position < end && self.mark[child.node as usize] != round {
                    if self.is_fixed(child.node) {
                        return false;
                    }
                    self.mark[child.node as usize] = round;
                    self.below.push(child.node);
                    self.stack.push(child.node);
                }
            }
            if self.below.len() > LIMIT {
                return false;
            }
        }
        self.stack.push(lower);
        while let Some(node) = self.stack.pop() {
            for parent in &graph.parents[node as usize] {
                let position = self.position[parent.node as usize];
                if position > start && self.mark[parent.node as usize] != round {
                    if self.is_fixed(parent.node) {
                        return false;
                    }
                    self.mark[parent.node as usize] = round;
                    self.above.push(parent.node);
                    self.stack.push(parent.node);
                }
            }
            if self.above.len() > LIMIT {
                return false;
            }
        }
        let Self { position, above, below, places, .. } = self;
        above.sort_unstable_by_key(|&n| position[n as usize]);
        below.sort_unstable_by_key(|&n| position[n as usize]);
        places.clear();
        places.extend(above.iter().chain([&upper, &lower]).chain(&*below).map(|&n| position[n as usize]));
        places.sort_unstable();
        // One place is left over: the last.
        for (&node, &place) in above.iter().chain([&upper]).chain(&*below).zip(&*places) {
            position[node as usize] = place;
        }
        true
    }
}
