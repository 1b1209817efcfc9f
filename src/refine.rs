//! Refinement strategies: ways to find the nodes whose status must flip. All else is shared (see
//! [`engine`](crate::engine)), and all must arrive at the same cut.

pub mod event;
pub mod front;
pub mod published;
pub mod top_down;

use vertex_tree::Bounds;

use crate::criterion::Criterion;
use crate::front::{Front, Slot};
use crate::motion::{Course, Motion, Speed};
use crate::normal_cone::{self, Cones};
use crate::queue::Kind;
use crate::view::View;

/// How the nodes that must change are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Strategy {
    /// Walk all active and boundary nodes from the roots, every frame (Zach & Karner, Figure 3).
    TopDown,
    /// Scan all boundary and all collapsible nodes, every frame, in a packed array.
    Front,
    /// Test a node only when the camera could have changed the answer: an event queue on an odometer clock.
    Event,
    /// The event queue as published, with its time bounds, integer frames and lists of nodes. It misses flips: its
    /// bounds are not conservative. For comparison.
    EventPublished,
}

impl Strategy {
    /// All of them, in the order of reports.
    pub const ALL: [Self; 4] = [Self::TopDown, Self::Front, Self::Event, Self::EventPublished];

    /// The name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::TopDown => "top-down",
            Self::Front => "front",
            Self::Event => "event",
            Self::EventPublished => "event-published",
        }
    }

    /// Whether its cut is the oracle's in every frame.
    #[must_use]
    pub fn is_exact(self) -> bool {
        self != Self::EventPublished
    }
}

/// What a strategy knows of the frame.
pub(crate) struct Frame<'a> {
    pub criterion: Criterion,
    pub views: &'a [View],
    pub speed: Speed,
    pub motion: Motion,
    /// Of the nodes in play, where the normal-cone test is part of the criterion.
    pub cones: Option<&'a Cones>,
}

impl Frame<'_> {
    /// Whether the node in a slot, which has these bounds, is wanted.
    #[inline]
    pub fn unfold(&self, slot: Slot, bounds: &Bounds) -> bool {
        self.criterion.unfold(self.views, bounds) && self.is_seen(slot, bounds)
    }

    /// Whether it would be in other views.
    pub fn unfold_in(&self, views: &[View], slot: Slot, bounds: &Bounds) -> bool {
        match self.cones {
            None => self.criterion.unfold(views, bounds),
            Some(cones) => normal_cone::unfold(self.criterion, views, bounds, &cones.of(slot)),
        }
    }

    /// How urgent a change is that is wanted, not negative: of unfolds that of most error first, of folds the least wanted.
    pub fn urgency(&self, kind: Kind, bounds: &Bounds) -> f64 {
        let urgency = self.criterion.urgency(self.views, bounds);
        if kind == Kind::Fold { 1.0 - urgency.min(1.0) } else { urgency }
    }

    /// [`unfold`](Self::unfold) of two nodes.
    #[inline(always)]
    pub fn unfold_both(&self, slots: [Slot; 2], bounds: [&Bounds; 2]) -> [bool; 2] {
        let wanted = self.criterion.unfold_both(self.views, bounds);
        match self.cones {
            None => wanted,
            Some(_) => [0, 1].map(|i| wanted[i] && self.is_seen(slots[i], bounds[i])),
        }
    }

    /// Whether one of the views that want a node does not see it from behind.
    #[inline]
    fn is_seen(&self, slot: Slot, bounds: &Bounds) -> bool {
        self.cones
            .is_none_or(|cones| normal_cone::unfold(self.criterion, self.views, bounds, &cones.of(slot)))
    }

    /// How many frames on a course must pass before the node in a slot can have to change.
    #[inline]
    pub fn earliest(&self, course: &Course, slot: Slot, kind: Kind, bounds: &Bounds) -> f64 {
        let (criterion, views) = (self.criterion, self.views);
        match (self.cones.map(|cones| cones.of(slot)), kind) {
            (None, Kind::Unfold) => criterion.earliest_unfold(views, course, bounds),
            (None, Kind::Fold) => criterion.earliest_fold(views, course, bounds),
            (Some(cone), Kind::Unfold) => {
                normal_cone::earliest_unfold(criterion, views, course, bounds, &cone)
            }
            (Some(cone), Kind::Fold) => normal_cone::earliest_fold(criterion, views, course, bounds, &cone),
        }
    }
}

/// Nodes whose status must flip: boundary nodes to unfold, collapsible nodes to fold.
#[derive(Default)]
pub(crate) struct Flips {
    pub unfold: Vec<Slot>,
    pub fold: Vec<Slot>,
    /// Tests of the criterion made to find them.
    pub tests: u64,
}

/// A strategy's state, as the part of the engine that carries out changes sees it: that is compiled for each strategy
/// apart, since several of these calls are made for every change.
///
/// The engine tells of every node that becomes or ceases to be a boundary node or collapsible, so that a strategy can
/// watch just these.
pub(crate) trait Watch {
    /// The node has become a boundary node or collapsible; the criterion does not ask for it to change.
    fn watch(&mut self, frame: &Frame, slot: Slot, kind: Kind, bounds: Bounds);

    /// The node is no longer what it was watched as, if it was watched.
    fn unwatch(&mut self, slot: Slot);

    /// The same for a node whose status has just changed: what it was watched for has come up.
    #[inline(always)]
    fn changed(&mut self, slot: Slot) {
        self.unwatch(slot);
    }

    /// The node should have changed, but the backend refused for now: it must be found again in the next frame, even
    /// if nothing moves.
    fn refused(&mut self, slot: Slot, kind: Kind, bounds: Bounds);

    /// Starts to read into the cache what [`unwatch`](Self::unwatch) and [`watch`](Self::watch) will touch.
    #[inline(always)]
    fn prefetch(&self, slot: Slot) {
        let _ = slot;
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
            $crate::refine::Finder::TopDown($strategy) => $body,
            $crate::refine::Finder::Front($strategy) => $body,
            $crate::refine::Finder::Event($strategy) => {
                let $strategy = &mut **$strategy;
                $body
            }
            $crate::refine::Finder::Published($strategy) => $body,
        }
    };
}
pub(crate) use with_strategy;

impl Finder {
    pub fn new(strategy: Strategy) -> Self {
        match strategy {
            Strategy::TopDown => Self::TopDown(top_down::TopDown::default()),
            Strategy::Front => Self::Front(front::FrontScan::default()),
            Strategy::Event => Self::Event(Box::new(event::EventDriven::new())),
            Strategy::EventPublished => Self::Published(published::Published::default()),
        }
    }

    /// A frame begins: the views have moved from `before` to `frame.views`. Appends what must flip.
    pub fn find(&mut self, frame: &Frame, before: &[View], front: &Front, flips: &mut Flips) {
        match self {
            Self::TopDown(s) => s.find(frame, front, flips),
            Self::Front(s) => s.find(frame, flips),
            Self::Event(s) => s.find(frame, before, flips),
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
