//! How nodes in play are named (see [`front`](crate::front)), and the changes that they wait for.

/// Where the record of a node in play is. Used again when the node has gone out of play.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Slot(pub u32);

impl Slot {
    /// Stands for no node.
    pub const NONE: Self = Self(0);

    /// The slot as an array index.
    #[inline(always)]
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }

    #[inline(always)]
    pub(crate) fn pair(self) -> usize {
        self.0 as usize / 2
    }
}

/// Which status change an event waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// The node is a boundary node: it may have to unfold.
    Unfold,
    /// The node is active and collapsible: it may have to fold.
    Fold,
}
