//! Budgets: steering the tolerance so that a frame stays within what may be displayed or a time.
//!
//! The cut stays exact throughout: in every frame it is the one that the criterion asks for at that frame's
//! tolerance. The tolerance changes by at most a fixed share a frame, and that is a third speed beside the camera's
//! two (see [`Speed::kappa`](crate::motion::Speed)), so the event queue's bounds hold while it does. Zach & Karner
//! (2003, section 5) suggest adjusting the error between frames and leave it there.

use std::time::Duration;

use crate::view::View;

/// What a frame may cost.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum Budget {
    /// No budget: the tolerance of the views stands.
    #[default]
    None,
    /// At most so much displayed, as the backend counts it: triangles of a mesh. Kept to while the camera rests, and within a few percent while it moves,
    /// as the tolerance follows what the frame before cost.
    Displayed(u64),
    /// At most this long for a frame. The engine counts its own step; a renderer adds what drawing took through
    /// [`Engine::add_frame_time`](crate::engine::Engine::add_frame_time).
    FrameTime(Duration),
}

/// The most that one frame may do, whatever its views ask for: for worst frames, after a teleport or while much arrives
/// from a store. What is left over is carried to the next frames, the most urgent changes first, by what they were no more
/// than eight frames ago, and the cut is exact again when nothing is left. Every frame makes at least one change if one
/// is possible, so that a cap of 0 is one of 1. A [`Budget`] is about the tolerance that the cut is for; this is about the way
/// there.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum WorkCap {
    /// Every frame does all that it finds to do.
    #[default]
    None,
    /// At most so many folds and unfolds a frame, and the unfolds that the last of them forces.
    Changes(u64),
    /// Folds and unfolds, and what it takes to decide which, for at most so long a frame.
    Time(Duration),
}

/// One in so many parts of a cap is spent on folds if there are any: what is folded late is not seen, but it adds up.
pub(crate) const FOLDS_OF: u64 = 4;

/// Most that the tolerance changes in a frame.
pub const STEP: f64 = 0.03;

/// The tolerance is left alone while the cost is within this share below the budget.
const DEAD_ZONE: f64 = 0.03;

/// A change of the tolerance by less than this share is not worth a frame's tests.
const SMALLEST_STEP: f64 = 1e-3;

/// The views' tolerance may become this much finer or coarser.
const FINEST: f64 = 1.0 / 256.0;
const COARSEST: f64 = 65536.0;

/// Steers a factor on the views' tolerance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steering {
    budget: Budget,
    /// What the tolerance is multiplied by.
    pub factor: f64,
    /// A factor at which the budget was exceeded, not long ago. Where a small step of the tolerance makes a large one
    /// of the cost, steering closes in on that step from its cheap side instead of swinging across it.
    too_fine: f64,
}

impl Steering {
    pub fn new(budget: Budget) -> Self {
        Self { budget, factor: 1.0, too_fine: 0.0 }
    }

    /// Another budget: the tolerance moves on from where it is. Without one it is that of the views again.
    pub fn set_budget(&mut self, budget: Budget) {
        self.budget = budget;
        self.too_fine = 0.0;
        if budget == Budget::None {
            self.factor = 1.0;
        }
    }

    pub fn budget(&self) -> Budget {
        self.budget
    }

    /// Largest change of `k` a frame among these views, while the factor is what it is.
    pub fn kappa(&self, views: &[View]) -> f64 {
        if self.budget == Budget::None { 0.0 } else { STEP * views.iter().map(View::k).fold(0.0, f64::max) }
    }

    /// Whether the budget keeps detail below what the views' own tolerance asks for.
    pub fn limits(&self) -> bool {
        self.factor > 1.0
    }

    /// Steers for the next frame by what this one cost. `moved` says whether the camera did, which makes what was
    /// learnt of the cost out of date; a measured time is always a little out of date.
    pub fn observe(&mut self, displayed: u64, time: Duration, moved: bool) {
        let load = match self.budget {
            Budget::None => return,
            Budget::Displayed(most) => displayed as f64 / most.max(1) as f64,
            Budget::FrameTime(most) => time.as_secs_f64() / most.as_secs_f64().max(1e-9),
        };
        if moved || matches!(self.budget, Budget::FrameTime(_)) {
            self.too_fine /= 1.0 + STEP;
        }
        // What is displayed grows about inversely with the tolerance: aim at the middle of the dead zone, half the way.
        let aim = (load / (1.0 - DEAD_ZONE / 2.0)).sqrt().clamp(1.0 / (1.0 + STEP), 1.0 + STEP);
        if load > 1.0 {
            self.too_fine = self.factor;
            self.factor = (self.factor * aim).min(COARSEST);
        } else if load < 1.0 - DEAD_ZONE {
            let finer = (self.factor * aim).max((self.factor * self.too_fine).sqrt()).max(FINEST);
            if finer < self.factor * (1.0 - SMALLEST_STEP) {
                self.factor = finer;
            }
        }
    }
}
