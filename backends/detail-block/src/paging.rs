//! Which blocks are in memory: loading and the two quotas (section 4 of the paper).
//!
//! * Beyond the **soft quota**, candidates are removed at the end of each frame, the least recently used first, once they
//!   have been candidates for some frames and are not expected back (see [`returns`](crate::returns)), and only if the
//!   node above is folded: what hangs below an active node may be unfolded next, and the paper's update loop (Figure 8)
//!   would load it again at once.
//! * The **hard quota** is never exceeded: a block is only asked for if it fits, with all that are under way; candidates
//!   that no change has lately used make room, and if that is not enough, the block is missed. (Setting a quota below what
//!   the front itself occupies is the exception: nothing is loaded then until the front has folded to below it.)
//!
//! As printed, the traversal loads the child blocks that it comes upon "and continues": the frame waits for the disk. Here a
//! change that wants a block is refused, and the block is asked for, so that no frame waits; that is the only difference between
//! the paper's scheme and [`Prefetch::Paper`](vertex_tree::Prefetch::Paper). Whoever wants it as printed waits for
//! [`settle`](vertex_tree::Hierarchy::settle) and asks again, as foldfront's `Settled` does (`--prefetch blocking`);
//! [`Io::Blocking`](crate::Io::Blocking) reads within the change itself: a store without latency, whose answer is taken at once.
//!
//! Blocks of active nodes are never removed, so whatever is active can be asked about.

use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use page_store::{Arrival, Failures, NOW as URGENT, Requests, Simulated, Store, ThreadError, Ticket};
use rustc_hash::FxHashMap;
use vertex_tree::{NodeId, PageStats, TreeError};

use crate::block::{Inflated, resident_bytes};
use crate::blocks::Blocks;
use crate::error::{XfmError, tree_error};
use crate::file::XfmFile;
use crate::foresight::Foresight;
use crate::removal::{Keepers, NOW, Removal};
use crate::settings::{Io, Settings};
use crate::stored::{Run, Stored};
use crate::waiting::{Wait, Waiting};

/// How many times in a row reading a block may fail before that is an error of the tree.
pub const ATTEMPTS: u32 = 16;

/// Frames of foresight, at least.
const LEAST: u32 = 2;

/// What paging has done since the tree was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PagingCounts {
    /// Blocks loaded.
    pub loads: u64,
    /// Of these, how many no change had missed: they were loaded ahead of time.
    pub ahead: u64,
    /// Blocks removed.
    pub removals: u64,
    /// Blocks loaded again within [`SOON`](crate::SOON) frames of their removal.
    pub soon_again: u64,
    /// Requests refused because of the hard quota.
    pub refused: u64,
    /// The most bytes of blocks there ever were, with those under way.
    pub peak_bytes: u64,
    /// How long frames have waited for blocks: where loading blocks only.
    pub blocked: Duration,
}

/// A block that has been asked for.
struct Pending {
    run: Run,
    ticket: Ticket,
    waiting: Vec<NodeId>,
}

pub(crate) struct Paging {
    pub blocks: Blocks,
    /// Bytes of blocks under way.
    pub reserved: u64,
    pending: FxHashMap<u32, Pending>,
    requests: Requests<Stored>,
    /// Whether a change waits for what it asks for.
    is_blocking: bool,
    pub waiting: Waiting,
    failures: Failures<u32>,
    foresight: Foresight,
    removal: Removal,
    pub soft: u64,
    pub hard: u64,
    frame: u64,
    stats: PageStats,
    pub counts: PagingCounts,
    error: Option<XfmError>,
    /// The first since somebody asked.
    pub fault: Option<TreeError>,
    /// Kept for their allocations.
    arrivals: Vec<Arrival<Stored>>,
    withdrawn: Vec<Run>,
}

impl Paging {
    pub fn new(file: Arc<XfmFile>, settings: &Settings) -> Result<Self, ThreadError> {
        let at_once = Simulated { latency: Duration::ZERO, bandwidth: None, depth: 1 };
        let store = match settings.io {
            Io::Blocking => Store::simulated(at_once),
            Io::Simulated(store) => Store::simulated(store),
            Io::Background => Store::new()?,
        };
        Ok(Self {
            requests: Requests::new(store, Arc::new(Stored(file.clone()))),
            blocks: Blocks::new(file),
            reserved: 0,
            pending: FxHashMap::default(),
            is_blocking: settings.io == Io::Blocking,
            waiting: Waiting::default(),
            // What a change misses is asked for in every frame: it is an error of the tree soon enough.
            failures: Failures::new(0),
            foresight: Foresight::default(),
            removal: Removal::new(settings.grace.into()),
            soft: settings.soft_quota,
            hard: settings.hard_quota,
            frame: 0,
            stats: PageStats::default(),
            counts: PagingCounts::default(),
            error: None,
            fault: None,
            arrivals: Vec::new(),
            withdrawn: Vec::new(),
        })
    }

    /// Marks a block as used in this frame.
    #[inline(always)]
    pub fn use_block(&mut self, number: u32) {
        let frame = self.frame;
        if let Some(block) = self.blocks.block_mut(number) {
            block.used = frame;
            let left = std::mem::take(&mut block.left);
            if std::mem::take(&mut block.is_unused) {
                self.stats.ahead_used += 1;
            }
            self.removal.back(left);
        }
    }

    // Asking for blocks.

    /// Asks for blocks that a change of `node` takes, at most two. Says whether they are loaded, which they may be at
    /// once only where loading blocks.
    pub fn demand(&mut self, blocks: Range<u32>, node: NodeId) -> bool {
        let (mut missing, mut waits) = (Run { first: 0, count: 0 }, false);
        for number in blocks.clone() {
            if self.blocks.block(number).is_some() {
                self.use_block(number);
            } else if let Some(pending) = self.pending.get_mut(&number) {
                waits = true;
                pending.waiting.push(node);
                self.requests.demand(pending.ticket);
            } else {
                missing = match missing.count {
                    0 => Run { first: number, count: 1 },
                    count => Run { first: missing.first, count: count + 1 },
                };
            }
        }
        if waits {
            self.waiting.wait(node, blocks.clone());
        }
        if missing.count == 0 {
            return !waits;
        }
        if !self.make_room(self.bytes_of(missing), NOW) {
            self.counts.refused += 1;
            self.stats.no_room += 1;
            self.waiting.again.push(node);
            return false;
        }
        self.ask(missing, Some(node));
        if self.is_blocking {
            return self.read_now(missing) && !waits;
        }
        self.waiting.wait(node, blocks);
        false
    }

    /// Bytes of memory that blocks take.
    fn bytes_of(&self, run: Run) -> u64 {
        run.numbers().map(|b| resident_bytes(self.blocks.file.nodes_in(b))).sum()
    }

    /// Asks for a run, for which there is room: for a node, or ahead of time.
    fn ask(&mut self, run: Run, node: Option<NodeId>) {
        self.reserved += self.bytes_of(run);
        self.counts.peak_bytes = self.counts.peak_bytes.max(self.blocks.bytes + self.reserved);
        let ticket = self.requests.ask(run, if node.is_some() { URGENT } else { URGENT + 1 });
        for number in run.numbers() {
            self.pending.insert(number, Pending { run, ticket, waiting: node.into_iter().collect() });
        }
    }

    /// Reads a run that has been asked for, where loading blocks. Says whether all of it is there.
    fn read_now(&mut self, run: Run) -> bool {
        let start = Instant::now();
        self.requests.settle();
        let mut arrivals = std::mem::take(&mut self.arrivals);
        self.requests.take(&mut arrivals);
        // What asked goes on at once, or is refused and asks again in the next frame.
        let mut arrived = Vec::new();
        for arrival in arrivals.drain(..) {
            self.integrate(arrival, &mut arrived);
        }
        self.arrivals = arrivals;
        let is_there = run.numbers().all(|number| self.blocks.block(number).is_some());
        if !is_there {
            self.waiting.again.append(&mut arrived);
        }
        self.counts.blocked += start.elapsed();
        is_there
    }

    /// Takes a run into the directory.
    fn integrate(&mut self, arrival: Arrival<Stored>, arrived: &mut Vec<NodeId>) {
        let Arrival { read: run, is_demanded, content } = arrival;
        self.reserved -= self.bytes_of(run);
        for number in run.numbers() {
            let Some(pending) = self.pending.remove(&number) else { continue };
            pending.waiting.iter().for_each(|&node| self.stop_waiting(node));
            arrived.extend(pending.waiting);
        }
        let blocks = match content {
            Ok(blocks) => blocks,
            // One failed read is one fault, whatever it was to bring, and has been counted.
            Err(error) => return self.failed(run.first, error, is_demanded),
        };
        for (number, block) in run.numbers().zip(blocks) {
            let check = |block: Inflated| match self.blocks.check_links(&block) {
                Ok(()) => Ok(block),
                Err(reason) => Err(self.blocks.file.damaged(number, reason)),
            };
            match block.and_then(check) {
                Ok(mut inflated) => {
                    // A read that came ahead of time is used when its first block is.
                    inflated.block.is_unused = !is_demanded && number == run.first;
                    self.counts.ahead += u64::from(!is_demanded);
                    self.insert(inflated);
                }
                Err(error) => {
                    self.stats.faults += 1;
                    self.failed(number, error, is_demanded);
                }
            }
        }
    }

    pub fn insert(&mut self, mut inflated: Inflated) {
        let number = inflated.block.number;
        self.failures.forget(number);
        inflated.block.used = self.frame;
        self.blocks.insert(inflated);
        self.counts.loads += 1;
        self.counts.soon_again += u64::from(self.removal.came(number));
        self.may_go(number);
    }

    /// Reading a block has failed. That it was only foreseen is no error of the tree: it is left alone until it is missed.
    fn failed(&mut self, number: u32, error: XfmError, is_demanded: bool) {
        if !is_demanded {
            self.failures.suspect(number);
        } else if self.failures.failed(number, self.frame) >= ATTEMPTS {
            self.failures.forget(number);
            self.error = Some(error);
            return;
        }
        self.fault.get_or_insert_with(|| tree_error(error));
    }

    pub fn take_error(&mut self) -> Result<(), TreeError> {
        self.error.take().map_or(Ok(()), |error| Err(tree_error(error)))
    }

    // Changes that wait.

    /// A change that waits has made use of blocks: see [`Waiting::pin_for`].
    pub fn pin_for(&mut self, node: NodeId, needed: Option<NodeId>) {
        self.waiting.pin_for(node, needed, &self.blocks);
    }

    /// A change does not wait any more: it asks again, or is to.
    pub fn stop_waiting(&mut self, node: NodeId) {
        let Some(Wait { blocks, pinned }) = self.waiting.stop(node) else { return };
        pinned.into_iter().for_each(|number| self.use_block(number));
        for number in blocks {
            if let Some(pending) = self.pending.get_mut(&number) {
                pending.waiting.retain(|&other| other != node);
            }
        }
    }

    /// A change that was refused is not wanted any more.
    pub fn give_up(&mut self, node: NodeId) {
        self.waiting.again.retain(|&other| other != node);
        let Some(blocks) = self.waiting.waits_for(node) else { return };
        self.stop_waiting(node);
        for number in blocks {
            let Some(&Pending { run, ticket, .. }) = self.pending.get(&number) else { continue };
            let is_unwanted =
                |number: u32| self.pending.get(&number).is_some_and(|pending| pending.waiting.is_empty());
            if run.numbers().all(is_unwanted) && self.requests.withdraw(ticket) {
                self.withdrawn(run);
            }
        }
    }

    // Foresight.

    /// For how many frames ahead it is worth to know what will be needed.
    pub fn look_ahead(&self) -> u32 {
        self.requests.look_ahead(LEAST)
    }

    /// A node is expected to change in so many frames.
    pub fn foresee(&mut self, node: NodeId, frames: u32) {
        self.foresight.foresee(node, frames, &self.blocks);
    }

    /// Takes back what was asked for ahead of time and has not been started. Says whether there was any.
    fn withdraw(&mut self) -> bool {
        let mut runs = std::mem::take(&mut self.withdrawn);
        self.requests.withdraw_ahead(&mut runs);
        let is_any = !runs.is_empty();
        runs.drain(..).for_each(|run| self.withdrawn(run));
        self.withdrawn = runs;
        is_any
    }

    /// A request has been taken back.
    fn withdrawn(&mut self, run: Run) {
        self.reserved -= self.bytes_of(run);
        for number in run.numbers() {
            self.pending.remove(&number);
        }
    }

    /// Asks for what has been named in this frame, instead of what was before.
    pub fn ask_for_foreseen(&mut self) {
        self.withdraw();
        self.foresight.end_frame();
        let mut at = 0;
        // Making room takes off the end.
        while let Some((due, first)) = self.foresight.at(at) {
            at += 1;
            if !self.is_missing(first) {
                continue;
            }
            // Siblings are named together and lie together.
            let sibling = self.foresight.at(at) == Some((due, first + 1));
            let count = if sibling && self.is_missing(first + 1) { 2 } else { 1 };
            at += count as usize - 1;
            let run = Run { first, count };
            if !self.make_room(self.bytes_of(run), due) {
                return;
            }
            self.ask(run, None);
        }
    }

    /// Whether a block is neither there nor under way, and nothing is known to be wrong with it.
    fn is_missing(&self, number: u32) -> bool {
        self.blocks.block(number).is_none()
            && !self.pending.contains_key(&number)
            && !self.failures.holds(number)
    }

    // Making room.

    /// A block may have become a candidate for removal.
    pub fn may_go(&mut self, number: u32) {
        self.removal.may_go(number, &mut self.blocks);
    }

    /// A node has been folded: its children are not in play any more.
    pub fn leave_play(&mut self, node: NodeId) {
        self.removal.leave_play(node, &mut self.blocks);
    }

    /// A candidate to make room below the hard quota for what is needed in so many frames: one that is foreseen if there is no
    /// other.
    fn any_candidate(&mut self, since: u64, due: u32) -> Option<u32> {
        let Self { blocks, removal, waiting, foresight, .. } = self;
        let keepers = Keepers { waiting, foresight, since };
        if let Some(number) = removal.unforeseen(keepers, blocks) {
            return Some(number);
        }
        while let Some(number) = foresight.farthest(due) {
            if Removal::may_take(number, Keepers { waiting, foresight, since }, blocks) {
                return Some(number);
            }
        }
        None
    }

    fn remove(&mut self, number: u32) {
        self.removal.remove(number, &mut self.blocks);
        self.counts.removals += 1;
    }

    /// Makes room below the hard quota for so many bytes, which are needed in so many frames.
    ///
    /// What a change has made use of in the last frame stays, and what one that waits is going to make use of, so that what
    /// has come for it is still there when the rest does. With a camera at rest a block that
    /// has come for a change is thus not removed for another, and as every change that is made lets the front sink,
    /// loading comes to an end, whatever the quota.
    fn make_room(&mut self, bytes: u64, due: u32) -> bool {
        let fits =
            |paging: &Self| (paging.blocks.bytes + paging.reserved).saturating_add(bytes) <= paging.hard;
        while !fits(self) {
            // What has not been started takes no room from what is missed.
            if due == NOW && self.withdraw() {
                continue;
            }
            match self.any_candidate(self.frame.saturating_sub(1), due) {
                Some(number) => self.remove(number),
                None => return false,
            }
        }
        true
    }

    // Frames.

    pub fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        self.frame += 1;
        self.removal.begin_frame(self.frame);
        arrived.append(&mut self.waiting.again);
        let mut arrivals = std::mem::take(&mut self.arrivals);
        self.requests.begin_frame(self.frame, &mut arrivals);
        for arrival in arrivals.drain(..) {
            self.integrate(arrival, arrived);
        }
        self.arrivals = arrivals;
        self.take_error()
    }

    /// Waits for all that is under way. It is taken at the start of the next frame. Returns how long that took.
    pub fn settle(&mut self) -> Duration {
        self.requests.settle()
    }

    /// Lets time pass, if it is virtual.
    pub fn pass(&mut self, time: Duration) {
        self.requests.pass(time);
    }

    /// Removes candidates beyond the quotas.
    pub fn end_frame(&mut self) -> PageStats {
        while self.blocks.bytes + self.reserved > self.hard
            && let Some(number) = self.any_candidate(self.frame, NOW)
        {
            self.remove(number);
        }
        while self.blocks.bytes > self.soft {
            let Self { blocks, removal, waiting, foresight, .. } = self;
            let keepers = Keepers { waiting, foresight, since: 0 };
            let Some(number) = removal.beyond_soft(keepers, blocks) else { break };
            self.remove(number);
        }
        self.removal.end_frame();
        let resident_bytes = self.blocks.bytes + self.blocks.fixed_bytes();
        let resident = PageStats { resident_bytes, ..PageStats::default() };
        std::mem::take(&mut self.stats) + self.requests.take_stats() + resident
    }
}
