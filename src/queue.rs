//! The circular event queue: what is due when, in buckets that are read in sequence.
//!
//! Zach & Karner (2003, section 3, "Queue Management") keep lists of nodes in an array that is used as a circular
//! buffer, one list a frame. This queue keeps their interface and differs in five ways, each for speed:
//!
//! * An event carries what its test needs (sphere and error), so a bucket streams through the cache instead of
//!   missing it once a node.
//! * Time is continuous, in ticks of a small part of a frame at full speed, and the buffer is *geometric*: level `l`
//!   is a ring of 16 slots, each `2^l` ticks wide. A deadline `t` ticks ahead goes to the level on which `t` is 8 to
//!   15 slots away, so it is known to an eighth of itself and the horizon is practically unlimited.
//! * There is no cascading from level to level: a slot is drained as soon as the clock reaches its start, so an
//!   event comes up to an eighth of its time early, is tested for nothing, and is scheduled again.
//! * There can be several clocks, each with a wheel of its own; an event waits on one of them (see
//!   [`refine::event`](crate::refine::event) for what they measure).
//! * Cancelling an event touches one byte. Each node has a *ticket*, each event the ticket of its node when it was
//!   scheduled; cancelling changes the node's, and events with an old ticket are dropped when they come up.
//!
//! Events of the tick that a clock is in come up at every advance until that tick has passed: their deadline may
//! lie anywhere in it.

use vertex_tree::{Bounds, NodeId};

/// Ticks in a frame at full speed. A camera far below full speed still has ticks that are finer than its frames.
pub const TICKS_PER_FRAME: f64 = 512.0;

/// Slots a level. Deadlines go to the level on which they are at least half of this away.
const SLOTS: u64 = 16;
/// Level 44 reaches 2^47 ticks ahead. Whatever is further waits in its last slot, and is scheduled again.
const LEVELS: usize = 44;

/// Which status change an event waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The node is a boundary node: it may have to unfold.
    Unfold,
    /// The node is active and collapsible: it may have to fold.
    Fold,
}

/// A test that is due some time. Half a cache line.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(32))]
pub struct Event {
    /// Sphere and error of the node.
    pub bounds: Bounds,
    /// The node to test.
    pub node: NodeId,
    /// Twice the ticket, plus 1 where it waits for folding. No member is narrower than its neighbours, or copying an
    /// event would be several moves.
    tag: u32,
    _reserved: u32,
}

impl Event {
    /// What the test is for.
    #[inline(always)]
    #[must_use]
    pub fn kind(&self) -> Kind {
        if self.tag & 1 == 0 { Kind::Unfold } else { Kind::Fold }
    }

    #[inline(always)]
    fn ticket(&self) -> u8 {
        (self.tag >> 1) as u8
    }
}

/// Buckets of events on one clock.
#[derive(Debug)]
struct Wheel {
    /// `levels[l][s]` holds the events whose deadline tick, divided by `2^l`, is `s` modulo 16.
    levels: Vec<[Vec<Event>; SLOTS as usize]>,
    /// For each level, a bit for each slot that may hold events.
    occupied: [u16; LEVELS],
    /// The tick that the clock is in.
    tick: u64,
}

impl Wheel {
    fn new() -> Self {
        Self {
            levels: (0..LEVELS).map(|_| std::array::from_fn(|_| Vec::new())).collect(),
            occupied: [0; LEVELS],
            tick: 0,
        }
    }

    #[inline(always)]
    fn push(&mut self, now: f64, frames: f64, event: Event) {
        // Rounded down; `as` saturates, so that a bound of infinity is as late as can be.
        let deadline = ((now + frames).next_down() * TICKS_PER_FRAME) as u64;
        let ahead = deadline.saturating_sub(self.tick);
        // On level l, `ahead` spans (ahead >> l) slots, and one more where it straddles their borders: at most 15.
        let level = (64 - ahead.leading_zeros() as usize).saturating_sub(4);
        let (mut level, deadline) = if level < LEVELS {
            (level, self.tick + ahead)
        } else {
            (LEVELS - 1, self.tick + ((SLOTS - 2) << (LEVELS - 1)))
        };
        level += usize::from((deadline >> level) - (self.tick >> level) >= SLOTS);
        let slot = ((deadline >> level) % SLOTS) as usize;
        self.occupied[level] |= 1 << slot;
        self.levels[level][slot].push(event);
    }

    /// Calls `take` with each bucket that the clock reaches on its way to `now`.
    fn advance(&mut self, now: f64, mut take: impl FnMut(&mut Vec<Event>)) {
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
            if self.occupied[level] == 0 {
                continue;
            }
            for slot in first..=last.min(first + SLOTS - 1) {
                self.take(level, (slot % SLOTS) as usize, &mut take);
            }
        }
    }

    fn take(&mut self, level: usize, slot: usize, take: &mut impl FnMut(&mut Vec<Event>)) {
        if self.occupied[level] >> slot & 1 == 1 {
            self.occupied[level] &= !(1 << slot);
            take(&mut self.levels[level][slot]);
        }
    }
}

/// The queue. Times are frames at full speed on an [`Odometer`](crate::motion::Odometer), one for each clock.
#[derive(Debug)]
pub struct EventQueue {
    wheels: Vec<Wheel>,
    /// Events to return at every advance.
    pressing: Vec<Event>,
    tickets: Vec<u8>,
    /// Events in the buckets, cancelled ones included.
    stored: usize,
    /// An upper bound on the cancelled ones among them.
    cancelled: usize,
}

impl EventQueue {
    /// An empty queue for nodes with numbers less than `node_limit`, all its clocks at time 0.
    #[must_use]
    pub fn new(node_limit: u32, clocks: usize) -> Self {
        Self {
            wheels: (0..clocks).map(|_| Wheel::new()).collect(),
            pressing: Vec::new(),
            tickets: vec![0; node_limit as usize],
            stored: 0,
            cancelled: 0,
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

    /// An event for `node`, to be scheduled; void once something cancels it.
    #[inline]
    #[must_use]
    pub fn event(&self, node: NodeId, kind: Kind, bounds: Bounds) -> Event {
        let tag = u32::from(self.tickets[node.index()]) << 1 | u32::from(kind == Kind::Fold);
        Event { bounds, node, tag, _reserved: 0 }
    }

    /// Whether nothing has cancelled an event since it was made.
    #[inline]
    #[must_use]
    pub fn is_valid(&self, event: &Event) -> bool {
        self.tickets[event.node.index()] == event.ticket()
    }

    /// Schedules an event that must not come up later than `frames` after the clock's present time `now`, which is
    /// that of the last [`advance`](Self::advance). Does not touch the node, so that an event that has come up and led
    /// to nothing can be scheduled again in passing.
    #[inline(always)]
    pub fn schedule(&mut self, clock: usize, now: f64, frames: f64, event: Event) {
        self.stored += 1;
        self.wheels[clock].push(now, frames, event);
    }

    /// Schedules an event for the next advance of any clock and every advance after it, moved or not, until it is
    /// cancelled by a status change or comes up: for a change that was refused and is still wanted.
    pub fn press(&mut self, event: Event) {
        self.stored += 1;
        self.pressing.push(event);
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

    #[cold]
    fn sweep(&mut self) {
        let tickets = &self.tickets;
        self.stored = 0;
        let buckets = self.wheels.iter_mut().flat_map(|wheel| wheel.levels.iter_mut().flatten());
        for bucket in buckets.chain([&mut self.pressing]) {
            bucket.retain(|event| tickets[event.node.index()] == event.ticket());
            self.stored += bucket.len();
        }
        self.cancelled = 0;
    }

    /// Appends the pressing events to `due`, removing them.
    pub fn take_pressing(&mut self, due: &mut Vec<Event>) {
        drain(&mut self.pressing, &self.tickets, &mut self.stored, &mut self.cancelled, due);
    }

    /// Moves a clock to `now` and appends to `due` every event on it that must be tested by then, removing it, and
    /// whatever is pressing.
    pub fn advance(&mut self, clock: usize, now: f64, due: &mut Vec<Event>) {
        self.take_pressing(due);
        let Self { wheels, tickets, stored, cancelled, .. } = self;
        wheels[clock].advance(now, |bucket| drain(bucket, tickets, stored, cancelled, due));
    }

    /// Appends every event on one clock to `due`, removing it: for a motion that its speeds do not cover.
    pub fn take_clock(&mut self, clock: usize, due: &mut Vec<Event>) {
        let Self { wheels, tickets, stored, cancelled, .. } = self;
        let wheel = &mut wheels[clock];
        for level in 0..LEVELS {
            for slot in 0..SLOTS as usize {
                wheel.take(level, slot, &mut |bucket| drain(bucket, tickets, stored, cancelled, due));
            }
        }
    }

    /// Appends every event to `due`, removing it: for a motion that no declared speed covers.
    pub fn take_all(&mut self, due: &mut Vec<Event>) {
        self.take_pressing(due);
        for clock in 0..self.wheels.len() {
            self.take_clock(clock, due);
        }
        self.cancelled = 0;
    }
}

/// Moves the events of a bucket that are still valid to `due`. The bucket keeps its allocation.
fn drain(
    bucket: &mut Vec<Event>,
    tickets: &[u8],
    stored: &mut usize,
    cancelled: &mut usize,
    due: &mut Vec<Event>,
) {
    *stored -= bucket.len();
    let before = due.len();
    due.reserve(bucket.len());
    for event in &*bucket {
        if tickets[event.node.index()] == event.ticket() {
            due.push(*event);
        }
    }
    *cancelled = cancelled.saturating_sub(bucket.len() - (due.len() - before));
    bucket.clear();
}
