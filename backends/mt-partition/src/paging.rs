//! Fetches nodes and lets go of them.
//!
//! A change of the front needs a *group*: unfolding a node needs its record and those of all its children, folding needs
//! those of all its parents, whose patches appear. A group is asked for as a whole: room for what is missing is reserved
//! first, and what is there is pinned until the rest has come. So whatever fits the memory at all comes, one group after
//! the other, however little memory there is: nothing else has to stay, as the displayed patches do not depend on the
//! records that they came from, and the engine keeps the bounds of the nodes in play.
//!
//! The paper reads what its traversal comes upon, and goes on when it is there. Here a change is refused until its group has come, so that
//! no frame waits; what is read and what is kept is as printed ([`Prefetch::Paper`]). Whoever wants it as printed waits for
//! [`settle`](vertex_tree::Hierarchy::settle) and asks again, as foldfront's `Settled` does (`--prefetch blocking`).
//!
//! Groups come first. What is foreseen (`foresight`) is fetched behind them and has to make do with the room that they
//! leave (`room`).
//!
//! All of this runs on the thread of the tree; see [`reader`](crate::reader) for the one that reads.

mod answers;
mod cut;
mod foresight;
mod room;

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use rustc_hash::FxHashMap;
use vertex_tree::{NONE, NodeId, PageStats, Prefetch};

use self::foresight::Foresight;
use self::room::Need;
use crate::cache::{CacheMode, PartitionState};
use crate::file::MtFile;
use crate::memory::Memory;
use crate::reader::{Answer, Line, NOW, Reader, Ticket};
use crate::record::Record;
use crate::residents::{OVERHEAD, Residents};

/// Which neighbours a change needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Unfold,
    Fold,
}

impl Change {
    /// The nodes that the change of a node needs beyond the node itself.
    fn neighbours(self, record: &Record, mut f: impl FnMut(u32)) {
        match self {
            Self::Unfold => record.below().for_each(f),
            Self::Fold => record.above().filter(|&(n, _)| n != NONE).for_each(|(n, _)| f(n)),
        }
    }
}

/// A group that has been asked for.
#[derive(Debug)]
struct Group {
    members: Vec<u32>,
    /// Reads that it still waits for.
    reads: u32,
}

/// A read that has been asked for.
#[derive(Debug)]
struct Read {
    ticket: Ticket,
    /// The nodes whose groups wait for it; none if it is only foreseen, or if none is wanted any more.
    waiting: Vec<u32>,
    /// Whether it was asked for ahead of time, and no group has waited for it since.
    is_ahead: bool,
}

/// Frames in which the cache mode may wait for answers: what has arrived for a change that waits for more would be let go
/// of otherwise. A front that never comes to rest must not keep everything.
const PATIENCE: u32 = 16;

/// What is known of a node, in memory or not: all that a change asks about its neighbours lies together.
#[derive(Clone, Copy, Debug)]
struct NodeState {
    partition: u32,
    /// Its arcs in the cut.
    links: u32,
    is_active: bool,
    /// Whether it is on its way and there is room for it.
    is_reserved: bool,
}

#[derive(Debug)]
pub(crate) struct Paging {
    file: Arc<MtFile>,
    mode: CacheMode,
    line: Line,
    pub residents: Residents,
    partitions: Vec<PartitionState>,
    nodes: Vec<NodeState>,
    frame: u64,
    /// By the node that is to change.
    groups: FxHashMap<u32, Group>,
    /// By what is read, a partition or a node.
    reads: FxHashMap<u32, Read>,
    /// Changes of this frame for which there was no room.
    deferred: Vec<(u32, Change)>,
    /// A change for which there was none although everything gave way, and whether it has been asked for in this frame.
    /// Until it is made, others may not take the room that it waits for: each could lose its first records to the others
    /// while it waits for the next.
    first: Option<(u32, bool)>,
    /// Changes that can be asked for again in the next frame.
    again: Vec<u32>,
    /// What was read badly: how often in a row, and the frame from which on it may be tried again.
    failures: FxHashMap<u32, (u32, u64)>,
    dirty: Vec<u32>,
    answers: Vec<Answer>,
    /// Nodes that an answer has brought, in ascending order. Kept for its allocation.
    brought: Vec<u32>,
    unanswered_frames: u32,
    /// This tree's number among those that share the budget.
    member: u64,
    /// Bytes that could not be had in this frame, and whether the others know.
    wanted: u64,
    has_told: bool,
    /// Frames in a row in which room was wanted that could not be had by letting go of what no cut holds.
    pressed: u32,
    /// Whether nodes go for want of room only, whatever the cache mode.
    keeps_all: bool,
    /// What the engine foresees, where that is asked for.
    foresight: Option<Foresight>,
    stats: PageStats,
    pub is_lost: bool,
}

impl Paging {
    pub fn new(
        file: Arc<MtFile>,
        mode: CacheMode,
        prefetch: Prefetch,
        memory: Memory,
        reader: Reader,
    ) -> Self {
        let member = memory.join();
        let state = |node| NodeState {
            partition: file.partition_of(node),
            links: 0,
            is_active: false,
            is_reserved: false,
        };
        let mut paging = Self {
            member,
            wanted: 0,
            has_told: false,
            line: Line::new(reader, file.clone()),
            mode,
            residents: Residents::new(file.nodes(), memory),
            partitions: vec![PartitionState::default(); file.partitions.len() - 1],
            nodes: (0..file.nodes()).map(state).collect(),
            frame: 0,
            groups: FxHashMap::default(),
            reads: FxHashMap::default(),
            deferred: Vec::new(),
            first: None,
            again: Vec::new(),
            failures: FxHashMap::default(),
            dirty: Vec::new(),
            answers: Vec::new(),
            brought: Vec::new(),
            unanswered_frames: 0,
            pressed: 0,
            keeps_all: false,
            foresight: (prefetch == Prefetch::Schedule).then(Foresight::default),
            stats: PageStats::default(),
            is_lost: false,
            file,
        };
        for root in &paging.file.clone().roots {
            paging.enter(root.0);
        }
        paging
    }

    fn bytes_of(&self, node: u32) -> u64 {
        self.file.length(node) + OVERHEAD
    }

    /// What is read to get a node.
    fn unit_of(&self, node: u32) -> u32 {
        if self.mode.reads_partitions() { self.file.partition_of(node) } else { node }
    }

    fn nodes_of(&self, unit: u32) -> Range<u32> {
        if self.mode.reads_partitions() {
            self.file.partitions[unit as usize]..self.file.partitions[unit as usize + 1]
        } else {
            unit..unit + 1
        }
    }

    /// Starts to read what a change of a node touches into the cache, in steps that follow each other.
    #[inline]
    pub fn prepare(&self, node: u32, step: usize) {
        match step {
            0 => {
                self.residents.prefetch_slot(node);
                vertex_tree::prefetch(&self.nodes, node as usize);
            }
            1 => self.residents.prefetch(node),
            _ => {
                if let Some(record) = self.residents.get(node) {
                    record.prefetch();
                }
            }
        }
    }

    /// The same for the records of nodes that are in memory and about to be asked for.
    #[inline]
    pub fn prepare_all(&self, nodes: &[u32]) {
        for &node in nodes {
            if let Some(record) = self.residents.get(node) {
                record.prefetch();
            }
        }
    }

    // Requests.

    /// Whether all that a change of a node needs is in memory. If not, it has been asked for.
    pub fn has(&mut self, node: u32, change: Change) -> bool {
        if let Some(record) = self.residents.get(node) {
            let mut all = true;
            change.neighbours(record, |n| {
                all &= self.residents.contains(n);
                self.residents.prefetch(n);
            });
            if all {
                self.first = self.first.filter(|&(first, _)| first != node);
                return true;
            }
        }
        if let Some((_, is_asked_for)) = self.first.as_mut().filter(|(first, _)| *first == node) {
            *is_asked_for = true;
        }
        if !self.groups.contains_key(&node) && !self.request(node, change, Need::Change) {
            self.deferred.push((node, change));
        }
        false
    }

    /// Asks for what a change needs, if there is room for it.
    fn request(&mut self, node: u32, change: Change, need: Need) -> bool {
        if self.first.is_some_and(|(first, _)| first != node && !self.groups.contains_key(&first)) {
            return false;
        }
        let mut members = vec![node];
        if let Some(record) = self.residents.get(node) {
            change.neighbours(record, |n| members.push(n));
        }
        let missing: Vec<u32> = members.iter().copied().filter(|&n| !self.residents.contains(n)).collect();
        let mut units: Vec<u32> = missing.iter().map(|&n| self.unit_of(n)).collect();
        units.sort_unstable();
        units.dedup();
        if units.iter().any(|&unit| self.is_paused(unit)) {
            self.again.push(node);
            return true;
        }
        for &n in &members {
            self.residents.pin(n);
        }
        if let Err(bytes) = self.reserve(&missing, need) {
            for &n in &members {
                self.residents.unpin(n, 0);
            }
            self.wanted = self.wanted.max(bytes);
            return false;
        }
        let mut reads = 0;
        for &unit in &units {
            reads += u32::from(self.ask(unit, NOW, Some(node)));
        }
        self.groups.insert(node, Group { members, reads });
        true
    }

    /// Asks for a partition or a node, or makes a request that is there more urgent. Says whether there will be an answer.
    fn ask(&mut self, unit: u32, urgency: u64, waiting: Option<u32>) -> bool {
        if let Some(read) = self.reads.get_mut(&unit) {
            // What a change waits for stays the most urgent.
            if read.waiting.is_empty() {
                self.line.rank(&mut read.ticket, urgency);
            }
            read.is_ahead &= waiting.is_none();
            read.waiting.extend(waiting);
            return true;
        }
        match self.line.ask(self.nodes_of(unit), urgency) {
            Some(ticket) => {
                let is_ahead = waiting.is_none();
                self.reads.insert(unit, Read { ticket, waiting: waiting.into_iter().collect(), is_ahead });
                true
            }
            None => {
                self.is_lost = true;
                false
            }
        }
    }

    /// A change that was refused is not wanted any more: what only it waits for is not either.
    pub fn give_up(&mut self, node: u32) {
        self.again.retain(|&other| other != node);
        self.first = self.first.filter(|&(first, _)| first != node);
        let Some(group) = self.groups.remove(&node) else { return };
        for member in group.members {
            self.residents.unpin(member, 0);
            let unit = self.unit_of(member);
            let Some(read) = self.reads.get_mut(&unit) else { continue };
            let before = read.waiting.len();
            read.waiting.retain(|&other| other != node);
            if read.waiting.len() < before {
                self.withdraw(unit);
            }
        }
    }

    /// Whether something was read badly, and not long ago.
    fn is_paused(&self, unit: u32) -> bool {
        self.failures.get(&unit).is_some_and(|&(_, from)| from > self.frame)
    }

    // Frames.

    pub fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) {
        self.frame += 1;
        self.line.set_frame(self.frame);
        arrived.extend(self.again.drain(..).map(NodeId));
        let mut answers = std::mem::take(&mut self.answers);
        answers.extend(std::iter::from_fn(|| self.line.take()));
        if let Some(foresight) = &mut self.foresight {
            foresight.store.begin_frame(answers.len(), self.line.waiting().iter().sum());
        }
        for answer in answers.drain(..) {
            self.arrive(answer, arrived);
        }
        self.answers = answers;
    }

    /// Waits for all that has been asked for. Returns how long that took.
    pub fn settle(&mut self) -> Duration {
        let answers = &mut self.answers;
        self.line.settle(|answer| answers.push(answer))
    }

    /// Asks for everything that there is room for, and from now on lets go of nothing unless room is needed.
    pub fn load_all(&mut self) {
        self.keeps_all = true;
        self.dirty.clear();
        let units =
            if self.mode.reads_partitions() { self.partitions.len() as u32 } else { self.file.nodes() };
        for unit in 0..units {
            let is_missing = |n: &u32| !self.residents.contains(*n) && !self.nodes[*n as usize].is_reserved;
            let missing: Vec<u32> = self.nodes_of(unit).filter(is_missing).collect();
            if self.is_paused(unit) || missing.is_empty() {
                continue;
            }
            if !self.residents.memory().try_reserve(missing.iter().map(|&n| self.bytes_of(n)).sum()) {
                return;
            }
            missing.iter().for_each(|&n| self.nodes[n as usize].is_reserved = true);
            if !self.ask(unit, u64::MAX, None) {
                self.release_reserved(unit);
            }
        }
    }

    /// Lets time pass, where it is virtual.
    pub fn pass(&mut self, time: Duration) {
        self.line.pass(time);
    }

    pub fn end_frame(&mut self) -> PageStats {
        self.foresee();
        // What found no room may have anything that is not needed at this moment.
        self.wanted = 0;
        // It does not ask while what it needs is on its way.
        let goes_on = |&(first, is_asked_for): &(u32, bool)| is_asked_for || self.groups.contains_key(&first);
        self.first = self.first.filter(goes_on).map(|(first, _)| (first, false));
        let mut deferred = std::mem::take(&mut self.deferred);
        let is_first = |node: u32| self.first.is_some_and(|(first, _)| first == node);
        deferred.sort_by_key(|&(node, _)| !is_first(node));
        for (node, change) in deferred.drain(..) {
            if !self.groups.contains_key(&node) && !self.request(node, change, Need::Pressing) {
                self.first = self.first.or(Some((node, true)));
                self.again.push(node);
                self.stats.no_room += 1;
            }
        }
        self.deferred = deferred;
        // What is foreseen may not take the room that a refused change waits for.
        if self.wanted == 0 && self.first.is_none() {
            self.fetch_ahead();
        }
        if self.wanted > 0 || self.has_told {
            self.residents.memory().want(self.member, self.wanted);
            self.has_told = self.wanted > 0;
        }
        self.relieve();
        self.unanswered_frames = if self.groups.is_empty() { 0 } else { self.unanswered_frames + 1 };
        if self.groups.is_empty() || self.unanswered_frames > PATIENCE {
            self.unanswered_frames = 0;
            self.clean();
        }
        let mut stats = std::mem::take(&mut self.stats);
        stats.resident_bytes = self.residents.bytes();
        stats
    }
}

impl Drop for Paging {
    fn drop(&mut self) {
        let is_reserved = |&n: &u32| self.nodes[n as usize].is_reserved;
        let reserved = (0..self.file.nodes()).filter(is_reserved).map(|n| self.bytes_of(n)).sum();
        self.residents.memory().release(reserved);
        self.residents.memory().want(self.member, 0);
    }
}
