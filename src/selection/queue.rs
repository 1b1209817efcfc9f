//! The circular event queue: what is due when, in buckets that are read in sequence.
//!
//! Zach & Karner (2003, section 3, "Queue Management") keep lists of nodes in an array that is used as a circular
//! buffer, one list a frame. This queue keeps their interface and differs in five ways, each for speed:
//!
//! * An event carries what its test needs (sphere and error), so a bucket streams through the cache instead of
//!   missing it once a node.
//! * Time is continuous, in ticks of a small part of a frame of a clock, and the buffer is *geometric*: level `l`
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

mod event;
mod pool;
mod well_formed;
mod wheel;

use vertex_tree::{Bounds, prefetch};

pub(crate) use self::event::ticks;
pub use self::event::{DUE, Event, HORIZON, TICKS_PER_FRAME};
use self::pool::{Bucket, CHUNK, Pool};
use self::wheel::{LEVELS, SLOTS, Wheel};

use crate::in_play::{Kind, Slot};

/// One clock of a queue.
pub(crate) struct OnClock<'a> {
    wheel: &'a mut Wheel,
    pool: &'a mut Pool,
    stored: &'a mut usize,
}

impl OnClock<'_> {
    #[inline(always)]
    pub fn schedule(&mut self, frames: f64, event: Event) {
        // Rounded down, as the clock's time is to its tick; `as` saturates.
        self.schedule_ticks((frames * TICKS_PER_FRAME) as u32, event);
    }

    /// Schedules an event that must not come up more than so many ticks after the one that the clock is in.
    #[inline(always)]
    pub fn schedule_ticks(&mut self, ticks: u32, event: Event) {
        *self.stored += 1;
        self.wheel.push(self.pool, ticks, event);
    }
}

/// The queue. Times are frames on an [`Odometer`](crate::motion::Odometer), one for each clock.
#[derive(Debug)]
pub struct EventQueue {
    wheels: Vec<Wheel>,
    pool: Pool,
    /// Events to return at every advance.
    pressing: Bucket,
    /// Buckets whose time has come, none of them empty.
    ripe: Vec<Bucket>,
    /// Kept between sweeps for its allocation.
    swept: Vec<Event>,
    tickets: Vec<u16>,
    /// Events in the buckets, cancelled ones included.
    stored: usize,
    /// An upper bound on the cancelled ones among them: how often something was cancelled, less what has been dropped. It
    /// is more than those that there are by the events that had come up, for nodes that were then changed.
    cancelled: usize,
    /// Cancelled events that have been dropped.
    dropped: usize,
    /// The bucket, through all wheels, that the sweep under way comes to next, and `cancelled + dropped` when it began.
    next_swept: usize,
    cancels_before: usize,
}

impl EventQueue {
    /// An empty queue, all its clocks at time 0.
    #[must_use]
    pub fn new(clocks: usize) -> Self {
        Self {
            wheels: (0..clocks).map(|_| Wheel::new()).collect(),
            pool: Pool::new(),
            pressing: 0,
            ripe: Vec::new(),
            swept: Vec::new(),
            tickets: Vec::new(),
            stored: 0,
            cancelled: 0,
            dropped: 0,
            next_swept: 0,
            cancels_before: 0,
        }
    }

    /// An upper bound on the number of scheduled events.
    #[must_use]
    pub fn len(&self) -> usize {
        self.stored
    }

    /// A lower bound on it.
    pub(crate) fn least_len(&self) -> usize {
        self.stored.saturating_sub(self.cancelled)
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
        Event::new(bounds, slot, self.tickets[slot.index()], kind)
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
    pub fn schedule(&mut self, clock: usize, frames: f64, event: Event) {
        self.on(clock).schedule(frames, event);
    }

    /// For scheduling many events on one clock.
    #[inline(always)]
    pub(crate) fn on(&mut self, clock: usize) -> OnClock<'_> {
        OnClock { wheel: &mut self.wheels[clock], pool: &mut self.pool, stored: &mut self.stored }
    }

    /// Schedules an event for the next advance of any clock and every advance after it, moved or not, until it is
    /// cancelled by a status change or comes up: for a change that was refused and is still wanted.
    pub fn press(&mut self, event: Event) {
        self.stored += 1;
        self.pool.push(&mut self.pressing, event);
    }

    /// Cancels whatever is scheduled for a node of which nothing is likely to be: its event has come up.
    #[inline]
    pub fn retire(&mut self, slot: Slot) {
        if slot.index() < self.tickets.len() && self.is_last_ticket(slot) {
            self.begin_anew(slot);
        }
    }

    /// Cancels whatever is scheduled for a node.
    #[inline]
    pub fn cancel(&mut self, slot: Slot) {
        if slot.index() >= self.tickets.len() {
            return;
        }
        self.cancelled += 1;
        // While half of what is stored may be garbage, it is swept bucket by bucket, so that no frame pays for all of it.
        if self.is_last_ticket(slot) {
            self.begin_anew(slot);
        } else if self.cancelled > self.stored / 2 + 1024 {
            self.sweep_on();
        }
    }

    /// Gives a node the next ticket. Whether that is the last.
    #[inline(always)]
    fn is_last_ticket(&mut self, slot: Slot) -> bool {
        let ticket = &mut self.tickets[slot.index()];
        *ticket += 1;
        *ticket == u16::MAX
    }

    /// A ticket that comes round could bring an old event back to life. No event has the last ticket, so that now a sweep drops
    /// all those of the node, and it can begin with the first again.
    #[cold]
    fn begin_anew(&mut self, slot: Slot) {
        self.sweep_all();
        self.tickets[slot.index()] = 0;
    }

    /// Sweeps the next bucket that is not empty.
    #[cold]
    fn sweep_on(&mut self) {
        let buckets = self.wheels.len() * LEVELS * SLOTS as usize;
        if self.next_swept == 0 {
            self.cancels_before = self.cancelled + self.dropped;
        }
        while self.next_swept < buckets {
            let at = self.next_swept;
            self.next_swept += 1;
            let wheel = &mut self.wheels[at / (LEVELS * SLOTS as usize)];
            let bucket = &mut wheel.levels.as_flattened_mut()[at % (LEVELS * SLOTS as usize)];
            if *bucket != 0 {
                let dropped = sweep(&mut self.pool, bucket, &mut self.swept, &self.tickets);
                self.drop_cancelled(dropped);
                return;
            }
        }
        // Once round: what was cancelled before is gone, so no more can be left than have been cancelled since.
        self.next_swept = 0;
        self.cancelled = self.cancelled + self.dropped - self.cancels_before;
    }

    #[cold]
    fn sweep_all(&mut self) {
        let Self { wheels, pool, pressing, ripe, swept, tickets, .. } = self;
        let buckets = wheels.iter_mut().flat_map(|wheel| wheel.levels.as_flattened_mut());
        let all = buckets.chain(&mut *ripe).chain([pressing]);
        let dropped = all.map(|bucket| sweep(pool, bucket, swept, tickets)).sum();
        ripe.retain(|&bucket| bucket != 0);
        self.drop_cancelled(dropped);
        self.cancelled = 0;
        self.next_swept = 0;
    }

    /// So many cancelled events are no longer stored.
    #[inline(always)]
    fn drop_cancelled(&mut self, count: usize) {
        self.stored -= count;
        self.cancelled = self.cancelled.saturating_sub(count);
        self.dropped += count;
    }

    /// Reads the tickets of nodes into the cache that are about to be cancelled or given events.
    pub(crate) fn prefetch(&self, slot: Slot) {
        prefetch(&self.tickets, slot.index());
    }

    /// Whether something has come up.
    #[inline]
    #[must_use]
    pub fn is_ripe(&self) -> bool {
        !self.ripe.is_empty()
    }

    /// Lets the pressing events come up.
    pub fn take_pressing(&mut self) {
        let pressing = std::mem::take(&mut self.pressing);
        if pressing != 0 {
            self.ripe.push(pressing);
        }
    }

    /// Moves a clock to `now`, and lets every event on it come up that must be tested by then, and whatever is pressing.
    pub fn advance(&mut self, clock: usize, now: f64) {
        self.take_pressing();
        self.wheels[clock].advance(now, &mut self.ripe);
    }

    /// Whether no event waits on a clock.
    #[must_use]
    pub fn is_idle(&self, clock: usize) -> bool {
        self.wheels[clock].is_empty()
    }

    /// Calls `f` with every event that an advance of a clock to `now` would let come up.
    pub(crate) fn due_within(&self, clock: usize, now: f64, mut f: impl FnMut(&Event)) {
        self.wheels[clock].due_within(now).for_each(|bucket| self.read(bucket, &mut f));
    }

    /// Calls `f` with every event that comes up at the next advance of any clock, moved or not.
    pub(crate) fn pressing(&self, mut f: impl FnMut(&Event)) {
        self.read(self.pressing, &mut f);
    }

    fn read(&self, bucket: Bucket, f: &mut impl FnMut(&Event)) {
        self.pool.read(bucket, |event| {
            if self.is_valid(event) {
                f(event);
            }
        });
    }

    /// Lets every event on one clock come up: for a motion that its speeds do not cover.
    pub fn take_clock(&mut self, clock: usize) {
        self.wheels[clock].take_all(&mut self.ripe);
    }

    /// Lets every event come up: for a motion that no declared speed covers.
    pub fn take_all(&mut self) {
        self.take_pressing();
        for clock in 0..self.wheels.len() {
            self.take_clock(clock);
        }
    }

    /// Removes some of the events that have come up and returns how many; 0 when there are no more. They are the first
    /// ones in `due`. Those that are scheduled meanwhile do not come up before their clock advances again.
    #[inline(always)]
    pub fn next_due(&mut self, due: &mut [Event; DUE]) -> usize {
        let Self { ripe, pool, tickets, stored, cancelled, dropped, .. } = self;
        let mut count = 0;
        while count < DUE
            && let Some(bucket) = ripe.last_mut()
        {
            let is_valid = |event: &Event| tickets[event.slot.index()] == event.ticket();
            let (now, taken) = pool.take(bucket, due, count, is_valid);
            *stored -= taken;
            *cancelled = cancelled.saturating_sub(taken - (now - count));
            *dropped += taken - (now - count);
            count = now;
            if *bucket == 0 {
                ripe.pop();
                if let Some(&next) = ripe.last() {
                    pool.prefetch_chunk((next - 1) / CHUNK);
                }
            }
        }
        count
    }
}

/// Drops the cancelled events in a bucket and returns how many there were. `kept` is used for its allocation.
fn sweep(pool: &mut Pool, bucket: &mut Bucket, kept: &mut Vec<Event>, tickets: &[u16]) -> usize {
    kept.clear();
    let (mut due, mut all) = ([Event::BLANK; DUE], 0);
    while *bucket != 0 {
        let is_valid = |event: &Event| tickets[event.slot.index()] == event.ticket();
        let (count, taken) = pool.take(bucket, &mut due, 0, is_valid);
        kept.extend_from_slice(&due[..count]);
        all += taken;
    }
    kept.iter().for_each(|&event| pool.push(bucket, event));
    all - kept.len()
}

#[cfg(test)]
mod tests;
