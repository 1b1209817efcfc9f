//! How a tree loads and how much it keeps.

use page_store::Simulated;
use vertex_tree::Prefetch;

/// What reads blocks, and what becomes of a frame meanwhile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Io {
    /// A thread of the tree's own. Frames do not wait.
    #[default]
    Background,
    /// The frame itself, as in the paper: it waits for the disk. Nothing is loaded ahead of time then.
    Blocking,
    /// A store on virtual time. There is no thread, and frames do not wait.
    Simulated(Simulated),
}

/// How a tree pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// What reads blocks.
    pub io: Io,
    /// What is read before a change needs it. The paper loads blocks when a change first needs them, and so does
    /// [`Prefetch::None`].
    pub prefetch: Prefetch,
    /// Bytes of blocks beyond which the least recently used ones are removed.
    pub soft_quota: u64,
    /// Bytes of blocks that are never exceeded.
    pub hard_quota: u64,
    /// Frames for which a block that has become a candidate for removal stays all the same, as far as the hard quota lets
    /// it; twice [`SOON`](crate::SOON) longer at most where it is expected back soon. Where what is displayed takes more
    /// than the soft quota, the least recently used block is one that has just been used, and without this it is often
    /// read again soon.
    pub grace: u32,
}

impl Default for Settings {
    /// Loads in the background, on first demand, and never removes a block.
    fn default() -> Self {
        Self {
            io: Io::Background,
            prefetch: Prefetch::Paper,
            soft_quota: u64::MAX,
            hard_quota: u64::MAX,
            grace: 180,
        }
    }
}
