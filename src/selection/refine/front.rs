//! Front scan: every boundary and every collapsible node is tested, every frame, in packed arrays.
//!
//! What systems that keep an explicit list of front vertices do (Hoppe 1997; El-Sana & Varshney 1999), with vector
//! instructions. Half of the nodes that top-down visits lie above the front and need no test.

use multiversion::multiversion;
use vertex_tree::{Bounds, prefetch};

use super::frame::{Flips, Frame};
use super::watch::Watch;
use crate::filter::{Lens, Lenses, certainly, doubtful, for_each_bit};
use crate::in_play::{Kind, Slot};
use crate::packed::Packed;

#[derive(Default)]
pub(crate) struct FrontScan {
    /// Boundary nodes, and collapsible nodes.
    folded: Packed,
    unfolded: Packed,
    /// For each slot, twice the place of its entry in one of the two, plus 1 in the second, plus 2; or 0.
    place: Vec<u32>,
}

impl FrontScan {
    pub fn find(&self, frame: &Frame, flips: &mut Flips) {
        let lenses = Lenses::new(frame.criterion, frame.views);
        self.find_with(frame, lenses.as_ref().map(Lenses::as_slice), flips);
    }

    /// The same with the views' lenses, if there are any.
    pub fn find_with(&self, frame: &Frame, lenses: Option<&[Lens]>, flips: &mut Flips) {
        flips.tests += self.len() as u64;
        scan(&self.folded, Kind::Unfold, lenses, frame, &mut flips.unfold);
        scan(&self.unfolded, Kind::Fold, lenses, frame, &mut flips.fold);
    }

    /// What is watched, boundary nodes and collapsible nodes; tags are slots.
    pub fn watched(&self) -> [(&Packed, Kind); 2] {
        [(&self.folded, Kind::Unfold), (&self.unfolded, Kind::Fold)]
    }

    pub fn for_each_watched(&self, f: &mut impl FnMut(Slot, Kind, &Bounds)) {
        for (packed, kind) in self.watched() {
            for (block, used) in packed.blocks() {
                (0..used).for_each(|lane| f(Slot(block.tag[lane]), kind, &block.bounds(lane)));
            }
        }
    }

    /// Checks that each entry is where its slot says, and no slot says more.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        for (packed, kind) in self.watched() {
            for (at, slot) in (0..).zip(packed.blocks().flat_map(|(block, used)| &block.tag[..used])) {
                let place = 2 * at + u32::from(kind == Kind::Fold) + 2;
                assert_eq!(self.place[*slot as usize], place, "where slot {slot} is watched");
            }
        }
        let places = self.place.iter().filter(|&&place| place != 0).count();
        assert_eq!(places, self.folded.len() + self.unfolded.len(), "slots that are watched");
    }

    /// How many nodes are watched.
    pub fn len(&self) -> usize {
        self.folded.len() + self.unfolded.len()
    }

    /// Watches a node, if it is not watched already.
    #[inline]
    pub fn put(&mut self, slot: Slot, kind: Kind, bounds: Bounds) {
        if self.place.len() <= slot.index() {
            self.place.resize(slot.index() + 1, 0);
        }
        if self.place[slot.index()] == 0 {
            let packed = self.packed(kind == Kind::Fold);
            packed.push(&bounds, slot.0);
            let at = packed.len() as u32 - 1;
            self.place[slot.index()] = 2 * at + u32::from(kind == Kind::Fold) + 2;
        }
    }

    /// No longer watches a node. Whether it did.
    #[inline]
    pub fn remove(&mut self, slot: Slot) -> bool {
        let Some(place) = self.place.get_mut(slot.index()) else { return false };
        let Some(place) = std::mem::take(place).checked_sub(2) else { return false };
        if let Some(moved) = self.packed(place % 2 == 1).swap_remove(place as usize / 2) {
            self.place[moved as usize] = place + 2;
        }
        true
    }

    /// Starts to read where a node is watched.
    #[inline(always)]
    pub fn prefetch_place(&self, slot: Slot) {
        prefetch(&self.place, slot.index());
    }

    fn packed(&mut self, unfolded: bool) -> &mut Packed {
        if unfolded { &mut self.unfolded } else { &mut self.folded }
    }
}

impl Watch for FrontScan {
    fn watch(&mut self, _: &Frame, slot: Slot, kind: Kind, bounds: Bounds) {
        self.put(slot, kind, bounds);
    }

    #[inline]
    fn unwatch(&mut self, slot: Slot) {
        self.remove(slot);
    }

    fn refused(&mut self, slot: Slot, kind: Kind, bounds: Bounds) {
        // What is watched is tested in every frame anyway.
        self.put(slot, kind, bounds);
    }
}

/// Appends the nodes among `packed` that must flip. Without lenses the filter is passed over.
#[multiversion(targets("x86_64+avx2", "x86_64+sse4.1"))]
fn scan(packed: &Packed, kind: Kind, lenses: Option<&[Lens]>, frame: &Frame, flips: &mut Vec<Slot>) {
    for (block, used) in packed.blocks() {
        let mask = match lenses {
            // A boundary node flips unless it is certainly not wanted, a collapsible one unless it certainly is.
            Some(lenses) => match kind {
                Kind::Unfold => doubtful(&certainly::<false>(block, lenses), used),
                // The filter knows of no cones: what it is certain of may be seen from behind.
                Kind::Fold if frame.cones.is_some() => (1 << used) - 1,
                Kind::Fold => doubtful(&certainly::<true>(block, lenses), used),
            },
            None => (1 << used) - 1,
        };
        for_each_bit(mask, |lane| {
            let slot = Slot(block.tag[lane]);
            if frame.unfold(slot, &block.bounds(lane)) == (kind == Kind::Unfold) {
                flips.push(slot);
            }
        });
    }
}

#[cfg(test)]
mod tests;
