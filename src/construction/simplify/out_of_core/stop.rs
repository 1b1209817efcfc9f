//! How a construction is told to stop.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};

/// Fails if somebody wants the construction to stop.
pub(super) fn check(stop: &AtomicBool) -> io::Result<()> {
    if stop.load(Ordering::Relaxed) { Err(io::Error::other(Interrupted)) } else { Ok(()) }
}

/// Somebody wanted the construction to stop.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(super) struct Interrupted;
