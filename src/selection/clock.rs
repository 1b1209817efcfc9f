//! Where the time comes from that frames are reported, capped and budgeted by: from the caller.
//!
//! The one file of this room that may ask the system for it, with the feature `clock`.

use std::time::Duration;

/// Says how much time has passed since some moment, which is always the same one.
#[derive(Clone, Copy)]
pub struct Clock(fn() -> Duration);

impl Clock {
    /// A clock that asks `now`, which must never go back.
    #[must_use]
    pub const fn new(now: fn() -> Duration) -> Self {
        Self(now)
    }

    /// The system's clock.
    #[cfg(feature = "clock")]
    #[must_use]
    pub const fn system() -> Self {
        Self(|| {
            static START: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
            START.get_or_init(std::time::Instant::now).elapsed()
        })
    }

    /// The clock of who says nothing of one.
    pub(crate) fn usual() -> Option<Self> {
        #[cfg(feature = "clock")]
        let clock = Some(Self::system());
        #[cfg(not(feature = "clock"))]
        let clock = None;
        clock
    }

    pub(crate) fn now(self) -> Duration {
        (self.0)()
    }
}

impl PartialEq for Clock {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::fn_addr_eq(self.0, other.0)
    }
}

impl std::fmt::Debug for Clock {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Clock").finish_non_exhaustive()
    }
}

/// A moment by a clock; without one no time passes.
#[derive(Clone, Copy)]
pub(crate) struct Moment {
    clock: Option<Clock>,
    at: Duration,
}

impl Moment {
    pub fn now(clock: Option<Clock>) -> Self {
        Self { clock, at: clock.map_or(Duration::ZERO, Clock::now) }
    }

    /// Whether so much time has passed since.
    pub fn is_past(&self, time: Duration) -> bool {
        self.clock.is_some_and(|clock| clock.now().saturating_sub(self.at) >= time)
    }

    /// How much time has passed since.
    pub fn elapsed(&self) -> Duration {
        self.clock.map_or(Duration::ZERO, |clock| clock.now().saturating_sub(self.at))
    }
}
