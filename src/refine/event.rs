//! Event-driven refinement: a node is tested only when the camera could have changed the answer.
//!
//! After Zach & Karner (2003), with time bounds that never miss (see [`criterion`](crate::criterion)) on a clock
//! that runs on distance travelled (see [`motion`](crate::motion)): exact at any speed of the camera.

use vertex_tree::{Bounds, NodeId};

use super::{Flips, Frame};
use crate::motion::Motion;
use crate::queue::{Event, EventQueue, Kind};

pub(crate) struct EventDriven {
    queue: EventQueue,
    /// Kept between frames for its allocation.
    due: Vec<Event>,
}

impl EventDriven {
    pub fn new(node_limit: u32) -> Self {
        Self { queue: EventQueue::new(node_limit), due: Vec::new() }
    }

    pub fn find(&mut self, frame: &Frame, flips: &mut Flips) {
        self.due.clear();
        match frame.motion {
            Motion::Rest => self.queue.advance(frame.now, false, &mut self.due),
            Motion::Frames(_) => self.queue.advance(frame.now, true, &mut self.due),
            Motion::Unbounded => self.queue.take_all(&mut self.due),
        }
        flips.tests += self.due.len() as u64;
        for &event in &self.due {
            let frames = bound(frame, event.kind, &event.bounds);
            // A positive bound says that nothing can have changed yet; only then is the predicate spared.
            if frames == 0.0 && frame.unfold(&event.bounds) == (event.kind == Kind::Unfold) {
                match event.kind {
                    Kind::Unfold => flips.unfold.push(event.node),
                    Kind::Fold => flips.fold.push(event.node),
                }
            } else {
                self.queue.reschedule(frame.now, frames, event);
            }
        }
    }

    pub fn watch(&mut self, frame: &Frame, node: NodeId, kind: Kind, bounds: Bounds) {
        self.queue.schedule(frame.now, bound(frame, kind, &bounds), node, kind, bounds);
    }

    pub fn unwatch(&mut self, node: NodeId) {
        self.queue.cancel(node);
    }

    pub fn refused(&mut self, node: NodeId, kind: Kind, bounds: Bounds) {
        self.queue.press(node, kind, bounds);
    }
}

/// Frames at full speed before the node can have to change.
#[inline]
fn bound(frame: &Frame, kind: Kind, bounds: &Bounds) -> f64 {
    match kind {
        Kind::Unfold => frame.criterion.earliest_unfold(frame.views, &frame.speed, bounds),
        Kind::Fold => frame.criterion.earliest_fold(frame.views, &frame.speed, bounds),
    }
}
