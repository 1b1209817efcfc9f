//! One pass: windows are loaded, worked on and written back, by several threads at a time where they do not meet.
//!
//! Each thread owns the window that it works on. The blocks on disk, and what is counted over all windows, are behind a
//! lock each, held while a block is read or written, and while a window's vertices are counted. Which thread comes first
//! makes no difference: windows that are worked on at the same time have no block in common (see `order`), so none reads what
//! another writes.

use std::io;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use collapse_log::external::Sorter;
use parking_lot::Mutex;
use rustc_hash::FxHashSet;
use vertex_tree::NONE;

use super::super::initial::{initial_quadric, leaf_radius};
use super::super::key_counts::KeyCounts;
use super::super::order::PIECES;
use super::super::remains::Remains;
use super::super::rounds::Builder;
use super::blocks::{Blocks, Ring};
use super::log::Log;
use super::stop::check;
use super::window::{Whole, Window};

/// What is done to the vertices of a window.
#[derive(Clone, Copy, Debug)]
pub(super) enum Work {
    /// Their first quadrics and candidates are found.
    Begin,
    /// They come up in a round with this limit.
    Round(f32),
    /// Those without a legal edge are looked at again.
    Retry,
    /// Nothing is: those into which others have merged are counted, and what holds them.
    CountRoots,
}

/// A pass that is under way.
#[derive(Debug)]
pub(super) struct Pass<'p> {
    pub work: Work,
    pub whole: &'p Whole,
    /// Bytes of memory that one window may take.
    pub window_bytes: u64,
    pub stop: &'p AtomicBool,
    pub blocks: Mutex<&'p mut Blocks>,
    pub totals: Mutex<Totals<'p>>,
    /// Pieces that are in a window now, where assertions are checked.
    pub in_use: Mutex<FxHashSet<u32>>,
}

/// What is counted and collected over all windows.
#[derive(Debug)]
pub(super) struct Totals<'p> {
    pub counts: &'p mut KeyCounts,
    pub log: &'p mut Log,
    pub round: Sorter<9>,
    /// Windows, and the vertices in them.
    pub windows: u64,
    pub loaded: u64,
    /// Vertices that have been written, and nodes that have been made.
    pub kept: usize,
    pub collapses: usize,
    /// Whether a key or a state has changed.
    pub changed: bool,
    /// Triangles that have vanished.
    pub vanished: usize,
    pub roots: usize,
    pub remains: Remains,
    pub followers: usize,
}

impl Pass<'_> {
    /// Works on blocks, which are ascending. Their first node gets the number `next_id`. Returns the number after that of
    /// the last one. `rings` has an entry for every piece, all outside; `failed` says that there is no need to go on.
    pub fn run(
        &self,
        blocks: &[u32],
        mut next_id: u32,
        rings: &mut [Ring],
        failed: &AtomicBool,
    ) -> io::Result<u32> {
        let mut blocks = blocks;
        while !blocks.is_empty() && !failed.load(Ordering::Relaxed) {
            check(self.stop)?;
            let (count, list) = choose(&self.blocks.lock(), blocks, self.window_bytes, rings);
            blocks = &blocks[count..];
            next_id = self.window(list, next_id)?;
        }
        Ok(next_id)
    }

    fn window(&self, list: Vec<(u32, Ring)>, next_id: u32) -> io::Result<u32> {
        let pieces: Vec<u32> =
            if cfg!(debug_assertions) { list.iter().map(|&(piece, _)| piece).collect() } else { Vec::new() };
        for &piece in &pieces {
            assert!(self.in_use.lock().insert(piece), "piece {piece} is in two windows");
        }
        let mut window = Window::load(&self.blocks, list, self.whole, next_id)?;
        window.count(self.totals.lock().counts, false);
        let (roots, remains) = self.work_on(&mut window);
        let builder = &window.builder;
        let nodes = window.loaded_nodes..builder.nodes.next();
        let (collapses, next_id) = (nodes.len(), builder.nodes.next_id);
        let mut totals = self.totals.lock();
        let Totals { log, round, .. } = &mut *totals;
        if let Work::Round(_) = self.work {
            log.collect(builder, nodes, |v| window.originals[v as usize], round)?;
        }
        totals.windows += 1;
        totals.loaded += window.vertices() as u64;
        totals.collapses += collapses;
        totals.vanished += self.whole.live_triangles - builder.surface.live_triangles;
        totals.followers += builder.nodes.followers;
        totals.changed |= builder.candidates.changed;
        totals.roots += roots;
        totals.remains.held_by_topology += remains.held_by_topology;
        totals.remains.held_by_orientation += remains.held_by_orientation;
        window.count(totals.counts, true);
        drop(totals);
        let is_begun = matches!(self.work, Work::Begin);
        let kept = window.store(&self.blocks, |s, v| !is_begun || s.spokes(v).next().is_some())?;
        self.totals.lock().kept += kept;
        let mut in_use = self.in_use.lock();
        for piece in pieces {
            in_use.remove(&piece);
        }
        Ok(next_id)
    }

    /// Returns the number of roots, and why they are left, if they are counted.
    fn work_on(&self, window: &mut Window) -> (usize, Remains) {
        let mut neighbours = Vec::new();
        let (mut roots, mut remains) = (0, Remains::default());
        let pieces: Vec<(u32, Range<usize>)> = window.inner().collect();
        let builder = &mut window.builder;
        for block in pieces.chunk_by(|a, b| a.0 / PIECES == b.0 / PIECES) {
            let range = match block {
                [(_, first), .., (_, last)] => first.start..last.end,
                [(_, only)] => only.clone(),
                [] => continue,
            };
            match self.work {
                Work::Begin => {
                    for v in range {
                        let v = v as u32;
                        let squared = farthest(builder, v);
                        builder.nodes.leaf_radius[v as usize] = leaf_radius(squared);
                        let Builder { surface, marks, .. } = &mut *builder;
                        let (quadric, special) = initial_quadric(v, surface, marks, &mut neighbours);
                        (surface.quadrics[v as usize], surface.special[v as usize]) = (quadric, special);
                        builder.candidates.refresh(v, &mut builder.surface, &mut builder.marks);
                    }
                }
                Work::Round(limit) => builder.run_block(limit, range),
                Work::Retry => builder.retry_hopeless(range),
                Work::CountRoots => {
                    remains.look_at(range.clone(), &builder.surface, &mut builder.marks);
                    roots += range.filter(|&v| builder.nodes.top[v] != NONE).count();
                }
            }
        }
        (roots, remains)
    }
}

/// The pieces of a window in which the first of these blocks come up, and how many do: as many as there is memory for,
/// but at least one. `rings` is left as it was found, with all pieces outside.
fn choose(blocks: &Blocks, up: &[u32], bytes: u64, rings: &mut [Ring]) -> (usize, Vec<(u32, Ring)>) {
    let pieces = blocks.len() as u32;
    let (mut list, mut used): (Vec<u32>, u64) = (Vec::new(), 0);
    // What the last block has changed, to be undone if it is too much.
    let mut raised: Vec<(u32, Ring)> = Vec::new();
    let mut count = 0;
    for &block in up {
        raised.clear();
        let mut more = 0;
        let mut raise = |piece: u32, ring: Ring| {
            let there = rings[piece as usize];
            if there < ring {
                if there == Ring::Outside {
                    more += blocks.memory(piece);
                }
                raised.push((piece, there));
                rings[piece as usize] = ring;
            }
        };
        for piece in block * PIECES..((block + 1) * PIECES).min(pieces) {
            raise(piece, Ring::Inner);
            for &near in blocks.neighbours(piece) {
                raise(near, Ring::Near);
                blocks.neighbours(near).iter().for_each(|&far| raise(far, Ring::Far));
            }
        }
        if count > 0 && used + more > bytes {
            raised.iter().rev().for_each(|&(piece, ring)| rings[piece as usize] = ring);
            break;
        }
        list.extend(raised.iter().filter(|r| r.1 == Ring::Outside).map(|r| r.0));
        used += more;
        count += 1;
    }
    list.sort_unstable();
    (count, list.into_iter().map(|piece| (piece, std::mem::take(&mut rings[piece as usize]))).collect())
}

/// The squared distance to the farthest corner of the triangles around `v`, in object units.
fn farthest(builder: &Builder, v: u32) -> f64 {
    let position = |v: u32| builder.surface.position(v).as_dvec3();
    let corners = builder.surface.spokes(v).flat_map(|s| [s.next, s.last]);
    corners.fold(0.0, |farthest: f64, w| farthest.max(position(v).distance_squared(position(w))))
}
