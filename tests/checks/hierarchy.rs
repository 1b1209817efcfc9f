//! What a hierarchy promises, whatever the mesh.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use foldfront::construction::simplify::{Options, Report, build};
use foldfront::experiment::bvh::Bvh;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::view::{Camera, View, theta_of_pixels};
use foldfront::testing::cut::{Displayed, uniform_cut};
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;

use crate::common::{direction, seeded};
use crate::replay::Replay;
use rand::RngExt;

pub fn options(merge_components: bool) -> Options {
    let mut options = Options::default();
    options.merge_components = merge_components;
    options
}

pub fn simplify(mesh: &Mesh, merge_components: bool) -> (CollapseLog, Report) {
    build(mesh.clone(), &options(merge_components), &mut |done, all| assert!(done <= all)).unwrap()
}

/// All that a log promises.
pub fn check(mesh: &Mesh, log: &CollapseLog, report: &Report) {
    assert_eq!(&log.mesh, mesh);
    let forest = log.forest().unwrap();
    assert_eq!(report.roots, forest.roots().count());
    assert_eq!(report.tree_depth, forest.depth());
    assert!(report.dependency_depth as usize <= report.rounds.len() + report.followers);
    let replay = Replay::new(log);
    assert_eq!(report.base_triangles, replay.base_triangles());
    replay.assert_nested();
    replay.assert_leaves_contained();
    let mut has_triangle = vec![false; mesh.positions.len()];
    mesh.triangles.iter().flatten().for_each(|&v| has_triangle[v as usize] = true);
    for c in &log.collapses {
        assert!(has_triangle[c.removed as usize] && has_triangle[c.kept as usize], "{c:?}");
    }

    // Cuts for cameras near and far, and for a tolerance that is the same everywhere.
    let mut random = seeded(report.collapses as u64);
    let (low, high) = mesh.bounding_box().unwrap_or_default();
    let [low, high] = [low, high].map(|corner| DVec3::from(corner.map(f64::from)));
    for _ in 0..4 {
        // A mesh may be a single point, which nothing can look at from there.
        let extent = if mesh.extent() > 0.0 { mesh.extent() } else { 1.0 };
        let distance = extent * 10_f64.powf(random.random_range(-1.5..0.5));
        let eye = (low + high) * 0.5 + direction(&mut random) * distance;
        let target = low + (high - low) * DVec3::from(random.random::<[f64; 3]>());
        let camera = Camera::look_at(eye, target, DVec3::Y, 1.0, 16.0 / 9.0).unwrap();
        let view = [View::new(&camera, theta_of_pixels(1.0, 1080)).unwrap()];
        for criterion in [Criterion::ScreenError, Criterion::SphereSize] {
            let active: Vec<bool> =
                log.collapses.iter().map(|c| criterion.unfold(&view, &c.bounds)).collect();
            replay.assert_closed(&active);
            replay.assert_consistent(&active);
        }
    }
    let mut errors: Vec<f32> = log.collapses.iter().map(|c| c.bounds.eps).collect();
    errors.sort_by(f32::total_cmp);
    for part in [4, 2] {
        if let Some(limit) = errors.get(errors.len() / part) {
            let active: Vec<bool> = log.collapses.iter().map(|c| c.bounds.eps > *limit).collect();
            replay.assert_closed(&active);
            replay.assert_consistent(&active);
        }
    }
}

pub fn simplify_and_check(mesh: &Mesh, merge_components: bool) -> Report {
    let (log, report) = simplify(mesh, merge_components);
    check(mesh, &log, &report);
    report
}

/// The same mesh comes to the same hierarchy.
pub fn is_deterministic(mesh: &Mesh) {
    for merge in [false, true] {
        assert_eq!(simplify(mesh, merge).0, simplify(mesh, merge).0);
    }
}

/// Cuts at one error everywhere keep what they promise, both ways: the input's vertices are as near to what is shown as
/// the errors of the folded nodes say, up to points that were thinned out; and what is shown is near to the input,
/// though only edges were looked at in that direction.
pub fn errors_are_honest(mesh: &Mesh) {
    let (log, _) = simplify(mesh, false);
    let forest = log.forest().unwrap();
    let input = Bvh::new(mesh);
    for part in [1e-4, 1e-3, 1e-2] {
        let eps = (part * mesh.extent()) as f32;
        let shown = Displayed::new(&log, &uniform_cut(&log, &forest, eps)).mesh(mesh);
        let surface = Bvh::new(&shown);
        let position = |v: u32| DVec3::from(mesh.positions[v as usize].map(f64::from));
        let vertices = (0..mesh.positions.len() as u32).map(position);
        let samples = shown.triangles.iter().flat_map(|corners| {
            let [a, b, c] = corners.map(position);
            [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (a + b + c) / 3.0]
        });
        let distances = |bvh: &Bvh, points: &mut dyn Iterator<Item = DVec3>| {
            let distance = |p| bvh.nearest(p, f64::INFINITY).unwrap().distance / f64::from(eps);
            let mut distances: Vec<f64> = points.map(distance).collect();
            distances.sort_by(f64::total_cmp);
            (distances[distances.len() * 99 / 100], distances[distances.len() - 1])
        };
        let (p99, max) = distances(&surface, &mut vertices.into_iter());
        assert!(p99 <= 1.0 && max <= 1.5, "input to shown at {part}: {p99} {max}");
        let (p99, max) = distances(&input, &mut samples.into_iter());
        assert!(p99 <= 1.0 && max <= 2.5, "shown to input at {part}: {p99} {max}");
    }
}
