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
//! * Cancelling an event touches two bytes. Each node in play has a *ticket*, each event the ticket of its node when it
//!   was scheduled; cancelling changes the node's, and events with an old ticket are dropped when they come up.
//!
//! Nodes are known by the slots of their records in the [`Front`](crate::front::Front), so tickets are as many as there
//! are nodes in play and stay in a near cache.
//!
//! Events of the tick that a clock is in come up at every advance until that tick has passed: their deadline may
//! lie anywhere in it.

use vertex_tree::{Bounds, prefetch};

use crate::front::Slot;

/// Ticks in a frame at full speed. A camera far below full speed still has ticks that are finer than its frames.
pub const TICKS_PER_FRAME: f64 = 512.0;

/// Slots a level. Deadlines go to the level on which they are at least half of this away.
const SLOTS: u64 = 16;
/// Level 28 reaches 2^32 ticks ahead, which is further than any deadline: those are `u32` ticks ahead, and what is
/// further is scheduled again.
const LEVELS: usize = 29;
/// The furthest that an event is scheduled ahead, in ticks: 4 million frames at full speed.
pub const HORIZON: u32 = 1 << 31;

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
    pub slot: Slot,
    /// Twice the ticket, plus 1 where it waits for folding. No member is narrower than its neighbours, or copying an
    /// event would be several moves.
    tag: u32,
    _reserved: u32,
}

impl Event {
    const BLANK: Self = Self {
        bounds: Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 },
        slot: Slot::NONE,
        tag: 0,
        _reserved: 0,
    };

    /// What the test is for.
    #[inline(always)]
    #[must_use]
    pub fn kind(&self) -> Kind {
        if self.tag & 1 == 0 { Kind::Unfold } else { Kind::Fold }
    }

    #[inline(always)]
    fn ticket(&self) -> u16 {
        (self.tag >> 1) as u16
    }
}

/// Events in a chunk.
const CHUNK: u32 = 16;

/// A list of chunks of events, of which all but the newest are full: the place after its last event, counted through
/// all chunks of the pool; 0 while it is empty.
///
/// To append is one store where the event goes and one here, in an array that is small enough to stay near. A count in
/// the chunk itself would be a read that misses the cache, for every event.
type Bucket = u32;

/// Where all buckets keep their events. Chunks are used again last in, first out: what is written next was read just
/// before and is in the nearest cache, and once there are enough of them nothing is allocated any more.
#[derive(Debug)]
struct Pool {
    /// The first one is not used, as place 0 says that a bucket is empty.
    chunks: Vec<[Event; CHUNK as usize]>,
    /// For each chunk, the one before it in its bucket, or 0.
    previous: Vec<u32>,
    free: Vec<u32>,
}

impl Pool {
    fn new() -> Self {
        Self { chunks: vec![[Event::BLANK; CHUNK as usize]], previous: vec![0], free: Vec::new() }
    }

    #[inline(always)]
    fn push(&mut self, bucket: &mut Bucket, event: Event) {
        if bucket.is_multiple_of(CHUNK) {
            self.open(bucket);
        }
        self.chunks[(*bucket / CHUNK) as usize][(*bucket % CHUNK) as usize] = event;
        *bucket += 1;
    }

    /// Adds an empty chunk to a bucket.
    #[inline(never)]
    fn open(&mut self, bucket: &mut Bucket) {
        let previous = bucket.saturating_sub(1) / CHUNK;
        let chunk = self.free.pop().unwrap_or_else(|| {
            self.chunks.push([Event::BLANK; CHUNK as usize]);
            self.previous.push(0);
            self.chunks.len() as u32 - 1
        });
        self.previous[chunk as usize] = previous;
        *bucket = chunk * CHUNK;
    }

    /// Moves the events of a bucket for which `keep` says so to `due`, and empties it. Returns how many there were.
    #[inline(always)]
    fn take(&mut self, bucket: &mut Bucket, due: &mut Vec<Event>, keep: impl Fn(&Event) -> bool) -> usize {
        let mut count = 0;
        let mut end = std::mem::take(bucket);
        while end != 0 {
            let chunk = (end - 1) / CHUNK;
            let previous = self.previous[chunk as usize];
            prefetch(&self.chunks, previous as usize);
            let events = &self.chunks[chunk as usize][..(end - chunk * CHUNK) as usize];
            count += events.len();
            for event in events {
                if keep(event) {
                    due.push(*event);
                }
            }
            self.free.push(chunk);
            end = if previous == 0 { 0 } else { (previous + 1) * CHUNK };
        }
        count
    }
}

/// Buckets of events on one clock.
#[derive(Debug)]
struct Wheel {
    /// `levels[l][s]` has the events whose deadline tick, divided by `2^l`, is `s` modulo 16.
    levels: [[Bucket; SLOTS as usize]; LEVELS],
    /// For each level, a bit for each slot that may hold events.
    occupied: [u16; LEVELS],
    /// The tick that the clock is in.
    tick: u64,
}

impl Wheel {
    fn new() -> Self {
        Self { levels: [[0; SLOTS as usize]; LEVELS], occupied: [0; LEVELS], tick: 0 }
    }

    /// Puts an event where it comes up before the clock is more than `ahead` ticks further.
    #[inline(always)]
    fn push(&mut self, pool: &mut Pool, ahead: u32, event: Event) {
        let ahead = ahead.min(HORIZON);
        let deadline = self.tick + u64::from(ahead);
        // On level l, `ahead` spans (ahead >> l) slots, and one more where it straddles their borders: at most 15.
        let mut level = (32 - ahead.leading_zeros() as usize).saturating_sub(4);
        level += usize::from((deadline >> level) - (self.tick >> level) >= SLOTS);
        let slot = (deadline >> level) % SLOTS;
        self.occupied[level] |= 1 << slot;
        pool.push(&mut self.levels[level][slot as usize], event);
    }

    /// Calls `take` with each bucket that the clock reaches on its way to `now`.
    fn advance(&mut self, now: f64, take: &mut dyn FnMut(&mut Bucket)) {
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

    fn take(&mut self, level: usize, slot: usize, take: &mut dyn FnMut(&mut Bucket)) {
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
    pressing: Bucket,
    /// Kept between sweeps for its allocation.
    swept: Vec<Event>,
    tickets: Vec<u16>,
    /// Events in the buckets, cancelled ones included.
    stored: usize,
    /// An upper bound on the cancelled ones among them.
    cancelled: usize,
}

impl EventQueue {
    /// An empty queue, all its clocks at time 0.
    #[must_use]
    pub fn new(clocks: usize) -> Self {
        Self {
            wheels: (0..clocks).map(|_| Wheel::new()).collect(),
            pool: Pool::new(),
            pressing: 0,
            swept: Vec::new(),
            tickets: Vec::new(),
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

    /// An event for a node, to be scheduled; void once something cancels it.
    #[inline]
    #[must_use]
    pub fn event(&mut self, slot: Slot, kind: Kind, bounds: Bounds) -> Event {
        if self.tickets.len() <= slot.index() {
            self.tickets.resize(slot.index() + 1, 0);
        }
        let tag = u32::from(self.tickets[slot.index()]) << 1 | u32::from(kind == Kind::Fold);
        Event { bounds, slot, tag, _reserved: 0 }
    }

    /// Whether nothing has cancelled an event since it was made.
    #[inline]
    #[must_use]
    pub fn is_valid(&self, event: &Event) -> bool {
        self.tickets[event.slot.index()] == event.ticket()
    }

    /// Schedules an event that must not come up later than `frames` after the clock's time at the last
    /// [`advance`](Self::advance). Does not touch the node, so that an event that has come up and led to nothing can be
    /// scheduled again in passing.
    #[inline(always)]
    pub fn schedule(&mut self, clock: usize, frames: f64, event: Event) {
        // Rounded down, as the clock's time is to its tick; `as` saturates.
        self.schedule_ticks(clock, (frames * TICKS_PER_FRAME) as u32, event);
    }

    /// Schedules an event that must not come up more than so many ticks after the one that the clock is in.
    #[inline(always)]
    pub fn schedule_ticks(&mut self, clock: usize, ticks: u32, event: Event) {
        self.stored += 1;
        self.wheels[clock].push(&mut self.pool, ticks, event);
    }

    /// Schedules an event for the next advance of any clock and every advance after it, moved or not, until it is
    /// cancelled by a status change or comes up: for a change that was refused and is still wanted.
    pub fn press(&mut self, event: Event) {
        self.stored += 1;
        self.pool.push(&mut self.pressing, event);
    }

    /// Cancels whatever is scheduled for a node.
    #[inline]
    pub fn cancel(&mut self, slot: Slot) {
        let Some(ticket) = self.tickets.get_mut(slot.index()) else { return };
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
            pool.take(bucket, swept, |event| tickets[event.slot.index()] == event.ticket());
            swept.iter().for_each(|&event| pool.push(bucket, event));
            self.stored += swept.len();
        }
        self.cancelled = 0;
    }

    /// Reads the tickets of nodes into the cache that are about to be cancelled or given events.
    pub(crate) fn prefetch(&self, slot: Slot) {
        prefetch(&self.tickets, slot.index());
    }

    /// Appends the pressing events to `due`, removing them.
    pub fn take_pressing(&mut self, due: &mut Vec<Event>) {
        let mut pressing = std::mem::take(&mut self.pressing);
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
    fn with_wheels(
        &mut self,
        due: &mut Vec<Event>,
        f: impl FnOnce(&mut [Wheel], &mut dyn FnMut(&mut Bucket)),
    ) {
        let Self { wheels, pool, tickets, stored, cancelled, .. } = self;
        f(wheels, &mut |bucket| {
            let before = due.len();
            let taken = pool.take(bucket, due, |event| tickets[event.slot.index()] == event.ticket());
            *stored -= taken;
            *cancelled = cancelled.saturating_sub(taken - (due.len() - before));
        });
    }
}
