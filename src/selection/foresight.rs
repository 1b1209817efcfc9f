//! Foresight: which nodes will change their status in the next frames, for backends that fetch pages ahead.
//!
//! The event queue knows, with a proof, before which time a node can not change. That is what a pager wants to know, but
//! as a guide to what to fetch it is early for most nodes: it allows for every motion that the camera might make. So it
//! serves as a filter, and what passes is tested against the views that the camera will have at a few instants ahead if it
//! goes on as it does (see [`trend`](self)): a node is named with the first instant at which it is wrong.
//!
//! What is below a node that will unfold is asked of the backend ([`Hierarchy::peek`]), down to where its pages end;
//! what is above one that will fold is in the front. Nodes are named in the order of the instants, and of what follows
//! from what.
//!
//! No node is named unless it is wrong in one of the views ahead, and these are within reach at the declared speed, or at
//! the camera's own where that is faster: nothing that can not be due by then is ever named.

mod ahead;
mod candidates;
mod trend;

use rustc_hash::FxHashSet;
use vertex_tree::{Bounds, Hierarchy, NodeId};

pub(crate) use self::ahead::Watched;
use self::ahead::{Ahead, Change, MOST_INSTANTS};
use self::candidates::Candidates;
use self::trend::Trend;
use crate::filter::MOST_VIEWS;
use crate::front::Front;
use crate::refine::Frame;
use crate::view::View;

/// The furthest that is looked ahead, in frames.
const MOST_FRAMES: u32 = 1 << (MOST_INSTANTS - 2);

/// No more nodes are named in a frame: after a teleport, only the most urgent ones are.
const MOST_NAMED: usize = 1 << 15;

/// What is kept from frame to frame, above all allocations.
#[derive(Default)]
pub(crate) struct Foresight {
    trend: Trend,
    instants: Vec<u32>,
    /// The views at each instant, those of one instant together.
    views: Vec<View>,
    candidates: Candidates,
    /// For each instant, the nodes that are wrong at it and were right before.
    agenda: [Vec<Change>; MOST_INSTANTS],
    peeked: Vec<(NodeId, Bounds)>,
    /// Nodes that have been named and can be come upon again.
    named: FxHashSet<NodeId>,
}

impl Foresight {
    /// A frame has passed in which nobody has asked for foresight.
    #[inline]
    pub fn skip(&mut self) {
        self.trend.forget();
    }

    /// Names to `tree` what will change within `look_ahead` frames. `before` are the views of the frame before,
    /// `unfinished` says whether something that is wanted now has been refused. Returns how many nodes were named.
    pub fn look<T: Hierarchy>(
        &mut self,
        tree: &mut T,
        watched: Watched,
        frame: &Frame,
        before: &[View],
        look_ahead: u32,
        unfinished: bool,
    ) -> u64 {
        self.trend.observe(before, frame.views);
        self.set_instants(look_ahead);
        self.views.clear();
        let moves = self.trend.carry_on(frame.views, &self.instants, &frame.speed, &mut self.views);
        if !moves && !unfinished {
            return 0;
        }
        if frame.views.is_empty() || frame.views.len() > MOST_VIEWS {
            // Nothing is wanted without a view; more views than the filter takes are not worth a second way.
            return 0;
        }
        let ahead = Ahead { frame, views: &self.views, instants: self.instants.len() };
        self.candidates.find(&ahead, watched, &mut self.agenda);
        self.name(tree, watched.front, frame)
    }

    fn set_instants(&mut self, look_ahead: u32) {
        let last = look_ahead.clamp(1, MOST_FRAMES);
        self.instants.clear();
        self.instants.extend((0..).map(|power| 1 << power).take_while(|&frames| frames < last));
        self.instants.push(last);
    }

    /// Names what is on the agenda, and what follows from it.
    fn name<T: Hierarchy>(&mut self, tree: &mut T, front: &Front, frame: &Frame) -> u64 {
        let Self { instants, views, agenda, peeked, named, .. } = self;
        named.clear();
        let count = instants.len();
        let criterion = frame.criterion;
        let views_at = |at: usize| &views[at * frame.views.len()..][..frame.views.len()];
        // The first instant from one on at which a node that is not in play is wanted; what its normals say is not known.
        let first = |from, bounds: &Bounds| (from..count).find(|&at| criterion.unfold(views_at(at), bounds));
        let mut total = 0;
        for at in 0..count {
            while let Some(change) = agenda[at].pop() {
                if total == MOST_NAMED {
                    agenda.iter_mut().for_each(Vec::clear);
                    return total as u64;
                }
                match change {
                    Change::Unfold(node) => {
                        // In a graph there may be several ways down to a node. The first is by the earliest instant.
                        if !T::IS_TREE && !named.insert(node) {
                            continue;
                        }
                        tree.will_need(node, instants[at]);
                        peeked.clear();
                        tree.peek(node, peeked);
                        for &(child, bounds) in &*peeked {
                            if let Some(then) = first(at, &bounds) {
                                agenda[then].push(Change::Unfold(child));
                            }
                        }
                    }
                    Change::Fold(slot) => {
                        let node = front.node(slot);
                        if !named.insert(node) {
                            continue;
                        }
                        tree.will_need(node, instants[at]);
                        for parent in front.parents(tree, slot) {
                            // What is wanted below the parent makes the parent wanted too: if it is not, nothing is.
                            let bounds = front.bounds(parent);
                            let is_wanted = |at| frame.unfold_in(views_at(at), parent, &bounds);
                            if let Some(then) = (at..count).find(|&at| !is_wanted(at)) {
                                agenda[then].push(Change::Fold(parent));
                            }
                        }
                    }
                }
                total += 1;
            }
        }
        total as u64
    }
}
