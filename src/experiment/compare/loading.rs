//! How pages come to be in memory: what fetches them before a change needs them, and what a change does that finds one
//! missing.

use vertex_tree::Prefetch;

use crate::experiment::store::Backend;

/// How pages are loaded.
///
/// Three of these are about what the papers say. All of them had a choice to make: what does a frame do that wants a page
/// which is not there?
///
/// * [`Blocking`](Self::Blocking) is what DeCoro & Pajarola (2002, section 4.1) and Holst & Schumann (2007, section 4) print: the
///   traversal loads what it comes upon and goes on when it is there. Time passes and the path does not; no page is
///   missed, unless memory can not hold what the cut takes.
/// * [`Printed`](Self::Printed) is what El-Sana & Chiang (2000, section 3.3) print, to the letter: the change is given up for
///   now, pages in use are never evicted, and three place holders are kept from switching down
///   ([`InUse::Printed`](meta_node::InUse::Printed)).
/// * [`Paper`](Self::Paper) is the published scheme of each backend as we would build it. Of El-Sana & Chiang's it keeps the
///   counts, the free list and urgent requests, and lets pages in use make room, since the engine keeps what a test reads, so
///   that every cut can be reached with four place holders. The loads of the other two are made asynchronous: on first
///   demand, as printed, but no frame waits. `pager.rs` of meta-node and `paging.rs` of the others say the rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Loading {
    /// The published scheme of the backend, made asynchronous where it is not.
    #[default]
    Paper,
    /// El-Sana & Chiang's rules as they are printed: for meta-nodes alone.
    Printed,
    /// A page is loaded when a change wants it, and the frame waits.
    Blocking,
    /// What the engine foresees is fetched ahead.
    Schedule,
    /// A page is fetched when a change has been refused for want of it.
    None,
}

impl Loading {
    /// All of them, in the order of reports.
    pub const ALL: [Self; 5] = [Self::Paper, Self::Printed, Self::Blocking, Self::Schedule, Self::None];

    /// The name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Printed => "printed",
            Self::Blocking => "blocking",
            Self::Schedule => "schedule",
            Self::None => "none",
        }
    }

    /// Whether a backend has it. One without pages has all that it could be asked for.
    #[must_use]
    pub fn is_for(self, backend: Backend) -> bool {
        self != Self::Printed || backend == Backend::MetaNode
    }

    /// What a backend fetches ahead.
    pub(super) fn prefetch(self) -> Prefetch {
        match self {
            Self::Paper | Self::Printed => Prefetch::Paper,
            Self::Schedule => Prefetch::Schedule,
            Self::Blocking | Self::None => Prefetch::None,
        }
    }
}
