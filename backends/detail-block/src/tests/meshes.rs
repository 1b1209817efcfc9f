//! Meshes of all kinds, and logs of random collapses for them.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use collapse_log::{Collapse, CollapseLog, Mesh};
use rand::RngExt;
use rand_pcg::Pcg64;
use vertex_tree::Bounds;

/// `side * side` vertices, with a boundary.
pub fn grid(side: usize, random: &mut Pcg64) -> Mesh {
    let mut mesh = Mesh::default();
    for y in 0..side {
        for x in 0..side {
            mesh.positions.push([x as f32, y as f32, random.random()]);
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

/// The same joined up at the sides: closed, of genus 1.
pub fn torus(side: usize, random: &mut Pcg64) -> Mesh {
    let mut mesh = grid(side + 1, random);
    let wrap = |v: u32| {
        let (x, y) = (v as usize % (side + 1), v as usize / (side + 1));
        (y % side * side + x % side) as u32
    };
    mesh.triangles.iter_mut().for_each(|t| *t = t.map(wrap));
    mesh.positions = (0..side * side)
        .map(|i| {
            let angle = |i: usize| i as f32 / side as f32 * std::f32::consts::TAU;
            let (a, b) = (angle(i % side), angle(i / side));
            let r = 3.0 + a.cos() + random.random_range(0.0..0.1);
            [r * b.cos(), r * b.sin(), a.sin()]
        })
        .collect();
    mesh
}

/// A grid with holes, doubled and degenerate triangles, fins, pinched vertices and triangles turned over.
pub fn rubble(side: usize, random: &mut Pcg64) -> Mesh {
    let mut mesh = grid(side, random);
    let count = mesh.triangles.len();
    for _ in 0..count / 10 {
        mesh.triangles.swap_remove(random.random_range(0..mesh.triangles.len()));
    }
    let vertices = mesh.positions.len();
    for _ in 0..count / 20 {
        let t = mesh.triangles[random.random_range(0..mesh.triangles.len())];
        let [a, b, c] = t;
        let other = random.random_range(0..vertices as u32);
        let added = match random.random_range(0..5) {
            0 => t,
            1 => [c, b, a],
            2 => [a, b, other],
            3 => [a, a, b],
            _ => [a, other, random.random_range(0..vertices as u32)],
        };
        mesh.triangles.push(added);
    }
    for _ in 0..count / 40 {
        let t = random.random_range(0..mesh.triangles.len());
        mesh.triangles[t].swap(0, 1);
    }
    mesh
}

/// A log of collapses along random edges of what is left, whether they are any good or not.
pub fn random_log(mesh: Mesh, random: &mut Pcg64) -> CollapseLog {
    let count = mesh.positions.len();
    let mut at: Vec<u32> = (0..count as u32).collect();
    let mut collapses = Vec::new();
    for round in 0..4 * count {
        let t = mesh.triangles[random.random_range(0..mesh.triangles.len())];
        let i = random.random_range(0..3);
        let [mut removed, mut kept] = [t[i], t[(i + 1) % 3]];
        for v in [&mut removed, &mut kept] {
            while at[*v as usize] != *v {
                *v = at[*v as usize];
            }
        }
        if removed == kept {
            continue;
        }
        at[removed as usize] = kept;
        let bounds = Bounds { center: [0.0; 3], radius: 1.0, eps: round as f32 * 1e-3 };
        collapses.push(Collapse { removed, kept, bounds });
    }
    CollapseLog { mesh, collapses }
}
