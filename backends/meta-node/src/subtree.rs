//! Some nodes of the forest in memory, to find which of them bring which triangles.

use vertex_tree::NONE;

/// The leaves below a node are `first..end`; those from `pivot` on are below the removed vertex.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Span {
    pub first: u32,
    pub pivot: u32,
    pub end: u32,
}

impl Span {
    /// The children of node `n` in preorder, that of the kept vertex first; [`NONE`] for a leaf.
    pub fn children(self, n: u32) -> [u32; 2] {
        let (kept, removed) = (self.pivot - self.first, self.end - self.pivot);
        [if kept > 1 { n + 1 } else { NONE }, if removed > 1 { n + kept } else { NONE }]
    }
}

/// Nodes in preorder: a subtree, or all nodes above some subtrees.
#[derive(Debug, Default)]
pub(crate) struct Subtree {
    spans: Vec<Span>,
    /// The node above each; [`NONE`] if it is not here.
    parents: Vec<u32>,
    /// The nodes above the next one.
    above: Vec<u32>,
    /// For each leaf from the first node's on, the last node that begins there or before. Only where leaves are dense.
    last: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    bringers: Vec<u32>,
}

/// With fewer nodes than leaves over this, the node at a leaf is searched for.
const SPARSE: usize = 4;

impl Subtree {
    /// Puts a node behind the others.
    pub fn push(&mut self, span: Span) {
        while self.above.last().is_some_and(|&n| self.spans[n as usize].end <= span.first) {
            self.above.pop();
        }
        self.parents.push(self.above.last().copied().unwrap_or(NONE));
        self.above.push(self.spans.len() as u32);
        self.spans.push(span);
    }

    /// All nodes are there.
    pub fn finish(&mut self) {
        let Some(&Span { first, end, .. }) = self.spans.first() else { return };
        if ((end - first) as usize) / SPARSE > self.spans.len() || self.parents[1..].contains(&NONE) {
            return;
        }
        self.last.resize((end - first) as usize, 0);
        for (n, span) in (0..).zip(&self.spans) {
            self.last[(span.first - first) as usize] = n;
        }
        let mut last = 0;
        for n in &mut self.last {
            last = last.max(*n);
            *n = last;
        }
    }

    /// The last node that begins at a leaf or before; [`NONE`] if there is none.
    fn last(&self, leaf: u32) -> u32 {
        let Some(first) = self.spans.first().map(|span| span.first) else { return NONE };
        if let Some(&n) = leaf.checked_sub(first).and_then(|at| self.last.get(at as usize)) {
            return n;
        }
        match self.spans.partition_point(|span| span.first <= leaf) {
            0 => NONE,
            n => n as u32 - 1,
        }
    }

    /// The lowest node that has two leaves below it, of which `low` is the lesser; [`NONE`] if none has.
    fn meet(&self, low: u32, high: u32) -> u32 {
        // The lowest node with `low` below it is this one, or above it: whatever begins later begins below that node.
        let mut n = self.last(low);
        while n != NONE && self.spans[n as usize].end <= high {
            n = self.parents[n as usize];
        }
        n
    }

    /// The node at which two corners of a triangle, which are three leaves, merge first: the lower one of their lowest common
    /// ancestors. [`NONE`] if that is not here.
    pub fn bringer(&self, mut leaves: [u32; 3]) -> u32 {
        leaves.sort_unstable();
        let [a, b, c] = leaves;
        let (ab, bc) = (self.meet(a, b), self.meet(b, c));
        // One of the two lies below or at the other, if both exist: the one with fewer leaves.
        let leaves_below = |n: u32| self.spans.get(n as usize).map_or(u32::MAX, |span| span.end - span.first);
        if leaves_below(ab) <= leaves_below(bc) { ab } else { bc }
    }

    /// Gives a triangle to a node.
    pub fn add(&mut self, bringer: u32, leaves: [u32; 3]) {
        self.bringers.push(bringer);
        self.triangles.push(leaves);
    }

    /// The triangles by the node that brings them, in the order in which they were given, and where those of each node
    /// start.
    pub fn sorted(&self) -> (Vec<[u32; 3]>, Vec<u32>) {
        let count = self.spans.len();
        let mut starts = vec![0_u32; count + 1];
        for &n in &self.bringers {
            starts[n as usize + 1] += 1;
        }
        for n in 0..count {
            starts[n + 1] += starts[n];
        }
        let mut next = starts.clone();
        let mut sorted = vec![[0; 3]; self.triangles.len()];
        for (&n, &leaves) in self.bringers.iter().zip(&self.triangles) {
            sorted[next[n as usize] as usize] = leaves;
            next[n as usize] += 1;
        }
        (sorted, starts)
    }
}
