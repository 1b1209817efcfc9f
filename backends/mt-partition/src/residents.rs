//! The nodes in memory.

use std::collections::VecDeque;

use vertex_tree::SparseTable;

use crate::memory::Memory;
use crate::record::Record;

/// A node in memory.
#[derive(Debug)]
struct Resident {
    node: u32,
    record: Record,
    /// Requests under way that rely on it.
    pins: u32,
    /// The last frame in which it must stay.
    stays: u64,
    /// Its place in the queue: earlier ones are out of date.
    stamp: u32,
    /// Whether it has been compared with those above it, and with those below.
    agrees: [bool; 2],
}

/// Nodes of a piece of the tables of what is in memory or in the cut: a few partitions, which come together.
pub(crate) const PIECE: usize = 64;

/// What a node takes in memory beyond its record.
pub(crate) const OVERHEAD: u64 = (size_of::<Resident>() + size_of::<(u32, u32)>()) as u64;

/// The nodes in memory, by number and by when they were last used.
#[derive(Debug)]
pub(crate) struct Residents {
    /// For each node in memory, its place among `all` and one more.
    places: SparseTable<u32, PIECE>,
    all: Vec<Resident>,
    /// Nodes with the stamps that they had then: as they were loaded or left the cut.
    queue: VecDeque<(u32, u32)>,
    stamp: u32,
    /// Where the search for a node of the cut to let go of goes on.
    hand: usize,
    bytes: u64,
    memory: Memory,
}

impl Residents {
    pub fn new(nodes: u32, memory: Memory) -> Self {
        Self {
            places: SparseTable::new(nodes),
            all: Vec::new(),
            queue: VecDeque::new(),
            stamp: 0,
            hand: 0,
            bytes: 0,
            memory,
        }
    }

    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    pub fn memory(&self) -> &Memory {
        &self.memory
    }

    /// The place of a node among `all`, or none that is there.
    #[inline(always)]
    fn place(&self, node: u32) -> usize {
        self.places.get(node).wrapping_sub(1) as usize
    }

    pub fn contains(&self, node: u32) -> bool {
        self.places.get(node) != 0
    }

    #[inline]
    pub fn get(&self, node: u32) -> Option<&Record> {
        self.all.get(self.place(node)).map(|r| &r.record)
    }

    /// Starts to read the place of a node into the cache.
    #[inline]
    pub fn prefetch_slot(&self, node: u32) {
        self.places.prefetch(node);
    }

    /// Starts to read what leads to the record of a node, once its place is there.
    #[inline]
    pub fn prefetch(&self, node: u32) {
        vertex_tree::prefetch(&self.all, self.place(node));
    }

    fn get_mut(&mut self, node: u32) -> Option<&mut Resident> {
        let place = self.place(node);
        self.all.get_mut(place)
    }

    /// Whether a node has been compared with those above it, or with those below.
    #[inline(always)]
    pub fn has_agreed(&self, node: u32, below: bool) -> bool {
        self.all.get(self.place(node)).is_some_and(|r| r.agrees[usize::from(below)])
    }

    /// A node has been compared with those above it, or with those below.
    pub fn agree(&mut self, node: u32, below: bool) {
        if let Some(resident) = self.get_mut(node) {
            resident.agrees[usize::from(below)] = true;
        }
    }

    /// Takes in a node of so many bytes, for which room has been reserved, and which is not in memory.
    pub fn insert(&mut self, node: u32, record: Record, bytes: u64) {
        self.stamp = self.stamp.wrapping_add(1);
        self.all.push(Resident { node, record, pins: 0, stays: 0, stamp: self.stamp, agrees: [false; 2] });
        self.places.set(node, self.all.len() as u32);
        self.bytes += bytes;
        self.enqueue(node, self.stamp);
    }

    /// The node goes to the end of the queue.
    pub fn touch(&mut self, node: u32) {
        self.stamp = self.stamp.wrapping_add(1);
        let stamp = self.stamp;
        if let Some(resident) = self.get_mut(node) {
            resident.stamp = stamp;
            self.enqueue(node, stamp);
        }
    }

    fn enqueue(&mut self, node: u32, stamp: u32) {
        self.queue.push_back((node, stamp));
        // Entries that are out of date are not worth more memory than the nodes are.
        if self.queue.len() > 4 * self.all.len() + 64 {
            let mut queue = std::mem::take(&mut self.queue);
            queue.retain(|&(n, s)| self.all.get(self.place(n)).is_some_and(|r| r.stamp == s));
            self.queue = queue;
        }
    }

    /// A request relies on the node from now on.
    pub fn pin(&mut self, node: u32) {
        if let Some(resident) = self.get_mut(node) {
            resident.pins += 1;
        }
    }

    /// A request that relied on the node has been answered, so that it stays for this frame, or given up (`frame` 0).
    pub fn unpin(&mut self, node: u32, frame: u64) {
        if let Some(resident) = self.get_mut(node) {
            resident.pins = resident.pins.saturating_sub(1);
            resident.stays = resident.stays.max(frame);
        }
    }

    /// Whether the node may go.
    pub fn is_free(&self, node: u32, frame: u64) -> bool {
        self.all.get(self.place(node)).is_some_and(|r| r.pins == 0 && r.stays < frame)
    }

    /// Lets go of a node that takes so many bytes.
    pub fn remove(&mut self, node: u32, bytes: u64) {
        let before = self.places.set(node, 0);
        let place = before.wrapping_sub(1) as usize;
        if place >= self.all.len() {
            return;
        }
        self.all.swap_remove(place);
        if let Some(moved) = self.all.get(place) {
            self.places.set(moved.node, before);
        }
        self.bytes -= bytes;
        self.memory.release(bytes);
    }

    /// The least recently used of the nodes that may go and that `other` does not hold back.
    pub fn oldest(&mut self, frame: u64, held_back: impl Fn(u32) -> bool) -> Option<u32> {
        let mut later = Vec::new();
        let mut found = None;
        while let Some(&(node, stamp)) = self.queue.front() {
            let is_current = self.all.get(self.place(node)).is_some_and(|r| r.stamp == stamp);
            if is_current && !held_back(node) {
                if self.is_free(node, frame) {
                    found = Some(node);
                    break;
                }
                // Its turn comes again.
                later.push((node, stamp));
            }
            // What is held back comes to the end of the queue when it is not any more.
            self.queue.pop_front();
        }
        for entry in later.into_iter().rev() {
            self.queue.push_front(entry);
        }
        found
    }

    /// Any node that may go and that `held_back` does not hold back, each once in a while.
    pub fn any(&mut self, frame: u64, held_back: impl Fn(u32) -> bool) -> Option<u32> {
        for _ in 0..self.all.len() {
            self.hand = if self.hand + 1 < self.all.len() { self.hand + 1 } else { 0 };
            let node = self.all[self.hand].node;
            if self.is_free(node, frame) && !held_back(node) {
                return Some(node);
            }
        }
        None
    }
}

impl Drop for Residents {
    fn drop(&mut self) {
        self.memory.release(self.bytes);
    }
}
