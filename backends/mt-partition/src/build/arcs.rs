//! The arcs of a graph in a temporary file.

use std::io;

use collapse_log::external::{Array, Spool};
use vertex_tree::NONE;

use super::work::Work;

/// Nodes along a curve that are counted together when the graph is cut into regions.
const SPAN: u32 = 64;

/// Bytes of memory that a node of a region takes, and an arc, once for each end in the region.
pub(super) const NODE_BYTES: u64 = 220;
pub(super) const ARC_BYTES: u64 = 60;

/// The arcs of a graph in ascending order: node above, node below, triangles. Of those with the source above or the drain
/// below [`NONE`] stands for the one.
pub(super) struct Arcs {
    pub spool: Spool<3>,
    /// Arcs, and the triangles on them.
    pub totals: (u64, u64),
    /// Bytes of memory for each [`SPAN`] nodes along each curve.
    weights: [Vec<u64>; 2],
}

impl Arcs {
    /// Cuts the graph into regions of at most so many bytes, or else of one span: where each ends along a curve. The first is
    /// half as large if they are to be shifted.
    pub fn cut(&self, most: u64, curve: usize, shifted: bool) -> Vec<u32> {
        let (mut ends, mut sum) = (Vec::new(), 0);
        if shifted && self.weights[curve].iter().sum::<u64>() > most {
            sum = most / 2;
        }
        for (span, weight) in (0..).zip(&self.weights[curve]) {
            if sum + weight > most && span > 0 {
                ends.push(span * SPAN);
                sum = 0;
            }
            sum += weight;
        }
        ends.push(NONE);
        ends
    }
}

/// Arcs that are being collected.
pub(super) struct Collecting<'o> {
    arcs: Arcs,
    others: &'o mut Array<u32>,
    last: Option<[u32; 3]>,
}

impl<'o> Collecting<'o> {
    pub fn new(work: Work<'_>, others: &'o mut Array<u32>) -> io::Result<Self> {
        let weights = vec![0; others.len().div_ceil(SPAN as usize)];
        let arcs = Arcs { spool: work.scratch.spool()?, totals: (0, 0), weights: [weights.clone(), weights] };
        Ok(Self { arcs, others, last: None })
    }

    /// Adds an arc that is not before the last one; those that are the same become one.
    pub fn push(&mut self, arc: [u32; 3]) -> io::Result<()> {
        match &mut self.last {
            Some(last) if last[..2] == arc[..2] => {
                last[2] += arc[2];
                Ok(())
            }
            last => {
                let before = last.replace(arc);
                self.store(before, arc[0])
            }
        }
    }

    /// Stores an arc. The next one is of the node `next`.
    fn store(&mut self, arc: Option<[u32; 3]>, next: u32) -> io::Result<()> {
        let Some(arc @ [above, below, triangles]) = arc else { return Ok(()) };
        self.arcs.totals = (self.arcs.totals.0 + 1, self.arcs.totals.1 + u64::from(triangles));
        for node in [above, below].into_iter().filter(|&node| node != NONE) {
            let bytes = ARC_BYTES + if node == above && above != next { NODE_BYTES } else { 0 };
            for (weights, at) in self.arcs.weights.iter_mut().zip([node, self.others.get(node as usize)?]) {
                weights[(at / SPAN) as usize] += bytes;
            }
        }
        self.arcs.spool.push(arc)
    }

    pub fn finish(mut self) -> io::Result<Arcs> {
        let last = self.last.take();
        self.store(last, NONE)?;
        Ok(self.arcs)
    }
}
