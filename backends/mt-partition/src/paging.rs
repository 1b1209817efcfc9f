//! Fetches nodes and lets go of them.
//!
//! A change of the front needs a *group*: unfolding a node needs its record and those of all its children, folding needs
//! those of all its parents, whose patches appear. A group is asked for as a whole: room for what is missing is reserved
//! first, and what is there is pinned until the rest has come. So whatever fits the memory at all comes, one group after
//! the other, however little memory there is: nothing else has to stay, as the displayed patches do not depend on the
//! records that they came from, and the engine keeps the bounds of the nodes in play.
//!
//! All of this runs on the thread of the tree; see [`reader`](crate::reader) for the one that reads.

use std::ops::Range;
use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};
use vertex_tree::{NONE, NodeId, PageStats};

use crate::cache::{CacheMode, PartitionState, Passed};
use crate::file::MtFile;
use crate::memory::Memory;
use crate::reader::{Answer, Line, Reader};
use crate::residents::{OVERHEAD, Residents};

/// Which neighbours a change needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Unfold,
    Fold,
}

/// A group that has been asked for.
#[derive(Debug)]
struct Group {
    members: Vec<u32>,
    /// Reads that it still waits for.
    reads: u32,
}

/// Frames in which the cache mode may wait for answers: what has arrived for a change that waits for more would be let go
/// of otherwise. A front that never comes to rest must not keep everything.
const PATIENCE: u32 = 16;
/// A read that has failed is tried again after 1, 2, 4 ... frames, up to this many.
const LONGEST_PAUSE: u64 = 64;

#[derive(Debug)]
pub(crate) struct Paging {
    file: Arc<MtFile>,
    mode: CacheMode,
    line: Line,
    pub residents: Residents,
    partitions: Vec<PartitionState>,
    /// For each node, its arcs in the cut.
    links: Vec<u32>,
    active: Vec<bool>,
    frame: u64,
    /// By the node that is to change.
    groups: FxHashMap<u32, Group>,
    /// By what is read, a partition or a node: the nodes that wait for it.
    reads: FxHashMap<u32, Vec<u32>>,
    /// Nodes on their way for which there is room.
    reserved: FxHashSet<u32>,
    /// Changes of this frame for which there was no room.
    deferred: Vec<(u32, Change)>,
    /// Changes that can be asked for again in the next frame.
    again: Vec<u32>,
    /// What was read badly: how often in a row, and the frame from which on it may be tried again.
    failures: FxHashMap<u32, (u32, u64)>,
    dirty: Vec<u32>,
    answers: Vec<Answer>,
    unanswered_frames: u32,
    /// This tree's number among those that share the budget.
    member: u64,
    /// Bytes that could not be had in this frame, and whether the others know.
    wanted: u64,
    has_told: bool,
    /// Frames in a row in which room was wanted that could not be had by letting go of what no cut holds.
    pressed: u32,
    stats: PageStats,
    pub is_lost: bool,
}

impl Paging {
    pub fn new(file: Arc<MtFile>, mode: CacheMode, memory: Memory, reader: Reader) -> Self {
        let member = memory.join();
        let mut paging = Self {
            member,
            wanted: 0,
            has_told: false,
            line: Line::new(reader, file.clone()),
            mode,
            residents: Residents::new(file.nodes(), memory),
            partitions: vec![PartitionState::default(); file.partitions.len() - 1],
            links: vec![0; file.nodes() as usize],
            active: vec![false; file.nodes() as usize],
            frame: 0,
            groups: FxHashMap::default(),
            reads: FxHashMap::default(),
            reserved: FxHashSet::default(),
            deferred: Vec::new(),
            again: Vec::new(),
            failures: FxHashMap::default(),
            dirty: Vec::new(),
            answers: Vec::new(),
            unanswered_frames: 0,
            pressed: 0,
            stats: PageStats::default(),
            is_lost: false,
            file,
        };
        for root in &paging.file.clone().roots {
            paging.set_links(root.0, 1);
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

    // The cut.

    fn set_links(&mut self, node: u32, links: u32) {
        let before = std::mem::replace(&mut self.links[node as usize], links);
        if (before > 0) == (links > 0) {
            return;
        }
        let partition = self.file.partition_of(node);
        let state = &mut self.partitions[partition as usize];
        if links > 0 {
            state.in_cut += 1;
        } else {
            state.in_cut -= 1;
            self.residents.touch(node);
            self.mark(partition);
        }
    }

    fn mark(&mut self, partition: u32) {
        if !std::mem::replace(&mut self.partitions[partition as usize].is_dirty, true) {
            self.dirty.push(partition);
        }
    }

    /// An arc of the node has come into the cut.
    fn note(&mut self, node: u32, change: Change) {
        let partition = self.file.partition_of(node);
        let state = &mut self.partitions[partition as usize];
        match change {
            Change::Unfold => state.came_down = true,
            Change::Fold => state.came_up = true,
        }
        self.mark(partition);
    }

    /// A node in memory has been unfolded, and so have `above` before, or folded: arcs come into the cut and leave it.
    pub fn changed(&mut self, node: u32, change: Change, above: &[u32], below: &[u32], arcs: u32) {
        self.active[node as usize] = change == Change::Unfold;
        let (gain, loss) = match change {
            Change::Unfold => (below, above),
            Change::Fold => (above, below),
        };
        for &n in gain {
            self.set_links(n, self.links[n as usize] + 1);
            self.note(n, change);
        }
        for &n in loss {
            self.set_links(n, self.links[n as usize].saturating_sub(1));
        }
        // A root without triangles is shown by nothing; it is in play all the same.
        self.set_links(node, arcs.max(1));
        self.note(node, change);
    }

    // Requests.

    /// Whether all that a change of a node needs is in memory. If not, it has been asked for.
    pub fn has(&mut self, node: u32, change: Change) -> bool {
        if let Some(record) = self.residents.get(node) {
            let all = match change {
                Change::Unfold => record.below().all(|n| self.residents.contains(n)),
                Change::Fold => record.above().all(|(n, _)| n == NONE || self.residents.contains(n)),
            };
            if all {
                return true;
            }
        }
        if !self.groups.contains_key(&node) && !self.request(node, change, false) {
            self.deferred.push((node, change));
        }
        false
    }

    /// Asks for what a change needs, if there is room for it.
    fn request(&mut self, node: u32, change: Change, spare_nothing: bool) -> bool {
        let mut members = vec![node];
        if let Some(record) = self.residents.get(node) {
            match change {
                Change::Unfold => members.extend(record.below()),
                Change::Fold => members.extend(record.above().map(|(n, _)| n).filter(|&n| n != NONE)),
            }
        }
        let missing: Vec<u32> = members.iter().copied().filter(|&n| !self.residents.contains(n)).collect();
        let mut units: Vec<u32> = missing.iter().map(|&n| self.unit_of(n)).collect();
        units.sort_unstable();
        units.dedup();
        if units.iter().any(|unit| self.failures.get(unit).is_some_and(|&(_, from)| from > self.frame)) {
            self.again.push(node);
            return true;
        }
        let unreserved = || missing.iter().filter(|n| !self.reserved.contains(n));
        let bytes = unreserved().map(|&n| self.bytes_of(n)).sum();
        for &n in &members {
            self.residents.pin(n);
        }
        if !self.reserve(bytes, spare_nothing) {
            for &n in &members {
                self.residents.unpin(n, 0);
            }
            self.wanted = self.wanted.max(bytes);
            return false;
        }
        self.reserved.extend(missing);
        for &unit in &units {
            if !self.reads.contains_key(&unit) {
                let nodes = self.nodes_of(unit);
                self.is_lost |= !self.line.ask(nodes);
            }
            self.reads.entry(unit).or_default().push(node);
        }
        self.groups.insert(node, Group { members, reads: units.len() as u32 });
        true
    }

    /// Reserves room, and makes some if there is none: of what no cut holds, or of anything.
    fn reserve(&mut self, bytes: u64, spare_nothing: bool) -> bool {
        loop {
            if self.residents.memory().try_reserve(bytes) {
                return true;
            }
            if !self.let_go_of_one(spare_nothing) {
                return false;
            }
        }
    }

    fn let_go_of_one(&mut self, spare_nothing: bool) -> bool {
        let links = &self.links;
        let oldest = self.residents.oldest(self.frame, |n| links[n as usize] > 0);
        let node = oldest.or_else(|| self.residents.any(self.frame).filter(|_| spare_nothing));
        if let Some(node) = node {
            self.let_go(node);
        }
        node.is_some()
    }

    fn let_go(&mut self, node: u32) {
        self.residents.remove(node, self.bytes_of(node));
        let partition = self.file.partition_of(node) as usize;
        let state = &mut self.partitions[partition];
        state.resident -= 1;
        if state.resident == 0 {
            state.forget();
        }
    }

    // Answers.

    fn arrive(&mut self, answer: Answer, arrived: &mut Vec<NodeId>) {
        let unit = self.unit_of(answer.nodes.start);
        let waiting = self.reads.remove(&unit).unwrap_or_default();
        let mut faults = 0;
        match answer.records {
            Err(_) => faults = 1,
            Ok(records) => {
                self.stats.reads += 1;
                self.stats.read_bytes += answer.nodes.clone().map(|n| self.file.length(n)).sum::<u64>();
                for (node, record) in answer.nodes.clone().zip(records) {
                    let Ok(record) = record else {
                        faults += 1;
                        continue;
                    };
                    let bytes = self.bytes_of(node);
                    let is_new = !self.residents.contains(node);
                    if self.reserved.remove(&node) || is_new && self.residents.memory().try_reserve(bytes) {
                        self.residents.insert(node, record, bytes);
                        let partition = self.file.partition_of(node);
                        self.partitions[partition as usize].resident += 1;
                        self.mark(partition);
                        for waiting in &waiting {
                            if self.groups.get(waiting).is_some_and(|group| group.members.contains(&node)) {
                                self.residents.pin(node);
                            }
                        }
                    }
                }
            }
        }
        // What did not come needs no room.
        for node in answer.nodes {
            if self.reserved.remove(&node) {
                self.residents.memory().release(self.bytes_of(node));
            }
        }
        if faults == 0 {
            self.failures.remove(&unit);
        } else {
            self.stats.faults += faults;
            let (times, from) = self.failures.entry(unit).or_default();
            *from = self.frame + (1_u64 << *times).min(LONGEST_PAUSE);
            *times = (*times + 1).min(LONGEST_PAUSE.ilog2());
        }
        for node in waiting {
            let Some(group) = self.groups.get_mut(&node) else { continue };
            group.reads -= 1;
            if group.reads == 0 {
                let members = self.groups.remove(&node).map(|group| group.members).unwrap_or_default();
                for n in members {
                    self.residents.unpin(n, self.frame);
                }
                arrived.push(NodeId(node));
            }
        }
    }

    pub fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) {
        self.frame += 1;
        arrived.extend(self.again.drain(..).map(NodeId));
        for answer in std::mem::take(&mut self.answers) {
            self.arrive(answer, arrived);
        }
        while let Some(answer) = self.line.take() {
            self.arrive(answer, arrived);
        }
    }

    /// Waits for all that has been asked for.
    pub fn settle(&mut self) {
        while let Some(answer) = self.line.wait() {
            self.answers.push(answer);
        }
    }

    pub fn end_frame(&mut self) -> PageStats {
        // What found no room may have anything that is not needed at this moment.
        self.wanted = 0;
        for (node, change) in std::mem::take(&mut self.deferred) {
            if !self.groups.contains_key(&node) && !self.request(node, change, true) {
                self.again.push(node);
            }
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

    /// Makes room where the limit has been lowered, or where another tree could not have what it wants.
    fn relieve(&mut self) {
        let mut excess = self.residents.memory().excess(self.member);
        self.pressed = if excess > 0 { self.pressed + 1 } else { 0 };
        while excess > 0 {
            let memory = self.residents.memory();
            let spare_nothing = self.pressed > 1 || memory.used() > memory.limit();
            if !self.let_go_of_one(spare_nothing) {
                break;
            }
            excess = self.residents.memory().excess(self.member);
        }
    }

    /// Lets go of what the cache mode does not keep, in the partitions where anything has changed.
    fn clean(&mut self) {
        let mut dirty = std::mem::take(&mut self.dirty);
        let mut postponed = Vec::new();
        for partition in dirty.drain(..) {
            self.partitions[partition as usize].is_dirty = false;
            let nodes =
                self.file.partitions[partition as usize]..self.file.partitions[partition as usize + 1];
            let state = self.partitions[partition as usize];
            let layer = |&n: &u32| self.residents.get(n).map(crate::record::Record::layer);
            let in_cut = nodes.clone().filter(|&n| self.links[n as usize] > 0);
            let layers = in_cut.filter_map(|n| layer(&n));
            let cut = [layers.clone().min().unwrap_or(0), layers.max().unwrap_or(0)];
            let mut is_postponed = false;
            for node in nodes {
                let Some(layer) = self.residents.get(node).map(crate::record::Record::layer) else {
                    continue;
                };
                let passed = Passed { layer, is_active: self.active[node as usize] };
                if self.links[node as usize] > 0 || state.keeps(self.mode, cut, passed) {
                    continue;
                }
                if self.residents.is_free(node, self.frame) {
                    self.let_go(node);
                } else {
                    is_postponed = true;
                }
            }
            if is_postponed {
                postponed.push(partition);
            }
        }
        self.dirty = dirty;
        for partition in postponed {
            self.mark(partition);
        }
    }
}

impl Drop for Paging {
    fn drop(&mut self) {
        let reserved = self.reserved.iter().map(|&n| self.bytes_of(n)).sum();
        self.residents.memory().release(reserved);
        self.residents.memory().want(self.member, 0);
    }
}
