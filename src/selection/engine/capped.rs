//! Carrying out changes within a cap on work, the most urgent first.
//!
//! # Order
//!
//! However old an urgency is, *parents unfold before their children, and fold after them*. A change waits only while its node
//! is a boundary node, or collapsible: it is taken out at the moment in which it ceases to be ([`Steps::unwatch`]). A
//! boundary node has no parent that is folded, so none that waits to unfold; it has no child in play that could. A
//! collapsible node has no child that is active, so none that waits to fold, and its parents are not collapsible. So at no
//! time do two nodes wait for the same kind of change of which one is above the other: the order among those that wait is
//! free, and urgency decides.
//!
//! By urgencies of one frame, parents are never less urgent than their children, so that what is left over is less urgent than
//! all that was made. Over a camera that moves, both are known as they were at most eight frames ago. A change whose urgency
//! is older, as the time did not suffice to look at it, gets a new one before it is made; and no change is made without
//! the predicate of the frame.
//!
//! # Progress
//!
//! A frame makes at least one change if one is possible: until then its cap does not count. What it comes upon meanwhile that
//! is not wanted any more leaves the list, and what the backend refuses waits elsewhere for its page. What is done besides is bounded: an eighth of what waits, and what is new; of a
//! cap in time no more than a half is spent on that, but for one heap and a few changes that are new, and in the worst case,
//! where nothing has been made when the time is up, but for what it takes to find one change that is wanted. So while the views
//! rest, where nothing that has been made is undone, the cut is reached in no more frames than changes are left, and by a cap
//! of `c` changes in as many as it takes to make them, `c` at a time.

use std::time::Duration;

use vertex_tree::{Refine, TreeError};

use super::changes::Steps;
use super::noted::{Noted, is_boundary, is_collapsible};
use crate::budget::{FOLDS_OF, WorkCap};
use crate::carried::{A_FRAME, HEAPS, Urgent};
use crate::clock::Moment;
use crate::in_play::{Kind, Slot};
use crate::motion::Motion;
use crate::refine::Watch;

/// Changes that are new and are put where they wait together, without a look at the time.
const TOGETHER: usize = 16;

/// What a frame may do.
#[derive(Clone, Copy)]
struct Allowance {
    cap: WorkCap,
    /// When the work began.
    start: Moment,
}

impl Allowance {
    /// Whether a part of the time has passed, where it is time that is capped.
    fn has_passed(&self, share: f64) -> bool {
        matches!(self.cap, WorkCap::Time(most) if self.start.is_past(most.mul_f64(share)))
    }
}

/// When the first round of folds ends, which must not wait for long: it is for a share of the cap.
enum Folds {
    Until(Duration),
    AtMost(u64),
}

impl<T: Refine<S>, S> Steps<'_, T, S> {
    /// Folds and unfolds, and whatever follows, within a cap. `start` is when the work began.
    pub(super) fn apply_within(&mut self, cap: WorkCap, start: Moment) -> Result<(), TreeError> {
        self.carried.begin_frame(self.frame.motion != Motion::Rest);
        let allowance = Allowance { cap, start };
        self.expect_found();
        self.prepare_turns(&allowance);
        let applied = self.take_urgent_turns(&allowance);
        let applied = applied.and_then(|()| self.let_go());
        self.counts.carried = self.carried.len() as u64;
        applied
    }

    /// Without a cap, what an earlier one has left takes its turn with everything else.
    #[cold]
    pub(super) fn take_back_carried(&mut self) {
        let mut carried = std::mem::take(self.carried);
        carried.drain(|kind, slot| {
            if self.wanted(slot) == (kind == Kind::Unfold) {
                let noted = (slot, self.front.node(slot));
                self.list_mut(kind).push(noted);
            } else {
                self.watch(slot, kind);
            }
        });
        *self.carried = carried;
    }

    /// What has been found waits from now on, and is watched by nobody else.
    fn expect_found(&mut self) {
        for kind in [Kind::Fold, Kind::Unfold] {
            for at in 0..self.list(kind).len() {
                let noted = self.list(kind)[at];
                // A strategy that looks at everything finds what waits again.
                if is_due(self, kind, noted) && !self.carried.contains(noted.0) {
                    self.finder.changed(noted.0);
                    self.carried.expect(kind, noted.0);
                }
            }
            self.list_mut(kind).clear();
        }
    }

    /// Looks anew at some of what waits, and at what is new.
    fn prepare_turns(&mut self, allowance: &Allowance) {
        for heap in 0..A_FRAME {
            if heap > 0 && allowance.has_passed(0.25) {
                break;
            }
            self.look_anew();
        }
        loop {
            let more = [Kind::Unfold, Kind::Fold].map(|kind| self.take_in(kind));
            if !more.contains(&true) || allowance.has_passed(0.5) {
                break;
            }
        }
    }

    /// Looks anew at what waits on the next heap.
    fn look_anew(&mut self) {
        let Self { front, finder, frame, tests, carried, .. } = self;
        carried.look_anew(|kind, slot| {
            let bounds = front.bounds(slot);
            *tests += 1;
            if frame.unfold(slot, &bounds) == (kind == Kind::Unfold) {
                return Some(frame.urgency(kind, &bounds));
            }
            finder.watch(frame, slot, kind, bounds);
            None
        });
    }

    /// One of the most urgent changes, in a hurry: after a teleport, most of what waits is not wanted any more, and the first
    /// that is may be anywhere.
    fn pop_in_a_hurry(&mut self, kind: Kind) -> Option<Urgent> {
        for _ in 0..HEAPS {
            let entry = self.carried.pop_current(kind);
            if entry.is_some() {
                return entry;
            }
            self.look_anew();
        }
        self.carried.pop_current(kind)
    }

    /// Puts some of the changes that are new where they wait. Says whether there were any.
    fn take_in(&mut self, kind: Kind) -> bool {
        for taken in 0..TOGETHER {
            let Some((slot, is_current)) = self.carried.next_coming(kind) else { return taken > 0 };
            if is_current || self.wanted(slot) == (kind == Kind::Unfold) {
                self.put(slot, kind);
            } else {
                self.watch(slot, kind);
            }
        }
        true
    }

    fn put(&mut self, slot: Slot, kind: Kind) {
        let urgency = self.frame.urgency(kind, &self.front.record(slot).bounds);
        self.carried.put(kind, slot, urgency);
    }

    /// Folds that must not wait, unfolds, and folds again with what is left.
    fn take_urgent_turns(&mut self, allowance: &Allowance) -> Result<(), TreeError> {
        // Where the cap is for less than a few changes, folds have their turn in some frames.
        let turn = self.carried.frame % FOLDS_OF;
        let folds = match allowance.cap {
            WorkCap::None => Folds::AtMost(0),
            WorkCap::Changes(most) => {
                let most = u128::from(most.max(1));
                let by = |turn: u64| most * u128::from(turn) / u128::from(FOLDS_OF);
                Folds::AtMost((by(turn + 1) - by(turn)) as u64)
            }
            WorkCap::Time(most) => {
                let elapsed = allowance.start.elapsed();
                Folds::Until(elapsed + most.saturating_sub(elapsed) / FOLDS_OF as u32)
            }
        };
        self.take_turns_while(Kind::Fold, allowance, |step| match folds {
            Folds::AtMost(most) => step.counts.folds < most,
            Folds::Until(end) => {
                !allowance.start.is_past(end) || turn == FOLDS_OF - 1 && step.changes_made() == 0
            }
        })?;
        let is_left = |step: &Self| {
            step.changes_made() == 0
                || match allowance.cap {
                    WorkCap::None => true,
                    WorkCap::Changes(most) => step.changes_made() < most,
                    WorkCap::Time(_) => !allowance.has_passed(1.0),
                }
        };
        self.take_turns_while(Kind::Unfold, allowance, is_left)?;
        self.take_turns_while(Kind::Fold, allowance, is_left)
    }

    fn changes_made(&self) -> u64 {
        self.counts.folds + self.counts.unfolds
    }

    /// Makes the most urgent changes of a kind, and what follows from them, while something of the cap is left.
    fn take_turns_while(
        &mut self,
        kind: Kind,
        allowance: &Allowance,
        is_left: impl Fn(&Self) -> bool,
    ) -> Result<(), TreeError> {
        while is_left(self) {
            let is_late = self.changes_made() == 0 && allowance.has_passed(1.0);
            let popped = if is_late { self.pop_in_a_hurry(kind) } else { self.carried.pop(kind) };
            let Some(entry) = popped else {
                if self.take_in(kind) {
                    continue;
                }
                break;
            };
            let slot = entry.slot;
            if !self.carried.is_current(&entry) {
                if self.wanted(slot) != (kind == Kind::Unfold) {
                    self.watch(slot, kind);
                    continue;
                }
                if self.carried.is_old(&entry) {
                    self.put(slot, kind);
                    continue;
                }
            }
            let noted = (slot, self.front.node(slot));
            let made = match kind {
                Kind::Fold => self.fold(noted),
                Kind::Unfold => self.unfold(noted),
            };
            if made.is_err() && is_due(self, kind, noted) {
                self.refused(slot, kind);
            }
            made?;
            // What follows comes at once.
            for at in 0..self.list(kind).len() {
                let noted = self.list(kind)[at];
                if is_due(self, kind, noted) && !self.carried.contains(noted.0) {
                    self.put(noted.0, kind);
                }
            }
            self.list_mut(kind).clear();
        }
        Ok(())
    }
}

/// Whether a node that was noted can still change that way.
fn is_due<T, S>(steps: &Steps<'_, T, S>, kind: Kind, noted: Noted) -> bool {
    match kind {
        Kind::Fold => is_collapsible(steps.front, noted),
        Kind::Unfold => is_boundary(steps.front, noted),
    }
}
