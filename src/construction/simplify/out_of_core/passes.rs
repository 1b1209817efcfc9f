//! The passes: each goes once through the mesh, window by window.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};

use collapse_log::external::{Scratch, Sorter};
use parking_lot::Mutex;
use vertex_tree::NONE;

use super::super::candidates::Parity;
use super::super::key_counts::KeyCounts;
use super::super::order::{self, PARTS, PIECES};
use super::super::remains::Remains;
use super::super::stall::Stall;
use super::blocks::{Blocks, Ring};
use super::log::Log;
use super::pass::{Pass, Totals, Work};
use super::stop::check;
use super::window::{Whole, Window};

/// The construction between passes.
#[derive(Debug)]
pub(super) struct Passes<'a> {
    pub scratch: Scratch,
    pub blocks: Blocks,
    pub whole: Whole,
    /// The number that the next node gets.
    pub next_id: u32,
    pub stop: &'a AtomicBool,
    /// Threads that may work on a pass.
    pub threads: usize,
    /// Bytes of memory that all that is left may take, to be finished in memory: the same for any number of threads, as
    /// components are joined then.
    pub whole_bytes: u64,
    /// Bytes of memory that all windows together may take, and those that a pass's nodes may take while they are sorted.
    pub window_bytes: u64,
    pub sort_bytes: usize,
    pub log: Log,
    /// Vertices of the input.
    pub numbers: u32,
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
    /// Why these are left.
    pub remains: Remains,
    /// Collapses that depend on another of their round.
    pub followers: usize,
    /// Rounds, with those without a collapse.
    pub rounds: usize,
}

impl Passes<'_> {
    /// Finds the first quadrics and candidates.
    pub fn begin(&mut self) -> io::Result<()> {
        self.sweep(Work::Begin).map(|_| ())
    }

    /// Collapses until nothing legal is left. `progress` is told the number of vertices that are left.
    pub fn run(&mut self, mut progress: impl FnMut(usize)) -> io::Result<()> {
        let mut stall = Stall::default();
        while !self.fits() {
            progress(self.live);
            if let Some(limit) = self.counts.limit() {
                self.blocks.widen(order::span(self.all, self.live));
                self.whole.gives_up = stall.gives_up();
                let (collapses, changed) = self.sweep(Work::Round(limit))?;
                stall.end_round(collapses, changed);
                self.rounds += 1;
                self.whole.parity = self.whole.parity.other();
            } else if stall.takes_hopeless() {
                self.sweep(Work::Retry)?;
            } else if !self.whole.leans {
                self.whole.leans = true;
                self.sweep(Work::Retry)?;
            } else {
                return self.sweep(Work::CountRoots).map(|_| ());
            }
        }
        self.finish_in_memory(stall, progress)
    }

    fn fits(&self) -> bool {
        (0..self.blocks.len() as u32).map(|b| self.blocks.memory(b)).sum::<u64>() <= self.whole_bytes
    }

    /// The rest, once all that is left fits in memory.
    fn finish_in_memory(&mut self, stall: Stall, mut progress: impl FnMut(usize)) -> io::Result<()> {
        let list: Vec<(u32, Ring)> = (0..self.blocks.len() as u32).map(|b| (b, Ring::Inner)).collect();
        self.whole.first_id = self.next_id;
        self.whole.merge = self.merge_components;
        let mut window = Window::load(&Mutex::new(&mut self.blocks), list, &self.whole, self.next_id)?;
        self.blocks = Blocks::new(0, self.scratch.file()?);
        window.builder.touched = None;
        let (all_numbers, numbers) = (self.numbers, window.numbers()[..window.vertices()].to_vec());
        let originals = std::mem::take(&mut window.originals);
        let (log, scratch, stop, sort_bytes) = (&mut self.log, &self.scratch, self.stop, self.sort_bytes);
        self.rounds += window.builder.run(
            stall,
            self.all,
            all_numbers,
            |v| numbers[v as usize],
            |builder, nodes, limit| {
                check(stop)?;
                progress(builder.surface.live.len());
                let mut round = Sorter::new(scratch, sort_bytes);
                log.collect(builder, nodes, |v| originals[v as usize], &mut round)?;
                log.end_round(round, limit)
            },
        )?;
        self.remains = window.builder.remains();
        self.followers += window.builder.nodes.followers;
        let (live, top) = (&window.builder.surface.live, &window.builder.nodes.top);
        self.live = live.len();
        self.roots = live.iter().filter(|&&v| top[v as usize] != NONE).count();
        self.whole.live_triangles = window.builder.surface.live_triangles;
        self.next_id = window.builder.nodes.next_id;
        Ok(())
    }

    /// Goes once through the mesh, in the order of a round. Returns the number of collapses, and whether any key or state has
    /// changed.
    fn sweep(&mut self, work: Work) -> io::Result<(usize, bool)> {
        // Outside of a round, stars are as they are.
        self.whole.first_id = if matches!(work, Work::Round(_)) { self.next_id } else { NONE };
        let (parts, borders) = self.split();
        let pieces = self.blocks.len();
        // Parts that are worked on at the same time have numbers set aside for their nodes, as many as there are vertices.
        // In the long run that is ten for every vertex of the input: too many for the very largest.
        let is_shared = self.threads > 1 && u64::from(self.next_id) + (self.live as u64) < u64::from(NONE);
        let threads = if is_shared { self.threads.min(parts.len()) } else { 1 };
        let mut next_id = self.next_id;
        let mut tasks = Vec::new();
        for blocks in &parts {
            tasks.push((blocks, next_id));
            let pieces = blocks.iter().flat_map(|b| b * PIECES..((b + 1) * PIECES).min(pieces as u32));
            next_id += if is_shared { pieces.map(|p| self.blocks.counts(p).vertices).sum() } else { 0 };
        }
        self.blocks.begin_pass(self.scratch.file()?);
        let totals = Totals {
            counts: &mut self.counts,
            log: &mut self.log,
            round: Sorter::new(&self.scratch, self.sort_bytes),
            windows: 0,
            loaded: 0,
            kept: 0,
            collapses: 0,
            changed: false,
            vanished: 0,
            roots: 0,
            remains: Remains::default(),
            followers: 0,
        };
        let pass = Pass {
            work,
            whole: &self.whole,
            window_bytes: self.window_bytes / threads as u64,
            stop: self.stop,
            blocks: Mutex::new(&mut self.blocks),
            totals: Mutex::new(totals),
            in_use: Mutex::default(),
        };
        let failed = AtomicBool::new(false);
        let mut rings = vec![Ring::Outside; pieces];
        if is_shared {
            let tasks = Mutex::new(tasks.into_iter());
            let next = || tasks.lock().next();
            let run = |rings: &mut [Ring]| {
                while let Some((blocks, first)) = next() {
                    let outcome = pass.run(blocks, first, rings, &failed);
                    failed.fetch_or(outcome.is_err(), Ordering::Relaxed);
                    outcome?;
                }
                Ok(())
            };
            std::thread::scope(|scope| {
                let helper = || run(&mut vec![Ring::Outside; pieces]);
                // Where there is no thread to be had, those that there are do the work.
                let start = |_| std::thread::Builder::new().spawn_scoped(scope, helper).ok();
                let helpers: Vec<_> = (1..threads).map_while(start).collect();
                let own = run(&mut rings);
                let joined = helpers
                    .into_iter()
                    .map(|h| h.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
                joined.fold(own, io::Result::and)
            })?;
        } else {
            for (blocks, _) in tasks {
                next_id = pass.run(blocks, next_id, &mut rings, &failed)?;
            }
        }
        // In windows no larger than those before: the allocator keeps back what other threads have freed.
        next_id = pass.run(&borders, next_id, &mut rings, &failed)?;
        let totals = pass.totals.into_inner();
        let (round, kept, collapses) = (totals.round, totals.kept, totals.collapses);
        let changed = totals.changed;
        self.windows += totals.windows;
        self.loaded += totals.loaded;
        self.roots += totals.roots;
        self.followers += totals.followers;
        self.remains.held_by_topology += totals.remains.held_by_topology;
        self.remains.held_by_orientation += totals.remains.held_by_orientation;
        self.whole.live_triangles -= totals.vanished;
        self.live -= collapses;
        self.next_id = next_id;
        match work {
            Work::Begin => {
                self.all += kept;
                self.live += kept;
            }
            Work::Round(limit) if collapses > 0 => self.log.end_round(round, limit)?,
            _ => {}
        }
        Ok((collapses, changed))
    }

    /// The blocks of each part that are not on borders, and those that are: in pieces, ascending.
    fn split(&self) -> (Vec<Vec<u32>>, Vec<u32>) {
        let pieces = self.blocks.len() as u32;
        let on_border = order::borders(pieces, |pair| {
            for a in 0..pieces {
                self.blocks.neighbours(a).iter().for_each(|&b| pair(a, b));
            }
        });
        let (mut parts, mut borders) = (vec![Vec::new(); PARTS as usize], Vec::new());
        for (block, &on_border) in (0..).zip(&on_border) {
            let blocks =
                if on_border { &mut borders } else { &mut parts[order::part(block, pieces) as usize] };
            blocks.push(block);
        }
        (parts, borders)
    }
}

/// The parity of the first round.
pub(super) const FIRST_PARITY: Parity = Parity::Even;
