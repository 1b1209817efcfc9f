//! What a strategy is given, and what it finds.

use vertex_tree::Bounds;

use crate::criterion::Criterion;
use crate::in_play::{Kind, Slot};
use crate::motion::{Course, Motion, Speed, Travel};
use crate::normal_cone::{self, Cones};
use crate::view::View;

/// What a strategy knows of the frame.
pub(crate) struct Frame<'a> {
    pub criterion: Criterion,
    pub views: &'a [View],
    pub speed: Speed,
    /// The motion in terms of the declared speed.
    pub motion: Motion,
    /// The motion from the last frame; `None` if the views can not be compared.
    pub travel: Option<Travel<'a>>,
    /// Whether foresight looks at the nodes that can change soon.
    pub looks_ahead: bool,
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
