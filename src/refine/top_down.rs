//! Top-down traversal (Zach & Karner 2003, Figure 3): every node in play is tested, every frame.
//!
//! The paper recurses. Here the hierarchy is walked level by level: the nodes of a level are known before the first
//! of them is read, so that the processor fetches several at once instead of waiting for each in turn, and as
//! backends number nodes depth-first, each level reads memory in ascending order.

use vertex_tree::{Bounds, NodeId};

use super::{Flips, Frame};
use crate::front::Front;

#[derive(Default)]
pub(crate) struct TopDown {
    level: Vec<NodeId>,
    below: Vec<NodeId>,
}

impl TopDown {
    pub fn find(&mut self, frame: &Frame, roots: &[NodeId], front: &Front, flips: &mut Flips) {
        // One view is the rule, and worth a loop without a loop in it.
        match frame.views {
            [view] => self.walk(roots, front, flips, |bounds| frame.criterion.unfold_for(view, bounds)),
            _ => self.walk(roots, front, flips, |bounds| frame.unfold(bounds)),
        }
    }

    #[inline(always)]
    fn walk(&mut self, roots: &[NodeId], front: &Front, flips: &mut Flips, unfold: impl Fn(&Bounds) -> bool) {
        self.level.clear();
        self.level.extend_from_slice(roots);
        while !self.level.is_empty() {
            flips.tests += self.level.len() as u64;
            self.below.clear();
            for &node in &self.level {
                let (bounds, active) = front.visit(node, &mut self.below);
                let wanted = unfold(bounds);
                if wanted != active {
                    if wanted {
                        flips.unfold.push(node);
                    } else if front.is_collapsible(node) {
                        // The rest of a subtree that has to go follows from its lowest nodes upwards.
                        flips.fold.push(node);
                    }
                }
            }
            std::mem::swap(&mut self.level, &mut self.below);
        }
    }
}
