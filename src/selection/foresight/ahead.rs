//! What candidates are found among, and tested with.

use vertex_tree::{Bounds, NodeId};

use crate::carried::Carried;
use crate::filter::Lenses;
use crate::front::Front;
use crate::in_play::{Kind, Slot};
use crate::refine::{Finder, Frame};
use crate::view::View;
use crate::waiting::Waiting;

/// Instants that are looked at: the next frame, then 2, 4, 8 and so on, and the last that is asked for.
pub(super) const MOST_INSTANTS: usize = 8;

/// A node that will change, and whose change may lead to others.
#[derive(Clone, Copy)]
pub(super) enum Change {
    /// A node that is folded now, and perhaps not even in play.
    Unfold(NodeId),
    Fold(Slot),
}

/// What is known at the end of a frame of the nodes that can change next: what a strategy watches, and what waits.
#[derive(Clone, Copy)]
pub(crate) struct Watched<'a> {
    pub front: &'a Front,
    pub finder: &'a Finder,
    pub waiting: &'a Waiting,
    pub carried: &'a Carried,
}

/// The views at the instants ahead.
pub(super) struct Ahead<'a> {
    pub frame: &'a Frame<'a>,
    pub views: &'a [View],
    pub instants: usize,
}

impl Ahead<'_> {
    pub fn at(&self, instant: usize) -> &[View] {
        let count = self.frame.views.len();
        &self.views[instant * count..][..count]
    }

    /// Whether a node will have to change at an instant if nothing happens before.
    pub fn is_wrong(&self, instant: usize, kind: Kind, slot: Slot, bounds: &Bounds) -> bool {
        self.frame.unfold_in(self.at(instant), slot, bounds) == (kind == Kind::Unfold)
    }

    pub fn lenses(&self, instant: usize) -> Option<Lenses> {
        Lenses::new(self.frame.criterion, self.at(instant))
    }
}
