//! The nodes of a tree: which are in memory or on their way, which are in the cut, and what the cache mode keeps of the others.

use std::ops::Range;
use std::sync::Arc;

use vertex_tree::{NONE, NodeId, SparseTable};

use super::change::Change;
use crate::cache::{CacheMode, PartitionState, Passed};
use crate::file::MtFile;
use crate::memory::Memory;
use crate::record::Record;
use crate::residents::{OVERHEAD, PIECE, Residents};

/// What is known of a node that is in the cut, active or on its way: all that a change asks about its neighbours lies together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct NodeState {
    partition: u32,
    /// Its arcs in the cut.
    links: u32,
    is_active: bool,
    /// Whether it is on its way and there is room for it.
    is_reserved: bool,
}

impl NodeState {
    /// Whether there is anything to know of it.
    fn is_known(self) -> bool {
        self.links > 0 || self.is_active || self.is_reserved
    }
}

#[derive(Debug)]
pub(crate) struct Nodes {
    pub file: Arc<MtFile>,
    mode: CacheMode,
    pub residents: Residents,
    partitions: Vec<PartitionState>,
    states: SparseTable<NodeState, PIECE>,
    /// Partitions in which something has changed since they were last looked through.
    dirty: Vec<u32>,
    /// Whether nodes go for want of room only, whatever the cache mode.
    keeps_all: bool,
}

impl Nodes {
    /// None in memory, and the roots in the cut.
    pub fn new(file: Arc<MtFile>, mode: CacheMode, memory: Memory) -> Self {
        let mut nodes = Self {
            mode,
            residents: Residents::new(file.nodes(), memory),
            partitions: vec![PartitionState::default(); file.layout.partitions() as usize],
            states: SparseTable::new(file.nodes()),
            dirty: Vec::new(),
            keeps_all: false,
            file,
        };
        for root in &nodes.file.clone().roots {
            nodes.enter(root.0);
        }
        nodes
    }

    /// Starts to read what is known of a node into the cache.
    #[inline]
    pub fn prefetch(&self, node: u32) {
        self.residents.prefetch_slot(node);
        self.states.prefetch(node);
    }

    /// Bytes that a node takes in memory.
    pub fn bytes_of(&self, node: u32) -> u64 {
        self.file.length(node) + OVERHEAD
    }

    /// What is read to get a node: a partition, or itself.
    pub fn unit_of(&self, node: u32) -> u32 {
        if self.mode.reads_partitions() { self.file.partition_of(node) } else { node }
    }

    /// How many of these there are.
    pub fn units(&self) -> u32 {
        if self.mode.reads_partitions() { self.partitions.len() as u32 } else { self.file.nodes() }
    }

    /// The nodes that a read of one brings.
    pub fn nodes_of(&self, unit: u32) -> Range<u32> {
        if self.mode.reads_partitions() { self.file.layout.nodes_of(unit) } else { unit..unit + 1 }
    }

    pub fn is_active(&self, node: u32) -> bool {
        self.states.get(node).is_active
    }

    pub fn is_in_cut(&self, node: u32) -> bool {
        self.states.get(node).links > 0
    }

    /// Changes what is known of a node.
    #[inline(always)]
    fn change<R>(&mut self, node: u32, change: impl FnOnce(&mut NodeState) -> R) -> R {
        let mut state = self.states.get(node);
        if state == NodeState::default() {
            state.partition = self.file.partition_of(node);
        }
        let changed = change(&mut state);
        if !state.is_known() {
            state = NodeState::default();
        }
        self.states.set(node, state);
        changed
    }

    /// The partition that a node is in, which is at hand for those that are known.
    #[inline(always)]
    fn partition_of(&self, node: u32) -> u32 {
        let state = self.states.get(node);
        if state.is_known() { state.partition } else { self.file.partition_of(node) }
    }

    // What is on its way.

    pub fn is_reserved(&self, node: u32) -> bool {
        self.states.get(node).is_reserved
    }

    /// There is room for a node from now on.
    pub fn reserve(&mut self, node: u32) {
        self.change(node, |state| state.is_reserved = true);
    }

    /// Bytes of those of some nodes that there is no room for yet.
    pub fn unreserved_bytes(&self, nodes: &[u32]) -> u64 {
        nodes.iter().filter(|&&n| !self.is_reserved(n)).map(|&n| self.bytes_of(n)).sum()
    }

    /// What does not come needs no room.
    pub fn release(&mut self, nodes: Range<u32>) {
        for node in nodes {
            if self.is_reserved(node) {
                self.change(node, |state| state.is_reserved = false);
                self.residents.memory().release(self.bytes_of(node));
            }
        }
    }

    /// A node has come. Says whether there was room for it.
    pub fn take_in(&mut self, node: u32, record: Record) -> bool {
        let bytes = self.bytes_of(node);
        let has_room = self.change(node, |state| std::mem::take(&mut state.is_reserved))
            || !self.residents.contains(node) && self.residents.memory().try_reserve(bytes);
        if has_room {
            self.residents.insert(node, record, bytes);
            let partition = self.file.partition_of(node);
            self.partitions[partition as usize].resident += 1;
            self.mark(partition);
        }
        has_room
    }

    /// Lets go of a node in memory.
    pub fn let_go(&mut self, node: u32) {
        self.residents.remove(node, self.bytes_of(node));
        let state = &mut self.partitions[self.file.partition_of(node) as usize];
        state.resident -= 1;
        if state.resident == 0 {
            state.forget();
        }
    }

    /// The least recently used of the nodes that may go, that no cut holds and that `is_foreseen` does not keep.
    pub fn oldest(&mut self, frame: u64, is_foreseen: impl Fn(u32) -> bool) -> Option<u32> {
        let Self { residents, states, .. } = self;
        residents.oldest(frame, |n| states.get(n).links > 0 || is_foreseen(n))
    }

    // The cut.

    /// An arc of the node comes into the cut.
    #[inline]
    fn enter(&mut self, node: u32) {
        let state = self.change(node, |state| {
            state.links += 1;
            *state
        });
        if state.links == 1 {
            self.partitions[state.partition as usize].in_cut += 1;
        }
    }

    /// An arc of the node leaves the cut.
    #[inline]
    fn leave(&mut self, node: u32) {
        let NodeState { links, partition, .. } = self.states.get(node);
        if links == 0 {
            return;
        }
        self.change(node, |state| state.links -= 1);
        if links == 1 {
            self.partitions[partition as usize].in_cut -= 1;
            self.residents.touch(node);
            self.mark(partition);
        }
    }

    /// Something has changed in the partition of a node.
    pub fn mark_of(&mut self, node: u32) {
        self.mark(self.file.partition_of(node));
    }

    fn mark(&mut self, partition: u32) {
        if self.keeps_all {
            return;
        }
        if !std::mem::replace(&mut self.partitions[partition as usize].is_dirty, true) {
            self.dirty.push(partition);
        }
    }

    /// A change has brought an arc of the node into the cut.
    #[inline]
    fn note(&mut self, node: u32, change: Change) {
        let partition = self.partition_of(node);
        let state = &mut self.partitions[partition as usize];
        match change {
            Change::Unfold => state.came_down = true,
            Change::Fold => state.came_up = true,
        }
        self.mark(partition);
    }

    /// A node in memory has been unfolded, and so have `above` before, or folded: arcs come into the cut (`gain`) and leave it
    /// (`loss`), so that the node has so many there.
    pub fn changed(&mut self, node: u32, change: Change, gain: &[u32], loss: &[u32], arcs: u32) {
        for &n in gain {
            self.enter(n);
            self.note(n, change);
        }
        for &n in loss {
            self.leave(n);
        }
        let (before, partition) = self.change(node, |state| {
            state.is_active = change == Change::Unfold;
            // A root without triangles is shown by nothing; it is in play all the same.
            (std::mem::replace(&mut state.links, arcs.max(1)), state.partition)
        });
        if before == 0 {
            self.partitions[partition as usize].in_cut += 1;
        }
        self.note(node, change);
    }

    // What is kept.

    /// From now on nodes go for want of room only.
    pub fn keep_all(&mut self) {
        self.keeps_all = true;
        self.dirty.clear();
    }

    pub fn keeps_all(&self) -> bool {
        self.keeps_all
    }

    fn layer(&self, node: u32) -> u32 {
        self.residents.get(node).map_or(0, Record::layer)
    }

    /// Appends what the cache mode does not keep, in the partitions where anything has changed, of what may go and is not kept
    /// otherwise.
    pub fn clean(&mut self, frame: u64, is_kept: impl Fn(u32) -> bool, gone: &mut Vec<u32>) {
        let mut dirty = std::mem::take(&mut self.dirty);
        let mut postponed = Vec::new();
        for partition in dirty.drain(..) {
            self.partitions[partition as usize].is_dirty = false;
            let nodes = self.file.layout.nodes_of(partition);
            let state = self.partitions[partition as usize];
            if self.mode == CacheMode::PCc && state.in_cut > 0 {
                continue;
            }
            let is_shown = |n: u32| self.is_in_cut(n) && self.residents.contains(n);
            let cut = if self.mode == CacheMode::PC && state.in_cut > 0 {
                let layers = nodes.clone().filter(|&n| is_shown(n)).map(|n| self.layer(n));
                [layers.clone().min().unwrap_or(0), layers.max().unwrap_or(0)]
            } else {
                [0; 2]
            };
            let mut is_postponed = false;
            for node in nodes {
                if !self.residents.contains(node) || self.is_in_cut(node) {
                    continue;
                }
                let is_cached = state.in_cut > 0 && {
                    let (layer, is_active) = (self.layer(node), self.is_active(node));
                    state.keeps(self.mode, cut, Passed { layer, is_active })
                };
                if is_cached || is_kept(node) {
                    continue;
                }
                if self.residents.is_free(node, frame) {
                    gone.push(node);
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

    // What nodes say of each other.

    /// Whether a record that has come agrees with what is always there: the list of roots, and the source, from which an arc may lead
    /// to it.
    pub fn fits_file(&self, node: u32, record: &Record) -> bool {
        let is_root = record.above().all(|(above, _)| above == NONE);
        let from_source = record.above().find(|&(above, _)| above == NONE).map(|(_, at)| at);
        self.file.root_bounds(NodeId(node)) == is_root.then(|| record.bounds())
            && self.file.position_in_base(node) == from_source
    }

    /// Whether a node and those that a change of it needs, all of them in memory, say the same of each other: both ends of an arc
    /// know of it, and layers and bounds are nested along it. Looked at when it is first needed.
    #[inline(always)]
    pub fn agrees(&mut self, node: u32, change: Change) -> bool {
        self.residents.has_agreed(node, change == Change::Unfold) || self.agree(node, change)
    }

    #[cold]
    fn agree(&mut self, node: u32, change: Change) -> bool {
        let Some(record) = self.residents.get(node) else { return false };
        let agrees = match change {
            Change::Unfold => {
                (0..).zip(record.arcs()).filter(|(_, arc)| arc.below != NONE).all(|(at, arc)| {
                    let below = self.residents.get(arc.below);
                    below.is_some_and(|below| below.hangs_below(record, at))
                })
            }
            Change::Fold => record.above().filter(|&(above, _)| above != NONE).all(|(above, at)| {
                let above = self.residents.get(above);
                above.is_some_and(|above| record.hangs_below(above, at))
            }),
        };
        if agrees {
            self.residents.agree(node, change == Change::Unfold);
        }
        agrees
    }
}

impl Drop for Nodes {
    fn drop(&mut self) {
        let reserved = self.states.iter().filter(|(_, state)| state.is_reserved);
        reserved.for_each(|(node, _)| self.residents.memory().release(self.bytes_of(node)));
    }
}
