//! What keeps rounds from going on for ever.
//!
//! A round without a collapse is not in vain as long as it finds something out: that a candidate is not legal, or what it
//! really costs. A round that changes no node, key or state would be followed by another like it, so the candidates that
//! come up in the next are given up where they come up in vain. So are they after many rounds without a collapse, whatever
//! those have found out: then nothing depends on what a round may find out for the construction to end.

/// Rounds without a collapse, one after the other, until the candidates that come up in vain are given up.
pub(super) const MOST_IDLE: usize = 64;

/// What is known of the rounds since the last collapse.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stall {
    idle: usize,
    /// Whether the last round has changed nothing at all.
    unchanged: bool,
    /// Whether the hopeless have been looked at again.
    hopeless_retried: bool,
}

impl Stall {
    /// Whether the candidates that come up in vain in the next round are given up.
    pub fn gives_up(self) -> bool {
        self.unchanged || self.idle >= MOST_IDLE
    }

    /// A round has made so many collapses; `changed` says whether it has changed any key or state.
    pub fn end_round(&mut self, collapses: usize, changed: bool) {
        if collapses > 0 {
            *self = Stall::default();
        } else {
            self.idle += 1;
            self.unchanged = !changed;
        }
    }

    /// Whether the vertices without a legal edge are to be looked at again now that there is no candidate: once.
    pub fn takes_hopeless(&mut self) -> bool {
        let is_due = !self.hopeless_retried;
        self.hopeless_retried = true;
        is_due
    }
}
