//! Front scan: every boundary and every collapsible node is tested, every frame, in a packed array.
//!
//! What systems that keep an explicit list of front vertices do (Hoppe 1997; El-Sana & Varshney 1999). Half of the
//! nodes that top-down visits lie above the front and need no test.

use vertex_tree::{Bounds, NodeId};

use super::{Flips, Frame};
use crate::queue::Kind;

#[derive(Clone, Copy)]
struct Entry {
    bounds: Bounds,
    node: NodeId,
    kind: Kind,
}

pub(crate) struct FrontScan {
    entries: Vec<Entry>,
    /// For each node, the place of its entry plus 1, or 0.
    place: Vec<u32>,
}

impl FrontScan {
    pub fn new(node_limit: u32) -> Self {
        Self { entries: Vec::new(), place: vec![0; node_limit as usize] }
    }

    pub fn find(&self, frame: &Frame, flips: &mut Flips) {
        flips.tests += self.entries.len() as u64;
        match frame.views {
            [view] => self.scan(flips, |bounds| frame.criterion.unfold_for(view, bounds)),
            _ => self.scan(flips, |bounds| frame.unfold(bounds)),
        }
    }

    #[inline(always)]
    fn scan(&self, flips: &mut Flips, unfold: impl Fn(&Bounds) -> bool) {
        for entry in &self.entries {
            if unfold(&entry.bounds) == (entry.kind == Kind::Unfold) {
                match entry.kind {
                    Kind::Unfold => flips.unfold.push(entry.node),
                    Kind::Fold => flips.fold.push(entry.node),
                }
            }
        }
    }

    pub fn watch(&mut self, node: NodeId, kind: Kind, bounds: Bounds) {
        if self.place[node.index()] == 0 {
            self.entries.push(Entry { bounds, node, kind });
            self.place[node.index()] = self.entries.len() as u32;
        }
    }

    pub fn unwatch(&mut self, node: NodeId) {
        let Some(at) = std::mem::take(&mut self.place[node.index()]).checked_sub(1) else { return };
        self.entries.swap_remove(at as usize);
        if let Some(moved) = self.entries.get(at as usize) {
            self.place[moved.node.index()] = at + 1;
        }
    }
}
