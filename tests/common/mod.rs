//! What several test files share: the table of backends, made-up meshes and trajectories, random logs and views.
#![allow(dead_code)]

pub mod backends;
pub mod data;
pub mod detail_block;
pub mod foreseen;
pub mod graph_cut;
pub mod meshes;
#[path = "../../examples/points/quadtree.rs"]
pub mod quadtree;
pub mod scenes;
pub mod trajectories;

use foldfront::selection::view::View;
use foldfront::testing::walk;
pub use foldfront::testing::walk::direction;
use foldfront::{Bounds, Collapse, CollapseLog, Mesh};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Random numbers, the same for the same seed.
pub fn seeded(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// A bumpy grid of `side * side` vertices around the origin, of extent about 2.
pub fn bumpy_grid(side: usize, random: &mut Pcg64) -> Mesh {
    let mut mesh = Mesh::default();
    for y in 0..side {
        for x in 0..side {
            let at = |i: usize| (2.0 * i as f64 / (side - 1) as f64 - 1.0) as f32;
            mesh.positions.push([at(x), at(y), random.random_range(0.0..0.1)]);
        }
    }
    let v = |x: usize, y: usize| (y * side + x) as u32;
    for y in 0..side - 1 {
        for x in 0..side - 1 {
            mesh.triangles.push([v(x, y), v(x + 1, y), v(x + 1, y + 1)]);
            mesh.triangles.push([v(x, y), v(x + 1, y + 1), v(x, y + 1)]);
        }
    }
    mesh
}

/// A log of random collapses, good for nothing but valid: spheres nested, errors saturated along the tree.
pub fn random_log(mesh: Mesh, random: &mut Pcg64) -> CollapseLog {
    let leaf = |v: usize| Bounds { center: mesh.positions[v], radius: 0.3, eps: 0.0 };
    let mut top: Vec<Bounds> = (0..mesh.positions.len()).map(leaf).collect();
    let mut live: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut collapses = Vec::new();
    while live.len() > 4 {
        let removed = live.swap_remove(random.random_range(0..live.len()));
        // Near in number is often near in space.
        let kept = *live
            .iter()
            .min_by_key(|&&v| u64::from(v.abs_diff(removed)) * 4 + random.random_range(0..64))
            .unwrap();
        let (a, b) = (top[removed as usize], top[kept as usize]);
        let bounds = around(a, b, (random.random::<f64>() * random.random::<f64>() * 0.02) as f32);
        top[kept as usize] = bounds;
        collapses.push(Collapse { removed, kept, bounds });
    }
    CollapseLog { mesh, collapses }
}

fn around(a: Bounds, b: Bounds, eps: f32) -> Bounds {
    let middle = |axis: usize| (a.center[axis] + b.center[axis]) / 2.0;
    let center = std::array::from_fn(middle);
    let reach = |s: Bounds| {
        DVec3::from(s.center.map(f64::from)).distance(DVec3::from(center.map(f64::from)))
            + f64::from(s.radius)
    };
    let radius = (reach(a).max(reach(b)) * (1.0 + 1e-6)) as f32;
    Bounds { center, radius, eps: eps.max(a.eps).max(b.eps) }
}

/// The radius of a ball that holds a mesh of extent about 2.
const REACH: f64 = 1.4;

/// A view from somewhere around a mesh of extent about 2, looking roughly towards it.
pub fn random_view(random: &mut Pcg64) -> View {
    walk::anywhere(DVec3::ZERO, REACH, random).with_k(100.0).unwrap()
}

/// One frame of a random walk around such a mesh.
pub fn random_step(view: &mut View, random: &mut Pcg64) {
    *view = walk::step(*view, DVec3::ZERO, REACH, random);
}
