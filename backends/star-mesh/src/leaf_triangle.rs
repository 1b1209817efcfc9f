//! What a backend says of a triangle.

/// A triangle of the hierarchy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafTriangle {
    /// The leaves of its corners, counter-clockwise.
    pub leaves: [u32; 3],
    /// The number, and in the upper two bits which corner is the far one.
    tag: u32,
}

impl LeafTriangle {
    /// Numbers are below this.
    pub const LIMIT: u32 = 1 << 30;

    /// A triangle that the backend knows by `number`. For one that a node brings, corner `far` is the one whose leaf is
    /// not below the node; for one of the base mesh it means nothing.
    #[must_use]
    pub fn new(leaves: [u32; 3], far: u32, number: u32) -> Self {
        debug_assert!(far < 3 && number < Self::LIMIT);
        Self { leaves, tag: far << 30 | number }
    }

    /// Whatever number the backend knows it by.
    #[must_use]
    pub fn number(self) -> u32 {
        self.tag & (Self::LIMIT - 1)
    }

    #[inline(always)]
    pub(crate) fn far(self) -> usize {
        (self.tag >> 30) as usize
    }

    #[inline(always)]
    pub(crate) fn far_leaf(self) -> u32 {
        self.leaves[self.far() % 3]
    }
}
