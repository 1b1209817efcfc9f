//! The engine: one front through one hierarchy, following the camera frame by frame.
//!
//! Each frame: advance the clock by the motion; take arrivals from the backend; let the strategy find the nodes
//! whose status must flip; apply folds, then unfolds, to a fixpoint; end the frame. A node that comes into play in
//! the course of this is tested at once, so a frame ends with the cut that its views ask for, or with the changes
//! that the backend refused counted as misses.
//!
//! Everything here runs on the caller's thread. A backend may have threads of its own; no call waits for them.

use std::time::{Duration, Instant};

use vertex_tree::{MeshSink, NodeId, PageStats, Step, TreeError, VertexTree};

use crate::budget::{Budget, Steering};
use crate::criterion::Criterion;
use crate::front::Front;
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

/// A node waiting on the stack for its turn.
#[derive(Clone, Copy, PartialEq)]
struct Pending {
    node: NodeId,
    /// Whether an entry below waits for this one: a dependency, not something that a view wants.
    needed: bool,
    /// Whether this entry waits for those above.
    waits: bool,
}

impl Pending {
    fn wanted(node: NodeId) -> Self {
        Self { node, needed: false, waits: false }
    }
    fn needed(node: NodeId) -> Self {
        Self { node, needed: true, waits: false }
    }
}

/// Counts of the frame under way.
#[derive(Default)]
struct Counts {
    unfolds: u64,
    folds: u64,
    forced: u64,
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
    still_needed: Vec<NodeId>,
    arrived: Vec<NodeId>,
    drawing_time: Duration,
}

impl<T: VertexTree, M: MeshSink> Engine<T, M> {
    /// Starts with every node folded: the base mesh.
    ///
    /// # Errors
    /// What the backend reports.
    pub fn new(mut tree: T, mut mesh: M, settings: Settings) -> Result<Self, TreeError> {
        let limit = tree.node_limit();
        let roots: Vec<_> = tree.roots().iter().map(|&root| (root, tree.bounds(root))).collect();
        let mut front = Front::new(limit);
        let mut finder = Finder::new(settings.strategy, limit);
        // No views yet: every root is due, whatever the first frame brings.
        let frame = Frame {
            criterion: settings.criterion,
            views: &[],
            speed: Speed { rho: settings.rho, omega: settings.omega, kappa: 0.0 },
            motion: crate::motion::Motion::Unbounded,
        };
        front.add_roots(&roots);
        for (root, bounds) in roots {
            finder.watch(&frame, root, Kind::Unfold, bounds);
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
        let mut motion = self.odometer.advance(&speed, &self.before, &self.views);
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
            counts: Counts::default(),
            tests: 0,
        };
        step.missing.clear();
        step.blocked.clear();
        let applied = step.apply(&self.flips);
        if applied.is_err() {
            step.abandon(&self.flips);
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

/// Changes whose memory is fetched together: enough to keep every channel to it busy, few enough to stay in the
/// nearest cache.
const PREPARED: usize = 32;

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
    still_needed: &'a mut Vec<NodeId>,
    counts: Counts,
    tests: u64,
}

impl<T: VertexTree, M: MeshSink> Steps<'_, T, M> {
    /// Folds, then unfolds, and whatever follows.
    fn apply(&mut self, flips: &Flips) -> Result<(), TreeError> {
        for nodes in flips.fold.chunks(PREPARED) {
            self.prepare(nodes);
            for &node in nodes {
                self.fold(node)?;
            }
        }
        for nodes in flips.unfold.chunks(PREPARED) {
            self.prepare(nodes);
            for &node in nodes {
                self.unfold(node)?;
            }
        }
        // What was needed when its turn came may have been let go since.
        let mut before = None;
        while !self.still_needed.is_empty() && before != Some(self.counts.folds) {
            before = Some(self.counts.folds);
            for at in 0..self.still_needed.len() {
                self.fold(self.still_needed[at])?;
            }
            let front = &*self.front;
            self.still_needed.sort_unstable();
            self.still_needed.dedup();
            self.still_needed.retain(|&node| front.is_collapsible(node));
        }
        while let Some(node) = self.still_needed.pop() {
            self.refused(node, Kind::Fold);
        }
        Ok(())
    }

    /// The backend can not go on: whatever was to change is to be looked at again when it can.
    fn abandon(&mut self, flips: &Flips) {
        let pending = self.stack.drain(..).map(|pending| pending.node);
        let mut nodes: Vec<NodeId> = pending.chain(self.still_needed.drain(..)).collect();
        nodes.extend(flips.fold.iter().chain(&flips.unfold));
        for node in nodes {
            if self.front.is_collapsible(node) {
                self.refused(node, Kind::Fold);
            } else if self.front.is_boundary(node) {
                self.refused(node, Kind::Unfold);
            }
        }
    }

    fn prepare(&self, nodes: &[NodeId]) {
        self.front.prepare(nodes);
        self.tree.prepare(nodes);
    }

    fn wanted(&mut self, node: NodeId) -> bool {
        self.tests += 1;
        self.frame.unfold(&self.front.bounds(node))
    }

    fn watch(&mut self, node: NodeId, kind: Kind) {
        self.finder.watch(self.frame, node, kind, self.front.bounds(node));
    }

    fn refused(&mut self, node: NodeId, kind: Kind) {
        self.finder.unwatch(node);
        self.finder.refused(self.frame, node, kind, self.front.bounds(node));
    }

    /// Folds a collapsible node that no view wants, then as many of its ancestors as follow.
    fn fold(&mut self, node: NodeId) -> Result<(), TreeError> {
        self.stack.push(Pending::wanted(node));
        while let Some(&Pending { node, .. }) = self.stack.last() {
            if !self.front.is_collapsible(node) {
                self.stack.pop();
                continue;
            }
            let step = self.tree.fold(node, self.mesh)?;
            self.stack.pop();
            match step {
                Step::Done => {}
                Step::NotResident => {
                    self.missing.push(node);
                    self.refused(node, Kind::Fold);
                    continue;
                }
                Step::Blocked => {
                    self.blocked.push(node);
                    self.refused(node, Kind::Fold);
                    continue;
                }
                Step::StillNeeded | Step::Needs(_) => {
                    self.still_needed.push(node);
                    continue;
                }
            }
            self.counts.folds += 1;
            for child in self.tree.children(node) {
                self.finder.unwatch(child);
            }
            self.finder.unwatch(node);
            self.front.set_folded(&*self.tree, node);
            self.watch(node, Kind::Unfold);
            let above = self.stack.len();
            self.stack.extend(self.tree.parents(node).map(Pending::wanted));
            self.retain_above(above, |steps, parent| {
                if !steps.front.is_collapsible(parent) {
                    return false;
                }
                let wanted = steps.wanted(parent);
                if wanted {
                    steps.watch(parent, Kind::Fold);
                }
                !wanted
            });
        }
        Ok(())
    }

    /// Unfolds a boundary node that some view wants, then as many of its descendants as are wanted too, and before
    /// any of them what the backend says it needs.
    fn unfold(&mut self, node: NodeId) -> Result<(), TreeError> {
        self.stack.push(Pending::wanted(node));
        while let Some(&Pending { node, needed, .. }) = self.stack.last() {
            if self.front.is_active(node) {
                self.stack.pop();
                continue;
            }
            if !self.front.is_boundary(node) {
                // A needed node below folded ones: its ancestors come first.
                let above = self.stack.len();
                let (front, parents) = (&*self.front, self.tree.parents(node));
                self.stack.extend(parents.filter(|&p| !front.is_active(p)).map(Pending::needed));
                if (above..self.stack.len()).any(|at| self.waits(self.stack[at].node)) {
                    self.give_up();
                } else {
                    self.stack[above - 1].waits = true;
                }
                continue;
            }
            match self.tree.unfold(node, self.mesh)? {
                Step::Done => {}
                Step::Needs(other) if !self.front.is_active(other) && !self.waits(other) => {
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
            if needed && !self.wanted(node) {
                self.counts.forced += 1;
            }
            self.finder.unwatch(node);
            for parent in self.tree.parents(node) {
                if self.front.is_collapsible(parent) {
                    self.finder.unwatch(parent);
                }
            }
            self.front.set_active(&*self.tree, node);
            self.watch(node, Kind::Fold);
            let above = self.stack.len();
            self.stack.extend(self.tree.children(node).map(Pending::wanted));
            self.retain_above(above, |steps, child| {
                if !T::IS_TREE && !steps.front.is_boundary(child) {
                    return false;
                }
                let wanted = steps.wanted(child);
                if !wanted {
                    steps.watch(child, Kind::Unfold);
                }
                wanted
            });
        }
        Ok(())
    }

    /// Drops the entries of the stack from `above` on that `keep` does not want kept.
    #[inline(always)]
    fn retain_above(&mut self, above: usize, mut keep: impl FnMut(&mut Self, NodeId) -> bool) {
        let mut kept = above;
        for at in above..self.stack.len() {
            let pending = self.stack[at];
            if keep(self, pending.node) {
                self.stack[kept] = pending;
                kept += 1;
            }
        }
        self.stack.truncate(kept);
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
        while let Some(Pending { node, needed, .. }) = self.stack.pop() {
            if self.front.is_boundary(node) {
                self.refused(node, Kind::Unfold);
            }
            if !needed {
                break;
            }
        }
    }
}
