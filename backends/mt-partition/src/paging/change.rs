//! What a change of the front needs.

use vertex_tree::NONE;

use crate::record::Record;

/// Which neighbours a change needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Unfold,
    Fold,
}

impl Change {
    /// The nodes that the change of a node needs beyond the node itself.
    #[inline(always)]
    pub fn neighbours(self, record: &Record, mut f: impl FnMut(u32)) {
        match self {
            Self::Unfold => record.below().for_each(f),
            Self::Fold => record.above().filter(|&(n, _)| n != NONE).for_each(|(n, _)| f(n)),
        }
    }
}

/// What room is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Need {
    /// A change, as long as the frame lasts: only what no cut holds and nobody foresees gives way.
    Change,
    /// A change, at the end of the frame: everything gives way that is not needed at this moment.
    Pressing,
    /// Something needed in this frame at the earliest: nothing gives way that is needed as soon.
    Foreseen(u64),
}
