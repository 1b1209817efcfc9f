//! How a replay opens trees of each backend.

use mt_partition::Memory;
use vertex_tree::simulated::Simulated;
use vertex_tree::{Prefetch, VertexTree};

use super::{Pace, Paging};
use crate::settled::Settled;

/// How trees are opened.
#[derive(Clone, Copy)]
pub(super) struct Opening {
    pub paging: Paging,
    pub prefetch: Prefetch,
    pub pace: Pace,
}

impl Opening {
    /// With memory for everything, and time.
    pub const SETTLED: Self =
        Self { paging: Paging::UNLIMITED, prefetch: Prefetch::None, pace: Pace::Settled };

    fn simulated(&self) -> Option<Simulated> {
        match self.pace {
            Pace::Simulated(_, store) => Some(store),
            Pace::Settled | Pace::WallClock(_) => None,
        }
    }

    pub fn meta_node(&self) -> meta_node::Settings {
        let Paging { page_memory, dependencies, .. } = self.paging;
        let io = self.simulated().map_or(meta_node::Io::Thread, meta_node::Io::Simulated);
        meta_node::Settings { page_memory, dependencies, prefetch: self.prefetch, io, ..Default::default() }
    }

    pub fn detail_block(&self) -> detail_block::Settings {
        let Paging { page_memory: hard_quota, soft_quota, .. } = self.paging;
        let soft_quota = soft_quota.min(hard_quota);
        let io = self.simulated().map_or(detail_block::Io::Background, detail_block::Io::Simulated);
        detail_block::Settings { soft_quota, hard_quota, prefetch: self.prefetch, io, ..Default::default() }
    }

    pub fn mt_partition(&self) -> mt_partition::Settings {
        let Paging { page_memory, cache, .. } = self.paging;
        let reader = self.simulated().map(mt_partition::Reader::simulated);
        mt_partition::Settings { cache, memory: Memory::new(page_memory), reader, prefetch: self.prefetch }
    }

    pub fn wrap<T: VertexTree>(&self, tree: T) -> Settled<T> {
        match self.pace {
            Pace::Settled => Settled::new(tree),
            Pace::Simulated(..) | Pace::WallClock(_) => Settled::in_real_time(tree),
        }
    }
}
