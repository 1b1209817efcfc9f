//! How a tree pages.

use page_store::Simulated;
use vertex_tree::Prefetch;

use crate::dependencies::Dependencies;

/// How a tree pages and what it makes of dependencies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Bytes that place holders may take, at most. Tables of about 20 bytes a page come on top.
    pub page_memory: u64,
    /// What is done about neighbours that are too coarse or too fine for a change.
    pub dependencies: Dependencies,
    /// What happens to pages with nodes of the front where there is no other place.
    pub in_use: InUse,
    /// What fetches pages before a change needs them; not asked with [`InUse::Printed`].
    pub prefetch: Prefetch,
    /// Who reads.
    pub io: Io,
}

impl Default for Settings {
    /// Memory for everything, dependencies off, pages yield, and the paper's own prefetching by a thread.
    fn default() -> Self {
        Self {
            page_memory: u64::MAX,
            dependencies: Dependencies::Off,
            in_use: InUse::Yields,
            prefetch: Prefetch::Paper,
            io: Io::Thread,
        }
    }
}

/// What happens to pages with nodes of the front where there is no other place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InUse {
    /// The one that has not been touched for longest makes room. Every cut can be reached.
    #[default]
    Yields,
    /// They stay, as in the paper, but for switching up and for less memory. A cut that needs more is not reached.
    Stays,
    /// They stay, and all else is as section 3.3 of the paper has it, to the letter: place holders of one size, no retries, a
    /// switch down only with the page of the children there. Pages are prefetched as the paper does it, whatever
    /// [`Settings::prefetch`] says.
    Printed,
}

/// Who reads pages, and when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Io {
    /// A thread of its own, as fast as the source is.
    #[default]
    Thread,
    /// Nobody before its time: the caller, in [`Hierarchy::pass`](vertex_tree::Hierarchy::pass), on virtual time. There
    /// is no thread. The same replay has the same misses.
    Simulated(Simulated),
}
