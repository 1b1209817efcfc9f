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
use crate::filter::{Lens, Lenses, Rates, earliest};
use crate::front::Slot;
use crate::motion::{Motion, Odometer, Speed, Travel};
use crate::packed::{Block, LANES};
use crate::queue::{Event, EventQueue, HORIZON, Kind, OnClock, TICKS_PER_FRAME};
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
        }
    }

    pub fn find(&mut self, frame: &Frame, before: &[View], flips: &mut Flips) {
        // Nodes may have come to be watched outside of a frame: the roots.
        self.settle(frame);
        match frame.motion {
            Motion::Rest => self.queue.take_pressing(),
            Motion::Frames(_) => self.advance(frame, before),
            Motion::Unbounded => self.queue.take_all(),
        }
        let Flips { unfold, fold, tests } = flips;
        let next = |queue: &mut EventQueue, due: &mut [Event; LANES]| {
            let count = queue.next_due(due);
            *tests += count as u64;
            count
        };
        self.process(frame, next, |event, _| match event.kind() {
            Kind::Unfold => unfold.push(event.slot),
            Kind::Fold => fold.push(event.slot),
        });
    }

    /// Moves all clocks, and chooses the one that the motion fits.
    fn advance(&mut self, frame: &Frame, before: &[View]) {
        let Some(travel) = Travel::between(before, frame.views) else {
            return self.queue.take_all();
        };
        let mut least = f64::INFINITY;
        for clock in 0..CLOCKS {
            let speed = skew(&frame.speed, clock);
            match self.odometers[clock].advance_by(&speed, &travel) {
                Motion::Frames(frames) => {
                    self.queue.advance(clock, self.odometers[clock].now());
                    // What the clock allows for in the time that it takes this motion for, at a typical distance.
                    let share = speed.rho / frame.speed.rho + speed.omega / frame.speed.omega;
                    if frames * share < least {
                        least = frames * share;
                        self.clock = clock;
                    }
                }
                Motion::Rest => {}
                Motion::Unbounded => self.queue.take_clock(clock),
            }
        }
    }

    /// Schedules the nodes that have come to be watched in this frame.
    pub fn settle(&mut self, frame: &Frame) {
        let mut fresh = std::mem::take(&mut self.fresh);
        fresh.retain(|event| self.queue.is_valid(event));
        let mut left = &fresh[..];
        let next = |_: &mut EventQueue, due: &mut [Event; LANES]| {
            let (now, later) = left.split_at(left.len().min(LANES));
            due[..now.len()].copy_from_slice(now);
            left = later;
            now.len()
        };
        // A node that no view wants is active where another needs it: its time to fold is the next motion.
        self.process(frame, next, |event, queue| queue.schedule_ticks(0, *event));
        fresh.clear();
        self.fresh = fresh;
    }

    /// Tests the events that `next` puts into its second argument, as many as it returns, until it returns 0. Calls `flip`
    /// for those whose nodes should change and schedules the others.
    fn process(
        &mut self,
        frame: &Frame,
        next: impl FnMut(&mut EventQueue, &mut [Event; LANES]) -> usize,
        flip: impl FnMut(&Event, &mut OnClock),
    ) {
        let bench = Bench { frame, speed: skew(&frame.speed, self.clock), clock: self.clock };
        match Lenses::new(frame.criterion, frame.views) {
            Some(lenses) => process(&mut self.queue, lenses.as_slice(), &bench, next, flip),
            None => process_plainly(&mut self.queue, &bench, next, flip),
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

/// What events are tested with.
struct Bench<'a> {
    frame: &'a Frame<'a>,
    /// The clock that they wait on after that, and its speed.
    clock: usize,
    speed: Speed,
}

impl Bench<'_> {
    /// Tests one event in f64.
    fn test(&self, event: &Event, queue: &mut OnClock, flip: &mut impl FnMut(&Event, &mut OnClock)) {
        let Self { frame, speed, .. } = self;
        let frames = match event.kind() {
            Kind::Unfold => frame.criterion.earliest_unfold(frame.views, speed, &event.bounds),
            Kind::Fold => frame.criterion.earliest_fold(frame.views, speed, &event.bounds),
        };
        // A positive bound says that nothing can have changed yet; only then is the predicate spared.
        if frames == 0.0 && frame.unfold(&event.bounds) == (event.kind() == Kind::Unfold) {
            flip(event, queue);
        } else {
            queue.schedule(frames, *event);
        }
    }
}

/// Events to be tested together.
struct Batch {
    events: [Event; LANES],
    count: usize,
    block: Block,
}

impl Batch {
    const EMPTY: Self = Self { events: [Event::BLANK; LANES], count: 0, block: Block::EMPTY };

    #[inline(always)]
    fn fill(&mut self, count: usize) {
        self.count = count;
        for (lane, event) in self.events.iter().enumerate() {
            self.block.set(lane, &event.bounds, event.tag());
        }
    }
}

#[multiversion(targets("x86_64+avx2+lzcnt+bmi1+bmi2", "x86_64+sse4.1"))]
fn process(
    queue: &mut EventQueue,
    lenses: &[Lens],
    bench: &Bench,
    mut next: impl FnMut(&mut EventQueue, &mut [Event; LANES]) -> usize,
    mut flip: impl FnMut(&Event, &mut OnClock),
) {
    let rates = Rates::new(&bench.speed);
    let mut batches = [const { Batch::EMPTY }; 2];
    let [batch, following] = &mut batches;
    let (mut batch, mut following) = (batch, following);
    let count = next(queue, &mut batch.events);
    batch.fill(count);
    while batch.count > 0 {
        // One ahead: what has just been written member by member can not be read as a vector at once.
        let count = next(queue, &mut following.events);
        following.fill(count);
        let frames = earliest(&batch.block, lenses, &rates);
        // To multiply by a power of two is exact; what is further than the horizon makes no difference.
        let ticks =
            frames.map(|frames| (frames * TICKS_PER_FRAME as f32).min(HORIZON as f32 / 2.0) as i32 as u32);
        let mut queue = queue.on(bench.clock);
        for (lane, event) in batch.events[..batch.count].iter().enumerate() {
            if frames[lane % LANES] > 0.0 {
                queue.schedule_ticks(ticks[lane % LANES], *event);
            } else {
                bench.test(event, &mut queue, &mut flip);
            }
        }
        std::mem::swap(&mut batch, &mut following);
    }
}

/// Without the filter, for more views than it takes.
fn process_plainly(
    queue: &mut EventQueue,
    bench: &Bench,
    mut next: impl FnMut(&mut EventQueue, &mut [Event; LANES]) -> usize,
    mut flip: impl FnMut(&Event, &mut OnClock),
) {
    let mut events = [Event::BLANK; LANES];
    loop {
        let count = next(queue, &mut events);
        for event in &events[..count] {
            bench.test(event, &mut queue.on(bench.clock), &mut flip);
        }
        if count == 0 {
            return;
        }
    }
}
