//! Refinement strategies: ways to find the nodes whose status must flip. All else is shared (see
//! [`engine`](crate::engine)), and all must arrive at the same cut.

pub mod event;
mod frame;
pub mod front;
pub mod published;
pub mod top_down;
mod watch;

use vertex_tree::Bounds;

pub(crate) use self::frame::{Flips, Frame};
pub(crate) use self::watch::Watch;
use crate::front::Front;
use crate::in_play::{Kind, Slot};
use crate::view::View;

/// How the nodes that must change are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Strategy {
    /// Walk all active and boundary nodes from the roots, every frame (Zach & Karner, Figure 3).
    TopDown,
    /// Scan all boundary and all collapsible nodes, every frame, in a packed array.
    Front,
    /// Test a node only when the camera could have changed the answer: an event queue on odometer clocks, and a scan of what
    /// is due so soon that a place in the queue is not worth it. It needs no declared speeds.
    Event,
    /// The event queue as published, with its time bounds, integer frames and lists of nodes. It misses flips: its
    /// bounds are not conservative. For comparison.
    EventPublished,
    /// The event queue alone, by declared speeds and without a scan. For comparison.
    EventQueue,
}

impl Strategy {
    /// All of them, in the order of reports.
    pub const ALL: [Self; 5] =
        [Self::TopDown, Self::Front, Self::Event, Self::EventPublished, Self::EventQueue];
    /// Those that are compared where nothing else is said.
    pub const COMPARED: [Self; 4] = [Self::TopDown, Self::Front, Self::Event, Self::EventPublished];

    /// The name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TopDown => "top-down",
            Self::Front => "front",
            Self::Event => "event",
            Self::EventQueue => "event-queue",
            Self::EventPublished => "event-published",
        }
    }

    /// Whether its cut is the oracle's in every frame.
    #[must_use]
    pub fn is_exact(self) -> bool {
        self != Self::EventPublished
    }
}

/// The state of whichever strategy it is.
pub(crate) enum Finder {
    TopDown(top_down::TopDown),
    Front(front::FrontScan),
    Event(Box<event::EventDriven>),
    Published(published::Published),
}

/// Evaluates `$body` with `$strategy` as the strategy that a [`Finder`] holds.
macro_rules! with_strategy {
    ($finder:expr, |$strategy:ident| $body:expr) => {
        match $finder {
            Finder::TopDown($strategy) => $body,
            Finder::Front($strategy) => $body,
            Finder::Event($strategy) => $body,
            Finder::Published($strategy) => $body,
        }
    };
}

impl Finder {
    pub fn new(strategy: Strategy) -> Self {
        match strategy {
            Strategy::TopDown => Self::TopDown(top_down::TopDown::default()),
            Strategy::Front => Self::Front(front::FrontScan::default()),
            Strategy::Event => Self::Event(Box::new(event::EventDriven::new())),
            Strategy::EventQueue => Self::Event(Box::new(event::EventDriven::queue_alone())),
            Strategy::EventPublished => Self::Published(published::Published::default()),
        }
    }

    /// A frame begins: the views have moved from `before` to `frame.views`. Appends what must flip.
    pub fn find(&mut self, frame: &Frame, before: &[View], front: &Front, flips: &mut Flips) {
        match self {
            Self::TopDown(s) => s.find(frame, front, flips),
            Self::Front(s) => s.find(frame, flips),
            Self::Event(s) => s.find(frame, flips),
            Self::Published(s) => s.find(frame, before, front, flips),
        }
    }

    /// The frame's changes have been made: whatever has come to be watched stays so. Returns how many nodes were tested for
    /// that.
    pub fn settle(&mut self, frame: &Frame) -> u64 {
        match self {
            Self::TopDown(_) | Self::Front(_) => 0,
            Self::Event(s) => s.settle(frame),
            Self::Published(s) => s.settle(),
        }
    }

    /// Calls `f` with everything that is watched, more than once if it is watched more than once: for tests.
    pub fn for_each_watched(&self, front: &Front, f: &mut impl FnMut(Slot, Kind, &Bounds)) {
        match self {
            Self::TopDown(_) => front.for_each_watched(f),
            Self::Front(s) => s.for_each_watched(f),
            Self::Event(s) => s.for_each_watched(f),
            Self::Published(s) => s.for_each_watched(front, f),
        }
    }

    /// Checks a strategy's own lists.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        match self {
            Self::TopDown(_) | Self::Published(_) => {}
            Self::Front(s) => s.assert_well_formed(),
            Self::Event(s) => s.assert_well_formed(),
        }
    }
}

/// A branch for each call, always the same way: the part of the engine that carries out changes is compiled once for a tree
/// and a sink, and not once more for each strategy.
impl Watch for Finder {
    #[inline]
    fn watch(&mut self, frame: &Frame, slot: Slot, kind: Kind, bounds: Bounds) {
        with_strategy!(self, |s| s.watch(frame, slot, kind, bounds));
    }

    #[inline]
    fn unwatch(&mut self, slot: Slot) {
        with_strategy!(self, |s| s.unwatch(slot));
    }

    #[inline]
    fn changed(&mut self, slot: Slot) {
        with_strategy!(self, |s| s.changed(slot));
    }

    fn refused(&mut self, slot: Slot, kind: Kind, bounds: Bounds) {
        with_strategy!(self, |s| s.refused(slot, kind, bounds));
    }

    #[inline]
    fn prefetch(&self, slot: Slot) {
        with_strategy!(self, |s| s.prefetch(slot));
    }
}

#[cfg(test)]
mod tests;
