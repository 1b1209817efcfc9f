//! How a replay opens trees of each backend.

use meta_node::InUse;
use mt_partition::Memory;
use page_store::Simulated;
use vertex_tree::Hierarchy;

use super::loading::Loading;
use super::options::{Pace, Paging};
use crate::experiment::stored_scene::ScenePaging;
use selection::settled::Settled;

/// How trees are opened.
#[derive(Clone, Copy)]
pub(super) struct Opening {
    pub paging: Paging,
    pub prefetch: Loading,
    pub pace: Pace,
}

impl Opening {
    /// With memory for everything, and time.
    pub const SETTLED: Self =
        Self { paging: Paging::UNLIMITED, prefetch: Loading::None, pace: Pace::Settled };

    fn simulated(&self) -> Option<Simulated> {
        match self.pace {
            Pace::Simulated(_, store) => Some(store),
            Pace::Settled | Pace::WallClock(_) => None,
        }
    }

    pub fn meta_node(&self) -> meta_node::Settings {
        let Paging { page_memory, dependencies, .. } = self.paging;
        let io = self.simulated().map_or(meta_node::Io::Thread, meta_node::Io::Simulated);
        let in_use = match self.prefetch {
            Loading::Printed => InUse::Printed,
            _ => InUse::Yields,
        };
        meta_node::Settings { page_memory, dependencies, in_use, prefetch: self.prefetch.prefetch(), io }
    }

    pub fn detail_block(&self) -> detail_block::Settings {
        let Paging { page_memory: hard_quota, soft_quota, .. } = self.paging;
        let soft_quota = soft_quota.min(hard_quota);
        let io = self.simulated().map_or(detail_block::Io::Background, detail_block::Io::Simulated);
        let prefetch = self.prefetch.prefetch();
        detail_block::Settings { soft_quota, hard_quota, prefetch, io, ..Default::default() }
    }

    pub fn mt_partition(&self) -> mt_partition::Settings {
        let Paging { page_memory, cache, .. } = self.paging;
        let reader = self.simulated().map(mt_partition::Reader::simulated);
        let prefetch = self.prefetch.prefetch();
        mt_partition::Settings { cache, memory: Memory::new(page_memory), reader, prefetch }
    }

    /// How a scene of several objects pages. Where each frame is settled, that is seen to from outside: objects that share
    /// memory would wait for each other.
    pub fn scene(&self) -> ScenePaging {
        ScenePaging {
            meta_node: self.meta_node(),
            detail_block: self.detail_block(),
            mt_partition: self.mt_partition(),
            waits: self.prefetch == Loading::Blocking,
        }
    }

    /// Whether changes wait for their pages.
    pub fn waits(&self) -> bool {
        self.pace == Pace::Settled || self.prefetch == Loading::Blocking
    }

    pub fn wrap<T: Hierarchy>(&self, tree: T) -> Settled<T> {
        Settled::waiting(tree, self.waits())
    }
}
