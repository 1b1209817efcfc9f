//! Which blocks will soon be back: what comes back comes in the reverse order of its leaving.
//!
//! Blocks leave play as the camera turns away from them, and if it turns round they come back, those first that
//! left last. That is the worst case of the least recently used rule: around the turn it removes, one after the other,
//! what is wanted next. But it shows in time. Let the *cohort* of a frame be the blocks that left play in it. When the camera
//! retraces its way, the cohort of frame `f` comes back as many frames after that of `f + n` as it left before it, `n`,
//! if it goes back as fast. So once the cohort of `f + 60` has come back, that of `f` is expected within 60 frames,
//! and stays for as long, whatever its age.
//!
//! A cohort counts as back if a third of its blocks are: where the camera goes on its way, nearly none come back, and
//! where it retraces it, nearly all; that a part of a view comes back while the rest goes on lies between.

use std::collections::VecDeque;

/// A block that is read again within so many frames of its removal counts as removed too soon.
pub const SOON: u64 = 60;

/// Frames around a cohort that are looked at together, to either side.
const AROUND: u64 = 5;

/// Frames beyond its time for which what is expected back stays at most.
const PATIENCE: u64 = 2 * SOON;

/// Blocks that left play in the same frame.
#[derive(Clone, Copy, Default)]
struct Cohort {
    left: u32,
    /// How many of them have come back.
    back: u32,
}

/// The cohorts of the last frames.
#[derive(Default)]
pub(crate) struct Returns {
    cohorts: VecDeque<Cohort>,
    /// The frame of the oldest one.
    first: u64,
}

impl Returns {
    /// A frame ends. Cohorts are kept for as long as blocks may wait for their removal.
    pub fn end_frame(&mut self, frame: u64, grace: u64) {
        while self.first + grace.saturating_add(PATIENCE) < frame {
            self.cohorts.pop_front();
            self.first += 1;
        }
    }

    /// A block leaves play.
    pub fn left(&mut self, frame: u64) {
        if let Some(cohort) = self.cohort_of(frame) {
            cohort.left += 1;
        }
    }

    /// A block that left play in a frame has come back.
    pub fn back(&mut self, left: u64) {
        if let Some(cohort) = self.cohort_of(left) {
            cohort.back += 1;
        }
    }

    fn cohort_of(&mut self, frame: u64) -> Option<&mut Cohort> {
        let at = frame.checked_sub(self.first)? as usize;
        if at >= self.cohorts.len() {
            self.cohorts.resize(at + 1, Cohort::default());
        }
        self.cohorts.get_mut(at)
    }

    /// Whether what left play in a frame, and might be removed in a later one, is expected back soon.
    pub fn expects(&self, left: u64, now: u64, grace: u64) -> bool {
        if now > left + grace.saturating_add(PATIENCE) {
            return false;
        }
        let after = (left + SOON - AROUND).max(self.first) - self.first;
        let seen = self.cohorts.iter().skip(after as usize).take(2 * AROUND as usize + 1);
        let sum = seen.fold(Cohort::default(), |sum, cohort| Cohort {
            left: sum.left + cohort.left,
            back: sum.back + cohort.back,
        });
        sum.back > 0 && 3 * sum.back >= sum.left
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera that turns round in frame 200: ten blocks leave in every frame before, and come back in as many after.
    #[test]
    fn what_left_before_a_turn_is_expected_after_it() {
        let (grace, turn) = (150, 200);
        let mut returns = Returns::default();
        for frame in 1..=turn {
            (0..10).for_each(|_| returns.left(frame));
            if frame > grace {
                assert!(!returns.expects(frame - grace, frame, grace), "frame {frame}: it goes on");
            }
            returns.end_frame(frame, grace);
        }
        for frame in turn + 1..=turn + 100 {
            (0..10).for_each(|_| returns.back(2 * turn - frame));
            // What left `grace` ago comes back in 2 turn - 2 frame + grace frames.
            let left = frame - grace;
            let comes_in = 2 * turn as i64 - left as i64 - frame as i64;
            let is_near = (comes_in - SOON as i64).abs() <= 2 * AROUND as i64;
            if comes_in > 0 && !is_near {
                assert_eq!(returns.expects(left, frame, grace), comes_in < SOON as i64, "frame {frame}");
            }
            returns.end_frame(frame, grace);
        }
        assert!(!returns.expects(50, 50 + grace + PATIENCE + 1, grace), "patience ends");
    }
}
