//! What a backend that pages is told, and what it says of a frame.

use std::ops::Add;
use std::time::Duration;

/// What paging did in a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PageStats {
    /// Read operations finished since the last call.
    pub reads: u64,
    /// Bytes those brought.
    pub read_bytes: u64,
    /// Bytes of the hierarchy now in memory.
    pub resident_bytes: u64,
    /// Reads since the last call that failed, or brought a damaged page. They are tried again.
    pub faults: u64,
    /// Those of the reads that no refused change had asked for: pages fetched ahead.
    pub ahead: u64,
    /// Pages fetched ahead that a change has used since the last call, each counted once, the first time.
    pub ahead_used: u64,
    /// Changes refused since the last call because what is in memory could not make room, not because the store is
    /// slow.
    pub no_room: u64,
    /// How long changes have waited for the store since the last call. No backend lets them; whoever makes them wait, as
    /// foldfront's `Settled`, says so here.
    pub stalled: Duration,
}

impl Add for PageStats {
    type Output = Self;

    /// What two trees did in a frame: the sums, of what is in memory too.
    fn add(self, other: Self) -> Self {
        Self {
            reads: self.reads + other.reads,
            read_bytes: self.read_bytes + other.read_bytes,
            resident_bytes: self.resident_bytes + other.resident_bytes,
            faults: self.faults + other.faults,
            ahead: self.ahead + other.ahead,
            ahead_used: self.ahead_used + other.ahead_used,
            no_room: self.no_room + other.no_room,
            stalled: self.stalled + other.stalled,
        }
    }
}

/// What fetches pages before a change needs them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Prefetch {
    /// The published scheme of the backend, made asynchronous where it is not.
    #[default]
    Paper,
    /// What the engine foresees, see [`Hierarchy::will_need`](crate::Hierarchy::will_need).
    Schedule,
    /// Nothing: a page is fetched when a change has been refused for want of it.
    None,
}

impl Prefetch {
    /// All of them, in the order of reports.
    pub const ALL: [Self; 3] = [Self::Paper, Self::Schedule, Self::None];

    /// The name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Schedule => "schedule",
            Self::None => "none",
        }
    }
}
