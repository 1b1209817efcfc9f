//! Whether a tree and its displayed mesh are what they should be.

use vertex_tree::{NONE, NodeId};

use crate::half_edges::Adjacent;
use crate::numbering::{Owner, owner};
use crate::tree::XfmTree;

impl XfmTree {
    /// Checks the whole state: the half-edge mesh (reverses in pairs, one fan a vertex, no degenerate and no doubled
    /// triangle), the active nodes (closed upwards and over what they need, their triangles where w x y z say), counts, and
    /// the quotas' bookkeeping. It takes time with what is displayed and loaded: for tests, after every step.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    pub fn assert_well_formed(&self) {
        let levels = self.paging.blocks.file.levels();
        let mut displayed = self.paging.blocks.file.initial_faces().triangles.len() as u64;
        let (mut needs, mut needed_by, mut bytes) = (0_u64, 0_u64, 0);
        for block in self.paging.blocks.iter() {
            bytes += crate::block::resident_bytes(block.count());
            let mut active = 0;
            for offset in 0..levels.full() {
                let id = levels.node(block.number, offset);
                let Some(node) = self.paging.blocks.node(id) else { continue };
                if !node.is_active() {
                    assert_eq!((node.needed_by(), node.slots), (0, [NONE; 2]), "folded node {id:?}");
                    continue;
                }
                active += 1;
                needed_by += u64::from(node.needed_by());
                let parent = match offset {
                    0 => block.parent,
                    _ => levels.node(block.number, (offset - 1) / 2).0,
                };
                assert!(
                    parent == NONE || self.paging.blocks.is_active(NodeId(parent)),
                    "{id:?} is active below a folded node"
                );
                let [w, x, y, z] = node.stored.adjacent;
                for h in [w, x, y, z] {
                    if let Owner::Node(needed, ..) = owner(h) {
                        needs += 1;
                        assert!(
                            self.paging.blocks.is_active(needed),
                            "{id:?} is active and {needed:?}, which it needs, is not"
                        );
                    }
                }
                let sides = Adjacent { w, x, y, z }.sides();
                displayed += sides.into_iter().map(u64::from).sum::<u64>();
                if self.shown.is_some() {
                    for (slot, is_there) in node.slots.into_iter().zip(sides) {
                        assert_eq!(slot != NONE, is_there, "{id:?}: triangles");
                    }
                    if node.needed_by() == 0 {
                        self.assert_beside(node.slots, [w, x, y, z], id);
                    }
                }
            }
            assert_eq!(active, block.active, "active nodes of block {}", block.number);
        }
        assert_eq!(needs, needed_by, "nodes are needed as often as others need them");
        assert_eq!(bytes, self.paging.blocks.bytes, "bytes of loaded blocks");
        assert_eq!(displayed, self.displayed, "triangles displayed");
        if let Some(shown) = &self.shown {
            shown.assert_well_formed(displayed);
        }
    }

    /// The triangles of a node that no other needs lie between w x y z as stored.
    fn assert_beside(&self, slots: [u32; 2], adjacent: [u32; 4], id: NodeId) {
        let Some(shown) = &self.shown else { return };
        if let [first, second] = slots
            && first != NONE
            && second != NONE
        {
            assert_eq!(shown.edges.rev(4 * first), 4 * second, "{id:?}: its triangles are apart");
        }
        for (side, slot) in slots.into_iter().enumerate().filter(|&(_, slot)| slot != NONE) {
            for i in 0..2 {
                let h = adjacent[2 * side + i];
                let found = shown.edges.rev(4 * slot + 1 + i as u32);
                assert_eq!(Some(found), self.half_edge(h), "{id:?}: what lies beside its triangles");
            }
        }
    }
}
