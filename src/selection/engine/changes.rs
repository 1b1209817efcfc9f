//! Carrying out status changes, and what follows from them.
//!
//! Folds come first, then unfolds, each to a fixpoint: a node that comes into play in the course of this is tested at once
//! and takes its turn at the end of its list.

use vertex_tree::{NodeId, Refine, Step, TreeError};

use super::noted::{Noted, Pending, is_boundary, is_collapsible, note};
use crate::budget::WorkCap;
use crate::carried::Carried;
use crate::clock::Moment;
use crate::front::{Front, Record};
use crate::in_play::{Kind, Slot};
use crate::refine::{Finder, Flips, Frame, Watch};
use crate::waiting::Waiting;

/// Counts of the frame under way.
#[derive(Default)]
pub(super) struct Counts {
    pub unfolds: u64,
    pub folds: u64,
    pub forced: u64,
    pub carried: u64,
}

/// Changes that are made before the next ones are prepared.
const TOGETHER: usize = 8;

/// Steps of preparation that are taken.
const MOST_STEPS: usize = 8;

/// Carries out status changes and what follows from them.
pub(super) struct Steps<'a, T, S> {
    pub tree: &'a mut T,
    pub sink: &'a mut S,
    pub front: &'a mut Front,
    pub finder: &'a mut Finder,
    pub frame: &'a Frame<'a>,
    pub stack: &'a mut Vec<Pending>,
    /// Nodes whose page is missing for a change; some more than once.
    pub missing: &'a mut Vec<NodeId>,
    /// Changes that wait for pages.
    pub waiting: &'a mut Waiting,
    /// Changes that a cap on work has left for later.
    pub carried: &'a mut Carried,
    /// Nodes whose change a rule of the backend's own forbade; some more than once.
    pub forbidden: &'a mut Vec<NodeId>,
    /// The same while others may yet make them possible.
    pub blocked: &'a mut Vec<Noted>,
    /// Nodes that no view wants and that something else still needs.
    pub still_needed: &'a mut Vec<Noted>,
    /// Collapsible nodes to fold and boundary nodes to unfold, in this order. What follows from a change goes to the end,
    /// so that its memory is fetched with that of others too.
    pub folding: &'a mut Vec<Noted>,
    pub unfolding: &'a mut Vec<Noted>,
    /// What the change under way has made boundary nodes or collapsible, where nodes have several parents.
    pub ready: &'a mut Vec<Slot>,
    pub counts: Counts,
    pub tests: u64,
}

impl<T: Refine<S>, S> Steps<'_, T, S> {
    /// Carries out what a strategy has found and what has waited for `arrived`, within a cap on work that began at `start`.
    pub fn carry_out(
        &mut self,
        flips: &Flips,
        arrived: &mut Vec<NodeId>,
        cap: WorkCap,
        start: Moment,
    ) -> Result<(), TreeError> {
        self.missing.clear();
        self.blocked.clear();
        self.forbidden.clear();
        note(self.front, &flips.fold, self.folding);
        note(self.front, &flips.unfold, self.unfolding);
        self.resume(arrived);
        let applied = match cap {
            WorkCap::None => self.apply(),
            cap => self.apply_within(cap, start),
        };
        if applied.is_err() {
            self.abandon();
        }
        applied
    }

    /// Folds, then unfolds, and whatever follows.
    fn apply(&mut self) -> Result<(), TreeError> {
        if self.carried.len() > 0 {
            self.take_back_carried();
        }
        self.take_turns(Kind::Fold)?;
        self.retry_blocked(Kind::Fold)?;
        self.forbid();
        self.take_turns(Kind::Unfold)?;
        self.retry_blocked(Kind::Unfold)?;
        self.let_go()
    }

    /// What a rule forbade when its turn came may have become possible since: to a fixpoint, so that the order in which a
    /// strategy finds changes does not matter.
    fn retry_blocked(&mut self, kind: Kind) -> Result<(), TreeError> {
        let mut before = None;
        while !self.blocked.is_empty() && before != Some(self.changes(kind)) {
            before = Some(self.changes(kind));
            let list = if kind == Kind::Fold { &mut *self.folding } else { &mut *self.unfolding };
            list.clear();
            list.append(self.blocked);
            self.take_turns(kind)?;
        }
        Ok(())
    }

    /// Changes of a kind made so far in this frame.
    fn changes(&self, kind: Kind) -> u64 {
        match kind {
            Kind::Fold => self.counts.folds,
            Kind::Unfold => self.counts.unfolds,
        }
    }

    /// What is blocked now stays so in this frame.
    fn forbid(&mut self) {
        self.forbidden.extend(self.blocked.drain(..).map(|(_, node)| node));
    }

    /// What was needed when its turn came may have been let go since.
    pub(super) fn let_go(&mut self) -> Result<(), TreeError> {
        self.forbid();
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
                    self.tree.prepare(node, step);
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
    pub(super) fn list(&self, kind: Kind) -> &Vec<Noted> {
        match kind {
            Kind::Fold => self.folding,
            Kind::Unfold => self.unfolding,
        }
    }

    pub(super) fn list_mut(&mut self, kind: Kind) -> &mut Vec<Noted> {
        match kind {
            Kind::Fold => self.folding,
            Kind::Unfold => self.unfolding,
        }
    }

    pub(super) fn wanted(&mut self, slot: Slot) -> bool {
        self.tests += 1;
        self.frame.unfold(slot, &self.front.record(slot).bounds)
    }

    pub(super) fn watch(&mut self, slot: Slot, kind: Kind) {
        self.finder.watch(self.frame, slot, kind, self.front.bounds(slot));
    }

    /// The node is no longer what it was watched as, if it was watched, nor what its change has been carried for.
    pub(super) fn unwatch(&mut self, slot: Slot) {
        self.finder.unwatch(slot);
        self.carried.remove(slot);
    }

    pub(super) fn refused(&mut self, slot: Slot, kind: Kind) {
        self.unwatch(slot);
        self.finder.refused(slot, kind, self.front.bounds(slot));
    }

    /// Folds a collapsible node that no view wants. Parents that no view wants either follow, once they can.
    pub(super) fn fold(&mut self, (slot, node): Noted) -> Result<(), TreeError> {
        if !is_collapsible(self.front, (slot, node)) {
            return Ok(());
        }
        match self.tree.fold_into(node, self.sink)? {
            Step::Done => {}
            Step::NotResident => {
                self.wait_for((slot, node), Kind::Fold, node);
                return Ok(());
            }
            Step::Blocked => {
                self.blocked.push((slot, node));
                self.refused(slot, Kind::Fold);
                return Ok(());
            }
            Step::StillNeeded | Step::Needs(_) => {
                self.still_needed.push((slot, node));
                return Ok(());
            }
        }
        self.folded(slot);
        Ok(())
    }

    /// The backend has folded a node.
    #[inline(always)]
    fn folded(&mut self, slot: Slot) {
        self.counts.folds += 1;
        self.carried.remove(slot);
        if T::IS_TREE {
            for child in self.front.children(self.tree, slot) {
                self.finder.unwatch(child);
                self.carried.remove(child);
            }
            self.finder.changed(slot);
            self.front.set_folded(self.tree, slot);
        } else {
            self.finder.changed(slot);
            self.ready.clear();
            let (finder, carried) = (&mut *self.finder, &mut *self.carried);
            let release = |child| {
                finder.unwatch(child);
                carried.remove(child);
            };
            self.front.set_folded_in_graph(self.tree, slot, release, self.ready);
        }
        self.watch(slot, Kind::Unfold);
        let (front, frame) = (&*self.front, self.frame);
        let mut comes_into_play = |slot: Slot| {
            let record = front.record(slot);
            self.tests += 1;
            if frame.unfold(slot, &record.bounds) {
                self.finder.watch(frame, slot, Kind::Fold, record.bounds);
            } else {
                self.folding.push((slot, record.node));
            }
        };
        if T::IS_TREE {
            front
                .parents(self.tree, slot)
                .filter(|&parent| front.record(parent).is_collapsible())
                .for_each(comes_into_play);
        } else {
            self.ready.iter().for_each(|&parent| comes_into_play(parent));
        }
    }

    /// Unfolds a boundary node that some view wants, and before it what the backend says it needs. Children that are
    /// wanted too follow.
    #[inline(always)]
    pub(super) fn unfold(&mut self, (slot, node): Noted) -> Result<(), TreeError> {
        if !is_boundary(self.front, (slot, node)) {
            return Ok(());
        }
        match self.tree.unfold_into(node, self.sink)? {
            Step::Done => self.unfolded(slot),
            step => {
                self.stack.push(Pending::wanted((slot, node)));
                self.wait_or_give_up((slot, node), step);
                self.unfold_needed()?;
            }
        }
        Ok(())
    }

    /// The backend has unfolded a node.
    #[inline(always)]
    pub(super) fn unfolded(&mut self, slot: Slot) {
        self.counts.unfolds += 1;
        self.finder.changed(slot);
        self.carried.remove(slot);
        if T::IS_TREE {
            for parent in self.front.parents(self.tree, slot) {
                if self.front.record(parent).is_collapsible() {
                    self.finder.unwatch(parent);
                    self.carried.remove(parent);
                }
            }
            self.front.set_active(self.tree, slot);
        } else {
            self.ready.clear();
            let (finder, carried) = (&mut *self.finder, &mut *self.carried);
            let hold = |parent| {
                finder.unwatch(parent);
                carried.remove(parent);
            };
            self.front.set_active_in_graph(self.tree, slot, hold, self.ready);
        }
        if let Some(cones) = self.frame.cones {
            for child in self.front.children(self.tree, slot) {
                cones.set(child, self.tree.normal_cone(self.front.node(child)));
            }
        }
        self.watch(slot, Kind::Fold);
        let (front, frame) = (&*self.front, self.frame);
        let mut comes_into_play = |slot: Slot, record: &Record, wanted: bool| {
            self.tests += 1;
            if wanted {
                self.unfolding.push((slot, record.node));
            } else {
                self.finder.watch(frame, slot, Kind::Unfold, record.bounds);
            }
        };
        if T::IS_TREE
            && let Some(children) = front.two_below(slot)
        {
            // The rule, and worth tests two at a time.
            let [a, b] = children.map(|child| front.record(child));
            let wanted = frame.unfold_both(children, [&a.bounds, &b.bounds]);
            comes_into_play(children[0], a, wanted[0]);
            comes_into_play(children[1], b, wanted[1]);
            return;
        }
        let mut test = |child: Slot| {
            let record = front.record(child);
            comes_into_play(child, record, frame.unfold(child, &record.bounds));
        };
        if T::IS_TREE {
            front.children(self.tree, slot).for_each(test);
        } else {
            self.ready.iter().for_each(|&child| test(child));
        }
    }
}
