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

use vertex_tree::{Bounds, NONE, NodeId};

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

/// Events in a chunk.
const CHUNK: usize = 15;

/// Part of a bucket: 512 bytes.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
struct Chunk {
    events: [Event; CHUNK],
    len: u32,
    /// The next chunk of the bucket, or of the free ones; [`NONE`] after the last.
    next: u32,
}

/// Where all buckets keep their events. Chunks are used again last in, first out: what is written next was read just
/// before and is in the nearest cache, and once there are enough of them nothing is allocated any more.
#[derive(Debug)]
struct Pool {
    chunks: Vec<Chunk>,
    free: u32,
}

impl Pool {
    /// Appends an event to the bucket whose newest chunk is `bucket`.
    #[inline(always)]
    fn push(&mut self, bucket: &mut u32, event: Event) {
        if let Some(chunk) = self.chunks.get_mut(*bucket as usize)
            && let Some(place) = chunk.events.get_mut(chunk.len as usize)
        {
            *place = event;
            chunk.len += 1;
        } else {
            self.push_chunk(bucket, event);
        }
    }

    fn push_chunk(&mut self, bucket: &mut u32, event: Event) {
        let new = self.free;
        if let Some(chunk) = self.chunks.get_mut(new as usize) {
            self.free = std::mem::replace(&mut chunk.next, *bucket);
            chunk.events[0] = event;
            chunk.len = 1;
            *bucket = new;
        } else {
            self.chunks.push(Chunk { events: [event; CHUNK], len: 1, next: *bucket });
            *bucket = self.chunks.len() as u32 - 1;
        }
    }

    /// Moves the events of a bucket for which `keep` says so to `due`, and empties it. Returns how many there were.
    #[inline(always)]
    fn take(&mut self, bucket: &mut u32, due: &mut Vec<Event>, keep: impl Fn(&Event) -> bool) -> usize {
        let mut count = 0;
        while let Some(chunk) = self.chunks.get_mut(*bucket as usize) {
            let events = &chunk.events[..chunk.len as usize];
            count += events.len();
            due.reserve(events.len());
            for event in events {
                if keep(event) {
                    due.push(*event);
                }
            }
            let next = std::mem::replace(&mut chunk.next, self.free);
            self.free = std::mem::replace(bucket, next);
        }
        count
    }
}

/// Buckets of events on one clock.
#[derive(Debug)]
struct Wheel {
    /// `levels[l][s]` is the newest chunk of the events whose deadline tick, divided by `2^l`, is `s` modulo 16.
    levels: [[u32; SLOTS as usize]; LEVELS],
    /// For each level, a bit for each slot that may hold events.
    occupied: [u16; LEVELS],
    /// The tick that the clock is in.
    tick: u64,
}

impl Wheel {
    fn new() -> Self {
        Self { levels: [[NONE; SLOTS as usize]; LEVELS], occupied: [0; LEVELS], tick: 0 }
    }

    #[inline(always)]
    fn push(&mut self, pool: &mut Pool, now: f64, frames: f64, event: Event) {
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
        pool.push(&mut self.levels[level][slot], event);
    }

    /// Calls `take` with each bucket that the clock reaches on its way to `now`.
    fn advance(&mut self, now: f64, take: &mut dyn FnMut(&mut u32)) {
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
                self.take(level, (slot % SLOTS) as usize, take);
            }
        }
    }

    fn take(&mut self, level: usize, slot: usize, take: &mut dyn FnMut(&mut u32)) {
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
    pool: Pool,
    /// Events to return at every advance.
    pressing: u32,
    /// Kept between sweeps for its allocation.
    swept: Vec<Event>,
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
            pool: Pool { chunks: Vec::new(), free: NONE },
            pressing: NONE,
            swept: Vec::new(),
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
        self.wheels[clock].push(&mut self.pool, now, frames, event);
    }

    /// Schedules an event for the next advance of any clock and every advance after it, moved or not, until it is
    /// cancelled by a status change or comes up: for a change that was refused and is still wanted.
    pub fn press(&mut self, event: Event) {
        self.stored += 1;
        self.pool.push(&mut self.pressing, event);
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
        let Self { wheels, pool, pressing, swept, tickets, .. } = self;
        self.stored = 0;
        let buckets = wheels.iter_mut().flat_map(|wheel| wheel.levels.as_flattened_mut());
        for bucket in buckets.chain([pressing]) {
            swept.clear();
            pool.take(bucket, swept, |event| tickets[event.node.index()] == event.ticket());
            swept.iter().for_each(|&event| pool.push(bucket, event));
            self.stored += swept.len();
        }
        self.cancelled = 0;
    }

    /// Appends the pressing events to `due`, removing them.
    pub fn take_pressing(&mut self, due: &mut Vec<Event>) {
        let mut pressing = std::mem::replace(&mut self.pressing, NONE);
        self.with_wheels(due, |_, take| take(&mut pressing));
    }

    /// Moves a clock to `now` and appends to `due` every event on it that must be tested by then, removing it, and
    /// whatever is pressing.
    pub fn advance(&mut self, clock: usize, now: f64, due: &mut Vec<Event>) {
        self.take_pressing(due);
        self.with_wheels(due, |wheels, take| wheels[clock].advance(now, take));
    }

    /// Appends every event on one clock to `due`, removing it: for a motion that its speeds do not cover.
    pub fn take_clock(&mut self, clock: usize, due: &mut Vec<Event>) {
        self.with_wheels(due, |wheels, take| {
            for level in 0..LEVELS {
                for slot in 0..SLOTS as usize {
                    wheels[clock].take(level, slot, take);
                }
            }
        });
    }

    /// Appends every event to `due`, removing it: for a motion that no declared speed covers.
    pub fn take_all(&mut self, due: &mut Vec<Event>) {
        self.take_pressing(due);
        for clock in 0..self.wheels.len() {
            self.take_clock(clock, due);
        }
        self.cancelled = 0;
    }

    /// Calls `f` with the wheels and with what moves the valid events of a bucket to `due`.
    #[inline(always)]
    fn with_wheels(&mut self, due: &mut Vec<Event>, f: impl FnOnce(&mut [Wheel], &mut dyn FnMut(&mut u32))) {
        let Self { wheels, pool, tickets, stored, cancelled, .. } = self;
        f(wheels, &mut |bucket| {
            let before = due.len();
            let taken = pool.take(bucket, due, |event| tickets[event.node.index()] == event.ticket());
            *stored -= taken;
            *cancelled = cancelled.saturating_sub(taken - (due.len() - before));
        });
    }
}
