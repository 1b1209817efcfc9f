//! Whether an engine's state is what it should be.

use vertex_tree::{Bounds, Hierarchy};

use super::Engine;
use crate::in_play::{Kind, Slot};
use crate::refine::Finder;

impl<T: Hierarchy, S> Engine<T, S> {
    /// Checks the whole state between two frames: the front's records, links and counts against the backend's structure; that
    /// each boundary node and each collapsible node is watched exactly once, for the change that it is due for, by the
    /// strategy or among the changes set aside, and nothing else is; the strategy's own lists; and what the backend can
    /// say of itself ([`Hierarchy::assert_well_formed`]). It takes time with the front and asks the backend about every
    /// node in play, of which some may have to be read: for tests, after every frame.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        self.front.assert_well_formed(&self.tree);
        self.finder.assert_well_formed();
        self.carried.assert_well_formed();
        self.assert_watched();
        self.tree.assert_well_formed();
    }

    #[track_caller]
    fn assert_watched(&self) {
        let front = &self.front;
        let mut watched = vec![[0_u32; 2]; front.slots()];
        let mut wrong = None;
        let mut watch = |slot: Slot, kind: Kind, bounds: &Bounds| {
            watched[slot.index()][usize::from(kind == Kind::Fold)] += 1;
            if front.bounds(slot) != *bounds {
                wrong = Some(slot);
            }
        };
        // Who looks at everything finds what is carried too, and leaves it to the list.
        let looks_at_everything = matches!(self.finder, Finder::TopDown(_));
        self.finder.for_each_watched(front, &mut |slot, kind, bounds| {
            if !(looks_at_everything && self.carried.contains(slot)) {
                watch(slot, kind, bounds);
            }
        });
        self.carried.for_each(|kind, slot| watch(slot, kind, &front.bounds(slot)));
        for (slot, kind) in self.waiting.valid(front) {
            watch(slot, kind, &front.bounds(slot));
        }
        if let Some(slot) = wrong {
            panic!("{:?} in {slot:?} is watched with bounds that are not its own", front.node(slot));
        }
        for (slot, watched) in (0..).map(Slot).zip(watched) {
            let record = front.record(slot);
            let expected = [record.is_boundary(), record.is_collapsible()].map(u32::from);
            let node = record.node;
            assert_eq!(
                watched, expected,
                "{node:?} in {slot:?}: how often it is watched to unfold and to fold"
            );
        }
    }
}
