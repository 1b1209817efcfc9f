//! How a tree loads and how much it keeps.

/// How blocks are loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Loading {
    /// By an I/O thread, when a frame misses them and ahead of time. Frames do not wait.
    #[default]
    Background,
    /// By an I/O thread, but only when a frame misses them.
    OnDemand,
    /// At once, as in the paper: the frame waits for the disk.
    Blocking,
}

/// How a tree pages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// How blocks are loaded.
    pub loading: Loading,
    /// Bytes of blocks beyond which the least recently used ones are removed.
    pub soft_quota: u64,
    /// Bytes of blocks that are never exceeded.
    pub hard_quota: u64,
    /// Frames for which a block that has become a candidate for removal stays all the same, as far as the hard quota lets
    /// it. Where what is displayed takes more than the soft quota, the least recently used block is one that has just
    /// been used, and without this it is often read again soon.
    pub grace: u32,
}

impl Default for Settings {
    /// Loads in the background and never removes a block.
    fn default() -> Self {
        Self { loading: Loading::Background, soft_quota: u64::MAX, hard_quota: u64::MAX, grace: 60 }
    }
}
