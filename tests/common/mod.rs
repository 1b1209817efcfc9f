//! What several test files share: the table of backends, made-up meshes and trajectories, a generator of random logs and views.
#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]
#![allow(dead_code)]

pub mod backends;
pub mod data;
pub mod detail_block;
pub mod foreseen;
pub mod graph_cut;
pub mod meshes;
#[path = "../../examples/points/quadtree.rs"]
pub mod quadtree;
pub mod trajectories;

use foldfront::selection::view::View;
use foldfront::{Bounds, Collapse, CollapseLog, Mesh};
use glam::{DQuat, DVec3};

/// A small generator with a fixed sequence; what matters is that its results are varied.
#[derive(Clone)]
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        self.0 >> 11
    }

    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit as u64) as usize
    }

    /// In 0..1.
    pub fn unit(&mut self) -> f64 {
        self.next() as f64 / (1_u64 << 53) as f64
    }

    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0;
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

/// A bumpy grid of `side * side` vertices around the origin, of extent about 2.
pub fn bumpy_grid(side: usize, random: &mut Random) -> Mesh {
    let mut mesh = Mesh::default();
    for y in 0..side {
        for x in 0..side {
            let at = |i: usize| (2.0 * i as f64 / (side - 1) as f64 - 1.0) as f32;
            mesh.positions.push([at(x), at(y), (random.unit() * 0.1) as f32]);
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
pub fn random_log(mesh: Mesh, random: &mut Random) -> CollapseLog {
    let leaf = |v: usize| Bounds { center: mesh.positions[v], radius: 0.3, eps: 0.0 };
    let mut top: Vec<Bounds> = (0..mesh.positions.len()).map(leaf).collect();
    let mut live: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut collapses = Vec::new();
    while live.len() > 4 {
        let removed = live.swap_remove(random.below(live.len()));
        // Near in number is often near in space.
        let kept =
            *live.iter().min_by_key(|&&v| u64::from(v.abs_diff(removed)) * 4 + random.next() % 64).unwrap();
        let (a, b) = (top[removed as usize], top[kept as usize]);
        let bounds = around(a, b, (random.unit() * random.unit() * 0.02) as f32);
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

/// A view from somewhere around a mesh of extent about 2, looking roughly towards it.
pub fn random_view(random: &mut Random) -> View {
    let eye = random.direction() * (0.5 + 3.0 * random.unit());
    let tan_half_fov: f64 = 0.5;
    let tan_beta = tan_half_fov * 2.0;
    let secant = (1.0 + tan_beta * tan_beta).sqrt();
    let direction = (random.direction() - eye).normalize();
    View::from_parts(eye, direction, 1.0 / secant, tan_beta / secant, 100.0).unwrap()
}

/// One frame of a random walk: mostly slow, sometimes at rest, fast, turning, or elsewhere altogether.
pub fn random_step(view: &mut View, random: &mut Random) {
    match random.below(40) {
        0 => *view = random_view(random).with_k(view.k()).unwrap(),
        1..=5 => {}
        6..=8 => turn(view, 0.4 * random.unit(), random),
        9..=10 => *view = view.with_eye(view.eye() + random.direction() * 0.5 * random.unit()).unwrap(),
        _ => {
            let ahead = view.direction() + random.direction();
            *view = view.with_eye(view.eye() + ahead * 0.01 * random.unit()).unwrap();
            turn(view, 0.01 * random.unit(), random);
            if view.eye().length() > 4.0 {
                *view = view.with_eye(view.eye() * 0.9).unwrap();
            }
        }
    }
}

/// Turns a view by `angle` radians about a random axis.
pub fn turn(view: &mut View, angle: f64, random: &mut Random) {
    let axis = view.direction().any_orthogonal_vector();
    let axis = DQuat::from_axis_angle(view.direction(), 6.0 * random.unit()) * axis.normalize();
    *view =
        view.with_direction((DQuat::from_axis_angle(axis, angle) * view.direction()).normalize()).unwrap();
}
