//! Lengths from 1e-30 to 1e30, whatever else is in the mesh.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use foldfront::Mesh;

use super::check::log_within;

const SIDE: u32 = 24;
const ROUNDS: usize = 200;
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

/// Collapses among the hills themselves, and of their errors the median and the largest.
fn figures(mesh: &Mesh) -> (usize, [f64; 2]) {
    let (log, _) = log_within(mesh, false, ROUNDS).unwrap();
    let collapses = log.collapses.iter().filter(|c| c.removed < SIDE * SIDE && c.kept < SIDE * SIDE);
    let mut errors: Vec<f64> = collapses.map(|c| c.bounds.eps.into()).collect();
    errors.sort_by(f64::total_cmp);
    (errors.len(), [errors[errors.len() / 2], errors[errors.len() - 1]])
}

/// About the same collapses as at scale 1 and the same errors, to scale. The largest are those of what is left of the hills at
/// the end, which is an accident of rounding.
#[track_caller]
fn assert_alike(scale: f32, mesh: &Mesh, what: &str) {
    let (expected, [expected_median, expected_largest]) = figures(&hills(1.0, 0.0));
    let (collapses, errors) = figures(mesh);
    let [median, largest] = errors.map(|error| error / f64::from(scale));
    let near = |a: f64, b: f64, part: f64| (a / b - 1.0).abs() <= part;
    assert!(expected > 500);
    assert!(
        near(collapses as f64, expected as f64, 0.02)
            && near(median, expected_median, 0.05)
            && near(largest, expected_largest, 0.5),
        "{what} at {scale}: {collapses} collapses, errors {median}, {largest}; \
         at 1: {expected}, {expected_median}, {expected_largest}"
    );
}

/// Powers of two between 1e-30 and 1e30 leave no trace at all.
#[test]
fn hills_scaled_by_powers_of_two_are_simplified_the_same() {
    let (expected, _) = log_within(&hills(1.0, 0.0), false, ROUNDS).unwrap();
    for exponent in [-99, -66, -33, -3, 1, 33, 66, 99] {
        let scale = 2.0_f32.powi(exponent);
        let (log, _) = log_within(&hills(scale, 0.0), false, ROUNDS).unwrap();
        assert_eq!(log.collapses.len(), expected.collapses.len(), "2^{exponent}");
        for (a, b) in log.collapses.iter().zip(&expected.collapses) {
            assert_eq!((a.removed, a.kept), (b.removed, b.kept), "2^{exponent}");
            assert_eq!(a.bounds.eps, b.bounds.eps * scale, "2^{exponent}");
        }
    }
}

#[test]
fn hills_of_any_size_are_simplified_alike() {
    for scale in SCALES {
        assert_alike(scale, &hills(scale, 0.0), "hills");
    }
}

#[test]
fn a_vertex_far_out_makes_no_difference() {
    for scale in SCALES {
        let mut mesh = hills(scale, 0.0);
        mesh.positions.push([1e30, -1e30, 1e30]);
        assert_alike(scale, &mesh, "with a far vertex, hills");
    }
}

#[test]
fn a_triangle_far_out_makes_no_difference() {
    for scale in SCALES {
        let mut mesh = hills(scale, 0.0);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([[3e36, 0.0, 0.0], [3e36, 1e36, 0.0], [3e36, 0.0, 1e36]]);
        mesh.triangles.push([first, first + 1, first + 2]);
        assert_alike(scale, &mesh, "with a far triangle, hills");
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
        let (log, _) = log_within(&mesh, false, ROUNDS).unwrap();
        let small = log.collapses.iter().filter(|c| c.removed < first).count();
        let large = log.collapses.len() - small;
        eprintln!("{scale} beside {beside}: {small} and {large} collapses");
        let least = SIDE as usize * SIDE as usize * 95 / 100;
        assert!(small >= least && large >= least, "{scale} beside {beside}: {small} and {large} collapses");
    }
}
