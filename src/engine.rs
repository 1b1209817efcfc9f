//! The engine: one front through one hierarchy, following the camera frame by frame.
//!
//! Each frame: advance the clock by the motion; take arrivals from the backend; let the strategy find the nodes
//! whose status must flip; apply folds, then unfolds, to a fixpoint; end the frame. A node that comes into play in
//! the course of this is tested at once, so a frame ends with the cut that its views ask for, or with the changes
//! that the backend refused counted as misses.
//!
//! Everything here runs on the caller's thread. A backend may have threads of its own; no call waits for them.

use std::collections::BinaryHeap;
use std::time::{Duration, Instant};

use vertex_tree::{MeshSink, NodeId, PageStats, Step, TreeError, VertexTree};

use crate::budget::{Budget, FOLDING_SHARE, Steering, WorkCap};
use crate::criterion::Criterion;
use crate::front::{Front, Slot};
use crate::motion::{Odometer, Speed};
use crate::queue::Kind;
use crate::refine::{Finder, Flips, Frame, Strategy};
use crate::view::View;

/// How an engine refines.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How the nodes that must change are found.
    pub strategy: Strategy,
    /// What "coarse" means.
    pub criterion: Criterion,
    /// Declared full speed of the camera, `rho` and `omega`; `kappa` is set by the engine.
    pub rho: f64,
    /// See [`Speed::omega`].
    pub omega: f64,
    /// What a frame may cost.
    pub budget: Budget,
    /// What a frame may do.
    pub work_cap: WorkCap,
}

impl Default for Settings {
    /// Event-driven, screen error, no budget, and full speeds of 1 object unit and 0.02 radians a frame.
    fn default() -> Self {
        Self {
            strategy: Strategy::Event,
            criterion: Criterion::ScreenError,
            rho: 1.0,
            omega: 0.02,
            budget: Budget::None,
            work_cap: WorkCap::None,
        }
    }
}

/// What kept the detail of a frame down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// The tolerance alone: more detail would not be seen.
    Error,
    /// The triangle budget.
    Triangles,
    /// The frame-time budget.
    Time,
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
            Self::Triangles => "triangles",
            Self::Time => "time",
            Self::Io => "io",
            Self::Work => "work",
        }
    }
}

/// What a frame did and cost.
#[derive(Clone, Copy, Debug)]
pub struct FrameReport {
    /// The whole refinement step.
    pub select: Duration,
    /// The part of it spent on folds, unfolds and the mesh.
    pub apply: Duration,
    /// Tests of the criterion.
    pub tests: u64,
    /// Nodes unfolded.
    pub unfolds: u64,
    /// Nodes folded.
    pub folds: u64,
    /// Those of the unfolds that no view wanted: another node needed them.
    pub forced: u64,
    /// Wanted changes left to later frames by the cap on work.
    pub carried: u64,
    /// Wanted changes that a rule of the backend's own forbade, see [`Step::Blocked`].
    pub blocked: u64,
    /// Wanted changes that the backend refused for want of a page.
    pub misses: u64,
    /// Active nodes at the end.
    pub active_nodes: u64,
    /// Triangles displayed at the end.
    pub triangles: u64,
    /// Hash of the set of active nodes, see [`Front::cut_hash`].
    pub cut_hash: u64,
    /// What kept the detail down.
    pub limit: Limit,
    /// What paging did.
    pub pages: PageStats,
}

/// A node in play and the slot that it was in when this was noted. By the time its turn comes it may have gone out of
/// play and another node may have come to the slot.
type Noted = (Slot, NodeId);

/// A node waiting on the stack for its turn.
#[derive(Clone, Copy, PartialEq)]
struct Pending {
    /// Where the node is, if it is known to be in play.
    slot: Slot,
    node: NodeId,
    /// Whether an entry below waits for this one: a dependency, not something that a view wants.
    needed: bool,
    /// Whether this entry waits for those above.
    waits: bool,
}

impl Pending {
    fn wanted((slot, node): Noted) -> Self {
        Self { slot, node, needed: false, waits: false }
    }
    fn needed(node: NodeId) -> Self {
        Self { slot: Slot::NONE, node, needed: true, waits: false }
    }
}

/// Counts of the frame under way.
#[derive(Default)]
struct Counts {
    unfolds: u64,
    folds: u64,
    forced: u64,
    carried: u64,
}

/// A change that waits for its turn where work is capped. The most urgent one is the greatest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Urgent {
    /// Bits of a number that is not negative, which are in the same order.
    urgency: u64,
    slot: Slot,
    node: NodeId,
}

/// A front through a hierarchy of backend `T`, reporting the displayed mesh to `M`.
pub struct Engine<T, M> {
    tree: T,
    mesh: M,
    front: Front,
    finder: Finder,
    settings: Settings,
    odometer: Odometer,
    steering: Steering,
    /// The views of the last frame, with the budget's factor applied, and room for the next.
    before: Vec<View>,
    views: Vec<View>,
    kappa: f64,
    flips: Flips,
    stack: Vec<Pending>,
    missing: Vec<NodeId>,
    blocked: Vec<NodeId>,
    still_needed: Vec<Noted>,
    folding: Vec<Noted>,
    unfolding: Vec<Noted>,
    urgent: [BinaryHeap<Urgent>; 2],
    arrived: Vec<NodeId>,
    drawing_time: Duration,
}

impl<T: VertexTree, M: MeshSink> Engine<T, M> {
    /// Starts with every node folded: the base mesh.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn new(mut tree: T, mut mesh: M, settings: Settings) -> Result<Self, TreeError> {
        let front = Front::new(&tree);
        let mut finder = Finder::new(settings.strategy);
        // No views yet: every root is due, whatever the first frame brings.
        let frame = Frame {
            criterion: settings.criterion,
            views: &[],
            speed: Speed { rho: settings.rho, omega: settings.omega, kappa: 0.0 },
            motion: crate::motion::Motion::Unbounded,
        };
        for root in front.roots() {
            finder.watch(&frame, root, Kind::Unfold, front.bounds(root));
        }
        tree.base_mesh(&mut mesh)?;
        Ok(Self {
            tree,
            mesh,
            front,
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
            blocked: Vec::new(),
            still_needed: Vec::new(),
            folding: Vec::new(),
            unfolding: Vec::new(),
            urgent: Default::default(),
            arrived: Vec::new(),
            drawing_time: Duration::ZERO,
        })
    }

    /// The backend.
    pub fn tree(&self) -> &T {
        &self.tree
    }

    /// The displayed mesh.
    pub fn mesh(&self) -> &M {
        &self.mesh
    }

    /// The displayed mesh, to be told that its changes have been taken.
    pub fn mesh_mut(&mut self) -> &mut M {
        &mut self.mesh
    }

    /// The active front.
    pub fn front(&self) -> &Front {
        &self.front
    }

    /// The views of the last frame, with the tolerance that a budget made of theirs.
    pub fn views(&self) -> &[View] {
        &self.views
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

    /// Moves the front to where these views want it. A node unfolds if any of them wants it: two for stereo, one
    /// more for each shadow map. No view at all folds everything.
    ///
    /// # Errors
    /// What the backend reports; the front then is a valid one between the old and the new.
    pub fn advance(&mut self, views: &[View]) -> Result<FrameReport, TreeError> {
        let start = Instant::now();
        self.arrived.clear();
        self.tree.begin_frame(&mut self.arrived)?;

        std::mem::swap(&mut self.before, &mut self.views);
        self.views.clear();
        self.views.extend(views.iter().map(|view| view.coarser(self.steering.factor)));

        // While a budget steers, `k` has a speed. It is declared anew when the tolerance has moved far from where it
        // was declared; bounds that were computed with another speed do not hold then.
        let kappa = self.steering.kappa(&self.views);
        let redeclared = kappa > 1.5 * self.kappa || kappa < 0.5 * self.kappa;
        if redeclared {
            self.kappa = kappa;
        }
        let speed = Speed { rho: self.settings.rho, omega: self.settings.omega, kappa: self.kappa };
        let mut motion = self.odometer.advance(&speed.into(), &self.before, &self.views);
        if redeclared {
            motion = crate::motion::Motion::Unbounded;
        }
        let frame = Frame { criterion: self.settings.criterion, views: &self.views, speed, motion };

        self.flips.unfold.clear();
        self.flips.fold.clear();
        self.flips.tests = 0;
        self.finder.find(&frame, &self.before, &self.front, &mut self.flips);

        let found = Instant::now();
        let mut step = Steps {
            tree: &mut self.tree,
            mesh: &mut self.mesh,
            front: &mut self.front,
            finder: &mut self.finder,
            frame: &frame,
            stack: &mut self.stack,
            missing: &mut self.missing,
            blocked: &mut self.blocked,
            still_needed: &mut self.still_needed,
            folding: &mut self.folding,
            unfolding: &mut self.unfolding,
            counts: Counts::default(),
            tests: 0,
        };
        step.missing.clear();
        step.blocked.clear();
        note(step.front, &self.flips.fold, step.folding);
        note(step.front, &self.flips.unfold, step.unfolding);
        let applied = match self.settings.work_cap {
            WorkCap::None => step.apply(),
            cap => step.apply_within(cap, found, &mut self.urgent),
        };
        if applied.is_err() {
            step.abandon();
        }
        let (counts, tests) = (step.counts, self.flips.tests + step.tests);
        let distinct = |nodes: &mut Vec<NodeId>| {
            nodes.sort_unstable();
            nodes.dedup();
            nodes.len() as u64
        };
        let (misses, blocked) = (distinct(&mut self.missing), distinct(&mut self.blocked));
        let apply = found.elapsed();
        self.finder.settle(&frame);
        applied?;
        let pages = self.tree.end_frame()?;
        let select = start.elapsed();

        let triangles = self.tree.displayed_triangles();
        let limit = match self.steering.budget() {
            _ if misses > 0 => Limit::Io,
            _ if counts.carried > 0 => Limit::Work,
            Budget::Triangles(_) if self.steering.limits() => Limit::Triangles,
            Budget::FrameTime(_) if self.steering.limits() => Limit::Time,
            _ => Limit::Error,
        };
        let moved = self.before.len() != self.views.len()
            || self.before.iter().zip(&self.views).any(|(b, v)| b.eye != v.eye || b.direction != v.direction);
        self.steering.observe(triangles, select + std::mem::take(&mut self.drawing_time), moved);
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
            active_nodes: self.front.active_nodes() as u64,
            triangles,
            cut_hash: self.front.cut_hash(),
            limit,
            pages,
        })
    }
}

/// Changes that are made before the next ones are prepared.
const TOGETHER: usize = 8;

/// Steps of preparation that are taken.
const MOST_STEPS: usize = 8;

/// Carries out status changes and what follows from them.
struct Steps<'a, T, M> {
    tree: &'a mut T,
    mesh: &'a mut M,
    front: &'a mut Front,
    finder: &'a mut Finder,
    frame: &'a Frame<'a>,
    stack: &'a mut Vec<Pending>,
    /// Nodes whose change was refused for want of a page; some more than once.
    missing: &'a mut Vec<NodeId>,
    /// Nodes whose change a rule of the backend's own forbade; some more than once.
    blocked: &'a mut Vec<NodeId>,
    /// Nodes that no view wants and that something else still needs.
    still_needed: &'a mut Vec<Noted>,
    /// Collapsible nodes to fold and boundary nodes to unfold, in this order. What follows from a change goes to the end,
    /// so that its memory is fetched with that of others too.
    folding: &'a mut Vec<Noted>,
    unfolding: &'a mut Vec<Noted>,
    counts: Counts,
    tests: u64,
}

impl<T: VertexTree, M: MeshSink> Steps<'_, T, M> {
    /// Folds, then unfolds, and whatever follows.
    fn apply(&mut self) -> Result<(), TreeError> {
        self.take_turns(Kind::Fold)?;
        self.take_turns(Kind::Unfold)?;
        self.let_go()
    }

    /// What was needed when its turn came may have been let go since.
    fn let_go(&mut self) -> Result<(), TreeError> {
        let mut before = None;
        while !self.still_needed.is_empty() && before != Some(self.counts.folds) {
            before = Some(self.counts.folds);
            self.folding.clear();
            self.folding.append(self.still_needed);
            self.take_turns(Kind::Fold)?;
            let front = &*self.front;
            self.still_needed.sort_unstable();
            self.still_needed.dedup();
            self.still_needed.retain(|&noted| is_collapsible(front, noted));
        }
        while let Some((slot, _)) = self.still_needed.pop() {
            self.refused(slot, Kind::Fold);
        }
        Ok(())
    }

    /// The same within a cap, most urgent first. `start` is when the work began.
    fn apply_within(
        &mut self,
        cap: WorkCap,
        start: Instant,
        [folds, unfolds]: &mut [BinaryHeap<Urgent>; 2],
    ) -> Result<(), TreeError> {
        let is_spent = |counts: &Counts, share: f64| match cap {
            WorkCap::None => false,
            WorkCap::Changes(most) => (counts.folds + counts.unfolds) as f64 >= most as f64 * share,
            WorkCap::Time(most) => start.elapsed() >= most.mul_f64(share),
        };
        let mut result = Ok(());
        // Folds that must not wait, unfolds, and folds again with what is left.
        for (kind, share) in [(Kind::Fold, FOLDING_SHARE), (Kind::Unfold, 1.0), (Kind::Fold, 1.0)] {
            let heap = if kind == Kind::Fold { &mut *folds } else { &mut *unfolds };
            loop {
                // At first all that was found, later what follows from a change.
                self.await_turn(kind, heap);
                if result.is_err() || is_spent(&self.counts, share) {
                    break;
                }
                let Some(Urgent { slot, node, .. }) = heap.pop() else { break };
                result = match kind {
                    Kind::Fold => self.fold((slot, node)),
                    Kind::Unfold => self.unfold((slot, node)),
                };
            }
        }
        for (kind, heap) in [(Kind::Fold, folds), (Kind::Unfold, unfolds)] {
            for Urgent { slot, node, .. } in heap.drain() {
                let is_still = if kind == Kind::Fold { is_collapsible } else { is_boundary };
                if is_still(self.front, (slot, node)) {
                    self.counts.carried += 1;
                    self.refused(slot, kind);
                }
            }
        }
        result.and_then(|()| self.let_go())
    }

    /// Moves the changes found so far to a heap.
    fn await_turn(&mut self, kind: Kind, heap: &mut BinaryHeap<Urgent>) {
        let list = if kind == Kind::Fold { &mut *self.folding } else { &mut *self.unfolding };
        heap.extend(list.drain(..).map(|(slot, node)| {
            let urgency = self.frame.criterion.urgency(self.frame.views, &self.front.record(slot).bounds);
            // Of what is to be folded, the least wanted first.
            let urgency = if kind == Kind::Fold { 1.0 - urgency.min(1.0) } else { urgency };
            Urgent { urgency: urgency.max(0.0).to_bits(), slot, node }
        }));
    }

    /// The backend can not go on: whatever was to change is to be looked at again when it can.
    fn abandon(&mut self) {
        let pending = self.stack.drain(..).map(|pending| (pending.slot, pending.node));
        let mut all: Vec<Noted> = pending.chain(self.still_needed.drain(..)).collect();
        all.extend(self.folding.iter().chain(&*self.unfolding));
        for (slot, node) in all {
            let slot = if slot == Slot::NONE { self.front.find(self.tree, node) } else { slot };
            if is_collapsible(self.front, (slot, node)) {
                self.refused(slot, Kind::Fold);
            } else if is_boundary(self.front, (slot, node)) {
                self.refused(slot, Kind::Unfold);
            }
        }
    }

    /// Changes the nodes of a list, which may grow meanwhile. While some change, those whose turn comes next are prepared,
    /// the further off the less.
    #[inline(always)]
    fn take_turns(&mut self, kind: Kind) -> Result<(), TreeError> {
        let mut prepared = [0; MOST_STEPS];
        let steps = T::PREPARATION.clamp(1, MOST_STEPS);
        let mut done = 0;
        while done < self.list(kind).len() {
            for (step, prepared) in prepared[..steps].iter_mut().enumerate() {
                let end = self.list(kind).len().min(done + TOGETHER * (steps - step));
                for &(slot, node) in &self.list(kind)[*prepared..end] {
                    if step == 0 {
                        self.front.prefetch_linked(slot);
                        self.finder.prefetch(slot);
                    }
                    self.tree.prepare(node, step, self.mesh);
                }
                *prepared = end;
            }
            let end = self.list(kind).len().min(done + TOGETHER);
            for at in done..end {
                match kind {
                    Kind::Fold => self.fold(self.folding[at])?,
                    Kind::Unfold => self.unfold(self.unfolding[at])?,
                }
            }
            done = end;
        }
        Ok(())
    }

    #[inline(always)]
    fn list(&self, kind: Kind) -> &Vec<Noted> {
        match kind {
            Kind::Fold => self.folding,
            Kind::Unfold => self.unfolding,
        }
    }

    fn wanted(&mut self, slot: Slot) -> bool {
        self.tests += 1;
        self.frame.unfold(&self.front.record(slot).bounds)
    }

    fn watch(&mut self, slot: Slot, kind: Kind) {
        self.finder.watch(self.frame, slot, kind, self.front.bounds(slot));
    }

    fn refused(&mut self, slot: Slot, kind: Kind) {
        self.finder.unwatch(slot);
        self.finder.refused(slot, kind, self.front.bounds(slot));
    }

    /// Folds a collapsible node that no view wants. Parents that no view wants either follow, once they can.
    fn fold(&mut self, (slot, node): Noted) -> Result<(), TreeError> {
        if !is_collapsible(self.front, (slot, node)) {
            return Ok(());
        }
        match self.tree.fold(node, self.mesh)? {
            Step::Done => {}
            Step::NotResident => {
                self.missing.push(node);
                self.refused(slot, Kind::Fold);
                return Ok(());
            }
            Step::Blocked => {
                self.blocked.push(node);
                self.refused(slot, Kind::Fold);
                return Ok(());
            }
            Step::StillNeeded | Step::Needs(_) => {
                self.still_needed.push((slot, node));
                return Ok(());
            }
        }
        self.counts.folds += 1;
        for child in self.front.children(self.tree, slot) {
            self.finder.unwatch(child);
        }
        self.finder.unwatch(slot);
        self.front.set_folded(self.tree, slot);
        self.watch(slot, Kind::Unfold);
        for parent in self.front.parents(self.tree, slot) {
            let record = self.front.record(parent);
            if record.is_collapsible() {
                self.tests += 1;
                if self.frame.unfold(&record.bounds) {
                    self.finder.watch(self.frame, parent, Kind::Fold, record.bounds);
                } else {
                    self.folding.push((parent, record.node));
                }
            }
        }
        Ok(())
    }

    /// Unfolds a boundary node that some view wants, and before it what the backend says it needs. Children that are
    /// wanted too follow.
    fn unfold(&mut self, noted: Noted) -> Result<(), TreeError> {
        self.stack.push(Pending::wanted(noted));
        while let Some(&Pending { slot, node, needed, .. }) = self.stack.last() {
            let slot = if slot == Slot::NONE { self.front.find(self.tree, node) } else { slot };
            if self.front.node(slot) == node && self.front.record(slot).is_active() {
                self.stack.pop();
                continue;
            }
            if !is_boundary(self.front, (slot, node)) {
                // A needed node below folded ones: its ancestors come first.
                let above = self.stack.len();
                let (front, tree) = (&*self.front, &*self.tree);
                let is_folded = |p: &NodeId| !front.record(front.find(tree, *p)).is_active();
                self.stack.extend(tree.parents(node).filter(is_folded).map(Pending::needed));
                if (above..self.stack.len()).any(|at| self.waits(self.stack[at].node)) {
                    self.give_up();
                } else {
                    self.stack[above - 1].waits = true;
                }
                continue;
            }
            match self.tree.unfold(node, self.mesh)? {
                Step::Done => {}
                Step::Needs(other) if !self.is_active(other) && !self.waits(other) => {
                    if let Some(pending) = self.stack.last_mut() {
                        pending.waits = true;
                    }
                    self.stack.push(Pending::needed(other));
                    continue;
                }
                Step::Blocked => {
                    self.blocked.push(node);
                    self.give_up();
                    continue;
                }
                Step::Needs(_) | Step::NotResident | Step::StillNeeded => {
                    self.missing.push(node);
                    self.give_up();
                    continue;
                }
            }
            self.stack.pop();
            self.counts.unfolds += 1;
            if needed && !self.wanted(slot) {
                self.counts.forced += 1;
            }
            self.finder.unwatch(slot);
            for parent in self.front.parents(self.tree, slot) {
                if self.front.record(parent).is_collapsible() {
                    self.finder.unwatch(parent);
                }
            }
            self.front.set_active(self.tree, slot);
            self.watch(slot, Kind::Fold);
            for child in self.front.children(self.tree, slot) {
                let record = self.front.record(child);
                if T::IS_TREE || record.is_boundary() {
                    self.tests += 1;
                    if self.frame.unfold(&record.bounds) {
                        self.unfolding.push((child, record.node));
                    } else {
                        self.finder.watch(self.frame, child, Kind::Unfold, record.bounds);
                    }
                }
            }
        }
        Ok(())
    }

    fn is_active(&self, node: NodeId) -> bool {
        self.front.record(self.front.find(self.tree, node)).is_active()
    }

    /// Whether a node waits for the one on top of the stack, directly or by way of others. To need it then is a cycle
    /// of dependencies, which can only come from a damaged store.
    fn waits(&self, node: NodeId) -> bool {
        // What lies below an entry that nobody needs only waits for its turn.
        let last = self.stack.iter().rposition(|pending| !pending.needed).unwrap_or(0);
        self.stack[last..].iter().any(|pending| pending.waits && pending.node == node)
    }

    /// The node on top of the stack can not be unfolded in this frame, and with it nothing that waits for it.
    fn give_up(&mut self) {
        while let Some(Pending { slot, node, needed, .. }) = self.stack.pop() {
            let slot = if slot == Slot::NONE { self.front.find(self.tree, node) } else { slot };
            if is_boundary(self.front, (slot, node)) {
                self.refused(slot, Kind::Unfold);
            }
            if !needed {
                break;
            }
        }
    }
}

/// Looks up the nodes in some slots, before anything changes.
fn note(front: &Front, slots: &[Slot], noted: &mut Vec<Noted>) {
    noted.clear();
    for slots in slots.chunks(32) {
        slots.iter().for_each(|&slot| front.prefetch(slot));
        noted.extend(slots.iter().map(|&slot| (slot, front.node(slot))));
    }
}

/// Whether a node that was noted is still in its slot and collapsible.
#[inline(always)]
fn is_collapsible(front: &Front, (slot, node): Noted) -> bool {
    let record = front.record(slot);
    record.node == node && record.is_collapsible()
}

/// Whether a node that was noted is still in its slot and a boundary node.
#[inline(always)]
fn is_boundary(front: &Front, (slot, node): Noted) -> bool {
    let record = front.record(slot);
    record.node == node && record.is_boundary()
}
