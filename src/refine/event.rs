//! Event-driven refinement: a node is tested only when the camera could have changed the answer.
//!
//! After Zach & Karner (2003), with time bounds that never miss (see [`criterion`](crate::criterion)) on clocks
//! that run on distance travelled (see [`motion`](crate::motion)): exact at any speed of the camera.
//!
//! # Several clocks
//!
//! A clock advances by the larger of distance travelled over `rho` and angle turned over `omega`, so it is wasteful
//! for a camera that turns without moving as fast as declared, or moves without turning. Here several clocks differ in
//! the ratio of the two: clock `i` takes one of the declared speeds down by a power of two. All of them always run; an
//! event waits on the one that fit the motion of the frame in which it was scheduled. Each by itself never misses, so
//! the choice is free.

use multiversion::multiversion;
use vertex_tree::Bounds;

use super::{Flips, Frame};
use crate::filter::{Lens, Lenses, earliest};
use crate::front::Slot;
use crate::motion::{Motion, Odometer, Speed, Travel};
use crate::packed::{Block, LANES};
use crate::queue::{Event, EventQueue, Kind, TICKS_PER_FRAME};
use crate::view::View;

/// Clocks with `omega` taken down, and as many with `rho` taken down.
const SKEWED: i32 = 4;
const CLOCKS: usize = 2 * SKEWED as usize + 1;

pub(crate) struct EventDriven {
    queue: EventQueue,
    odometers: [Odometer; CLOCKS],
    /// The clock for new events.
    clock: usize,
    /// Nodes watched since the last frame's events were scheduled.
    fresh: Vec<Event>,
    /// Kept between frames for its allocation.
    due: Vec<Event>,
}

/// Declared speeds of a clock.
fn skew(speed: &Speed, clock: usize) -> Speed {
    let skew = clock as i32 - SKEWED;
    let share = f64::from(1_u32 << skew.unsigned_abs()).recip();
    if skew < 0 {
        Speed { omega: speed.omega * share, ..*speed }
    } else {
        Speed { rho: speed.rho * share, ..*speed }
    }
}

impl EventDriven {
    pub fn new() -> Self {
        Self {
            queue: EventQueue::new(CLOCKS),
            odometers: [Odometer::default(); CLOCKS],
            clock: SKEWED as usize,
            fresh: Vec::new(),
            due: Vec::new(),
        }
    }

    pub fn find(&mut self, frame: &Frame, before: &[View], flips: &mut Flips) {
        // Nodes may have come to be watched outside of a frame: the roots.
        self.settle(frame);
        self.due.clear();
        match frame.motion {
            Motion::Rest => self.queue.take_pressing(&mut self.due),
            Motion::Frames(_) => self.advance(frame, before),
            Motion::Unbounded => self.queue.take_all(&mut self.due),
        }
        if self.due.is_empty() {
            return;
        }
        flips.tests += self.due.len() as u64;
        let due = std::mem::take(&mut self.due);
        self.process(&due, frame, |event, _| match event.kind() {
            Kind::Unfold => flips.unfold.push(event.slot),
            Kind::Fold => flips.fold.push(event.slot),
        });
        self.due = due;
    }

    /// Moves all clocks, and chooses the one that the motion fits.
    fn advance(&mut self, frame: &Frame, before: &[View]) {
        let Some(travel) = Travel::between(before, frame.views) else {
            return self.queue.take_all(&mut self.due);
        };
        let mut least = f64::INFINITY;
        for clock in 0..CLOCKS {
            let speed = skew(&frame.speed, clock);
            match self.odometers[clock].advance_by(&speed, &travel) {
                Motion::Frames(frames) => {
                    self.queue.advance(clock, self.odometers[clock].now(), &mut self.due);
                    // What the clock allows for in the time that it takes this motion for, at a typical distance.
                    let share = speed.rho / frame.speed.rho + speed.omega / frame.speed.omega;
                    if frames * share < least {
                        least = frames * share;
                        self.clock = clock;
                    }
                }
                Motion::Rest => {}
                Motion::Unbounded => self.queue.take_clock(clock, &mut self.due),
            }
        }
    }

    /// Schedules the nodes that have come to be watched in this frame.
    pub fn settle(&mut self, frame: &Frame) {
        let mut fresh = std::mem::take(&mut self.fresh);
        fresh.retain(|event| self.queue.is_valid(event));
        let clock = self.clock;
        // A node that no view wants is active where another needs it: its time to fold is the next motion.
        self.process(&fresh, frame, |event, queue| queue.schedule_ticks(clock, 0, *event));
        fresh.clear();
        self.fresh = fresh;
    }

    /// Tests events, calls `flip` for those whose nodes should change and schedules the others.
    fn process(&mut self, due: &[Event], frame: &Frame, flip: impl FnMut(&Event, &mut EventQueue)) {
        let clock = self.clock;
        let bench = Bench { frame, speed: skew(&frame.speed, clock), clock };
        match Lenses::new(frame.criterion, frame.views) {
            Some(lenses) => process(due, lenses.as_slice(), &bench, &mut self.queue, flip),
            None => process_plainly(due, &bench, &mut self.queue, flip),
        }
    }

    pub fn watch(&mut self, slot: Slot, kind: Kind, bounds: Bounds) {
        self.fresh.push(self.queue.event(slot, kind, bounds));
    }

    pub fn unwatch(&mut self, slot: Slot) {
        self.queue.cancel(slot);
    }

    pub fn prefetch(&self, slot: Slot) {
        self.queue.prefetch(slot);
    }

    pub fn refused(&mut self, slot: Slot, kind: Kind, bounds: Bounds) {
        let event = self.queue.event(slot, kind, bounds);
        self.queue.press(event);
    }
}

/// What an event is tested with, and where it waits after that.
struct Bench<'a> {
    frame: &'a Frame<'a>,
    /// Of the clock.
    speed: Speed,
    clock: usize,
}

#[multiversion(targets("x86_64+avx2", "x86_64+sse4.1"))]
fn process(
    due: &[Event],
    lenses: &[Lens],
    bench: &Bench,
    queue: &mut EventQueue,
    mut flip: impl FnMut(&Event, &mut EventQueue),
) {
    let mut block = Block::EMPTY;
    for events in due.chunks(LANES) {
        for (lane, event) in events.iter().enumerate() {
            block.set(lane, &event.bounds, u32::from(event.kind() == Kind::Fold));
        }
        let frames = earliest(&block, lenses, &bench.speed);
        for (event, &frames) in events.iter().zip(&frames) {
            if frames > 0.0 {
                // To multiply by a power of two is exact.
                queue.schedule_ticks(bench.clock, (frames * TICKS_PER_FRAME as f32) as u32, *event);
            } else {
                test(event, bench, queue, &mut flip);
            }
        }
    }
}

/// Without the filter, for more views than it takes.
fn process_plainly(
    due: &[Event],
    bench: &Bench,
    queue: &mut EventQueue,
    mut flip: impl FnMut(&Event, &mut EventQueue),
) {
    for event in due {
        test(event, bench, queue, &mut flip);
    }
}

/// Tests one event in f64.
fn test(
    event: &Event,
    bench: &Bench,
    queue: &mut EventQueue,
    flip: &mut impl FnMut(&Event, &mut EventQueue),
) {
    let Bench { frame, speed, clock } = bench;
    let frames = match event.kind() {
        Kind::Unfold => frame.criterion.earliest_unfold(frame.views, speed, &event.bounds),
        Kind::Fold => frame.criterion.earliest_fold(frame.views, speed, &event.bounds),
    };
    // A positive bound says that nothing can have changed yet; only then is the predicate spared.
    if frames == 0.0 && frame.unfold(&event.bounds) == (event.kind() == Kind::Unfold) {
        flip(event, queue);
    } else {
        queue.schedule(*clock, frames, *event);
    }
}
