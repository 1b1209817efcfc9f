//! The collapses as they will be in the log, pass by pass.

use std::io;
use std::ops::Range;

use collapse_log::external::{Scratch, Sorter, Spool};

use super::super::report::Round;
use super::super::rounds::Builder;

/// The collapses in order, on disk.
#[derive(Debug)]
pub(super) struct Log {
    pub collapses: Spool<7>,
    pub rounds: Vec<Round>,
    pub inversions: usize,
    pub largest_eps: f32,
    pub tree_depth: u32,
    pub dependency_depth: u32,
    highest: f32,
}

impl Log {
    pub fn new(scratch: &Scratch) -> io::Result<Log> {
        Ok(Log {
            collapses: scratch.spool()?,
            rounds: Vec::new(),
            inversions: 0,
            largest_eps: 0.0,
            tree_depth: 0,
            dependency_depth: 0,
            highest: 0.0,
        })
    }

    /// Adds nodes to those of a round. `original` is the input's number of a vertex.
    pub fn collect(
        &mut self,
        builder: &Builder,
        nodes: Range<u32>,
        original: impl Fn(u32) -> u32,
        round: &mut Sorter<9>,
    ) -> io::Result<()> {
        for n in nodes {
            let (i, all) = (n as usize, &builder.nodes);
            let c = all.collapses[i];
            let [x, y, z] = c.bounds.center.map(f32::to_bits);
            let [radius, eps] = [c.bounds.radius, c.bounds.eps].map(f32::to_bits);
            let [removed, kept] = [c.removed, c.kept].map(&original);
            round.push([all.keys[i].to_bits(), all.id(n), removed, kept, x, y, z, radius, eps])?;
            self.largest_eps = self.largest_eps.max(c.bounds.eps);
            self.tree_depth = self.tree_depth.max(all.height[i]);
            self.dependency_depth = self.dependency_depth.max(all.depth[i]);
        }
        Ok(())
    }

    /// Puts the nodes of a round in order of their keys, which are not negative, so that their bits sort as they do.
    pub fn end_round(&mut self, nodes: Sorter<9>, limit: f32) -> io::Result<()> {
        let mut round = Round { limit, ..Round::default() };
        nodes.finish(|[key, _, removed, kept, x, y, z, radius, eps]| {
            let key = f32::from_bits(key);
            self.inversions += usize::from(key < self.highest);
            self.highest = self.highest.max(key);
            round.push(key);
            self.collapses.push([removed, kept, x, y, z, radius, eps])
        })?;
        self.rounds.push(round);
        Ok(())
    }
}
