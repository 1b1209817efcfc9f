//! Thousands of triangles at one vertex or edge: the construction takes a few rounds more than elsewhere, and not one for each.
//!
//! Rounds are counted, as time depends on who else is there. A grid of as many triangles takes some thirty; here no more
//! than [`ROUNDS`] are allowed, or [`MERGING`] where components are merged, whatever the number of triangles. Only for copies of a
//! vertex that are merged does the number grow, from 138 rounds for 250 triangles to 428 for 4,000.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use foldfront::Mesh;

use super::check::log_within;

const ROUNDS: usize = 100;
const MERGING: usize = 200;
/// For 2,000 copies of a vertex that are merged, where many rounds make a collapse or two.
const COPIES: usize = 500;

fn simplified(name: &str, mesh: &Mesh, merge: bool, rounds: usize) -> usize {
    let (log, report) = log_within(mesh, merge, rounds).unwrap_or_else(|fault| panic!("{name}: {fault}"));
    log.forest().unwrap();
    assert!(report.base_triangles > 0 && report.base_triangles <= mesh.triangles.len());
    eprintln!("{name}, {merge}: {} rounds, {} collapses", report.attempted_rounds, report.collapses);
    report.collapses
}

/// A number for a number, in 0..1.
fn scattered(i: u32) -> f32 {
    (i.wrapping_mul(2_654_435_769) >> 8) as f32 / (1 << 24) as f32
}

/// Triangles that share one vertex and nothing else.
fn star(count: u32) -> Mesh {
    let mut mesh = Mesh { positions: vec![[0.0; 3]], ..Mesh::default() };
    for i in 0..count {
        let p: [f32; 3] = std::array::from_fn(|axis| 2.0 * scattered(3 * i + axis as u32) - 1.0);
        let q = [p[0] + 0.02, p[1] - 0.01, p[2] + 0.01];
        mesh.positions.extend([p, q]);
        mesh.triangles.push([0, 2 * i + 1, 2 * i + 2]);
    }
    mesh
}

/// Triangles at one edge.
fn book(count: u32) -> Mesh {
    let mut mesh = Mesh { positions: vec![[0.0; 3], [0.0, 0.0, 1.0]], ..Mesh::default() };
    for i in 0..count {
        let turn = std::f32::consts::TAU * i as f32 / count as f32;
        mesh.positions.push([turn.cos(), turn.sin(), 0.5]);
        mesh.triangles.push([0, 1, i + 2]);
    }
    mesh
}

/// A cone, closed all around.
fn fan(count: u32) -> Mesh {
    let mut mesh = Mesh { positions: vec![[0.0, 0.0, 0.3]], ..Mesh::default() };
    for i in 0..count {
        let turn = std::f32::consts::TAU * i as f32 / count as f32;
        mesh.positions.push([turn.cos(), turn.sin(), 0.0]);
        mesh.triangles.push([0, 1 + i, 1 + (i + 1) % count]);
    }
    mesh
}

/// Triangles that have a corner at one place, each its own.
fn unwelded(count: u32) -> Mesh {
    let mut mesh = star(count);
    for (i, t) in (0..).zip(&mut mesh.triangles) {
        mesh.positions.push([0.0; 3]);
        *t = [2 * count + 1 + i, t[1], t[2]];
    }
    mesh
}

#[test]
fn triangles_at_one_vertex() {
    for count in [1_000, 2_400, 10_000] {
        simplified("star", &star(count), false, ROUNDS);
        simplified("star", &star(count), true, MERGING);
    }
}

#[test]
fn pages_at_one_edge() {
    for count in [1_000, 2_400, 10_000] {
        simplified("book", &book(count), false, ROUNDS);
        simplified("book", &book(count), true, MERGING);
    }
}

#[test]
fn a_closed_fan_of_tens_of_thousands() {
    for count in [10_000, 70_000] {
        let collapses = simplified("fan", &fan(count), false, ROUNDS);
        assert!(collapses > count as usize * 9 / 10, "{collapses} of {count}");
    }
}

#[test]
fn thousands_of_copies_of_a_vertex() {
    let mesh = unwelded(2_000);
    simplified("copies", &mesh, false, ROUNDS);
    let collapses = simplified("copies", &mesh, true, COPIES);
    assert!(collapses > 4_000, "{collapses}");
}
