//! The reduction of a graph that is larger than memory, in rounds.
//!
//! In a round the graph is cut into regions, intervals of a curve, that fit in memory; each is loaded and reduced by
//! itself, until no candidate is left whose key is below a limit, which rises from round to round. So merges are made in
//! about the order in which they are made in memory, where the least key of all comes first. An arc that leads from one
//! region to another has to wait until a round in which both of its ends are in the same: rounds take turns with two
//! curves and two ways to cut each, and regions grow as the graph shrinks. Once it is a single region, the rest is as in
//! memory.
//!
//! **No cycles.** A merge is safe if no other path joins the two nodes, and a path may leave the region and come back.
//! The topological order of the whole graph (`crate::order`) tells: its positions are kept for all nodes all the time. A
//! region is loaded with its neighbours in others, which are *fixed*: they keep their positions. The search for another
//! path looks at nothing but what lies between the two nodes in the order; where it comes to a fixed node, the merge is
//! given up for this round. So each merge that is made has been looked at as it would have been with the whole graph in
//! memory.

use std::io;

use collapse_log::external::{Array, Sorter, Spool, too_few};
use vertex_tree::NONE;

use super::arcs::{Arcs, Collecting};
use super::history::{History, State};
use super::region::{ABOVE, BELOW, Outcome, Region};
use super::work::Work;
use crate::reduce::SIZE;

/// Limit of the first round: nodes that hold so many triangles together may be merged.
const FIRST_LIMIT: f64 = SIZE * 16.0;
/// By how much the limit grows from round to round: see DESIGN.md for what others gave.
const GROWTH: f64 = 1.25;

/// A graph that is being reduced.
pub(super) struct Rounds<'a> {
    work: Work<'a>,
    /// By place, of nodes that are left.
    pub states: Array<State>,
    /// By place, how far along the second curve.
    others: Array<u32>,
    /// By place, the node that a node has been merged into; itself, if it is left.
    pub into: Array<u32>,
    pub arcs: Arcs,
    /// Arcs, and triangles on them, before anything was merged.
    pub unreduced: (u64, u64),
    /// Arc collapses that were given up because of another path, or to be tried again in another region.
    pub refused: u64,
}

/// Ways to cut a graph into regions: two curves, each cut in two ways.
const WAYS: u32 = 4;

impl<'a> Rounds<'a> {
    pub fn new(work: Work<'a>, history: History, arcs: Arcs) -> io::Result<Self> {
        let History { states, others, .. } = history;
        let mut into = Array::new(work.scratch, states.len(), NONE, work.memory / 16);
        (0..states.len()).try_for_each(|n| into.set(n, n as u32))?;
        Ok(Self { work, states, others, into, unreduced: arcs.totals, arcs, refused: 0 })
    }

    /// Merges nodes until arcs hold `patch` triangles on average, as far as that is possible.
    pub fn run(&mut self, patch: f64) -> io::Result<()> {
        let (mut limit, mut idle) = (FIRST_LIMIT, 0);
        for round in 0_usize.. {
            let (arcs, triangles) = self.arcs.totals;
            if triangles as f64 >= patch * arcs as f64 {
                break;
            }
            let curve = round % 2;
            let regions = self.arcs.cut(self.work.memory as u64 / 2, curve, round / 2 % 2 == 1);
            let is_whole = regions.len() == 1;
            let outcome = self.round(curve, &regions, patch, if is_whole { f64::INFINITY } else { limit })?;
            self.refused += outcome.refused;
            self.relabel()?;
            // Where nothing has been merged in any way to cut the graph, nothing will be.
            idle = if outcome.merged > 0 || outcome.left.is_some() { 0 } else { idle + 1 };
            if is_whole || idle == WAYS {
                break;
            }
            limit = (limit * GROWTH).max(outcome.left.unwrap_or(0.0));
        }
        Ok(())
    }

    fn round(&mut self, curve: usize, regions: &[u32], patch: f64, limit: f64) -> io::Result<Outcome> {
        let (mut dealt, counts) = self.deal(curve, regions)?;
        let mut dealt = dealt.read()?;
        let mut totals = self.arcs.totals;
        let mut outcome = Outcome::default();
        let mut arcs = Vec::new();
        for count in counts {
            self.work.check()?;
            arcs.clear();
            for _ in 0..count {
                arcs.push(dealt.next().ok_or_else(too_few)??);
            }
            let Self { work, states, into, .. } = self;
            let mut region = Region::load(*work, &mut arcs, states, into, totals)?;
            let of_region = region.reduce(patch, limit, states, into)?;
            totals = region.totals();
            outcome.merged += of_region.merged;
            outcome.refused += of_region.refused;
            outcome.left = [outcome.left, of_region.left].into_iter().flatten().reduce(f64::min);
        }
        Ok(outcome)
    }

    /// Deals arcs out to the regions of their ends: above, below, triangles, and which of the ends are in the region; and
    /// how many each gets.
    fn deal(&mut self, curve: usize, regions: &[u32]) -> io::Result<(Spool<4>, Vec<u64>)> {
        let Self { work, others, arcs, .. } = self;
        let mut sorted = Sorter::<5>::new(work.scratch, work.memory / 8);
        let mut region = |node: u32| {
            let at = if curve == 0 { node } else { others.get(node as usize)? };
            io::Result::Ok(regions.partition_point(|&end| end <= at) as u32)
        };
        for arc in arcs.spool.read()? {
            work.check()?;
            let [above, below, triangles] = arc?;
            let mut push = |region, own| sorted.push([region, above, below, triangles, own]);
            match (above, below) {
                (NONE, NONE) => {}
                (NONE, _) => push(region(below)?, BELOW)?,
                (_, NONE) => push(region(above)?, ABOVE)?,
                _ => {
                    let [of_above, of_below] = [region(above)?, region(below)?];
                    if of_above == of_below {
                        push(of_above, ABOVE | BELOW)?;
                    } else {
                        push(of_above, ABOVE)?;
                        push(of_below, BELOW)?;
                    }
                }
            }
        }
        let (mut spool, mut counts) = (work.scratch.spool()?, vec![0; regions.len()]);
        sorted.finish(|[region, above, below, triangles, own]| {
            counts[region as usize] += 1;
            spool.push([above, below, triangles, own])
        })?;
        Ok((spool, counts))
    }

    /// Lets arcs join the nodes that are left, and gives up those within one.
    fn relabel(&mut self) -> io::Result<()> {
        let Self { work, others, into, arcs, .. } = self;
        let mut sorted = Sorter::<3>::new(work.scratch, work.memory / 4);
        let mut resolve = |node: u32| if node == NONE { Ok(NONE) } else { into.get(node as usize) };
        for arc in arcs.spool.read()? {
            work.check()?;
            let [above, below, triangles] = arc?;
            let [above, below] = [resolve(above)?, resolve(below)?];
            if above != below || above == NONE {
                sorted.push([above, below, triangles])?;
            }
        }
        let mut relabelled = Collecting::new(*work, others)?;
        sorted.finish(|arc| relabelled.push(arc))?;
        *arcs = relabelled.finish()?;
        Ok(())
    }
}
