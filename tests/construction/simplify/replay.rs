//! Replays a collapse log on its own terms and finds what it promises: nothing here shares code with the construction.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::collections::BTreeSet;

use foldfront::vertex_tree::NONE;
use foldfront::{Bounds, CollapseLog};
use glam::DVec3;

/// What a log says once it has been replayed.
pub struct Replay<'a> {
    log: &'a CollapseLog,
    /// For each node, the nodes that must be folded before it.
    pub predecessors: Vec<Vec<u32>>,
    /// For each triangle, the nodes that changed it, in order. The last one makes it vanish if `vanishes` says so.
    changes: Vec<Vec<u32>>,
    vanishes: Vec<bool>,
    /// For each triangle, its corners before the first change and after each one that did not make it vanish.
    states: Vec<Vec<[u32; 3]>>,
}

fn position(log: &CollapseLog, v: u32) -> DVec3 {
    DVec3::from(log.mesh.positions[v as usize].map(f64::from))
}

fn is_flat([a, b, c]: [u32; 3]) -> bool {
    a == b || b == c || c == a
}

impl<'a> Replay<'a> {
    pub fn new(log: &'a CollapseLog) -> Self {
        let vertices = log.mesh.positions.len();
        let mut stars = vec![BTreeSet::new(); vertices];
        for (t, corners) in (0_u32..).zip(&log.mesh.triangles) {
            if !is_flat(*corners) {
                corners.iter().for_each(|&v| _ = stars[v as usize].insert(t));
            }
        }
        let mut replay = Replay {
            log,
            predecessors: Vec::with_capacity(log.collapses.len()),
            changes: vec![Vec::new(); log.mesh.triangles.len()],
            vanishes: vec![false; log.mesh.triangles.len()],
            states: log.mesh.triangles.iter().map(|&corners| vec![corners]).collect(),
        };
        // The last node at a vertex, and the last that took a triangle away from it and changed none of the others.
        let mut top = vec![NONE; vertices];
        let mut trace = vec![NONE; vertices];
        for (n, c) in (0_u32..).zip(&log.collapses) {
            let star = std::mem::take(&mut stars[c.removed as usize]);
            let mut before: BTreeSet<u32> =
                [top[c.removed as usize], top[c.kept as usize], trace[c.removed as usize]].into();
            let (mut touched, mut lost) = (BTreeSet::new(), BTreeSet::new());
            for &t in &star {
                let corners = *replay.states[t as usize].last().unwrap();
                before.insert(replay.changes[t as usize].last().copied().unwrap_or(NONE));
                replay.changes[t as usize].push(n);
                let others = corners.into_iter().filter(|&v| v != c.removed && v != c.kept);
                if corners.contains(&c.kept) {
                    replay.vanishes[t as usize] = true;
                    stars[c.kept as usize].remove(&t);
                    others.for_each(|v| {
                        stars[v as usize].remove(&t);
                        lost.insert(v);
                    });
                } else {
                    let moved = corners.map(|v| if v == c.removed { c.kept } else { v });
                    replay.states[t as usize].push(moved);
                    stars[c.kept as usize].insert(t);
                    touched.extend(others);
                }
            }
            for &v in lost.difference(&touched) {
                before.insert(trace[v as usize]);
                trace[v as usize] = n;
            }
            before.remove(&NONE);
            replay.predecessors.push(before.into_iter().collect());
            top[c.kept as usize] = n;
        }
        replay
    }

    /// The triangles shown after all collapses.
    pub fn base_triangles(&self) -> usize {
        let flat = self.log.mesh.triangles.iter().filter(|t| is_flat(**t)).count();
        self.vanishes.iter().filter(|v| !**v).count() - flat
    }

    /// Spheres are nested with the promised slack and errors saturated, over all predecessors.
    pub fn assert_nested(&self) {
        let slack = (self.log.mesh.extent() / 2_f64.powi(40)).min(self.median_edge() / 2_f64.powi(12));
        for (n, c) in self.log.collapses.iter().enumerate() {
            for &m in &self.predecessors[n] {
                assert!((m as usize) < n, "node {n} depends on {m}");
                let inner = self.log.collapses[m as usize].bounds;
                let needed = center(c.bounds).distance(center(inner)) + f64::from(inner.radius);
                let radius = f64::from(c.bounds.radius);
                assert!(
                    needed + slack + radius / 2_f64.powi(20) <= radius,
                    "node {n} {:?} does not contain {m} {inner:?}",
                    c.bounds
                );
                assert!(inner.eps <= c.bounds.eps, "node {n} {:?}, before it {m} {inner:?}", c.bounds);
            }
        }
    }

    /// The median length of the edges that have any, 0 where none has.
    fn median_edge(&self) -> f64 {
        let log = self.log;
        let shown = log.mesh.triangles.iter().filter(|t| !is_flat(**t));
        let edges = shown.flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let lengths = edges.map(|[v, w]| position(log, v).distance(position(log, w)));
        let mut lengths: Vec<f64> = lengths.filter(|length| *length > 0.0).collect();
        lengths.sort_by(f64::total_cmp);
        lengths.get(lengths.len() / 2).copied().unwrap_or(0.0)
    }

    /// The sphere of each node contains the input triangles around the leaves right below it, as far as they show
    /// anything. With nesting, that means all leaves below.
    pub fn assert_leaves_contained(&self) {
        let log = self.log;
        let mut reach = vec![0.0_f64; log.mesh.positions.len()];
        for &[a, b, c] in log.mesh.triangles.iter().filter(|t| !is_flat(**t)) {
            for (v, w) in [(a, b), (b, c), (c, a)] {
                let length = position(log, v).distance(position(log, w));
                reach[v as usize] = reach[v as usize].max(length);
                reach[w as usize] = reach[w as usize].max(length);
            }
        }
        let mut is_leaf = vec![true; log.mesh.positions.len()];
        for c in &log.collapses {
            for v in [c.removed, c.kept] {
                if std::mem::take(&mut is_leaf[v as usize]) {
                    let needed = position(log, v).distance(center(c.bounds)) + reach[v as usize];
                    assert!(needed <= f64::from(c.bounds.radius), "{c:?}, leaf {v}");
                }
            }
        }
    }

    /// Where the nodes in `active` are unfolded, every triangle shown is one that the simplification went through: the
    /// folded nodes among those that changed it are the first ones, and it looks as they left it.
    pub fn assert_consistent(&self, active: &[bool]) {
        let mut shown: Vec<u32> = (0..self.log.mesh.positions.len() as u32).collect();
        for (c, _) in self.log.collapses.iter().zip(active).rev().filter(|(_, active)| !**active) {
            shown[c.removed as usize] = shown[c.kept as usize];
        }
        for (t, corners) in self.log.mesh.triangles.iter().enumerate() {
            if is_flat(*corners) {
                continue;
            }
            let changes = &self.changes[t];
            let folded = changes.iter().take_while(|&&n| !active[n as usize]).count();
            assert!(changes[folded..].iter().all(|&n| active[n as usize]), "triangle {t} skips a change");
            let now = corners.map(|v| shown[v as usize]);
            match self.states[t].get(folded) {
                Some(expected) => assert_eq!(now, *expected, "triangle {t} after {folded} of {changes:?}"),
                None => assert!(is_flat(now), "triangle {t} should have vanished, is {now:?}"),
            }
        }
    }

    /// Whatever must be folded before a folded node is folded.
    pub fn assert_closed(&self, active: &[bool]) {
        for (n, predecessors) in self.predecessors.iter().enumerate().filter(|&(n, _)| !active[n]) {
            for &m in predecessors {
                assert!(!active[m as usize], "{m} is unfolded below {n}");
            }
        }
    }
}

fn center(bounds: Bounds) -> DVec3 {
    DVec3::from(bounds.center.map(f64::from))
}
