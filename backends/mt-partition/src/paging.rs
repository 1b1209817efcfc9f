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
//! Nodes that contradict each other, as a record that has come and one that was there may, count as badly read: they are let go of, and
//! read again later.
//!
//! All of this runs on the thread of the tree.

mod change;
mod foresight;
mod nodes;
mod room;

use std::sync::Arc;
use std::time::Duration;

use page_store::{Arrival, Failures, NOW, Requests, Ticket};
use rustc_hash::FxHashMap;
use vertex_tree::{NodeId, PageStats, Prefetch, TreeError};

pub(crate) use self::change::Change;
use self::change::Need;
use self::foresight::Foresight;
use self::nodes::Nodes;
use crate::cache::CacheMode;
use crate::file::MtFile;
use crate::memory::Memory;
use crate::reader::{Reader, Stored};

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
}

/// Frames in which the cache mode may wait for answers: what has arrived for a change that waits for more would be let go
/// of otherwise, and what has come along with something foreseen before it is foreseen itself. A front that never comes to
/// rest must not keep everything.
const PATIENCE: u32 = 16;

/// A read that has failed is tried again after 1, 2, 4 ... frames, up to this many.
const LONGEST_PAUSE: u64 = 64;

/// Frames of foresight, at least.
const LEAST_AHEAD: u32 = 2;

#[derive(Debug)]
pub(crate) struct Paging {
    pub nodes: Nodes,
    requests: Requests<Stored>,
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
    failures: Failures<u32>,
    /// Nodes that an answer has brought, in ascending order, and those that the cache mode lets go of. Kept for their allocations.
    brought: Vec<u32>,
    gone: Vec<u32>,
    arrivals: Vec<Arrival<Stored>>,
    unanswered_frames: u32,
    /// This tree's number among those that share the budget.
    member: u64,
    /// Bytes that could not be had in this frame, and whether the others know.
    wanted: u64,
    has_told: bool,
    /// Frames in a row in which room was wanted that could not be had by letting go of what no cut holds.
    pressed: u32,
    /// What the engine foresees, where that is asked for.
    foresight: Option<Foresight>,
    stats: PageStats,
    /// The first since somebody asked.
    pub fault: Option<TreeError>,
}

impl Paging {
    pub fn new(
        file: Arc<MtFile>,
        mode: CacheMode,
        prefetch: Prefetch,
        memory: Memory,
        reader: &Reader,
    ) -> Self {
        Self {
            member: memory.join(),
            wanted: 0,
            has_told: false,
            requests: reader.requests(file.clone()),
            nodes: Nodes::new(file, mode, memory),
            frame: 0,
            groups: FxHashMap::default(),
            reads: FxHashMap::default(),
            deferred: Vec::new(),
            first: None,
            again: Vec::new(),
            failures: Failures::new(LONGEST_PAUSE),
            brought: Vec::new(),
            gone: Vec::new(),
            arrivals: Vec::new(),
            unanswered_frames: 0,
            pressed: 0,
            foresight: (prefetch == Prefetch::Schedule).then(Foresight::default),
            stats: PageStats::default(),
            fault: None,
        }
    }

    /// Starts to read what a change of a node touches into the cache, in steps that follow each other.
    #[inline]
    pub fn prepare(&self, node: u32, step: usize) {
        match step {
            0 => self.nodes.prefetch(node),
            1 => self.nodes.residents.prefetch(node),
            _ => self.prepare_all(&[node]),
        }
    }

    /// The same for the records of nodes that are in memory and about to be asked for.
    #[inline]
    pub fn prepare_all(&self, nodes: &[u32]) {
        for &node in nodes {
            if let Some(record) = self.nodes.residents.get(node) {
                record.prefetch();
            }
        }
    }

    // Requests.

    /// Whether all that a change of a node needs is in memory. If not, it has been asked for.
    pub fn has(&mut self, node: u32, change: Change) -> bool {
        if let Some(record) = self.nodes.residents.get(node) {
            let mut all = true;
            change.neighbours(record, |n| {
                all &= self.nodes.residents.contains(n);
                self.nodes.residents.prefetch(n);
            });
            if all {
                self.first = self.first.filter(|&(first, _)| first != node);
                return self.nodes.agrees(node, change) || self.contradicts(node);
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

    /// A node and one beside it say different things of each other: no change is made with it before it has been read anew.
    #[cold]
    fn contradicts(&mut self, node: u32) -> bool {
        let unit = self.nodes.unit_of(node);
        if !self.is_paused(unit) {
            self.count_fault(
                self.damaged(node, "it and a node beside it say different things of each other"),
            );
            self.failures.failed(unit, self.frame);
        }
        if self.nodes.residents.is_free(node, self.frame) {
            self.let_go(node);
        }
        self.again.push(node);
        false
    }

    /// Asks for what a change needs, if there is room for it.
    fn request(&mut self, node: u32, change: Change, need: Need) -> bool {
        if self.first.is_some_and(|(first, _)| first != node && !self.groups.contains_key(&first)) {
            return false;
        }
        let mut members = vec![node];
        if let Some(record) = self.nodes.residents.get(node) {
            change.neighbours(record, |n| members.push(n));
        }
        let missing: Vec<u32> =
            members.iter().copied().filter(|&n| !self.nodes.residents.contains(n)).collect();
        let mut units: Vec<u32> = missing.iter().map(|&n| self.nodes.unit_of(n)).collect();
        units.sort_unstable();
        units.dedup();
        if units.iter().any(|&unit| self.is_paused(unit)) {
            self.again.push(node);
            return true;
        }
        for &n in &members {
            self.nodes.residents.pin(n);
        }
        if let Err(bytes) = self.reserve(&missing, need) {
            for &n in &members {
                self.nodes.residents.unpin(n, 0);
            }
            self.wanted = self.wanted.max(bytes);
            return false;
        }
        for &unit in &units {
            self.ask(unit, NOW, Some(node));
        }
        self.groups.insert(node, Group { members, reads: units.len() as u32 });
        true
    }

    /// Asks for a partition or a node, or makes a request that is there more urgent.
    fn ask(&mut self, unit: u32, urgency: u64, waiting: Option<u32>) {
        if let Some(read) = self.reads.get_mut(&unit) {
            // What a change waits for stays the most urgent.
            if read.waiting.is_empty() {
                self.requests.rank(read.ticket, urgency);
            }
            if waiting.is_some() {
                self.requests.demand(read.ticket);
            }
            read.waiting.extend(waiting);
            return;
        }
        let ticket = self.requests.ask(self.nodes.nodes_of(unit), urgency);
        self.reads.insert(unit, Read { ticket, waiting: waiting.into_iter().collect() });
    }

    /// Takes back a read that is only foreseen and has not been started, and says whether it did.
    fn withdraw(&mut self, unit: u32) -> bool {
        let Some(read) = self.reads.get(&unit) else { return false };
        if !read.waiting.is_empty() || !self.requests.withdraw(read.ticket) {
            return false;
        }
        self.reads.remove(&unit);
        self.nodes.release(self.nodes.nodes_of(unit));
        true
    }

    /// A change that was refused is not wanted any more: what only it waits for is not either.
    pub fn give_up(&mut self, node: u32) {
        self.again.retain(|&other| other != node);
        self.first = self.first.filter(|&(first, _)| first != node);
        let Some(group) = self.groups.remove(&node) else { return };
        for member in group.members {
            self.nodes.residents.unpin(member, 0);
            let unit = self.nodes.unit_of(member);
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
        self.failures.rests(unit, self.frame)
    }

    fn damaged(&self, node: u32, reason: &'static str) -> TreeError {
        let file = &self.nodes.file;
        TreeError::Damaged { file: file.name().to_owned(), offset: file.offset(node), reason }
    }

    fn count_fault(&mut self, fault: TreeError) {
        self.stats.faults += 1;
        self.fault.get_or_insert(fault);
    }

    /// Takes in what the store answers.
    fn arrive(&mut self, arrival: Arrival<Stored>, arrived: &mut Vec<NodeId>) {
        let Arrival { read: nodes, is_demanded, content } = arrival;
        let unit = self.nodes.unit_of(nodes.start);
        let waiting = self.reads.remove(&unit).map_or(Vec::new(), |read| read.waiting);
        let mut is_whole = true;
        let records = content.unwrap_or_else(|fault| {
            // It has been counted.
            is_whole = false;
            self.fault.get_or_insert_with(|| TreeError::Store(fault.into()));
            Vec::new()
        });
        for (node, record) in nodes.clone().zip(records) {
            let record = match record {
                Ok(record) if self.nodes.fits_file(node, &record) => record,
                wrong => {
                    is_whole = false;
                    self.count_fault(match wrong {
                        Err(fault) => TreeError::Store(fault.into()),
                        Ok(_) => self.damaged(
                            node,
                            "it is not among the roots, or the triangles at first, as the file says",
                        ),
                    });
                    continue;
                }
            };
            if self.nodes.take_in(node, record) {
                if let Some(foresight) = self.foresight.as_mut().filter(|_| !is_demanded) {
                    foresight.unused.insert(node);
                }
                self.brought.push(node);
            }
        }
        for group in waiting.iter().filter_map(|waiting| self.groups.get(waiting)) {
            let is_brought = |n: &&u32| self.brought.binary_search(n).is_ok();
            group.members.iter().filter(is_brought).for_each(|&n| self.nodes.residents.pin(n));
        }
        self.brought.clear();
        self.nodes.release(nodes);
        if is_whole {
            self.failures.forget(unit);
        } else {
            self.failures.failed(unit, self.frame);
        }
        for node in waiting {
            let Some(group) = self.groups.get_mut(&node) else { continue };
            group.reads -= 1;
            if group.reads == 0 {
                let members = self.groups.remove(&node).map(|group| group.members).unwrap_or_default();
                for n in members {
                    self.nodes.residents.unpin(n, self.frame);
                }
                arrived.push(NodeId(node));
            }
        }
    }

    // Changes that have been made.

    /// A node in memory has been unfolded, and so have `above` before, or folded: it has so many arcs in the cut.
    pub fn changed(&mut self, node: u32, change: Change, above: &[u32], below: &[u32], arcs: u32) {
        let (gain, loss) = match change {
            Change::Unfold => (below, above),
            Change::Fold => (above, below),
        };
        self.nodes.changed(node, change, gain, loss, arcs);
        // What of these was fetched ahead has been worth it.
        if let Some(foresight) = self.foresight.as_mut().filter(|f| !f.unused.is_empty()) {
            for n in std::iter::once(node).chain(gain.iter().copied()) {
                self.stats.ahead_used += u64::from(foresight.used(n, &self.nodes));
            }
        }
    }

    // Frames.

    pub fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) {
        self.frame += 1;
        arrived.extend(self.again.drain(..).map(NodeId));
        let mut arrivals = std::mem::take(&mut self.arrivals);
        self.requests.begin_frame(self.frame, &mut arrivals);
        for arrival in arrivals.drain(..) {
            self.arrive(arrival, arrived);
        }
        self.arrivals = arrivals;
    }

    /// Waits for all that has been asked for. Returns how long that took.
    pub fn settle(&mut self) -> Duration {
        self.requests.settle()
    }

    /// Lets time pass, where it is virtual.
    pub fn pass(&mut self, time: Duration) {
        self.requests.pass(time);
    }

    /// Asks for everything that there is room for, and from now on lets go of nothing unless room is needed.
    pub fn load_all(&mut self) {
        self.nodes.keep_all();
        for unit in 0..self.nodes.units() {
            let nodes = &self.nodes;
            let is_missing = |n: &u32| !nodes.residents.contains(*n) && !nodes.is_reserved(*n);
            let missing: Vec<u32> = nodes.nodes_of(unit).filter(is_missing).collect();
            if self.is_paused(unit) || missing.is_empty() {
                continue;
            }
            if !nodes.residents.memory().try_reserve(nodes.unreserved_bytes(&missing)) {
                return;
            }
            missing.iter().for_each(|&n| self.nodes.reserve(n));
            self.ask(unit, u64::MAX, None);
        }
    }

    pub fn end_frame(&mut self) -> PageStats {
        if let Some(foresight) = &mut self.foresight {
            foresight.end_frame(self.frame, &mut self.nodes);
        }
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
            self.nodes.residents.memory().want(self.member, self.wanted);
            self.has_told = self.wanted > 0;
        }
        self.relieve();
        // What is foreseen comes a few nodes of a partition at a time: the others that the read brings are next.
        self.unanswered_frames = if self.reads.is_empty() { 0 } else { self.unanswered_frames + 1 };
        if self.reads.is_empty() || self.unanswered_frames > PATIENCE {
            self.unanswered_frames = 0;
            self.clean();
        }
        let resident_bytes = self.nodes.residents.bytes();
        let resident = PageStats { resident_bytes, ..PageStats::default() };
        std::mem::take(&mut self.stats) + self.requests.take_stats() + resident
    }

    /// Lets go of what the cache mode does not keep.
    fn clean(&mut self) {
        let mut gone = std::mem::take(&mut self.gone);
        let foresight = &self.foresight;
        let is_kept = |node: u32| foresight.as_ref().is_some_and(|f| f.keeps(node));
        self.nodes.clean(self.frame, is_kept, &mut gone);
        gone.drain(..).for_each(|node| self.let_go(node));
        self.gone = gone;
    }

    // Foresight.

    /// For how many frames ahead it is worth knowing what will be needed.
    pub fn look_ahead(&self) -> u32 {
        if self.foresight.is_some() { self.requests.look_ahead(LEAST_AHEAD) } else { 0 }
    }

    pub fn will_need(&mut self, node: u32, frames: u32) {
        if let Some(foresight) = &mut self.foresight {
            foresight.will_need(node, frames);
        }
    }

    /// Asks for what is expected and not there, as far as there is room, and takes back what is not expected any more.
    fn fetch_ahead(&mut self) {
        let Some(foresight) = &self.foresight else { return };
        let mut units = foresight.missing(&self.nodes);
        if !self.nodes.keeps_all() {
            let mut idle: Vec<u32> =
                self.reads.iter().filter(|(_, r)| r.waiting.is_empty()).map(|(&u, _)| u).collect();
            idle.sort_unstable();
            for unit in idle {
                if units.binary_search_by_key(&unit, |u| u.1).is_err() {
                    self.withdraw(unit);
                }
            }
        }
        units.sort_unstable_by_key(|&(due, unit, _)| (due, unit));
        for (due, unit, nodes) in units {
            if self.is_paused(unit) {
                continue;
            }
            if self.reserve(&nodes, Need::Foreseen(due)).is_err() {
                break;
            }
            self.ask(unit, due, None);
        }
    }
}

impl Drop for Paging {
    fn drop(&mut self) {
        self.nodes.residents.memory().want(self.member, 0);
    }
}
