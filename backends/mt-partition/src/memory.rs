//! A memory budget that several trees can share.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes that nodes may take in memory, and how many do, over all trees that hold a clone of it. The tables of a file and
/// its base mesh are not counted: they are always there.
///
/// A tree reserves room before it asks for nodes, so the limit is never exceeded, unless it is lowered: then the trees let
/// go of what they can at the end of their next frame. A tree that finds no room says so, and all of them make some at the
/// end of their frames: first what no cut holds, least recently used first, then what some cut does.
#[derive(Clone, Debug)]
pub struct Memory(Arc<Shared>);

#[derive(Debug)]
struct Shared {
    limit: AtomicU64,
    used: AtomicU64,
    /// Bytes that some tree could not have.
    wanted: AtomicU64,
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
        Self(Arc::new(Shared { limit: limit.into(), used: 0.into(), wanted: 0.into() }))
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

    /// Says that so many bytes could not be had.
    pub(crate) fn want(&self, bytes: u64) {
        self.0.wanted.fetch_max(bytes, Ordering::Relaxed);
    }

    /// Says that they have been.
    pub(crate) fn satisfied(&self) {
        self.0.wanted.store(0, Ordering::Relaxed);
    }

    /// Bytes that must go for the limit to be kept and for what somebody wants to fit.
    pub(crate) fn excess(&self) -> u64 {
        let wanted = self.0.wanted.load(Ordering::Relaxed);
        self.used().saturating_add(wanted).saturating_sub(self.limit())
    }
}
