//! Hierarchy construction: on real meshes, and on small ones made to be difficult.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

#[path = "../common/mod.rs"]
mod common;
mod out_of_core;
mod replay;

use common::{Random, data};
use foldfront::bvh::Bvh;
use foldfront::criterion::Criterion;
use foldfront::cut::{Displayed, uniform_cut};
use foldfront::simplify::{Options, Report, build};
use foldfront::vertex_tree::LogError;
use foldfront::view::{Camera, View, theta_of_pixels};
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;
use replay::Replay;

fn options(merge_components: bool) -> Options {
    let mut options = Options::default();
    options.merge_components = merge_components;
    options
}

fn simplify(mesh: &Mesh, merge_components: bool) -> (CollapseLog, Report) {
    build(mesh.clone(), &options(merge_components), &mut |done, all| assert!(done <= all)).unwrap()
}

/// All that a log promises.
fn check(mesh: &Mesh, log: &CollapseLog, report: &Report) {
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
    let mut random = Random(report.collapses as u64);
    let Some((low, high)) = mesh.bounding_box() else { return };
    let [low, high] = [low, high].map(|corner| DVec3::from(corner.map(f64::from)));
    for _ in 0..4 {
        // A mesh may be a single point, which nothing can look at from there.
        let extent = if mesh.extent() > 0.0 { mesh.extent() } else { 1.0 };
        let distance = extent * 10_f64.powf(2.0 * random.unit() - 1.5);
        let eye = (low + high) * 0.5 + random.direction() * distance;
        let target = low + (high - low) * DVec3::new(random.unit(), random.unit(), random.unit());
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

fn simplify_and_check(mesh: &Mesh, merge_components: bool) -> Report {
    let (log, report) = simplify(mesh, merge_components);
    check(mesh, &log, &report);
    report
}

macro_rules! real_mesh {
    ($name:ident, $file:literal, $merge:literal, $($holds:tt)*) => {
        #[test]
        fn $name() {
            let Some(mesh) = data::mesh($file) else { return };
            let report = simplify_and_check(&mesh, $merge);
            assert!(report $($holds)*, "{report:?}");
        }
    };
}

real_mesh!(armadillo, "meshes/armadillo_100k.ply", false, .base_triangles < 100);
real_mesh!(beast, "meshes/beast.ply", false, .base_triangles < 1000);
real_mesh!(bunny, "meshes/bunny.ply", false, .base_triangles < 100);
real_mesh!(dragon, "meshes/dragon.ply", false, .base_triangles < 5000);
real_mesh!(happy, "meshes/happy.ply", false, .base_triangles < 5000);
real_mesh!(horse, "meshes/horse.ply", false, .base_triangles < 100);
real_mesh!(lucy, "meshes/lucy_100k.ply", false, .base_triangles < 100);
real_mesh!(ogre, "meshes/ogre.ply", false, .base_triangles < 1000);
real_mesh!(turbine_blade, "meshes/turbineblade_200k.ply", false, .base_triangles < 100);
real_mesh!(sierra, "terrain/N36W119.hgt", false, .roots < 10);
real_mesh!(everest_with_voids, "terrain/N27E086.hgt", false, .base_triangles < 50_000);
real_mesh!(rainier_with_voids, "terrain/N46W122.hgt", false, .base_triangles < 50_000);
real_mesh!(death_valley, "terrain/N36W118.hgt", false, .roots < 10);
real_mesh!(great_basin, "terrain/N37W118.hgt", false, .roots < 10);
real_mesh!(white_mountains, "terrain/N37W119.hgt", false, .roots < 10);
real_mesh!(lake_constance, "terrain/N47E009.hgt", false, .roots < 10);
real_mesh!(mont_blanc, "terrain/alps_montblanc_647_16bit.png", false, .roots < 10);
real_mesh!(grand_canyon, "terrain/gcanyon_elev_1200_8bit.png", false, .roots < 10);
real_mesh!(boston, "city/boston_blocks.obj", false, .roots > 1000);
real_mesh!(den_haag, "city/denhaag01_lod2_terrain.obj", false, .roots > 1000);
real_mesh!(den_haag_joined, "city/denhaag01_lod2_terrain.obj", true, .roots < 10);
real_mesh!(boston_joined, "city/boston_blocks.obj", true, .roots < 10);
real_mesh!(dragon_joined, "meshes/dragon.ply", true, .roots < 10);

#[test]
fn is_deterministic() {
    let Some(mesh) = data::mesh("meshes/ogre.ply") else { return };
    for merge in [false, true] {
        assert_eq!(simplify(&mesh, merge).0, simplify(&mesh, merge).0);
    }
}

/// A mesh from corner lists, one letter a vertex.
fn drawn(positions: &[[f32; 3]], triangles: &[&str]) -> Mesh {
    let corner = |letter: char| letter as u32 - 'a' as u32;
    let triangle = |t: &&str| <[u32; 3]>::try_from(t.chars().map(corner).collect::<Vec<_>>()).unwrap();
    Mesh {
        positions: positions.to_vec(),
        triangles: triangles.iter().map(triangle).collect(),
        ..Mesh::default()
    }
}

/// A strip of `length` quads, its ends joined after half a turn if `twisted`, else after none.
fn ring(length: u32, twisted: bool) -> Mesh {
    let mut mesh = Mesh::default();
    for i in 0..length {
        let turn = i as f32 / length as f32 * std::f32::consts::TAU;
        let tilt = if twisted { 0.5 * turn } else { 0.7 };
        for side in [-0.3_f32, 0.3] {
            let r = 1.0 + side * tilt.cos();
            mesh.positions.push([r * turn.cos(), r * turn.sin(), side * tilt.sin()]);
        }
        let next = (i + 1) % length;
        let [a, b] = [2 * i, 2 * i + 1];
        let [c, d] = if twisted && next == 0 { [2 * next + 1, 2 * next] } else { [2 * next, 2 * next + 1] };
        mesh.triangles.extend([[a, c, b], [b, c, d]]);
    }
    mesh
}

fn flat_grid(side: u32, scale: f32) -> Mesh {
    let mut mesh = Mesh::default();
    for y in 0..side {
        for x in 0..side {
            mesh.positions.push([x as f32 * scale, y as f32 * scale, 0.0]);
            if x + 1 < side && y + 1 < side {
                let a = y * side + x;
                mesh.triangles.extend([[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]);
            }
        }
    }
    mesh
}

const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

/// Small meshes with everything that can be wrong with one.
fn difficult() -> Vec<(&'static str, Mesh)> {
    let mut crowd = flat_grid(12, 1.0);
    crowd.positions.fill([3.0, 4.0, 5.0]);
    let mut doubled_faces = flat_grid(8, 1.0);
    doubled_faces.triangles.extend_from_within(..);
    let mut with_strays = flat_grid(6, 1.0);
    with_strays.positions.splice(0..0, [[9.0; 3]; 3]);
    with_strays.triangles.iter_mut().flatten().for_each(|v| *v += 3);
    // Triangles that name a vertex twice show nothing, also not where a vertex has no other.
    with_strays.triangles.extend([[0, 0, 1], [4, 5, 4], [6, 6, 6]]);
    // All corners of a fan on one line: a 0, b 1, c 2, …
    let line: Vec<[f32; 3]> = (0..10).map(|i| [i as f32, 0.0, 0.0]).collect();
    let mut far_apart = flat_grid(5, 1e-3);
    far_apart.positions.iter_mut().take(5).for_each(|p| p[0] = 1e30);
    let mut largest = flat_grid(4, 1.0);
    largest.positions.iter_mut().flatten().for_each(|x| *x = f32::MAX * (*x / 1.5 - 1.0));
    let mut fan = Mesh { positions: vec![[0.0, 0.0, 1.0]], triangles: Vec::new(), ..Mesh::default() };
    for i in 0..200 {
        let turn = i as f32 / 200.0 * std::f32::consts::TAU;
        fan.positions.push([turn.cos(), turn.sin(), 0.0]);
        fan.triangles.push([0, 1 + i, 1 + (i + 1) % 200]);
    }
    vec![
        ("nothing", Mesh::default()),
        (
            "vertices alone",
            Mesh { positions: vec![[1.0, 2.0, 3.0]; 5], triangles: Vec::new(), ..Mesh::default() },
        ),
        ("one triangle", drawn(&SQUARE, &["abc"])),
        ("a square", drawn(&SQUARE, &["abc", "acd"])),
        // a---b   Two triangles that share vertex c alone.
        //  \ /
        //   c
        //  / \
        // d---e
        ("a bow-tie", {
            let c = [0.5, 0.5, 0.0];
            drawn(&[[0.0, 1.0, 0.0], [1.0, 1.0, 0.0], c, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], &["acb", "dec"])
        }),
        ("two faces of one triangle", drawn(&SQUARE, &["abc", "acb"])),
        ("the same triangle three times", drawn(&SQUARE, &["abc", "abc", "cab"])),
        (
            "three sheets at one edge",
            drawn(&[SQUARE.as_slice(), &[[0.5, 0.0, 1.0]]].concat(), &["abc", "abd", "abe"]),
        ),
        ("a tetrahedron", {
            drawn(&[SQUARE[0], SQUARE[1], SQUARE[3], [0.3, 0.3, 1.0]], &["acb", "abd", "bcd", "cad"])
        }),
        ("a Moebius strip", ring(40, true)),
        ("a collar", ring(40, false)),
        ("a plane grid", flat_grid(20, 1.0)),
        ("all in one place", crowd),
        ("every face twice", doubled_faces),
        ("stray vertices", with_strays),
        ("a fan without area", drawn(&line, &["abc", "acd", "ade", "aef", "afg", "agh", "ahi", "aij"])),
        ("a cone of 200 triangles", fan),
        ("a grid as small as can be", flat_grid(6, f32::from_bits(1))),
        ("far apart", far_apart),
        ("as large as can be", largest),
    ]
}

#[test]
fn difficult_meshes() {
    for (name, mesh) in difficult() {
        for merge in [false, true] {
            println!("{name}, {merge}");
            let report = simplify_and_check(&mesh, merge);
            let shown = mesh.triangles.iter().any(|[a, b, c]| a != b && b != c && c != a);
            assert_eq!(report.base_triangles > 0, shown, "{name}");
        }
    }
}

#[test]
fn wrong_meshes_are_refused() {
    let missing = drawn(&SQUARE, &["abe"]);
    assert!(matches!(
        build(missing, &Options::default(), &mut |_, _| ()),
        Err(LogError::CornerOutOfRange { triangle: 0, vertex: 4, vertices: 4 })
    ));
    let mut infinite = drawn(&SQUARE, &["abc"]);
    infinite.positions[3][1] = f32::INFINITY;
    assert!(matches!(
        build(infinite, &Options::default(), &mut |_, _| ()),
        Err(LogError::BadPosition { vertex: 3, .. })
    ));
}

/// Plane ground costs nothing to simplify, and makes shallow trees all the same.
#[test]
fn plane_ground() {
    let side = 64;
    let report = simplify_and_check(&flat_grid(side, 1.0), false);
    assert!(report.base_triangles <= 2, "{report:?}");
    assert!(report.tree_depth <= 40, "{report:?}");
}

/// A bay in a coast is filled when its innermost vertex goes: an error, though no vertex is far from the surface.
///
/// ```text
/// g-------f-------e
/// |               |      b lies on the segment a c for the filled bay
/// |    b          |
/// a---/ \---------d  c between b and d
/// ```
#[test]
fn a_filled_bay_is_an_error() {
    let mesh = drawn(
        &[
            [0.0, 0.0, 0.0],
            [1.0, 0.5, 0.0],
            [2.0, 0.0, 0.0],
            [4.0, 0.0, 0.0],
            [4.0, 2.0, 0.0],
            [2.0, 2.0, 0.0],
            [0.0, 2.0, 0.0],
        ],
        &["abg", "bfg", "bcf", "cef", "cde"],
    );
    let (log, report) = simplify(&mesh, false);
    check(&mesh, &log, &report);
    let bay = log.collapses.iter().find(|c| c.removed == 1).unwrap();
    assert!(bay.bounds.eps >= 0.4, "{bay:?}");
}

/// Cuts at one error everywhere keep what they promise, both ways: the input's vertices are as near to what is shown as
/// the errors of the folded nodes say, up to points that were thinned out; and what is shown is near to the input,
/// though only edges were looked at in that direction.
#[test]
fn errors_are_honest() {
    let Some(mesh) = data::mesh("meshes/bunny.ply") else { return };
    let (log, _) = simplify(&mesh, false);
    let forest = log.forest().unwrap();
    let input = Bvh::new(&mesh);
    for part in [1e-4, 1e-3, 1e-2] {
        let eps = (part * mesh.extent()) as f32;
        let shown = Displayed::new(&log, &uniform_cut(&log, &forest, eps)).mesh(&mesh);
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

/// Two boxes: each is a component of its own, and together they end in one tree where that is asked for.
#[test]
fn components_are_joined() {
    let mut mesh = Mesh::default();
    for (x, size) in [(0.0, 4.0), (10.0, 1.0)] {
        let first = mesh.positions.len() as u32;
        for i in 0..8 {
            let side = |bit: u32| if i & bit == 0 { 0.0 } else { size };
            mesh.positions.push([x + side(1), side(2), side(4)]);
        }
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        for [a, b, c, d] in faces.map(|face| face.map(|v| v + first)) {
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    let apart = simplify_and_check(&mesh, false);
    assert!(apart.roots >= 2 && apart.base_triangles >= 8, "{apart:?}");
    let (log, joined) = simplify(&mesh, true);
    check(&mesh, &log, &joined);
    assert!(joined.roots <= 3 && joined.base_triangles >= 1, "{joined:?}");
    // What is left of two boxes can not be near all of their corners, and the error says how far it is.
    let shown = Displayed::new(&log, &vec![false; log.collapses.len()]).mesh(&mesh);
    let surface = Bvh::new(&shown);
    let distance = |p: &[f32; 3]| {
        let p = DVec3::from(p.map(f64::from));
        surface.nearest(p, f64::INFINITY).map_or(f64::INFINITY, |nearest| nearest.distance)
    };
    let farthest = mesh.positions.iter().map(distance).fold(0.0, f64::max);
    assert!(farthest > 1.0 && f64::from(joined.largest_eps) >= farthest * 0.999, "{farthest}, {joined:?}");
}
