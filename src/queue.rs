//! The circular event queue: what is due when, in buckets that are read in sequence.
//!
//! Zach & Karner (2003, section 3, "Queue Management") keep lists of nodes in an array that is used as a circular
//! buffer, one list a frame. This queue keeps their interface and differs in four ways, each for speed:
//!
//! * An event carries what its test needs (sphere and error), so a bucket streams through the cache instead of
//!   missing it once a node.
//! * Time is continuous, in ticks of an eighth of a frame at full speed, and the buffer is *geometric*: level `l`
//!   is a ring of 16 slots, each `2^l` ticks wide. A deadline `t` ticks ahead goes to the level on which `t` is 8 to
//!   15 slots away, so it is known to an eighth of itself and the horizon is practically unlimited.
//! * There is no cascading from level to level: a slot is drained as soon as the clock reaches its start, so an
//!   event comes up to an eighth of its time early, is tested for nothing, and is scheduled again.
//! * Cancelling an event touches one byte. Each node has a *ticket*, each event the ticket of its node when it was
//!   scheduled; cancelling changes the node's, and events with an old ticket are dropped when they come up.
//!
//! Events of the tick that the clock is in come up at every advance until that tick has passed: their deadline may
//! lie anywhere in it.

use vertex_tree::{Bounds, NodeId};

/// Ticks in a frame at full speed. Ticks finer than a frame spare the nodes that are due within a few frames many
/// tests.
pub const TICKS_PER_FRAME: f64 = 8.0;

/// Slots a level. Deadlines go to the level on which they are at least half of this away.
const SLOTS: u64 = 16;
/// Level 40 reaches 2^43 ticks ahead. Whatever is further waits in its last slot, and is scheduled again.
const LEVELS: usize = 40;

/// Which status change an event waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The node is a boundary node: it may have to unfold.
    Unfold,
    /// The node is active and collapsible: it may have to fold.
    Fold,
}

/// A test that is due some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Sphere and error of the node.
    pub bounds: Bounds,
    /// The node to test.
    pub node: NodeId,
    /// What for.
    pub kind: Kind,
    ticket: u8,
}

/// The queue. Times are frames at full speed on an [`Odometer`](crate::motion::Odometer).
#[derive(Debug)]
pub struct EventQueue {
    /// `levels[l][s]` holds the events whose deadline tick, divided by `2^l`, is `s` modulo 16.
    levels: Vec<[Vec<Event>; SLOTS as usize]>,
    /// Events to return at every advance.
    pressing: Vec<Event>,
    /// The tick that the clock is in.
    tick: u64,
    tickets: Vec<u8>,
    /// Events in the buckets, cancelled ones included.
    stored: usize,
    /// An upper bound on the cancelled ones among them.
    cancelled: usize,
    /// Kept between frames for its allocation.
    drained: Vec<Event>,
}

impl EventQueue {
    /// An empty queue for nodes with numbers less than `node_limit`, at time 0.
    #[must_use]
    pub fn new(node_limit: u32) -> Self {
        Self {
            levels: (0..LEVELS).map(|_| std::array::from_fn(|_| Vec::new())).collect(),
            pressing: Vec::new(),
            tick: 0,
            tickets: vec![0; node_limit as usize],
            stored: 0,
            cancelled: 0,
            drained: Vec::new(),
        }
    }

    /// An upper bound on the number of scheduled events.
    #[must_use]
    pub fn len(&self) -> usize {
        self.stored
    }

    /// Whether no event is scheduled.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.stored == 0
    }

    /// Schedules a test of `node` that must not come later than `frames` after the clock's present time `now`,
    /// which is that of the last [`advance`](Self::advance).
    #[inline]
    pub fn schedule(&mut self, now: f64, frames: f64, node: NodeId, kind: Kind, bounds: Bounds) {
        let ticket = self.tickets[node.index()];
        self.push(now, frames, Event { bounds, node, kind, ticket });
    }

    /// Schedules an event again that has come up and led to nothing. Does not touch the node.
    #[inline]
    pub fn reschedule(&mut self, now: f64, frames: f64, event: Event) {
        self.push(now, frames, event);
    }

    #[inline]
    fn push(&mut self, now: f64, frames: f64, event: Event) {
        self.stored += 1;
        // Rounded down; `as` saturates, so that a bound of infinity is as late as can be.
        let deadline = ((now + frames).next_down() * TICKS_PER_FRAME) as u64;
        let ahead = deadline.saturating_sub(self.tick);
        if ahead == 0 {
            self.levels[0][(self.tick % SLOTS) as usize].push(event);
            return;
        }
        // On level l, `ahead` spans (ahead >> l) slots, and one more where it straddles their borders: at most 15.
        let bits = 64 - ahead.leading_zeros() as usize;
        let level = bits.saturating_sub(4);
        let (level, deadline) = if level < LEVELS {
            (level, deadline)
        } else {
            (LEVELS - 1, self.tick + ((SLOTS - 2) << (LEVELS - 1)))
        };
        let (mut level, mut slot) = (level, deadline >> level);
        if slot - (self.tick >> level) >= SLOTS {
            level += 1;
            slot = deadline >> level;
        }
        self.levels[level][(slot % SLOTS) as usize].push(event);
    }

    /// Schedules a test of `node` for the next advance and every advance after it, moved or not, until it is
    /// cancelled by a status change or comes up: for a change that was refused and is still wanted.
    pub fn press(&mut self, node: NodeId, kind: Kind, bounds: Bounds) {
        self.stored += 1;
        self.pressing.push(Event { bounds, node, kind, ticket: self.tickets[node.index()] });
    }

    /// Cancels whatever is scheduled for `node`.
    #[inline]
    pub fn cancel(&mut self, node: NodeId) {
        let ticket = &mut self.tickets[node.index()];
        *ticket = ticket.wrapping_add(1);
        let wrapped = *ticket == 0;
        self.cancelled += 1;
        // A ticket that has come round could bring an old event back to life: sweep before it can. Otherwise sweep
        // when half of what is stored may be garbage: a constant share of the work that put it there.
        if wrapped || self.cancelled > self.stored / 2 + 1024 {
            self.sweep();
        }
    }

    fn sweep(&mut self) {
        let tickets = &self.tickets;
        self.stored = 0;
        for bucket in self.levels.iter_mut().flatten().chain([&mut self.pressing]) {
            bucket.retain(|event| tickets[event.node.index()] == event.ticket);
            self.stored += bucket.len();
        }
        self.cancelled = 0;
    }

    /// Moves the clock to `now` and appends to `due` every event that must be tested by then, removing it. Without
    /// motion (`now` as before) only pressing events come up: nothing else can have changed.
    pub fn advance(&mut self, now: f64, moved: bool, due: &mut Vec<Event>) {
        self.take_pressing(due);
        if !moved {
            return;
        }
        let before = self.tick;
        let after = (now * TICKS_PER_FRAME) as u64;
        debug_assert!(after >= before, "the clock went back from tick {before} to {after}");
        self.tick = after;
        for level in 0..LEVELS {
            let (first, last) = (before >> level, after >> level);
            // The slot of the present tick is drained every time, that of a wider level once, when it is reached.
            let first = if level == 0 { first } else { first + 1 };
            if first > last {
                // Wider levels have not moved either.
                break;
            }
            for slot in first..=last.min(first + SLOTS - 1) {
                self.take(level, (slot % SLOTS) as usize, due);
            }
        }
    }

    /// Appends every event to `due`, removing it: for a motion that no declared speed covers.
    pub fn take_all(&mut self, due: &mut Vec<Event>) {
        self.take_pressing(due);
        for level in 0..LEVELS {
            for slot in 0..SLOTS as usize {
                self.take(level, slot, due);
            }
        }
        self.cancelled = 0;
    }

    fn take_pressing(&mut self, due: &mut Vec<Event>) {
        let mut drained = std::mem::take(&mut self.drained);
        std::mem::swap(&mut drained, &mut self.pressing);
        self.append_valid(&mut drained, due);
        self.drained = drained;
    }

    fn take(&mut self, level: usize, slot: usize, due: &mut Vec<Event>) {
        if self.levels[level][slot].is_empty() {
            return;
        }
        // Swapped rather than taken, so that allocations circulate.
        let mut drained = std::mem::take(&mut self.drained);
        std::mem::swap(&mut drained, &mut self.levels[level][slot]);
        self.append_valid(&mut drained, due);
        self.drained = drained;
    }

    fn append_valid(&mut self, drained: &mut Vec<Event>, due: &mut Vec<Event>) {
        self.stored -= drained.len();
        let before = due.len();
        due.extend(drained.iter().filter(|e| self.tickets[e.node.index()] == e.ticket));
        self.cancelled = self.cancelled.saturating_sub(drained.len() - (due.len() - before));
        drained.clear();
    }
}
