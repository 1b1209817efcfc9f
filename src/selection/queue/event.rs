//! What is in a queue.

use vertex_tree::Bounds;

use crate::in_play::{Kind, Slot};

/// Ticks in a frame of a clock. A camera far slower than its course still has ticks that are finer than its frames.
pub const TICKS_PER_FRAME: f64 = 512.0;

/// The furthest that an event is scheduled ahead, in ticks: 4 million frames.
pub const HORIZON: u32 = 1 << 31;

/// Ticks in so many frames: to multiply by a power of two is exact, and what is further than the horizon makes no difference.
#[inline(always)]
pub(crate) fn ticks(frames: [f32; DUE]) -> [u32; DUE] {
    frames.map(|frames| (frames * TICKS_PER_FRAME as f32).min(HORIZON as f32 / 2.0) as i32 as u32)
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
    /// Stands where there is no event.
    pub const BLANK: Self = Self {
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
    pub(crate) fn tag(&self) -> u32 {
        self.tag
    }

    #[inline(always)]
    pub(crate) fn new(bounds: Bounds, slot: Slot, ticket: u16, kind: Kind) -> Self {
        let tag = u32::from(ticket) << 1 | u32::from(kind == Kind::Fold);
        Self { bounds, slot, tag, _reserved: 0 }
    }

    #[inline(always)]
    pub(super) fn ticket(&self) -> u16 {
        (self.tag >> 1) as u16
    }
}

/// Most events that come up at a time: as many as vector code tests together.
pub const DUE: usize = crate::packed::LANES;
