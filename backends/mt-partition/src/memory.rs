//! A memory budget that several trees can share.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes that nodes may take in memory, and how many do, over all trees that hold a clone of it. The tables of a file and
/// its base mesh are not counted: they are always there.
///
/// A tree reserves room before it asks for nodes, so the limit is never exceeded, unless it is lowered: then the trees let
/// go of what they can at the end of their next frame. A tree that finds no room, even after letting go of all that it can
/// itself, says so, and the others make some at the end of their frames: first what no cut holds, least recently used
/// first, then what some cut does. Where several want room, the one that was there first gets it, and does not give way to
/// the others meanwhile: otherwise each could lose what it has waited for before the rest of it comes.
#[derive(Clone, Debug)]
pub struct Memory(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    limit: AtomicU64,
    used: AtomicU64,
    members: AtomicU64,
    /// By member, what could not be had.
    wanted: Mutex<BTreeMap<u64, u64>>,
}

impl Default for Memory {
    /// Without a limit.
    fn default() -> Self {
        Self::new(u64::MAX)
    }
}

impl Memory {
    /// So many bytes.
    #[must_use]
    pub fn new(limit: u64) -> Self {
        let (used, members) = (0.into(), 0.into());
        Self(Arc::new(Shared { limit: limit.into(), used, members, wanted: Mutex::default() }))
    }

    /// Another limit from now on.
    pub fn set_limit(&self, bytes: u64) {
        self.0.limit.store(bytes, Ordering::Relaxed);
    }

    /// The limit.
    #[must_use]
    pub fn limit(&self) -> u64 {
        self.0.limit.load(Ordering::Relaxed)
    }

    /// Bytes reserved now: nodes in memory and those that have been asked for.
    #[must_use]
    pub fn used(&self) -> u64 {
        self.0.used.load(Ordering::Relaxed)
    }

    // Each counter is right by itself, and nothing is published through them: relaxed order will do.

    pub(crate) fn try_reserve(&self, bytes: u64) -> bool {
        let limit = self.limit();
        let fits = |used: u64| used.checked_add(bytes).filter(|&sum| sum <= limit);
        self.0.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, fits).is_ok()
    }

    pub(crate) fn release(&self, bytes: u64) {
        self.0.used.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// A number for a tree that shares this budget from now on.
    pub(crate) fn join(&self) -> u64 {
        self.0.members.fetch_add(1, Ordering::Relaxed)
    }

    fn wanted(&self) -> MutexGuard<'_, BTreeMap<u64, u64>> {
        self.0.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Says how many bytes a tree wants and can not have: 0 if that is over.
    pub(crate) fn want(&self, member: u64, bytes: u64) {
        if bytes > 0 {
            self.wanted().insert(member, bytes);
        } else {
            self.wanted().remove(&member);
        }
    }

    /// Bytes of which a tree must let go of what it can, for the limit to be kept and for what the first of those who
    /// want something wants.
    pub(crate) fn excess(&self, member: u64) -> u64 {
        let first = self.wanted().first_key_value().map(|(&first, &bytes)| (first, bytes));
        let wanted = first.filter(|&(first, _)| first != member).map_or(0, |(_, bytes)| bytes);
        self.used().saturating_add(wanted).saturating_sub(self.limit())
    }
}
