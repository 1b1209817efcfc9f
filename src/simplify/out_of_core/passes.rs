//! The passes: each goes once through the mesh, window by window.

use std::io;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use vertex_tree::NONE;

use super::super::candidates::Parity;
use super::super::key_counts::KeyCounts;
use super::super::rounds::{BLOCK, Builder, block_width};
use super::super::{leaf_radius, set_initial_quadric};
use super::blocks::{Blocks, SPAN};
use super::log::Log;
use super::prepare::unscaled;
use super::scratch::Scratch;
use super::sort::Sorter;
use super::window::{Ring, Whole, Window};

/// What is done to the vertices of a window.
#[derive(Clone, Copy, Debug)]
enum Work {
    /// Their first quadrics and candidates are found.
    Begin,
    /// They come up in a round with this limit.
    Round(f32),
    /// Those without a legal edge are looked at again.
    Retry,
    /// Nothing is: those into which others have merged are counted.
    CountRoots,
}

/// The construction between passes.
#[derive(Debug)]
pub(super) struct Passes<'a> {
    pub scratch: Scratch,
    pub blocks: Blocks,
    pub whole: Whole,
    pub stop: &'a AtomicBool,
    /// Bytes of memory that a window may take, and those that a pass's nodes may take while they are sorted.
    pub window_bytes: u64,
    pub sort_bytes: usize,
    pub log: Log,
    /// Vertices that have a triangle: at the start, and now.
    pub all: usize,
    pub live: usize,
    pub counts: KeyCounts,
    /// Whether to join components, once all that is left fits in memory.
    pub merge_components: bool,
    /// Windows that have been loaded, and the vertices in them.
    pub windows: u64,
    pub loaded: u64,
    /// Vertices left at the end into which others have merged.
    pub roots: usize,
    /// How near each block is to those of the window that is being chosen.
    pub rings: Vec<Ring>,
}

impl Passes<'_> {
    /// Finds the first quadrics and candidates.
    pub fn begin(&mut self) -> io::Result<()> {
        self.sweep(Work::Begin)
    }

    /// Collapses until nothing legal is left. `progress` is told the number of vertices that are left.
    pub fn run(&mut self, mut progress: impl FnMut(usize)) -> io::Result<()> {
        let mut hopeless_retried = false;
        while !self.fits() {
            progress(self.live);
            if let Some(limit) = self.counts.limit() {
                self.whole.first_id = self.whole.next_id;
                let widening = block_width(self.all, self.live) / BLOCK as u32;
                self.blocks.widen(widening * SPAN);
                self.sweep(Work::Round(limit))?;
                self.whole.parity = self.whole.parity.other();
                if self.whole.next_id > self.whole.first_id {
                    hopeless_retried = false;
                }
            } else if !hopeless_retried {
                hopeless_retried = true;
                self.sweep(Work::Retry)?;
            } else {
                return self.sweep(Work::CountRoots);
            }
        }
        self.finish_in_memory(progress)
    }

    fn fits(&self) -> bool {
        (0..self.blocks.len() as u32).map(|b| self.blocks.memory(b)).sum::<u64>() <= self.window_bytes
    }

    /// The rest, once all that is left fits in memory.
    fn finish_in_memory(&mut self, mut progress: impl FnMut(usize)) -> io::Result<()> {
        let list: Vec<(u32, Ring)> = (0..self.blocks.len() as u32).map(|b| (b, Ring::Inner)).collect();
        self.whole.first_id = self.whole.next_id;
        self.whole.merge = self.merge_components;
        let mut window = Window::load(&self.blocks, list, &self.whole)?;
        self.blocks = Blocks::new(0, self.scratch.file()?);
        window.builder.touched = None;
        let numbers = window.numbers()[..window.vertices()].to_vec();
        let originals = std::mem::take(&mut window.originals);
        let (log, scratch, stop, sort_bytes) = (&mut self.log, &self.scratch, self.stop, self.sort_bytes);
        window.builder.run(
            self.all,
            |v| numbers[v as usize],
            |builder, nodes, limit| {
                check(stop)?;
                progress(builder.surface.live.len());
                let mut round = Sorter::new(scratch, sort_bytes);
                log.collect(builder, nodes, |v| originals[v as usize], &mut round)?;
                log.end_round(round, limit)
            },
        )?;
        let (live, top) = (&window.builder.surface.live, &window.builder.nodes.top);
        self.live = live.len();
        self.roots = live.iter().filter(|&&v| top[v as usize] != NONE).count();
        self.whole.live_triangles = window.builder.surface.live_triangles;
        self.whole.next_id = window.builder.nodes.next_id;
        Ok(())
    }

    fn sweep(&mut self, work: Work) -> io::Result<()> {
        if !matches!(work, Work::Round(_)) {
            // No round is under way, in which stars would have to look as they did before it.
            self.whole.first_id = NONE;
        }
        self.blocks.begin_pass(self.scratch.file()?);
        self.rings.clear();
        self.rings.resize(self.blocks.len(), Ring::Outside);
        let mut round = Sorter::new(&self.scratch, self.sort_bytes);
        let mut start = 0;
        while start < self.blocks.len() as u32 {
            check(self.stop)?;
            let (end, list) = self.choose(start);
            start = end;
            let mut window = Window::load(&self.blocks, list, &self.whole)?;
            self.windows += 1;
            self.loaded += window.vertices() as u64;
            window.count(&mut self.counts, false);
            self.work_on(&mut window, work);
            let builder = &window.builder;
            let nodes = window.loaded_nodes..builder.nodes.next();
            self.live -= nodes.len();
            if let Work::Round(_) = work {
                self.log.collect(builder, nodes, |v| window.originals[v as usize], &mut round)?;
            }
            self.whole.live_triangles = builder.surface.live_triangles;
            self.whole.next_id = builder.nodes.next_id;
            window.count(&mut self.counts, true);
            let is_begun = matches!(work, Work::Begin);
            let kept = window.store(&mut self.blocks, |s, v| !is_begun || s.spokes(v).next().is_some())?;
            if is_begun {
                self.all += kept;
                self.live += kept;
            }
        }
        match work {
            Work::Round(limit) if self.whole.next_id > self.whole.first_id => {
                self.log.end_round(round, limit)
            }
            _ => Ok(()),
        }
    }

    fn work_on(&mut self, window: &mut Window, work: Work) {
        let mut neighbours = Vec::new();
        let blocks: Vec<(u32, Range<usize>)> = window.inner().collect();
        let builder = &mut window.builder;
        // As many as make up a block of the rounds.
        let same = |a: &(u32, Range<usize>), b: &(u32, Range<usize>)| {
            a.0 / (BLOCK as u32 / SPAN) == b.0 / (BLOCK as u32 / SPAN)
        };
        for group in blocks.chunk_by(same) {
            let range = match group {
                [(_, first), .., (_, last)] => first.start..last.end,
                [(_, only)] => only.clone(),
                [] => continue,
            };
            match work {
                Work::Begin => {
                    for v in range {
                        let v = v as u32;
                        let squared = farthest(builder, v, self.whole.scale);
                        builder.nodes.leaf_radius[v as usize] = leaf_radius(squared);
                        set_initial_quadric(v, &mut builder.surface, &mut builder.marks, &mut neighbours);
                        builder.candidates.refresh(v, &mut builder.surface, &mut builder.marks);
                    }
                }
                Work::Round(limit) => builder.run_block(limit, self.whole.first_id, range),
                Work::Retry => builder.retry_hopeless(range),
                Work::CountRoots => self.roots += range.filter(|&v| builder.nodes.top[v] != NONE).count(),
            }
        }
    }

    /// The blocks of the window whose inner ones begin at `start`, and where those end: as many as there is memory for,
    /// but at least one block of the rounds.
    fn choose(&mut self, start: u32) -> (u32, Vec<(u32, Ring)>) {
        let unit = BLOCK as u32 / SPAN;
        let count = self.blocks.len() as u32;
        let mut list: Vec<u32> = Vec::new();
        let (mut end, mut bytes) = (start, 0);
        // What the last unit has changed, to be undone if it is too much.
        let mut raised: Vec<(u32, Ring)> = Vec::new();
        while end < count {
            raised.clear();
            let mut more = 0;
            let next = (end + unit).min(count);
            let (blocks, rings) = (&self.blocks, &mut self.rings);
            let mut raise = |block: u32, ring: Ring| {
                let there = rings[block as usize];
                if there < ring {
                    if there == Ring::Outside {
                        more += blocks.memory(block);
                    }
                    raised.push((block, there));
                    rings[block as usize] = ring;
                }
            };
            for block in end..next {
                raise(block, Ring::Inner);
                for &near in blocks.neighbours(block) {
                    raise(near, Ring::Near);
                    blocks.neighbours(near).iter().for_each(|&far| raise(far, Ring::Far));
                }
            }
            if end > start && bytes + more > self.window_bytes {
                raised.iter().rev().for_each(|&(block, ring)| self.rings[block as usize] = ring);
                break;
            }
            list.extend(raised.iter().filter(|r| r.1 == Ring::Outside).map(|r| r.0));
            bytes += more;
            end = next;
        }
        list.sort_unstable();
        let list = list.into_iter().map(|b| (b, std::mem::take(&mut self.rings[b as usize]))).collect();
        (end, list)
    }
}

/// The squared distance to the farthest corner of the triangles around `v`, in object units.
fn farthest(builder: &Builder, v: u32, scale: f64) -> f64 {
    let position = |v: u32| unscaled(builder.surface.position(v), scale);
    let corners = builder.surface.spokes(v).flat_map(|s| [s.next, s.last]);
    corners.fold(0.0, |farthest: f64, w| farthest.max(position(v).distance_squared(position(w))))
}

/// Fails if somebody wants the construction to stop.
pub(super) fn check(stop: &AtomicBool) -> io::Result<()> {
    if stop.load(Ordering::Relaxed) { Err(io::Error::other(Interrupted)) } else { Ok(()) }
}

/// Somebody wanted the construction to stop.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(super) struct Interrupted;

/// The parity of the first round.
pub(super) const FIRST_PARITY: Parity = Parity::Even;
