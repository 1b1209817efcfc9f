//! The engine: one front through one hierarchy, following the camera frame by frame.
//!
//! Each frame: advance the clock by the motion; take arrivals from the backend; let the strategy find the nodes
//! whose status must flip; apply folds, then unfolds, to a fixpoint; end the frame. A node that comes into play in
//! the course of this is tested at once, so a frame ends with the cut that its views ask for, or with the changes
//! that the backend refused counted as misses.
//!
//! Everything here runs on the caller's thread. A backend may have threads of its own; no call waits for them, unless the
//! backend is wrapped so that changes do ([`Settled`](crate::settled::Settled)).

mod capped;
mod changes;
mod needs;
mod noted;
mod waiting;
mod well_formed;

use std::time::Duration;

use vertex_tree::{NodeId, PageStats, Refine, TreeError};

use self::changes::{Counts, Steps};
use self::noted::{Noted, Pending};
use crate::budget::{Budget, Steering, WorkCap};
use crate::carried::Carried;
use crate::clock::{Clock, Moment};
use crate::criterion::Criterion;
use crate::foresight::{Foresight, Watched};
use crate::front::Front;
use crate::in_play::{Kind, Slot};
use crate::motion::{Motion, Odometer, Speed, Travel};
use crate::normal_cone::Cones;
use crate::refine::{Finder, Flips, Frame, Strategy, Watch};
use crate::view::{View, check_origin};
use crate::waiting::Waiting;

/// How an engine refines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How the nodes that must change are found.
    pub strategy: Strategy,
    /// What "coarse" means.
    pub criterion: Criterion,
    /// Whether a node is only unfolded for views that do not see all below it from behind, where the backend knows
    /// ([`Hierarchy::HAS_CONES`](vertex_tree::Hierarchy::HAS_CONES)).
    pub normal_cone: bool,
    /// Full speed of the eye, in object units a frame. [`Strategy::Event`] needs none: it learns from the motion.
    /// [`Strategy::EventQueue`] and [`Strategy::EventPublished`] go by it; it decides how far ahead they look, and of exact
    /// strategies never the cut. 0, or what is no number above 0, says that the eye is not expected to move: a frame in which
    /// it does tests everything that is watched. Foresight takes what is slower than a share of it for a motion that has begun.
    pub rho: f64,
    /// Full speed of turning, in radians a frame, for the same; 0 says that the camera is not expected to turn, as with
    /// `rho`. (`kappa` is the engine's own, see [`Speed::kappa`].)
    pub omega: f64,
    /// What a frame may cost.
    pub budget: Budget,
    /// What a frame may do.
    pub work_cap: WorkCap,
    /// What frames are timed by: with the feature `clock` the system's clock, if nothing else is said. Without a clock no time passes: reports
    /// have none, and budgets and caps in time limit nothing.
    pub clock: Option<Clock>,
}

impl Default for Settings {
    /// Event-driven, screen error, no budget; full speeds of 1 object unit and 0.02 radians a frame for the strategies that go
    /// by them.
    fn default() -> Self {
        Self {
            strategy: Strategy::Event,
            criterion: Criterion::ScreenError,
            normal_cone: false,
            rho: 1.0,
            omega: 0.02,
            budget: Budget::None,
            work_cap: WorkCap::None,
            clock: Clock::usual(),
        }
    }
}

/// What kept the detail of a frame down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The tolerance alone: more detail would not be seen.
    Error,
    /// The budget of what may be displayed.
    Displayed,
    /// The frame-time budget.
    Time,
    /// Pages that were not in memory, and for which what is there can not make room.
    Memory,
    /// Pages that were not in memory.
    Io,
    /// The cap on a frame's work.
    Work,
}

impl Limit {
    /// The word for it in `frames.csv`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Displayed => "triangles",
            Self::Time => "time",
            Self::Memory => "memory",
            Self::Io => "io",
            Self::Work => "work",
        }
    }
}

/// What a frame did and cost.
#[derive(Clone, Copy, Debug)]
pub struct FrameReport {
    /// The whole refinement step, with what it waited for a real store (see [`PageStats::stalled`]).
    pub select: Duration,
    /// The part of it spent on folds, unfolds and what is displayed.
    pub apply: Duration,
    /// Tests of the criterion, by its predicate or its time bounds: of what a strategy looked at, of what came into play, and
    /// of what came to be watched. What is foreseen for other views is not among them.
    pub tests: u64,
    /// Nodes unfolded.
    pub unfolds: u64,
    /// Nodes folded.
    pub folds: u64,
    /// Those of the unfolds that no view wanted: another node needed them.
    pub forced: u64,
    /// Changes left to later frames by the cap on work. With none, the cut is exact. They were wanted when they were looked at,
    /// at most a few frames ago.
    pub carried: u64,
    /// Wanted changes that a rule of the backend's own forbade, see [`Step::Blocked`](vertex_tree::Step::Blocked).
    pub blocked: u64,
    /// Nodes whose pages were missing for wanted changes: refused in this frame, or before and still waited for.
    pub misses: u64,
    /// Nodes that the backend was told to expect a change of, see [`Hierarchy::will_need`](vertex_tree::Hierarchy::will_need).
    pub foreseen: u64,
    /// Active nodes at the end.
    pub active_nodes: u64,
    /// What is displayed at the end, as the backend counts it: triangles of a mesh. See [`Hierarchy::displayed`](vertex_tree::Hierarchy::displayed).
    pub displayed: u64,
    /// Hash of the set of active nodes, see [`Front::cut_hash`].
    pub cut_hash: u64,
    /// What kept the detail down.
    pub limit: Limit,
    /// What paging did.
    pub pages: PageStats,
}

impl FrameReport {
    /// Two advances to the same views as one frame: what both did and cost, and how it ended.
    #[must_use]
    pub fn followed_by(&self, later: &Self) -> Self {
        let (a, b) = (self, later);
        Self {
            select: a.select + b.select,
            apply: a.apply + b.apply,
            tests: a.tests + b.tests,
            unfolds: a.unfolds + b.unfolds,
            folds: a.folds + b.folds,
            forced: a.forced + b.forced,
            pages: PageStats { resident_bytes: b.pages.resident_bytes, ..a.pages + b.pages },
            ..*b
        }
    }
}

/// A front through a hierarchy of backend `T`, reporting what is displayed to `S`.
pub struct Engine<T, S> {
    tree: T,
    sink: S,
    front: Front,
    cones: Cones,
    finder: Finder,
    settings: Settings,
    odometer: Odometer,
    steering: Steering,
    /// What the tree's spheres and positions are relative to, in world coordinates.
    origin: [f64; 3],
    /// The views of the last frame, relative to the origin and with the budget's factor applied, and room for the next.
    before: Vec<View>,
    views: Vec<View>,
    kappa: f64,
    flips: Flips,
    stack: Vec<Pending>,
    missing: Vec<NodeId>,
    waiting: Waiting,
    blocked: Vec<Noted>,
    forbidden: Vec<NodeId>,
    still_needed: Vec<Noted>,
    folding: Vec<Noted>,
    unfolding: Vec<Noted>,
    ready: Vec<Slot>,
    carried: Carried,
    arrived: Vec<NodeId>,
    drawing_time: Duration,
    foresight: Foresight,
}

impl<T: Refine<S>, S> Engine<T, S> {
    /// Starts with every node folded: with a mesh, the base mesh.
    ///
    /// # Errors
    /// What the backend reports, and [`TreeError::Origin`].
    pub fn new(mut tree: T, mut sink: S, settings: Settings) -> Result<Self, TreeError> {
        let origin = tree.origin();
        check_origin(origin).map_err(|_| TreeError::Origin { origin })?;
        let front = Front::new(&tree);
        let mut finder = Finder::new(settings.strategy);
        // No views yet: every root is due, whatever the first frame brings.
        let frame = Frame {
            criterion: settings.criterion,
            views: &[],
            speed: Speed { rho: settings.rho, omega: settings.omega, kappa: 0.0 },
            motion: Motion::Unbounded,
            travel: None,
            looks_ahead: false,
            cones: None,
        };
        for root in front.roots() {
            finder.watch(&frame, root, Kind::Unfold, front.bounds(root));
        }
        tree.start(&mut sink)?;
        Ok(Self {
            origin,
            tree,
            sink,
            front,
            cones: Cones::default(),
            finder,
            settings,
            odometer: Odometer::default(),
            steering: Steering::new(settings.budget),
            before: Vec::new(),
            views: Vec::new(),
            kappa: 0.0,
            flips: Flips::default(),
            stack: Vec::new(),
            missing: Vec::new(),
            waiting: Waiting::default(),
            blocked: Vec::new(),
            forbidden: Vec::new(),
            still_needed: Vec::new(),
            folding: Vec::new(),
            unfolding: Vec::new(),
            ready: Vec::new(),
            carried: Carried::default(),
            arrived: Vec::new(),
            drawing_time: Duration::ZERO,
            foresight: Foresight::default(),
        })
    }

    /// The backend.
    pub fn tree(&self) -> &T {
        &self.tree
    }

    /// The backend, to wait for its pages or to change what it may use. Folding or unfolding behind the engine's back
    /// breaks the front.
    pub fn tree_mut(&mut self) -> &mut T {
        &mut self.tree
    }

    /// What is displayed, as the sink keeps it.
    pub fn sink(&self) -> &S {
        &self.sink
    }

    /// The sink, to be told that its changes have been taken.
    pub fn sink_mut(&mut self) -> &mut S {
        &mut self.sink
    }

    /// The active front.
    pub fn front(&self) -> &Front {
        &self.front
    }

    /// World coordinates of what is displayed and all spheres are relative to: that of the tree.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// The views of the last frame, relative to the [`origin`](Self::origin), with the tolerance that a budget made of theirs.
    pub fn views(&self) -> &[View] {
        &self.views
    }

    /// The nodes whose pages were missing for a change in the last frame, in ascending order.
    pub fn missing(&self) -> &[NodeId] {
        &self.missing
    }

    /// Takes the first fault since the last call: in which file, where, and what is wrong there. How many a frame had is in
    /// its [report](PageStats::faults); what they keep back is among its [misses](Self::missing) while it is wanted.
    pub fn take_fault(&mut self) -> Option<TreeError> {
        self.tree.take_fault()
    }

    /// How the engine refines.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Sets another budget from the next frame on; the tolerance moves there from where it is.
    pub fn set_budget(&mut self, budget: Budget) {
        self.settings.budget = budget;
        self.steering.set_budget(budget);
    }

    /// Sets another cap on a frame's work from the next frame on.
    pub fn set_work_cap(&mut self, work_cap: WorkCap) {
        self.settings.work_cap = work_cap;
    }

    /// Adds what drawing took to the frame time that the next [`advance`](Self::advance) steers by.
    pub fn add_frame_time(&mut self, drawing: Duration) {
        self.drawing_time += drawing;
    }

    /// Calls `f` with every active node.
    pub fn for_each_active(&self, f: impl FnMut(NodeId)) {
        self.front.for_each_active(f);
    }

    /// Moves the front to where these views of the world want it. A node unfolds if any of them wants it: two for stereo, one
    /// more for each shadow map. No view at all folds everything.
    ///
    /// Eyes are in world coordinates. The arithmetic is about the tree's [`origin`](Self::origin), which costs an eye at most
    /// 2^-53 of its coordinates.
    ///
    /// # Errors
    /// What the backend reports; the front then is a valid one between the old and the new.
    pub fn advance(&mut self, views: &[View]) -> Result<FrameReport, TreeError> {
        let origin = self.origin;
        self.follow(views.iter().map(|view| view.about(origin)))
    }

    /// As [`advance`](Self::advance), to views that are relative to the origin, as [`views`](Self::views) gives them.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn advance_relative(&mut self, views: &[View]) -> Result<FrameReport, TreeError> {
        self.follow(views.iter().copied())
    }

    fn follow(&mut self, views: impl Iterator<Item = View>) -> Result<FrameReport, TreeError> {
        let start = Moment::now(self.settings.clock);
        self.tree.begin_frame(&mut self.arrived)?;

        std::mem::swap(&mut self.before, &mut self.views);
        self.views.clear();
        let factor = self.steering.factor;
        self.views.extend(views.map(|view| view.steered(factor)));

        // While a budget steers, `k` has a speed. It is declared anew when the tolerance has moved far from where it
        // was declared; bounds that were computed with another speed do not hold then.
        let kappa = self.steering.kappa(&self.views);
        let redeclared = kappa > 1.5 * self.kappa || kappa < 0.5 * self.kappa;
        if redeclared {
            self.kappa = kappa;
        }
        let speed = Speed { rho: self.settings.rho, omega: self.settings.omega, kappa: self.kappa };
        let travel = Travel::between(&self.before, &self.views);
        let mut motion = self.odometer.advance_by(&speed.into(), travel.as_ref());
        if redeclared {
            motion = Motion::Unbounded;
        }
        let cones = (T::HAS_CONES && self.settings.normal_cone).then_some(&self.cones);
        let criterion = self.settings.criterion;
        let looks_ahead = self.tree.look_ahead() > 0;
        let frame = Frame { criterion, views: &self.views, speed, motion, travel, looks_ahead, cones };

        self.flips.unfold.clear();
        self.flips.fold.clear();
        self.flips.tests = 0;
        self.finder.find(&frame, &self.before, &self.front, &mut self.flips);

        let found = Moment::now(self.settings.clock);
        let mut step = Steps {
            tree: &mut self.tree,
            sink: &mut self.sink,
            front: &mut self.front,
            finder: &mut self.finder,
            frame: &frame,
            stack: &mut self.stack,
            missing: &mut self.missing,
            waiting: &mut self.waiting,
            carried: &mut self.carried,
            blocked: &mut self.blocked,
            forbidden: &mut self.forbidden,
            still_needed: &mut self.still_needed,
            folding: &mut self.folding,
            unfolding: &mut self.unfolding,
            ready: &mut self.ready,
            counts: Counts::default(),
            tests: 0,
        };
        let applied = step.carry_out(&self.flips, &mut self.arrived, self.settings.work_cap, found);
        let (counts, tests) = (step.counts, self.flips.tests + step.tests);
        self.tree.finish(&mut self.sink);
        let distinct = |nodes: &mut Vec<NodeId>| {
            nodes.sort_unstable();
            nodes.dedup();
            nodes.len() as u64
        };
        let (misses, blocked) = (distinct(&mut self.missing), distinct(&mut self.forbidden));
        let apply = found.elapsed();
        let tests = tests + self.finder.settle(&frame);
        applied?;
        let foreseen = match self.tree.look_ahead() {
            0 => {
                self.foresight.skip();
                0
            }
            look_ahead => {
                let unfinished = misses > 0 || counts.carried > 0;
                let (front, finder) = (&self.front, &self.finder);
                let watched = Watched { front, finder, waiting: &self.waiting, carried: &self.carried };
                self.foresight.look(&mut self.tree, watched, &frame, &self.before, look_ahead, unfinished)
            }
        };
        let pages = self.tree.end_frame()?;
        let select = start.elapsed();

        let displayed = self.tree.displayed();
        let limit = match self.steering.budget() {
            _ if misses > 0 && pages.no_room > 0 => Limit::Memory,
            _ if misses > 0 => Limit::Io,
            _ if counts.carried > 0 => Limit::Work,
            Budget::Displayed(_) if self.steering.limits() => Limit::Displayed,
            Budget::FrameTime(_) if self.steering.limits() => Limit::Time,
            _ => Limit::Error,
        };
        let moved = self.before.len() != self.views.len()
            || self
                .before
                .iter()
                .zip(&self.views)
                .any(|(b, v)| b.eye() != v.eye() || b.direction() != v.direction());
        self.steering.observe(displayed, select + std::mem::take(&mut self.drawing_time), moved);
        Ok(FrameReport {
            select,
            apply,
            tests,
            unfolds: counts.unfolds,
            folds: counts.folds,
            forced: counts.forced,
            carried: counts.carried,
            blocked,
            misses,
            foreseen,
            active_nodes: self.front.active_nodes() as u64,
            displayed,
            cut_hash: self.front.cut_hash(),
            limit,
            pages,
        })
    }
}
