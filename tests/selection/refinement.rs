//! What is displayed: wholly unfolded the input, wholly folded the base mesh, and between them what the collapse log
//! says, on all kinds of meshes and on logs that make no sense. The real meshes are in `tests/real`.

use std::sync::Arc;

use crate::common::{direction, meshes, random_log, seeded};
use crate::unfolding::{Shown, assert_same, everything_unfolds_and_folds, expected};
use foldfront::experiment::scene::SceneKind;
use foldfront::testing::strict_mesh::StrictMesh;
use foldfront::vertex_tree::{Hierarchy, MeshSink, NONE, NodeId, Step, VertexTree};
use foldfront::{CollapseLog, Mesh};
use in_memory::{InMemoryHierarchy, InMemoryTree};
use rand::RngExt;
use rand_pcg::Pcg64;

#[test]
fn a_closed_surface_unfolds_and_folds() {
    everything_unfolds_and_folds("three handles", &meshes::with_handles(3, 14));
}

#[test]
fn a_scan_unfolds_and_folds() {
    everything_unfolds_and_folds("scan", &meshes::scan(14, &mut seeded(4)));
}

#[test]
fn a_patchwork_unfolds_and_folds() {
    everything_unfolds_and_folds("patchwork", &meshes::patchwork(12, &mut seeded(5)));
}

#[test]
fn mountains_with_voids_unfold_and_fold() {
    everything_unfolds_and_folds("mountains", &meshes::ground(120, 10, &mut seeded(6)));
}

#[test]
fn a_town_unfolds_and_folds() {
    everything_unfolds_and_folds("town", &meshes::part_of(SceneKind::City, 0.4));
}

/// Triangles between any vertices at all, some of them with a doubled corner, some twice; vertices without triangles.
fn nonsense(vertices: usize, triangles: usize, random: &mut Pcg64) -> CollapseLog {
    let positions = (0..vertices).map(|_| direction(random).as_vec3().to_array()).collect();
    let used = vertices - vertices / 10;
    let mut corner = || random.random_range(0..used as u32);
    let mut triangles: Vec<[u32; 3]> = (0..triangles).map(|_| [corner(), corner(), corner()]).collect();
    triangles.extend_from_within(..triangles.len() / 10);
    let mut log = random_log(Mesh { positions, triangles, ..Mesh::default() }, random);
    // As many roots as come.
    log.collapses.truncate(vertices - 1 - random.random_range(0..vertices / 2));
    log
}

/// What a strict mesh shows, in the numbering of the input.
fn strictly_shown(log: &CollapseLog, tree: &InMemoryTree, mesh: &StrictMesh) -> Shown {
    for (&vertex, &(position, _)) in &mesh.vertices {
        assert_eq!(position, log.mesh.positions[tree.input_vertex(vertex).unwrap() as usize]);
    }
    let mut shown = vec![[NONE; 3]; log.mesh.triangles.len()];
    for (&id, corners) in &mesh.triangles {
        shown[tree.input_triangle(id).unwrap() as usize] = corners.map(|v| tree.input_vertex(v).unwrap());
    }
    shown
}

#[test]
fn any_order_of_steps_to_a_cut_shows_what_the_log_says() {
    for seed in 0..40 {
        let mut random = seeded(seed);
        let vertices = random.random_range(5..65);
        let triangles = random.random_range(0..200);
        let log = nonsense(vertices, triangles, &mut random);
        let hierarchy = Arc::new(InMemoryHierarchy::new(&log).unwrap());
        let mut tree = InMemoryTree::new(hierarchy.clone());
        let mut mesh = StrictMesh::default();
        tree.base_mesh(&mut mesh).unwrap();
        let mut active = vec![false; log.collapses.len()];
        let is_active = |active: &[bool], n: NodeId| active[hierarchy.log_number(n) as usize];
        let base = strictly_shown(&log, &tree, &mesh);
        for step in 0..600 {
            // Mostly unfolding for a while, then mostly folding.
            let node = NodeId(random.random_range(0..log.collapses.len()) as u32);
            let unfold = random.random_range(0..10) < if step / 100 % 2 == 0 { 8 } else { 2 };
            let can_unfold = !is_active(&active, node) && tree.parents(node).all(|p| is_active(&active, p));
            let can_fold = is_active(&active, node) && tree.children(node).all(|c| !is_active(&active, c));
            if unfold && can_unfold {
                assert_eq!(tree.unfold(node, &mut mesh).unwrap(), Step::Done);
            } else if !unfold && can_fold {
                assert_eq!(tree.fold(node, &mut mesh).unwrap(), Step::Done);
            } else {
                continue;
            }
            let flag = &mut active[hierarchy.log_number(node) as usize];
            *flag = !*flag;
            // Now and then many changes at once, of which later ones build on earlier ones.
            if step % 100 < 50 && random.random_ratio(7, 8) {
                continue;
            }
            tree.update_mesh(&mut mesh);
            let found = strictly_shown(&log, &tree, &mesh);
            assert_same(&found, &expected(&log, &active), &format!("seed {seed}, step {step}"));
            assert_eq!(tree.displayed(), mesh.triangles.len() as u64);
        }
        let mut nodes: Vec<NodeId> = (0..tree.node_limit()).map(NodeId).collect();
        nodes.retain(|&n| is_active(&active, n));
        for &node in nodes.iter().rev() {
            tree.fold(node, &mut mesh).unwrap();
        }
        tree.update_mesh(&mut mesh);
        assert!(
            strictly_shown(&log, &tree, &mesh) == base,
            "seed {seed}: folding is not the inverse of unfolding"
        );
    }
}

#[test]
fn a_strict_mesh_is_strict() {
    let fails = |act: fn(&mut StrictMesh)| {
        let mut mesh = StrictMesh::default();
        mesh.vertex_added(0, [0.0; 3]);
        mesh.vertex_added(1, [1.0; 3]);
        mesh.triangle_added(7, [0, 1, 0]);
        std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| act(&mut mesh))).is_err()
    };
    assert!(!fails(|mesh| mesh.corner_moved(7, 1, 0)));
    assert!(fails(|mesh| mesh.corner_moved(7, 1, 2)));
    assert!(fails(|mesh| mesh.vertex_added(1, [0.0; 3])));
    assert!(fails(|mesh| mesh.vertex_removed(1)));
    assert!(fails(|mesh| mesh.triangle_added(7, [0, 0, 0])));
    assert!(fails(|mesh| mesh.triangle_added(8, [0, 0, 2])));
    assert!(fails(|mesh| mesh.triangle_removed(8)));
}
