//! Nodes that are due so soon that to test them in every frame costs less than a place in the queue.
//!
//! An event costs about as much as twenty nodes of a scan. So a node whose time bound is less than [`NEAR`] frames away is put
//! into packed arrays and tested whenever the camera moves. In turns, a few blocks of them a frame, they are looked at again:
//! what is much further away by then gets an event. How many blocks that are follows from what the last ones were worth, and
//! from the camera: when it slows down, what was near is not.
//!
//! A look is worth its cost only where few nodes are near and where they stay for a while. Where most are, or where nodes come
//! and go within a few frames, they are scanned without a look; and [`Balance`] adds up whether all of this pays.

use multiversion::multiversion;

use super::super::frame::Frame;
use super::super::front::FrontScan;
use super::balance::{Balance, Looks};
use crate::filter::{Lens, Rates, earliest};
use crate::in_play::{Kind, Slot};
use crate::motion::Course;
use crate::packed::{Block, LANES};
use crate::queue::{EventQueue, HORIZON, TICKS_PER_FRAME, ticks};

/// Frames within which a node is near.
const NEAR: f64 = 16.0;
/// What a node that is near costs where foresight looks at all of them, in tests of a scan.
const FORESEEN: f64 = 4.0;
/// So many times as far away it is no longer: a node does not come and go all the time.
const FAR: u32 = 4;

/// A clock that takes less of a frame than this for a frame has few ticks for [`NEAR`] frames.
const LEAST_PACE: f64 = 1.0 / 256.0;

/// The share of all blocks that is looked at again in a frame, at least and at most.
const LEAST_SHARE: f64 = 1.0 / 256.0;
const MOST_SHARE: f64 = 1.0 / 4.0;

/// Where so many of those that come to be watched are near, others are taken to be so without a look, until so many of those
/// that are looked at again are not.
const MOSTLY: f64 = 0.75;
const SELDOM: f64 = 0.25;

/// Where all nodes are watched for so many frames in the mean, or fewer, none is looked at.
const BUSY: f64 = 16.0;

/// Weight of a new frame in the means.
const NEWS: f64 = 1.0 / 8.0;

pub(super) struct Near {
    pub scan: FrontScan,
    /// Frames on the current clock that a frame takes: a slow camera has more time.
    pace: f64,
    /// The pace at which what is here was found to be near.
    looked_at: f64,
    /// Ticks within which a node is near.
    ticks: u32,
    /// Share of the blocks to look at again in a frame, what is left of the last frames', and the next block.
    share: f64,
    left: f64,
    next: usize,
    /// Of what has come to be watched lately, the share that was near; of what has been looked at again, the share that was not.
    mostly: f64,
    gone: f64,
    /// Nodes that have come to be watched in this frame.
    come: f64,
    /// Whether nodes are watched for a few frames only, so that no look is worth it.
    is_busy: bool,
    balance: Balance,
    /// What a node that is scanned costs in a frame, in tests of a scan.
    price: f64,
}

impl Near {
    pub fn new() -> Self {
        Self {
            scan: FrontScan::default(),
            pace: 1.0,
            looked_at: 1.0,
            // Before anything has moved, nobody knows what is near.
            ticks: 0,
            share: LEAST_SHARE,
            left: 0.0,
            next: 0,
            mostly: 0.0,
            gone: 0.0,
            come: 0.0,
            is_busy: false,
            balance: Balance::new(),
            price: 1.0,
        }
    }

    fn set_pace(&mut self, pace: f64) {
        self.pace = pace;
        self.ticks = ((NEAR / self.price * TICKS_PER_FRAME * pace) as u32).clamp(1, HORIZON / 4);
        self.balance.slow_down(pace);
        if pace < self.looked_at / 2.0 {
            // Much of what is here is no longer near.
            self.share = MOST_SHARE;
            self.looked_at = pace;
        }
        self.looked_at = self.looked_at.max(pace);
    }

    /// A frame begins, with so many nodes watched.
    pub fn begin_frame(&mut self, watched: usize, looks: Looks, looks_ahead: bool) {
        self.price = if looks_ahead { FORESEEN } else { 1.0 };
        self.is_busy = self.come * BUSY > watched as f64;
        self.come = 0.0;
        // The first views unfold everything, which does not come again.
        let has_moved = self.ticks > 0;
        if has_moved
            && self.balance.add(looks, [self.scan.len(), watched].map(|n| n as f64 * self.price), self.pace)
        {
            self.share = LEAST_SHARE;
        }
    }

    /// Events that are due in fewer ticks than this are scanned.
    pub fn soon(&self) -> u32 {
        if self.balance.scans_everything() { u32::MAX } else { self.ticks }
    }

    /// The current clock has taken so many frames for a frame.
    pub fn observe(&mut self, frames: f64) {
        self.set_pace((self.pace + frames.min(4.0)) / 2.0);
    }

    /// Whether the clock's ticks are too long to tell what is near.
    pub fn is_crawling(&self) -> bool {
        self.pace < LEAST_PACE
    }

    /// There is a new clock, whose course is the present motion, and costs so many times what the one before did.
    pub fn begin_course(&mut self, cost: f64) {
        if cost < 0.5 {
            self.share = MOST_SHARE;
        }
        self.balance.change_unit(cost);
        self.pace = 1.0;
        self.looked_at = 1.0;
        self.set_pace(1.0);
    }

    /// Of so many nodes that have come to be watched so many were near.
    pub fn learn(&mut self, all: usize, near: usize) {
        if all > 0 {
            let weight = NEWS * (all as f64 / 8.0).min(1.0);
            self.mostly += (near as f64 / all as f64 - self.mostly) * weight;
        }
    }

    /// Whether a node that comes to be watched is to be taken for near without a look.
    #[inline(always)]
    pub fn takes_unseen(&mut self) -> bool {
        self.come += 1.0;
        self.is_busy || self.balance.scans_everything() || self.mostly > MOSTLY
    }

    /// Looks at some of the nodes again, and schedules those that are not near any more, on a clock that has this course. Returns
    /// how many it has looked at.
    pub fn look_again(
        &mut self,
        frame: &Frame,
        lenses: &[Lens],
        course: &Course,
        queue: &mut EventQueue,
        clock: usize,
    ) -> u64 {
        if self.is_busy || self.balance.scans_everything() {
            return 0;
        }
        let [folded, unfolded] = self.scan.watched().map(|(packed, _)| packed.count());
        self.left += self.share * (folded + unfolded) as f64;
        let blocks = self.left as usize;
        self.left -= blocks as f64;
        if blocks == 0 {
            return 0;
        }
        let rates = Rates::new(course);
        let (mut seen, mut gone) = (0, 0_u64);
        for _ in 0..blocks {
            let [(folded, _), (unfolded, _)] = self.scan.watched();
            if self.next >= folded.count() + unfolded.count() {
                self.next = 0;
            }
            let (kind, found) = match self.next.checked_sub(folded.count()) {
                None => (Kind::Unfold, folded.block(self.next)),
                Some(at) => (Kind::Fold, unfolded.block(at)),
            };
            self.next += 1;
            let Some((block, used)) = found else { break };
            let slots = block.tag.map(Slot);
            let block = Block { tag: [u32::from(kind == Kind::Fold); LANES], ..*block };
            let mut ticks = ticks_of(&block, lenses, &rates);
            if frame.cones.is_some() && kind == Kind::Fold {
                // The filter knows of no cones: they can make a fold earlier.
                for (lane, ticks) in ticks[..used].iter_mut().enumerate() {
                    let frames = frame.earliest(course, slots[lane], kind, &block.bounds(lane));
                    *ticks = (frames * TICKS_PER_FRAME) as u32;
                }
            }
            seen += used as u64;
            let limit = FAR * self.ticks;
            for lane in (0..used).filter(|&lane| ticks[lane] > limit) {
                self.scan.remove(slots[lane]);
                let event = queue.event(slots[lane], kind, block.bounds(lane));
                queue.on(clock).schedule_ticks(ticks[lane], event);
                gone += 1;
            }
        }
        if gone * 4 > seen {
            self.share = (2.0 * self.share).min(MOST_SHARE);
        } else if gone * 6 < seen {
            self.share = (0.75 * self.share).max(LEAST_SHARE);
        }
        self.gone += (gone as f64 / seen.max(1) as f64 - self.gone) * NEWS;
        if self.gone > SELDOM {
            (self.mostly, self.gone) = (0.0, 0.0);
        }
        seen
    }
}

/// The ticks before which no node of a block can have to change; tags say of which kind they are.
#[multiversion(targets("x86_64+avx2+lzcnt+bmi1+bmi2", "x86_64+sse4.1"))]
fn ticks_of(block: &Block, lenses: &[Lens], rates: &Rates) -> [u32; LANES] {
    ticks(earliest(block, lenses, rates))
}

#[cfg(test)]
mod tests;
