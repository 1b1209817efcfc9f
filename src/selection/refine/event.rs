//! Event-driven refinement: a node is tested only when the camera could have changed the answer.
//!
//! After Zach & Karner (2003), with time bounds that never miss (see [`criterion`](crate::criterion)) on clocks
//! that run on distance travelled (see [`motion`](crate::motion)): exact at any speed of the camera.
//!
//! # Several clocks
//!
//! A clock advances by the largest of what the camera does in terms of what the clock allows it to do in a frame (its
//! [`Course`]). It is wasteful for a camera that does only one of these things, or does them another way. So the course
//! follows the motion: it has the heading and the speeds of the last few frames, and room to stray. When the camera has
//! left it, a new clock starts on a new course, and events that are scheduled from then on wait on that one. Those that
//! wait on older clocks stay there until they come up: all clocks go on running. Each by itself never misses, so the
//! choice is free.
//!
//! How movement and turning compare is learned from what the camera has done (`usual`); the queue alone goes by
//! declared speeds.
//!
//! # Queue and scan
//!
//! What is due within a few frames is not worth a place in the queue, and is scanned instead (`near`), wherever
//! that pays (`balance`).

mod balance;
mod near;
mod usual;

use glam::DVec3;
use multiversion::multiversion;
use vertex_tree::Bounds;

use self::balance::Looks;
use self::near::Near;
use self::usual::Usual;
use super::frame::{Flips, Frame};
use super::front::FrontScan;
use super::watch::Watch;
use crate::filter::{Lens, Lenses, Rates, earliest};
use crate::in_play::{Kind, Slot};
use crate::motion::{Course, Motion, Odometer, Speed, Travel};
use crate::packed::{Block, LANES};
use crate::queue::{Event, EventQueue, OnClock, TICKS_PER_FRAME, ticks};

/// Clocks that run at the same time. When a new course needs one, the oldest gives up its events: they are tested early.
const CLOCKS: usize = 16;

/// Frames that a course is kept at least, so that a camera that shakes does not wear out the clocks.
const LEAST_FRAMES: u32 = 6;

/// How much more than another course one may cost before it is left.
const PATIENCE: f64 = 1.15;

/// Events that could be tested in the time that a clock more takes in a frame.
const CLOCK: f64 = 8.0;

/// Weight of a new frame in the means of recent motion.
const NEWS: f64 = 0.25;

/// Room to stray: this share of the speed along the heading, and so many times as far as the camera has strayed.
const STRAY: f64 = 1.0 / 8.0;
const STRAYED: f64 = 1.5;

/// The room grows by this factor, up to this share, when a course has lasted fewer frames than this, and shrinks else.
const WIDER: f64 = 1.25;
const MOST_STRAY: f64 = 0.4;
const SHORT: u32 = 24;

/// No speed of a course is less than this share of the declared one at the pace of the motion.
const LEAST: f64 = 1.0 / 16.0;

pub(crate) struct EventDriven {
    queue: EventQueue,
    clocks: [Clock; CLOCKS],
    /// The clock for new events, and for how many frames it has been.
    clock: usize,
    frames: u32,
    /// Recent motion of the first view, newer frames counting more, and how far it has strayed from its mean.
    drift: DVec3,
    strayed: f64,
    /// What the camera usually does in a frame, and the nodes that are scanned; neither for the queue alone.
    usual: Usual,
    near: Option<Near>,
    /// Events that have come up in a frame, newer frames counting more.
    due: f64,
    /// What the last frame has looked at.
    looks: Looks,
    /// Room to stray that a new course gets, as a share of the speed along the heading.
    room: f64,
    /// Nodes watched since the last frame's events were scheduled.
    fresh: Vec<Event>,
    /// Room for what is tested.
    batches: [Batch; 2],
}

#[derive(Clone, Copy)]
struct Clock {
    course: Course,
    odometer: Odometer,
}

impl EventDriven {
    pub fn new() -> Self {
        Self { near: Some(Near::new()), ..Self::queue_alone() }
    }

    /// By declared speeds, and without a scan.
    pub fn queue_alone() -> Self {
        let course = Course::from(Speed { rho: 1.0, omega: 1.0, kappa: 1.0 });
        Self {
            queue: EventQueue::new(CLOCKS),
            clocks: [Clock { course, odometer: Odometer::default() }; CLOCKS],
            clock: 0,
            // The first motion sets the first course.
            frames: LEAST_FRAMES,
            drift: DVec3::ZERO,
            strayed: 0.0,
            usual: Usual::default(),
            near: None,
            due: 0.0,
            looks: Looks::default(),
            room: STRAY,
            fresh: Vec::new(),
            batches: [const { Batch::EMPTY }; 2],
        }
    }

    pub fn find(&mut self, frame: &Frame, flips: &mut Flips) {
        // Nodes may have come to be watched outside of a frame: the roots.
        flips.tests += self.settle(frame);
        match frame.motion {
            Motion::Rest => self.queue.take_pressing(),
            Motion::Unbounded if self.near.is_none() => self.queue.take_all(),
            Motion::Frames(_) | Motion::Unbounded => self.advance(frame),
        }
        let lenses = Lenses::new(frame.criterion, frame.views);
        let lenses = lenses.as_ref().map(Lenses::as_slice);
        if frame.motion != Motion::Rest
            && let Some(near) = &mut self.near
        {
            near.scan.find_with(frame, lenses, flips);
            if let Some(lenses) = lenses {
                let course = &self.clocks[self.clock].course;
                self.looks.again = near.look_again(frame, lenses, course, &mut self.queue, self.clock);
                flips.tests += self.looks.again;
            }
        }
        self.due *= 1.0 - NEWS;
        if !self.queue.is_ripe() {
            return;
        }
        let Flips { unfold, fold, tests } = flips;
        let before = *tests;
        let next = |queue: &mut EventQueue, due: &mut [Event; LANES]| {
            let count = queue.next_due(due);
            *tests += count as u64;
            count
        };
        self.process(frame, lenses, next, |event, _| match event.kind() {
            Kind::Unfold => unfold.push(event.slot),
            Kind::Fold => fold.push(event.slot),
        });
        self.looks.due = flips.tests - before;
        self.due += self.looks.due as f64 * NEWS;
    }

    /// What the motion is measured in: usual speeds, or for the queue alone those that are declared.
    fn speed(&self, frame: &Frame) -> Speed {
        if self.near.is_some() { self.usual.speed() } else { frame.speed }
    }

    /// Moves all clocks, and sees to it that the current one is on the camera's course.
    fn advance(&mut self, frame: &Frame) {
        let Some(travel) = &frame.travel else {
            return self.queue.take_all();
        };
        // What is pressing is so also where no clock advances.
        self.queue.take_pressing();
        let is_usual = self.usual.learn(travel);
        if let Some(near) = &mut self.near {
            let watched = self.queue.least_len() + near.scan.len();
            near.begin_frame(watched, std::mem::take(&mut self.looks), frame.looks_ahead);
        }
        let mut taken = Motion::Rest;
        for (number, clock) in self.clocks.iter_mut().enumerate() {
            if number == self.clock || !self.queue.is_idle(number) {
                self.looks.clocks += 1;
                let motion = clock.odometer.advance_by(&clock.course, Some(travel));
                match motion {
                    Motion::Frames(_) => self.queue.advance(number, clock.odometer.now()),
                    Motion::Rest => {}
                    Motion::Unbounded => self.queue.take_clock(number),
                }
                if number == self.clock {
                    taken = motion;
                }
            }
        }
        // After a jump the camera is expected to go on as before it.
        if is_usual || self.near.is_none() {
            self.follow(frame, travel, taken);
        }
    }

    /// Starts a clock on a new course if the current one costs too much for the motion: it took so many frames for it.
    fn follow(&mut self, frame: &Frame, travel: &Travel, taken: Motion) {
        let speed = self.speed(frame);
        let course = self.course(&speed, travel);
        self.frames += 1;
        if let (Some(near), Motion::Frames(frames)) = (&mut self.near, taken) {
            near.observe(frames);
        }
        // On a clock that crawls, ticks are too coarse.
        let is_crawling = self.near.as_ref().is_some_and(Near::is_crawling);
        // A clock more costs time in every frame, about what it takes to test so many events.
        let patience = PATIENCE + if self.near.is_some() { CLOCK / (self.due + 2.0 * CLOCK) } else { 0.0 };
        let is_left = match taken {
            Motion::Rest => false,
            Motion::Frames(frames) => {
                self.frames > LEAST_FRAMES
                    && (is_crawling
                        || frames * cost(&self.clocks[self.clock].course, &speed)
                            > patience * cost(&course, &speed))
            }
            Motion::Unbounded => true,
        };
        if is_left {
            if let Some(near) = &mut self.near {
                // A camera on a curve leaves every course; with more room it does so less often.
                let lasted = if self.frames < SHORT { WIDER } else { 1.0 / WIDER };
                self.room = (self.room * lasted).clamp(STRAY, MOST_STRAY);
                near.begin_course(cost(&course, &speed) / cost(&self.clocks[self.clock].course, &speed));
            }
            self.clock = (self.clock + 1) % self.ring();
            self.queue.take_clock(self.clock);
            self.clocks[self.clock].course = course;
            self.frames = 0;
        }
    }

    /// How many clocks new courses take in turns: what waits on few events is not worth many.
    fn ring(&self) -> usize {
        match self.near {
            Some(_) => ((self.queue.len() as f64).sqrt() / 8.0).clamp(2.0, CLOCKS as f64) as usize,
            None => CLOCKS,
        }
    }

    /// The course on which a motion takes one frame.
    fn course(&mut self, speed: &Speed, travel: &Travel) -> Course {
        let moved = travel.moves().next().unwrap_or_default();
        self.drift += (moved - self.drift) * NEWS;
        let heading = self.drift.normalize_or_zero();
        let forward = moved.dot(heading).max(0.0);
        self.strayed += ((moved - forward * heading).length() - self.strayed) * NEWS;

        let farthest = travel.moves().map(DVec3::length).fold(0.0, f64::max);
        let per = |amount: f64, rate: f64| if rate > 0.0 { amount / rate } else { 0.0 };
        let pace = per(farthest, speed.rho).max(per(travel.turned, speed.omega));
        let pace = LEAST * pace.max(per(travel.steered, speed.kappa));
        let omega = travel.turned.max(pace * speed.omega);
        let kappa = travel.steered.max(pace * speed.kappa);
        let stray = (self.room * forward).max(STRAYED * self.strayed).max(pace * speed.rho * STRAY);
        if stray < forward / 2.0 {
            Course { heading, rho: forward.max(pace * speed.rho), stray, omega, kappa }
        } else {
            Course::from(Speed { rho: farthest.max(pace * speed.rho), omega, kappa })
        }
    }

    /// Schedules the nodes that have come to be watched in this frame, and says how many they are.
    pub fn settle(&mut self, frame: &Frame) -> u64 {
        if self.fresh.is_empty() {
            return 0;
        }
        let (mut tests, scanned) = (0, self.scanned());
        let mut fresh = std::mem::take(&mut self.fresh);
        let mut left = fresh.iter();
        let next = |queue: &mut EventQueue, due: &mut [Event; LANES]| {
            let mut count = 0;
            while count < LANES
                && let Some(event) = left.next()
            {
                due[count] = *event;
                count += usize::from(queue.is_valid(event));
            }
            tests += count as u64;
            count
        };
        // A node that no view wants is active where another needs it: its time to fold is the next motion.
        let lenses = Lenses::new(frame.criterion, frame.views);
        self.process(frame, lenses.as_ref().map(Lenses::as_slice), next, |event, place| place.put(0, event));
        let near = self.scanned() - scanned;
        if let Some(scan) = &mut self.near {
            scan.learn(tests as usize, near);
            self.looks.first += tests;
        }
        fresh.clear();
        self.fresh = fresh;
        tests
    }

    /// How many nodes are scanned.
    fn scanned(&self) -> usize {
        self.near.as_ref().map_or(0, |near| near.scan.len())
    }

    /// What is scanned.
    pub fn near(&self) -> Option<&FrontScan> {
        self.near.as_ref().map(|near| &near.scan)
    }

    pub fn for_each_watched(&self, f: &mut impl FnMut(Slot, Kind, &Bounds)) {
        let fresh = self.fresh.iter().filter(|event| self.queue.is_valid(event));
        fresh.for_each(|event| f(event.slot, event.kind(), &event.bounds));
        self.queue.for_each(|event| f(event.slot, event.kind(), &event.bounds));
        if let Some(near) = &self.near {
            near.scan.for_each_watched(f);
        }
    }

    #[track_caller]
    pub fn assert_well_formed(&self) {
        self.queue.assert_well_formed();
        if let Some(near) = &self.near {
            near.scan.assert_well_formed();
        }
    }

    /// Tests the events that `next` puts into its second argument, as many as it returns, until it returns 0. Calls `flip`
    /// for those whose nodes should change and has the others watched. Without lenses the filter is passed over.
    fn process(
        &mut self,
        frame: &Frame,
        lenses: Option<&[Lens]>,
        next: impl FnMut(&mut EventQueue, &mut [Event; LANES]) -> usize,
        flip: impl FnMut(&Event, &mut Place),
    ) {
        let bench = Bench { frame, course: self.clocks[self.clock].course, clock: self.clock };
        let (queue, near) = (&mut self.queue, &mut self.near);
        match lenses {
            Some(lenses) => process(queue, near, lenses, &bench, &mut self.batches, next, flip),
            None => process_plainly(queue, near, &bench, next, flip),
        }
    }

    /// Calls `f` with the events that may have to be tested at one of several instants: `travels` says how the views get
    /// there, `None` if that can not be compared. Clocks that run on net displacement have reached them at none of these.
    pub fn for_each_due<'a, I: Iterator<Item = Option<Travel<'a>>>>(
        &self,
        travels: impl Fn() -> I,
        mut f: impl FnMut(&Event),
    ) {
        self.queue.pressing(&mut f);
        for (number, clock) in
            self.clocks.iter().enumerate().filter(|&(number, _)| !self.queue.is_idle(number))
        {
            let reached = |travel: Option<Travel>| {
                travel.map_or(f64::INFINITY, |travel| clock.odometer.after(&clock.course, &travel))
            };
            let now = travels().map(reached).fold(clock.odometer.now(), f64::max);
            self.queue.due_within(number, now, &mut f);
        }
    }
}

impl Watch for EventDriven {
    #[inline(always)]
    fn watch(&mut self, _: &Frame, slot: Slot, kind: Kind, bounds: Bounds) {
        if let Some(near) = &mut self.near
            && near.takes_unseen()
        {
            near.scan.put(slot, kind, bounds);
            return;
        }
        let event = self.queue.event(slot, kind, bounds);
        self.fresh.push(event);
    }

    #[inline(always)]
    fn unwatch(&mut self, slot: Slot) {
        if !self.near.as_mut().is_some_and(|near| near.scan.remove(slot)) {
            self.queue.cancel(slot);
        }
    }

    #[inline(always)]
    fn changed(&mut self, slot: Slot) {
        if !self.near.as_mut().is_some_and(|near| near.scan.remove(slot)) {
            self.queue.retire(slot);
        }
    }

    #[inline(always)]
    fn prefetch(&self, slot: Slot) {
        self.queue.prefetch(slot);
        if let Some(near) = &self.near {
            near.scan.prefetch_place(slot);
        }
    }

    fn refused(&mut self, slot: Slot, kind: Kind, bounds: Bounds) {
        let event = self.queue.event(slot, kind, bounds);
        self.queue.press(event);
    }
}

/// What a frame on a course costs: about in proportion to the tests that it makes due. The declared speeds say how
/// movement and turning compare.
fn cost(course: &Course, speed: &Speed) -> f64 {
    let share = |amount: f64, rate: f64| if rate > 0.0 { amount / rate } else { 0.0 };
    // Half of all directions are ahead, more or less.
    share(0.5 * course.rho + course.stray, speed.rho)
        + share(course.omega, speed.omega)
        + share(course.kappa, speed.kappa)
}

/// What events are tested with.
struct Bench<'a> {
    frame: &'a Frame<'a>,
    /// The clock that they wait on after that, and its course.
    clock: usize,
    course: Course,
}

impl Bench<'_> {
    /// Tests one event in f64.
    fn test(&self, event: &Event, place: &mut Place, flip: &mut impl FnMut(&Event, &mut Place)) {
        let Self { frame, course, .. } = self;
        let frames = frame.earliest(course, event.slot, event.kind(), &event.bounds);
        // A positive bound says that nothing can have changed yet; only then is the predicate spared.
        if frames == 0.0 && frame.unfold(event.slot, &event.bounds) == (event.kind() == Kind::Unfold) {
            flip(event, place);
        } else {
            // Rounded down, as the clock's time is to its tick; `as` saturates.
            place.put((frames * TICKS_PER_FRAME) as u32, event);
        }
    }
}

/// Where events go: those that are due soon to the nodes that are scanned, the others into the queue.
struct Place<'a> {
    queue: OnClock<'a>,
    near: Option<&'a mut FrontScan>,
    /// Events that are due in fewer ticks than this are due soon.
    soon: u32,
}

impl<'a> Place<'a> {
    #[inline(always)]
    fn new(queue: &'a mut EventQueue, near: &'a mut Option<Near>, clock: usize) -> Self {
        let soon = near.as_ref().map_or(0, Near::soon);
        Self { queue: queue.on(clock), near: near.as_mut().map(|near| &mut near.scan), soon }
    }

    #[inline(always)]
    fn put(&mut self, ticks: u32, event: &Event) {
        if ticks < self.soon
            && let Some(near) = &mut self.near
        {
            near.put(event.slot, event.kind(), event.bounds);
        } else {
            self.queue.schedule_ticks(ticks, *event);
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
        // What is left in the other lanes is tested too, and nobody asks for the outcome.
        for (lane, event) in self.events[..count].iter().enumerate() {
            self.block.set(lane, &event.bounds, event.tag());
        }
    }
}

#[multiversion(targets("x86_64+avx2+lzcnt+bmi1+bmi2", "x86_64+sse4.1"))]
fn process(
    queue: &mut EventQueue,
    near: &mut Option<Near>,
    lenses: &[Lens],
    bench: &Bench,
    batches: &mut [Batch; 2],
    mut next: impl FnMut(&mut EventQueue, &mut [Event; LANES]) -> usize,
    mut flip: impl FnMut(&Event, &mut Place),
) {
    let rates = Rates::new(&bench.course);
    let [batch, following] = batches;
    let (mut batch, mut following) = (batch, following);
    let count = next(queue, &mut batch.events);
    batch.fill(count);
    while batch.count > 0 {
        // One ahead: what has just been written member by member can not be read as a vector at once.
        let count = next(queue, &mut following.events);
        following.fill(count);
        let frames = earliest(&batch.block, lenses, &rates);
        let ticks = ticks(frames);
        let mut place = Place::new(queue, near, bench.clock);
        for (lane, event) in batch.events[..batch.count].iter().enumerate() {
            // The filter knows of no cones: they can make a fold earlier, not an unfold.
            let is_valid = bench.frame.cones.is_none() || event.kind() == Kind::Unfold;
            if is_valid && frames[lane % LANES] > 0.0 {
                place.put(ticks[lane % LANES], event);
            } else {
                bench.test(event, &mut place, &mut flip);
            }
        }
        std::mem::swap(&mut batch, &mut following);
    }
}

/// Without the filter, for more views than it takes.
fn process_plainly(
    queue: &mut EventQueue,
    near: &mut Option<Near>,
    bench: &Bench,
    mut next: impl FnMut(&mut EventQueue, &mut [Event; LANES]) -> usize,
    mut flip: impl FnMut(&Event, &mut Place),
) {
    let mut events = [Event::BLANK; LANES];
    loop {
        let count = next(queue, &mut events);
        for event in &events[..count] {
            bench.test(event, &mut Place::new(queue, near, bench.clock), &mut flip);
        }
        if count == 0 {
            return;
        }
    }
}

#[cfg(test)]
mod tests;
