//! The brute-force cut: what every strategy must arrive at.
//!
//! Every node of the hierarchy is tested, nothing is remembered and no order is relied on. The cut is the closure
//! upwards of the nodes that some view wants.

use collapse_log::{CollapseLog, Forest, LogError};
use vertex_tree::{Bounds, NONE, NormalCone, Refine};

use selection::criterion::Criterion;
use selection::engine::Engine;
use selection::front::mix;
use selection::normal_cone;
use selection::view::View;

/// Bounds and parents of all nodes, in the order of the collapse log.
#[derive(Clone, Debug)]
pub struct Oracle {
    bounds: Vec<Bounds>,
    /// Of all nodes, or empty where the normal-cone test is no part of the criterion.
    cones: Vec<NormalCone>,
    parent: Vec<u32>,
    active: Vec<bool>,
    hash: u64,
    count: usize,
}

/// A node whose status is not the oracle's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Number in the collapse log.
    pub node: u32,
    /// Sphere and error.
    pub bounds: Bounds,
    /// Whether the oracle has it active; the engine has the opposite.
    pub active: bool,
    /// How many nodes differ in all.
    pub count: usize,
}

impl Oracle {
    /// An oracle for a log.
    ///
    /// # Errors
    /// What [`CollapseLog::forest`] finds wrong with the log.
    pub fn new(log: &CollapseLog) -> Result<Self, LogError> {
        Ok(Self::with_forest(log, log.forest()?))
    }

    /// An oracle for a log whose forest is known.
    #[must_use]
    pub fn with_forest(log: &CollapseLog, forest: Forest) -> Self {
        Self {
            bounds: log.collapses.iter().map(|c| c.bounds).collect(),
            cones: Vec::new(),
            active: vec![false; forest.parent.len()],
            parent: forest.parent,
            hash: 0,
            count: 0,
        }
    }

    /// The same with the normal-cone test: a cone for each collapse of the log.
    ///
    /// # Panics
    /// If there are more or fewer.
    #[must_use]
    pub fn with_cones(self, cones: Vec<NormalCone>) -> Self {
        assert_eq!(cones.len(), self.bounds.len(), "one cone for each collapse");
        Self { cones, ..self }
    }

    /// Finds the cut for these views.
    pub fn cut(&mut self, criterion: Criterion, views: &[View]) -> &[bool] {
        let nodes = self.active.iter_mut().zip(&self.bounds);
        match views {
            _ if !self.cones.is_empty() => nodes.zip(&self.cones).for_each(|((active, bounds), cone)| {
                *active = normal_cone::unfold(criterion, views, bounds, cone);
            }),
            // One view is the rule, and worth a loop without a loop in it.
            [view] => nodes.for_each(|(active, bounds)| *active = criterion.unfold_for(view, bounds)),
            _ => nodes.for_each(|(active, bounds)| *active = criterion.unfold(views, bounds)),
        }
        // Children come before their parents in the log, so one pass closes upwards.
        (self.hash, self.count) = (0, 0);
        for n in 0..self.active.len() {
            if self.active[n] {
                self.hash = self.hash.wrapping_add(mix(n as u32));
                self.count += 1;
                if self.parent[n] != NONE {
                    self.active[self.parent[n] as usize] = true;
                }
            }
        }
        &self.active
    }

    /// The active nodes of the last cut, by number in the collapse log.
    #[must_use]
    pub fn active(&self) -> &[bool] {
        &self.active
    }

    /// Hash of the last cut, comparable with [`Front::cut_hash`](selection::front::Front::cut_hash).
    #[must_use]
    pub fn cut_hash(&self) -> u64 {
        self.hash
    }

    /// Size of the last cut.
    #[must_use]
    pub fn active_nodes(&self) -> usize {
        self.count
    }

    /// Compares an engine's front with the cut for the engine's own views: `None` if they agree.
    pub fn compare<T: Refine<S>, S>(&mut self, engine: &Engine<T, S>) -> Option<Difference> {
        self.cut(engine.settings().criterion, engine.views());
        if self.hash == engine.front().cut_hash() && self.count == engine.front().active_nodes() {
            return None;
        }
        let mut differs = self.active.clone();
        engine.for_each_active(|node| {
            let n = engine.tree().log_number(node) as usize;
            differs[n] = !differs[n];
        });
        let count = differs.iter().filter(|&&d| d).count();
        let node = differs.iter().rposition(|&d| d)?;
        Some(Difference { node: node as u32, bounds: self.bounds[node], active: self.active[node], count })
    }
}
