use super::*;
use glam::{DQuat, dvec3};
use std::f64::consts::FRAC_PI_2;

/// At the origin, looking along -z, 90 degrees high and wide: at depth `d` the image spans -d to d, and with 200
/// lines one object unit straight ahead takes 100 / d pixels.
fn camera() -> Camera {
    Camera::new(DVec3::ZERO, DQuat::IDENTITY, FRAC_PI_2, 1.0).unwrap()
}

const LINES: u32 = 200;

/// A grid of `n` x `n` squares that spans `-half..half` in x and y, at the height `z` says.
fn grid(n: u32, half: f32, z: impl Fn(f32, f32) -> f32) -> Mesh {
    let at = |i: u32| (2.0 * i as f32 / n as f32 - 1.0) * half;
    let positions = (0..=n)
        .flat_map(|row| (0..=n).map(move |column| (at(column), at(row))))
        .map(|(x, y)| [x, y, z(x, y)]);
    let first = |row, column| row * (n + 1) + column;
    let triangles = (0..n).flat_map(|row| (0..n).map(move |column| first(row, column))).flat_map(|v| {
        let above = v + n + 1;
        [[v, v + 1, above + 1], [v, above + 1, above]]
    });
    Mesh { positions: positions.collect(), triangles: triangles.collect(), ..Mesh::default() }
}

#[test]
fn a_mesh_does_not_deviate_from_itself() {
    let mesh = grid(8, 4.0, |_, _| -10.0);
    let found = deviation(&mesh, &mesh, &camera(), LINES);
    assert_eq!((found.triangles, found.triangles_in_view), (128, 128));
    assert_eq!((found.flipped_triangles, found.degenerate_triangles), (0, 0));
    assert_eq!(found.forward.inner.count, 81);
    assert!(found.reverse.inner.count > 128 + 81, "triangles of 14 pixels have more than a centroid");
    for figures in [found.forward.inner, found.reverse.inner] {
        assert!(figures.max < 1e-9);
    }
    assert_eq!(found.forward.border, Figures::default());
    assert_eq!(found.reverse.border, Figures::default());
}

/// Parallel planes, one unit apart: the distance is 1 everywhere, and 1 unit straight ahead takes 100 / 10 pixels in
/// the plane of the original and 100 / 11 in that of the displayed mesh.
#[test]
fn pixels_follow_from_the_distance_to_the_eye() {
    let found = deviation(&grid(8, 4.0, |_, _| -11.0), &grid(8, 4.0, |_, _| -10.0), &camera(), LINES);
    assert!((found.forward.inner.max - 10.0).abs() < 1e-9);
    assert_eq!(found.forward.inner.max_at, Some([0.0, 0.0, -10.0]));
    assert!((found.reverse.inner.max - 100.0 / 11.0).abs() < 1e-9);
    assert_eq!(found.reverse.inner.max_at, Some([0.0, 0.0, -11.0]));
    // The corners of the original are sqrt(132) away from the eye.
    assert!(found.forward.inner.median < 10.0 && found.forward.inner.median > 100.0 / 132f64.sqrt());
    let twice = deviation(&grid(8, 4.0, |_, _| -11.0), &grid(8, 4.0, |_, _| -10.0), &camera(), 2 * LINES);
    assert!((twice.forward.inner.p99 - 2.0 * found.forward.inner.p99).abs() < 1e-9);
}

/// A needle of one vertex on an otherwise flat mesh is seen in one direction only: forward if it is not displayed,
/// reverse if it is not in the original.
///
/// ```text
///   ______/\______     ______________
/// ```
#[test]
fn what_is_missing_and_what_is_too_much_are_measured_apart() {
    let flat = grid(1, 4.0, |_, _| -10.0);
    let needle = grid(64, 4.0, |x, y| if x == 0.0 && y == 0.0 { -9.0 } else { -10.0 });
    let missing = deviation(&flat, &needle, &camera(), LINES);
    assert!((missing.forward.inner.max - 100.0 / 9.0).abs() < 1e-9);
    assert!(missing.reverse.inner.max < 2.0, "the flat mesh is nowhere far from the needle's foot");
    let too_much = deviation(&needle, &flat, &camera(), LINES);
    assert!(too_much.forward.inner.max < 1e-9);
    assert!((too_much.reverse.inner.max - 100.0 / 9.0).abs() < 1e-9);
    assert_eq!(too_much.reverse.inner.max_at, Some([0.0, 0.0, -9.0]));
}

/// One large triangle cuts off the bulge of a finer original: the samples inside it find the middle.
#[test]
fn large_triangles_are_sampled_inside() {
    let bulge = |x: f32, y: f32| -10.0 + (1.0 - (x / 4.0) * (x / 4.0)) * (1.0 - (y / 4.0) * (y / 4.0));
    let found = deviation(&grid(1, 4.0, bulge), &grid(64, 4.0, bulge), &camera(), LINES);
    assert!(found.reverse.inner.max > 9.0, "only {} pixels found of 10", found.reverse.inner.max);
    assert!(found.reverse.inner.max < 10.0);
}

/// The mesh spans twice the image: the squares on its border reach out of the view.
#[test]
fn samples_of_triangles_that_leave_the_view_are_counted_apart() {
    let coarse = grid(5, 20.0, |_, _| -11.0);
    let fine = grid(40, 19.0, |_, _| -10.0);
    let found = deviation(&coarse, &fine, &camera(), LINES);
    assert_eq!(found.triangles, 50);
    // Squares of 8 units: the middle one, from -4 to 4, is inside -11..11, its 8 neighbours cross.
    assert_eq!(found.triangles_in_view, 18);
    for direction in [found.forward, found.reverse] {
        assert!(direction.inner.count > 0 && direction.border.count > direction.inner.count);
        assert!(direction.border.max <= 10.0 + 1e-9, "samples out of view are no samples");
    }
    // Original vertices 0.95 units apart, up to 10 either way.
    assert_eq!(found.forward.inner.count + found.forward.border.count, 21 * 21);
}

#[test]
fn triangles_turned_over_and_without_area_are_counted() {
    let original = grid(8, 4.0, |_, _| -10.0);
    let mut displayed = original.clone();
    displayed.triangles[3].swap(0, 1);
    displayed.triangles[70].swap(1, 2);
    displayed.triangles[100] = [5, 5, 6];
    let found = deviation(&displayed, &original, &camera(), LINES);
    assert_eq!((found.flipped_triangles, found.degenerate_triangles), (2, 1));
}

#[test]
fn an_empty_mesh_is_infinitely_far_off() {
    let mesh = grid(2, 4.0, |_, _| -10.0);
    let nothing_shown = deviation(&Mesh::default(), &mesh, &camera(), LINES);
    assert_eq!(nothing_shown.forward.inner.count, 0);
    assert_eq!(nothing_shown.forward.border.max, f64::INFINITY);
    assert_eq!(nothing_shown.reverse, Direction::default());
    let nothing_meant = deviation(&mesh, &Mesh::default(), &camera(), LINES);
    assert_eq!(nothing_meant.forward, Direction::default());
    assert_eq!(nothing_meant.reverse.inner.max, f64::INFINITY);
}

#[test]
fn quantiles_are_nearest_ranks() {
    let samples: Vec<(f64, DVec3)> =
        (1..=200).rev().map(|i| (f64::from(i), dvec3(f64::from(i), 0.0, 0.0))).collect();
    let figures = Figures::new(&samples);
    assert_eq!((figures.median, figures.p99, figures.max), (100.0, 198.0, 200.0));
    assert_eq!(figures.max_at, Some([200.0, 0.0, 0.0]));
    assert_eq!(Figures::new(&samples[..1]).median, 200.0);
}

#[cfg(feature = "cli")]
#[test]
fn json_has_every_figure() {
    let mesh = grid(8, 4.0, |_, _| -10.0);
    let json = deviation(&mesh, &mesh, &camera(), LINES).to_json();
    assert_eq!(json["triangles"], 128);
    assert_eq!(json["forward"]["inner"]["count"], 81);
    assert!(json["reverse"]["border"]["max_at"].is_null());
}
