//! Lengths from 1e-30 to 1e30, whatever else is in the mesh.

use foldfront::Mesh;

use crate::check::log_within;

const SIDE: u32 = 24;
const SCALES: [f32; 7] = [1e-30, 1e-20, 1e-10, 1.0, 1e10, 1e20, 1e30];

/// Hills of 24 by 24 vertices, about `scale` apart, beginning at `corner` times the scale.
fn hills(scale: f32, corner: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..SIDE * SIDE {
        let (x, y) = ((i % SIDE) as f32, (i / SIDE) as f32);
        let height = 2.0 * (0.45 * x).sin() * (0.35 * y).cos() + 0.2 * (1.7 * x + 2.3 * y).sin();
        mesh.positions.push([corner + x, corner + y, height].map(|c| c * scale));
        if x as u32 + 1 < SIDE && y as u32 + 1 < SIDE {
            mesh.triangles.extend([[i, i + 1, i + SIDE + 1], [i, i + SIDE + 1, i + SIDE]]);
        }
    }
    mesh
}

/// Collapses of vertices below a number, and of their errors the median and the largest.
fn figures(mesh: &Mesh, below: u32) -> (usize, [f64; 2]) {
    let (log, _) = log_within(mesh, false, 400).unwrap();
    let collapses = log.collapses.iter().filter(|c| c.removed < below && c.kept < below);
    let mut errors: Vec<f64> = collapses.map(|c| c.bounds.eps.into()).collect();
    errors.sort_by(f64::total_cmp);
    (errors.len(), [errors[errors.len() / 2], errors[errors.len() - 1]])
}

/// About the same collapses as at scale 1 and the same errors, to scale.
#[track_caller]
fn assert_alike(scale: f32, mesh: &Mesh, part: f64, what: &str) {
    let expected = figures(&hills(1.0, 0.0), SIDE * SIDE);
    let (collapses, errors) = figures(mesh, SIDE * SIDE);
    let near = |a: f64, b: f64| (a / b - 1.0).abs() <= part;
    assert!(expected.0 > 500, "{expected:?}");
    assert!(near(collapses as f64, expected.0 as f64), "{what} at {scale}: {collapses}, {expected:?}");
    for (error, expected) in errors.into_iter().zip(expected.1) {
        let error = error / f64::from(scale);
        assert!(near(error, expected), "{what} at {scale}: an error of {error}, not {expected}");
    }
}

#[test]
fn hills_of_any_size_are_simplified_alike() {
    for scale in SCALES {
        assert_alike(scale, &hills(scale, 0.0), 0.02, "hills");
    }
}

#[test]
fn a_vertex_far_out_makes_no_difference() {
    for scale in SCALES {
        let mut mesh = hills(scale, 0.0);
        mesh.positions.push([1e30, -1e30, 1e30]);
        assert_alike(scale, &mesh, 0.02, "with a far vertex, hills");
    }
}

#[test]
fn a_triangle_far_out_makes_no_difference() {
    for scale in SCALES {
        let mut mesh = hills(scale, 0.0);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([[3e36, 0.0, 0.0], [3e36, 1e36, 0.0], [3e36, 0.0, 1e36]]);
        mesh.triangles.push([first, first + 1, first + 2]);
        assert_alike(scale, &mesh, 0.02, "with a far triangle, hills");
    }
}

/// What is small beside something large is simplified too, though its errors are nothing beside the other's.
#[test]
fn hills_beside_hills_of_another_size() {
    for (scale, beside) in [(1e-20, 1.0), (1e-10, 1.0), (1.0, 1e10), (1e-20, 1e20)] {
        let mut mesh = hills(scale, 0.0);
        let first = mesh.positions.len() as u32;
        let large = hills(beside, 2.0);
        mesh.positions.extend(large.positions);
        mesh.triangles.extend(large.triangles.iter().map(|t| t.map(|v| v + first)));
        let (log, _) = log_within(&mesh, false, 400).unwrap();
        let small = log.collapses.iter().filter(|c| c.removed < first).count();
        let large = log.collapses.len() - small;
        eprintln!("{scale} beside {beside}: {small} and {large} collapses");
        let least = SIDE as usize * SIDE as usize * 95 / 100;
        assert!(small >= least && large >= least, "{scale} beside {beside}: {small} and {large} collapses");
    }
}
