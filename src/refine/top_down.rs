//! Top-down traversal (Zach & Karner 2003, Figure 3): every node in play is tested, every frame.
//!
//! The paper's recursion, with a stack that holds at most one node a level. Records lie in depth-first order, so the
//! walk reads memory in sequence.

use vertex_tree::NodeId;

use super::{Flips, Frame};
use crate::front::Front;

#[derive(Default)]
pub(crate) struct TopDown {
    stack: Vec<NodeId>,
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
    fn walk(
        &mut self,
        roots: &[NodeId],
        front: &Front,
        flips: &mut Flips,
        unfold: impl Fn(&vertex_tree::Bounds) -> bool,
    ) {
        for &root in roots {
            self.stack.push(root);
            while let Some(mut node) = self.stack.pop() {
                loop {
                    let visit = front.visit(node);
                    flips.tests += 1;
                    let wanted = unfold(&visit.bounds);
                    if wanted != visit.active {
                        if wanted {
                            flips.unfold.push(node);
                        } else if front.is_collapsible(node) {
                            // The rest of a subtree that has to go follows from its lowest nodes upwards.
                            flips.fold.push(node);
                        }
                    }
                    self.stack.extend(visit.next_sibling);
                    let Some(child) = visit.first_child else { break };
                    node = child;
                }
            }
        }
    }
}
