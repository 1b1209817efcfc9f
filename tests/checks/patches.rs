//! The finest cut of a multi-triangulation is its input.

use std::sync::Arc;

use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::view::View;
use foldfront::vertex_tree::{Hierarchy, MeshSink};
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;
use mt_partition::{BuildOptions, MtFile, MtTree};

use crate::common::graph_cut;
use foldfront::testing::strict_mesh::StrictMesh;

/// Advances until nothing is missing, and says after how many frames that was.
pub fn advance_settled<M: MeshSink>(engine: &mut Engine<MtTree, M>, views: &[View]) -> usize {
    for frame in 0..2000 {
        if engine.advance(views).unwrap().misses == 0 {
            return frame;
        }
        engine.tree_mut().settle().unwrap();
    }
    panic!("the front never arrives");
}

/// By the size of spheres and from all around, everything is wanted, whatever its error.
pub fn finest<M: MeshSink>(file: &Arc<MtFile>, mesh: M) -> Engine<MtTree, M> {
    let tree = MtTree::new(file.clone(), mt_partition::Settings::default()).unwrap();
    let settings = Settings { criterion: Criterion::SphereSize, ..Settings::default() };
    Engine::new(tree, mesh, settings).unwrap()
}

/// See [`finest`].
pub fn all_around(eye: DVec3) -> [View; 6] {
    let (cos_beta, sin_beta) = (0.5, 0.75_f64.sqrt());
    [DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z]
        .map(|direction| View::from_parts(eye, direction, cos_beta, sin_beta, 1e9).unwrap())
}

/// Triangles by input vertices, each starting with its least one, in ascending order.
fn canonical(triangles: impl Iterator<Item = [u32; 3]>) -> Vec<[u32; 3]> {
    let rotated = |t: [u32; 3]| {
        let least = (0..3).min_by_key(|&i| t[i]).unwrap();
        [0, 1, 2].map(|i| t[(least + i) % 3])
    };
    let mut all: Vec<_> = triangles.map(rotated).collect();
    all.sort_unstable();
    all
}

pub fn displayed(engine: &Engine<MtTree, StrictMesh>) -> Vec<[u32; 3]> {
    let vertex = |slot| engine.tree().input_vertex(slot).unwrap();
    canonical(engine.sink().triangles.values().map(|t| t.map(vertex)))
}

fn input(mesh: &Mesh) -> Vec<[u32; 3]> {
    let is_shown = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    canonical(mesh.triangles.iter().copied().filter(is_shown))
}

pub fn assert_finest_is_input(file: &Arc<MtFile>, mesh: &Mesh) {
    let mut engine = finest(file, StrictMesh::default());
    let (lo, hi) = mesh.bounding_box().unwrap_or_default();
    let center: [f64; 3] = std::array::from_fn(|i| f64::from(lo[i] + hi[i]) / 2.0);
    advance_settled(&mut engine, &all_around(center.into()));
    assert!(displayed(&engine) == input(mesh), "the finest cut is not the input");
    advance_settled(&mut engine, &[]);
    assert_eq!(engine.sink().triangles.len(), file.base_triangles() as usize);
}

/// Whatever is wrong with a mesh: the file verifies, the requested patches are reached, and the finest cut is the input.
pub fn verifies_and_is_the_input(name: &str, log: &CollapseLog) {
    let file = graph_cut::file(log, &BuildOptions::default());
    file.verify().unwrap();
    assert_finest_is_input(&file, &log.mesh);
    let size = |what: &str| file.facts().iter().find(|f| f.0 == what).unwrap().1.clone();
    eprintln!("{name}: {}; {}; {}", size("bytes"), size("triangles on arcs"), size("arcs"));
}
