//! Where the nodes in play of a graph are.
//!
//! Nodes that are visited together have numbers that are close ([`NodeId`]), and few of all are in play. So the table is in
//! pieces, and there are only those with a node in play: 8 bytes for every 256 nodes, and a kilobyte a piece.

use vertex_tree::NodeId;

use crate::in_play::Slot;

/// Nodes of a piece.
const PIECE: usize = 256;

struct Piece {
    slots: [Slot; PIECE],
    in_play: u32,
}

/// The slots of nodes in play.
#[derive(Default)]
pub(crate) struct SlotTable {
    pieces: Vec<Option<Box<Piece>>>,
    /// A piece that was let go of: nodes at its edge come and go.
    spare: Option<Box<Piece>>,
}

impl SlotTable {
    /// For nodes below a limit, none of them in play.
    pub fn new(limit: u32) -> Self {
        let mut pieces = Vec::new();
        pieces.resize_with((limit as usize).div_ceil(PIECE), || None);
        Self { pieces, spare: None }
    }

    /// Where a node is; [`Slot::NONE`] if it is not in play.
    #[inline(always)]
    pub fn get(&self, node: NodeId) -> Slot {
        match &self.pieces[node.index() / PIECE] {
            Some(piece) => piece.slots[node.index() % PIECE],
            None => Slot::NONE,
        }
    }

    /// A node is in play, in a slot.
    #[inline(always)]
    pub fn insert(&mut self, node: NodeId, slot: Slot) {
        let piece = self.pieces[node.index() / PIECE].get_or_insert_with(|| {
            self.spare.take().unwrap_or_else(|| Box::new(Piece { slots: [Slot::NONE; PIECE], in_play: 0 }))
        });
        let before = std::mem::replace(&mut piece.slots[node.index() % PIECE], slot);
        piece.in_play += u32::from(before == Slot::NONE);
    }

    /// A node is not in play any more.
    #[inline(always)]
    pub fn remove(&mut self, node: NodeId) {
        let place = &mut self.pieces[node.index() / PIECE];
        let Some(piece) = place else { return };
        let before = std::mem::replace(&mut piece.slots[node.index() % PIECE], Slot::NONE);
        piece.in_play -= u32::from(before != Slot::NONE);
        if piece.in_play == 0 {
            self.spare = place.take();
        }
    }

    /// How many nodes are in play.
    pub fn len(&self) -> usize {
        self.pieces.iter().flatten().map(|piece| piece.in_play as usize).sum()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn agrees_with_an_ordered_map() {
        let limit = 1000;
        let (mut table, mut model) = (SlotTable::new(limit), BTreeMap::new());
        let mut random = Pcg64::seed_from_u64(1);
        for step in 1..20_000_u32 {
            // Now here, now there, so that pieces come and go.
            let around = 300 * (step / 1000 % 3);
            let node = NodeId(around + random.random_range(0..300));
            if model.remove(&node).is_some() {
                table.remove(node);
            } else if model.len() < 3 || random.random() {
                table.insert(node, Slot(step));
                model.insert(node, Slot(step));
            }
            let probe = NodeId(random.random_range(0..limit));
            assert_eq!(table.get(probe), model.get(&probe).copied().unwrap_or(Slot::NONE));
        }
        let pieces = |table: &SlotTable| table.pieces.iter().flatten().count();
        assert!(pieces(&table) <= 4 && pieces(&table) > 0);
        model.keys().for_each(|&node| table.remove(node));
        assert_eq!(pieces(&table), 0);
    }
}
