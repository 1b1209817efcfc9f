//! Implicit dependencies of meta-nodes, against the closure by brute force.

use foldfront::collapse_log::CollapseLog;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::testing::cut::Displayed;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{Hierarchy, NONE, NullSink};
use meta_node::{BuildOptions, Dependencies, MetaNodeTree};

use crate::common::backends::meta_node_file;
use crate::common::{random_step, random_view, seeded};

pub const EXACT: [Strategy; 3] = [Strategy::TopDown, Strategy::Front, Strategy::Event];
/// Small pages, so that small meshes have many.
pub const PAGES: BuildOptions = BuildOptions { levels: Some(3), page_bytes: 700 };

/// What implicit dependencies amount to, by brute force: a node needs the parents of all vertices around its own at the
/// time of its collapse (see `dependencies.rs`).
pub struct Needs(Vec<Vec<u32>>);

impl Needs {
    pub fn new(log: &CollapseLog) -> Self {
        let forest = log.forest().unwrap();
        let mut triangles = log.mesh.triangles.clone();
        let mut around: Vec<Vec<usize>> = vec![Vec::new(); log.mesh.positions.len()];
        for (t, corners) in triangles.iter().enumerate() {
            corners.iter().for_each(|&v| around[v as usize].push(t));
        }
        // The node at which each vertex of the input stands now.
        let mut top = vec![NONE; log.mesh.positions.len()];
        let mut parent_of_leaf = vec![NONE; log.mesh.positions.len()];
        for (n, collapse) in log.collapses.iter().enumerate() {
            for v in [collapse.kept, collapse.removed] {
                if top[v as usize] == NONE {
                    parent_of_leaf[v as usize] = n as u32;
                }
                top[v as usize] = n as u32;
            }
        }
        top.fill(NONE);
        let mut needs = Vec::new();
        for (n, collapse) in (0..).zip(&log.collapses) {
            let (kept, removed) = (collapse.kept, collapse.removed);
            for t in std::mem::take(&mut around[removed as usize]) {
                triangles[t].iter_mut().filter(|v| **v == removed).for_each(|v| *v = kept);
                around[kept as usize].push(t);
            }
            let is_shown = |t: &usize| {
                let [a, b, c] = triangles[*t];
                a != b && b != c && c != a
            };
            around[kept as usize].sort_unstable();
            around[kept as usize].dedup();
            around[kept as usize].retain(is_shown);
            let neighbours = around[kept as usize].iter().flat_map(|&t| triangles[t]).filter(|&v| v != kept);
            let mut needed: Vec<u32> = neighbours
                .map(|v| match top[v as usize] {
                    NONE => parent_of_leaf[v as usize],
                    node => forest.parent[node as usize],
                })
                .filter(|&parent| parent != NONE && parent != n)
                .collect();
            needed.extend(Some(forest.parent[n as usize]).filter(|&parent| parent != NONE));
            needed.sort_unstable();
            needed.dedup();
            needs.push(needed);
            (top[kept as usize], top[removed as usize]) = (n, n);
        }
        Self(needs)
    }

    /// Prerequisites have larger numbers: one pass carries a flag all the way.
    pub fn close(&self, active: &[bool]) -> Vec<bool> {
        let mut closed = active.to_vec();
        for n in 0..closed.len() {
            if closed[n] {
                self.0[n].iter().for_each(|&needed| closed[needed as usize] = true);
            }
        }
        closed
    }
}

/// Displayed triangles that look the other way than in the input.
fn flipped(log: &CollapseLog, active: &[bool]) -> usize {
    let displayed = Displayed::new(log, active);
    let normal = |corners: [u32; 3]| {
        let [a, b, c] = corners.map(|v| glam::DVec3::from(log.mesh.positions[v as usize].map(f64::from)));
        (b - a).cross(c - a)
    };
    displayed
        .triangles
        .iter()
        .map(|&t| log.mesh.triangles[t as usize])
        .filter(|corners| normal(*corners).dot(normal(corners.map(|v| displayed.shown_at[v as usize]))) < 0.0)
        .count()
}

/// With `force` every strategy arrives at the closure in every frame; with `block` all strategies do the same, and what
/// that is depends on the way; with `off` it is what is wanted. Flipped triangles are counted with each.
pub fn force_block_and_off(log: &CollapseLog) {
    let file = meta_node_file(log, &PAGES);
    let needs = Needs::new(log);
    let center: [f32; 3] = {
        let (lo, hi) = log.mesh.bounding_box().unwrap();
        [0, 1, 2].map(|i| (lo[i] + hi[i]) / 2.0)
    };
    let (center, scale) = (glam::DVec3::from(center.map(f64::from)), log.mesh.extent() / 2.0);
    let mut counts = Vec::new();
    for dependencies in [Dependencies::Off, Dependencies::Block, Dependencies::Force] {
        let mut engines: Vec<_> = EXACT
            .map(|strategy| {
                let paging = meta_node::Settings { dependencies, ..meta_node::Settings::default() };
                let mut tree = MetaNodeTree::new(file.clone(), paging).unwrap();
                tree.load_all();
                tree.settle().unwrap();
                let settings = Settings { strategy, rho: 0.02 * scale, ..Settings::default() };
                Engine::new(tree, NullSink, settings).unwrap()
            })
            .into();
        let mut oracle = Oracle::new(log).unwrap();
        let mut random = seeded(12);
        let mut view = random_view(&mut random);
        let (mut flips, mut forced, mut blocked, mut differ) = (0, 0, 0, 0);
        for frame in 0..400 {
            random_step(&mut view, &mut random);
            let placed = view.with_eye(center + scale * view.eye()).unwrap();
            let reports: Vec<_> = engines.iter_mut().map(|e| e.advance(&[placed]).unwrap()).collect();
            oracle.cut(engines[0].settings().criterion, &[placed]);
            let expected = match dependencies {
                Dependencies::Force => needs.close(oracle.active()),
                _ => oracle.active().to_vec(),
            };
            let mut active = vec![false; log.collapses.len()];
            let tree = engines[0].tree();
            engines[0].for_each_active(|node| active[tree.log_number(node) as usize] = true);
            for (strategy, report) in EXACT.iter().zip(&reports) {
                let name = strategy.name();
                assert_eq!(report.cut_hash, reports[0].cut_hash, "{dependencies:?}, {name}, frame {frame}");
                assert_eq!(report.misses, 0, "{dependencies:?}, {name}, frame {frame}");
            }
            if dependencies == Dependencies::Block {
                differ += usize::from(active != expected);
            } else {
                let wrong = active.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(wrong, 0, "{dependencies:?}, frame {frame}: {} expected", expected.len());
            }
            forced += reports[0].forced;
            blocked += reports[0].blocked;
            if frame % 10 == 0 {
                flips += flipped(log, &active);
            }
        }
        eprintln!(
            "{dependencies:?}: {flips} flipped, {forced} forced, {blocked} blocked, {differ} frames differ"
        );
        counts.push((flips, forced, blocked, differ));
    }
    let [off, block, force] = counts[..] else { panic!() };
    assert_eq!((off.1, off.2, block.1, force.2), (0, 0, 0, 0));
    assert!(block.2 > 100 && block.3 > 10, "blocking blocks, and the cut lags: {block:?}");
    assert!(force.1 > 100, "forcing forces: {force:?}");
    assert!(
        force.0 <= block.0.max(off.0),
        "flipped triangles: off {off:?}, block {block:?}, force {force:?}"
    );
}
