//! A hierarchy of any size, and the exact strategies along a walk through it, each frame against brute force.

use std::sync::Arc;

use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::{Camera, View};
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::NullSink;
use foldfront::{Bounds, Collapse, CollapseLog, Mesh};
use glam::DVec3;
use in_memory::{InMemoryHierarchy, InMemoryTree};

use crate::common::{bumpy_grid, direction};
use rand::RngExt;
use rand_pcg::Pcg64;

/// Random collapses of a bumpy grid of extent about `2 scale`, with spheres nested as far as their numbers allow: also where
/// those are subnormal. On flat ground every error is 0.
pub fn scaled_log(scale: f64, is_flat: bool, random: &mut Pcg64) -> CollapseLog {
    let grid = bumpy_grid(14, random);
    let scaled = |p: [f32; 3]| p.map(|x| (f64::from(x) * scale) as f32);
    let positions: Vec<[f32; 3]> = grid.positions.iter().map(|&p| scaled(p)).collect();
    let leaf = |&center: &[f32; 3]| Bounds { center, radius: (0.05 * scale) as f32, eps: 0.0 };
    let mut top: Vec<Bounds> = positions.iter().map(leaf).collect();
    let mut live: Vec<u32> = (0..positions.len() as u32).collect();
    let mut collapses = Vec::new();
    while live.len() > 4 {
        let removed = live.swap_remove(random.random_range(0..live.len()));
        let far = |&&v: &&u32| u64::from(v.abs_diff(removed));
        let kept = *live.iter().min_by_key(far).unwrap();
        let (a, b) = (top[removed as usize], top[kept as usize]);
        let eps = if is_flat { 0.0 } else { 0.02 * scale * random.random::<f64>() * random.random::<f64>() };
        let bounds = around(&a, &b, eps as f32);
        top[kept as usize] = bounds;
        collapses.push(Collapse { removed, kept, bounds });
    }
    CollapseLog { mesh: Mesh { positions, ..grid }, collapses }
}

fn around(a: &Bounds, b: &Bounds, eps: f32) -> Bounds {
    let center = std::array::from_fn(|axis| a.center[axis].midpoint(b.center[axis]));
    let place = |center: [f32; 3]| DVec3::from(center.map(f64::from));
    let reach = |s: &Bounds| place(s.center).distance(place(center)) + f64::from(s.radius);
    let radius = (reach(a).max(reach(b)) * (1.0 + 2e-6)) as f32;
    Bounds { center, radius: radius.next_up(), eps: eps.max(a.eps).max(b.eps) }
}

/// The exact strategies side by side.
pub struct Party {
    oracle: Oracle,
    engines: Vec<Engine<InMemoryTree, NullSink>>,
    pub changes: u64,
    pub frames: u64,
}

impl Party {
    pub fn new(log: &CollapseLog, settings: Settings) -> Self {
        let hierarchy = Arc::new(InMemoryHierarchy::new(log).unwrap());
        let engine = |strategy: Strategy| {
            let tree = InMemoryTree::new(hierarchy.clone());
            Engine::new(tree, NullSink, Settings { strategy, ..settings }).unwrap()
        };
        let exact = Strategy::ALL.into_iter().filter(|strategy| strategy.is_exact());
        Self {
            oracle: Oracle::new(log).unwrap(),
            engines: exact.map(engine).collect(),
            changes: 0,
            frames: 0,
        }
    }

    /// Goes on with the event queue alone: for walks that are long for its sake.
    pub fn only_events(&mut self) {
        self.engines.retain(|engine| engine.settings().strategy == Strategy::Event);
    }

    /// Moves all of them. Every one must have the cut of brute force, where that is to be looked at.
    #[track_caller]
    pub fn advance(&mut self, views: &[View], is_checked: bool) {
        for engine in &mut self.engines {
            let report = engine.advance(views).unwrap();
            self.changes += report.unfolds + report.folds;
            if is_checked {
                engine.assert_well_formed();
                let name = engine.settings().strategy.name();
                let difference = self.oracle.compare(engine);
                assert!(difference.is_none(), "{name}, frame {}: {difference:?}; {views:?}", self.frames);
            }
        }
        self.frames += 1;
    }
}

/// A view from around a mesh of extent about `2 scale`, which looks at some point of it through a lens.
pub fn look(scale: f64, fov_y: f64, theta: f64, random: &mut Pcg64) -> View {
    let eye = direction(random) * random.random_range(0.2..3.2) * scale;
    let target = direction(random) * random.random::<f64>() * scale;
    let camera =
        Camera::look_at(eye, target, direction(random), fov_y, random.random_range(0.5..1.5)).unwrap();
    View::new(&camera, theta).unwrap()
}
