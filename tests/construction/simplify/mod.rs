//! Hierarchy construction: on meshes of all kinds, and on small ones made to be difficult. The real ones are in
//! `tests/real`.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

mod out_of_core;

use crate::common::{meshes, seeded};
use crate::hierarchy::{check, errors_are_honest, is_deterministic, simplify, simplify_and_check};
use foldfront::Mesh;
use foldfront::collapse_log::LogError;
use foldfront::construction::simplify::{Options, build};
use foldfront::experiment::bvh::Bvh;
use foldfront::experiment::scene::SceneKind;
use foldfront::testing::cut::Displayed;
use glam::DVec3;

macro_rules! made_up {
    ($name:ident, $mesh:expr, $merge:literal, $($holds:tt)*) => {
        #[test]
        fn $name() {
            let report = simplify_and_check(&$mesh, $merge);
            assert!(report $($holds)*, "{report:?}");
        }
    };
}

made_up!(closed_surface, meshes::with_handles(3, 16), false, .base_triangles < 100);
made_up!(closed_surface_of_high_genus, meshes::with_handles(20, 8), false, .base_triangles < 500);
made_up!(scan, meshes::scan(16, &mut seeded(1)), false, .base_triangles < 1000);
made_up!(scan_joined, meshes::scan(16, &mut seeded(1)), true, .roots < 10);
made_up!(patchwork, meshes::patchwork(14, &mut seeded(2)), false, .base_triangles < 1000);
made_up!(mountains, meshes::ground(150, 0, &mut seeded(3)), false, .roots < 10);
made_up!(mountains_with_voids, meshes::ground(150, 20, &mut seeded(3)), false, .base_triangles < 5000);
made_up!(laserscan, meshes::part_of(SceneKind::Laserscan, 0.25), false, .roots < 10);
made_up!(town, meshes::part_of(SceneKind::City, 0.5), false, .roots > 500);
made_up!(town_joined, meshes::part_of(SceneKind::City, 0.5), true, .roots < 10);

#[test]
fn the_same_mesh_comes_to_the_same_hierarchy() {
    is_deterministic(&meshes::patchwork(14, &mut seeded(2)));
}

#[test]
fn cuts_keep_what_their_errors_promise() {
    errors_are_honest(&meshes::with_handles(2, 24));
    errors_are_honest(&meshes::scan(20, &mut seeded(4)));
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
