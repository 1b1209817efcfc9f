//! Every cut covers the surface once, and the finest one is the input.

use std::collections::HashMap;

use foldfront::experiment::scene::SceneKind;
use foldfront::selection::engine::Engine;
use foldfront::{Hierarchy, Mesh};
use mt_partition::{BuildOptions, CacheMode, Memory, MtTree, QueueOrder};

use super::{Walk, advance_settled, ball_log, engine};
use crate::common::{bumpy_grid, data, graph_cut, meshes, seeded};
use crate::patches::{assert_finest_is_input, displayed, verifies_and_is_the_input};
use foldfront::testing::strict_mesh::StrictMesh;

/// How often each directed edge occurs more or less often than its opposite, by edges: the boundary with its sense. It is
/// the same for all surfaces that cover the same ground, and empty for closed ones.
fn boundary(triangles: &[[u32; 3]]) -> HashMap<[u32; 2], i32> {
    let mut edges = HashMap::new();
    for t in triangles {
        for i in 0..3 {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    edges.retain(|_, sum| *sum != 0);
    edges
}

/// What is displayed is a surface without a boundary; returns how many triangles it has.
pub fn assert_closed(engine: &Engine<MtTree, StrictMesh>, when: &str) -> usize {
    let triangles = displayed(engine);
    assert_eq!(boundary(&triangles), HashMap::new(), "{when}");
    assert_eq!(crowded(&triangles), 0, "{when}");
    triangles.len()
}

/// Edges of more than two triangles.
fn crowded(triangles: &[[u32; 3]]) -> usize {
    let mut edges: HashMap<[u32; 2], usize> = HashMap::new();
    for t in triangles {
        for i in 0..3 {
            let (a, b) = (t[i], t[(i + 1) % 3]);
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    edges.values().filter(|&&count| count > 2).count()
}

fn options(patch: f64, partition: u32) -> BuildOptions {
    BuildOptions { patch, partition, ..BuildOptions::default() }
}

/// Closed in every frame, with any patch and partition size; and the input again, triangle for triangle, at the end.
#[test]
fn every_cut_of_a_closed_surface_is_closed() {
    let log = ball_log(4);
    for (seed, (patch, partition)) in
        [(0.0, 1), (0.0, 20), (4.0, 5), (10.0, 20), (1e9, 20)].into_iter().enumerate()
    {
        let file = graph_cut::file(&log, &options(patch, partition));
        let mut engine = engine(&file, CacheMode::PC, Memory::default(), StrictMesh::default());
        let mut walk = Walk::new(seed as u64, 300.0);
        let mut sizes = Vec::new();
        for frame in 0..300 {
            let report = engine.advance(&walk.step()).unwrap();
            // Frames with misses are as good as others.
            engine.tree_mut().settle().unwrap();
            let triangles = assert_closed(&engine, &format!("patch {patch}, frame {frame}"));
            assert_eq!(report.displayed, triangles as u64);
            sizes.push(triangles);
        }
        sizes.sort_unstable();
        sizes.dedup();
        assert!(
            sizes.len() > if patch > 1e6 { 1 } else { 20 },
            "patch {patch}: the cut hardly moves: {sizes:?}"
        );
        assert_finest_is_input(&file, &log.mesh);
        advance_settled(&mut engine, &[]);
        assert_eq!(engine.sink().triangles.len(), file.base_triangles() as usize);
    }
}

/// A surface with a boundary keeps covering the ground that its base mesh and its input cover between them: directed
/// edges cancel everywhere but along the boundary, which only ever goes through input vertices of the boundary.
#[test]
fn a_surface_with_a_boundary_has_no_other() {
    let log = data::log(bumpy_grid(33, &mut seeded(5)));
    let rim = |v: u32| [v % 33, v / 33].iter().any(|at| [0, 32].contains(at));
    let file = graph_cut::file(&log, &options(10.0, 20));
    let mut engine = engine(&file, CacheMode::PCc, Memory::default(), StrictMesh::default());
    let mut walk = Walk::new(9, 200.0);
    for frame in 0..400 {
        engine.advance(&walk.step()).unwrap();
        engine.tree_mut().settle().unwrap();
        let open = boundary(&displayed(&engine));
        assert!(open.keys().flatten().all(|&v| rim(v)), "frame {frame}: a crack within the surface");
        assert!(!open.is_empty(), "frame {frame}: nothing is displayed");
    }
    assert_finest_is_input(&file, &log.mesh);
}

#[test]
fn meshes_of_all_kinds() {
    for (name, mesh) in [
        ("scan", meshes::scan(14, &mut seeded(1))),
        ("patchwork", meshes::patchwork(12, &mut seeded(2))),
        ("handles", meshes::with_handles(5, 10)),
        ("mountains with voids", meshes::ground(80, 8, &mut seeded(3))),
        ("town", meshes::part_of(SceneKind::City, 0.3)),
    ] {
        verifies_and_is_the_input(name, &data::log(mesh));
    }
}

#[test]
fn the_reduction_keeps_its_promises() {
    let log = ball_log(6);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.mt");
    for patch in [3.0, 10.0, 20.0] {
        let report = mt_partition::write(&path, &log, &options(patch, 20)).unwrap();
        let per_arc = report.stored_triangles as f64 / report.arcs as f64;
        assert!(per_arc >= patch, "{report:?}");
        assert!(report.stored_triangles < 3 * report.triangles, "{report:?}");
        assert!(report.bytes <= 40 * report.triangles || patch < 10.0, "{report:?}");
        assert_eq!(report.bytes, std::fs::metadata(&path).unwrap().len());
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let log = ball_log(4);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.mt");
    let bytes = |options: &BuildOptions| {
        mt_partition::write(&path, &log, options).unwrap();
        std::fs::read(&path).unwrap()
    };
    let first = bytes(&BuildOptions::default());
    assert!(first == bytes(&BuildOptions::default()));
    let other = bytes(&BuildOptions { order: QueueOrder::Decreasing, ..BuildOptions::default() });
    assert!(first != other, "the order of the queue makes no difference");
}

/// Nothing at all, points, one triangle, triangles without a collapse.
#[test]
fn next_to_nothing() {
    let meshes = [
        Mesh::default(),
        Mesh { positions: vec![[0.0; 3]; 3], ..Mesh::default() },
        Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2], [1, 1, 2]],
            ..Mesh::default()
        },
    ];
    for mesh in meshes {
        for log in [data::log(mesh.clone()), foldfront::CollapseLog { mesh: mesh.clone(), collapses: vec![] }]
        {
            let file = graph_cut::file(&log, &BuildOptions::default());
            file.verify().unwrap();
            assert_finest_is_input(&file, &mesh);
        }
    }
}
