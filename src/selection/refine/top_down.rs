//! Top-down traversal (Zach & Karner 2003, Figure 3): every node in play is tested, every frame.
//!
//! The paper's recursion, with a stack. Records lie in the order in which the front descended, which is that of this
//! walk where nothing has changed since: memory is read in sequence.

use super::frame::{Flips, Frame};
use super::watch::Watch;
use crate::front::Front;
use crate::in_play::{Kind, Slot};
use vertex_tree::{Bounds, NONE};

#[derive(Default)]
pub(crate) struct TopDown {
    /// Pairs of siblings to visit. Kept between frames for its allocation.
    stack: Vec<u32>,
}

impl TopDown {
    pub fn find(&mut self, frame: &Frame, front: &Front, flips: &mut Flips) {
        // One view is the rule, and worth a loop without a loop in it.
        match frame.views {
            [view] if frame.cones.is_none() => {
                self.walk(front, flips, |_, bounds| frame.criterion.unfold_for(view, bounds));
            }
            _ => self.walk(front, flips, |slot, bounds| frame.unfold(slot, bounds)),
        }
    }

    #[inline(always)]
    fn walk(&mut self, front: &Front, flips: &mut Flips, unfold: impl Fn(Slot, &Bounds) -> bool) {
        self.stack.clear();
        self.stack.extend_from_slice(front.root_pairs());
        while let Some(pair) = self.stack.pop() {
            let records = front.pair(pair);
            // What is below both first, so that it comes while they are tested.
            records.iter().for_each(|record| front.descend(record, &mut self.stack));
            for (side, record) in (0..).zip(records) {
                if record.node.0 == NONE {
                    continue;
                }
                flips.tests += 1;
                let slot = Slot(2 * pair + side);
                let (wanted, active) = (unfold(slot, &record.bounds), record.is_active());
                if wanted != active && !record.is_waiting() {
                    if wanted {
                        if record.is_boundary() {
                            flips.unfold.push(slot);
                        }
                    } else if record.is_collapsible() {
                        // The rest of a subtree that has to go follows from its lowest nodes upwards.
                        flips.fold.push(slot);
                    }
                }
            }
        }
    }
}

/// It looks at everything anyway, but for changes that wait, which the front tells.
impl Watch for TopDown {
    #[inline(always)]
    fn watch(&mut self, _: &Frame, _: Slot, _: Kind, _: Bounds) {}

    #[inline(always)]
    fn unwatch(&mut self, _: Slot) {}

    fn refused(&mut self, _: Slot, _: Kind, _: Bounds) {}
}
