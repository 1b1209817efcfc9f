//! What is displayed: wholly unfolded the input, wholly folded the base mesh, and between them what the collapse log
//! says, on every mesh there is and on logs that make no sense.

mod common;

use std::sync::Arc;

use common::sink::StrictMesh;
use common::{Random, data, random_log, random_step, random_view};
use foldfront::active_mesh::ActiveMesh;
use foldfront::cut::Displayed;
use foldfront::engine::{Engine, Settings};
use foldfront::vertex_tree::{MeshSink, NONE, NodeId, Step, VertexTree};
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;
use in_memory::{Hierarchy, InMemoryTree};

/// For each input triangle the input vertices at which its corners are shown, [`NONE`] where it is hidden.
type Shown = Vec<[u32; 3]>;

/// What a set of active nodes should show.
fn expected(log: &CollapseLog, active: &[bool]) -> Shown {
    let displayed = Displayed::new(log, active);
    let mut shown = vec![[NONE; 3]; log.mesh.triangles.len()];
    for &t in &displayed.triangles {
        shown[t as usize] = log.mesh.triangles[t as usize].map(|v| displayed.shown_at[v as usize]);
    }
    shown
}

/// What the buffers of a renderer show.
fn shown(log: &CollapseLog, tree: &InMemoryTree, mesh: &ActiveMesh) -> Shown {
    let mut shown = vec![[NONE; 3]; log.mesh.triangles.len()];
    assert_eq!(mesh.displayed() as u64, tree.displayed_triangles());
    for (id, corners) in mesh.displayed_triangles() {
        let at = &mut shown[tree.input_triangle(id).unwrap() as usize];
        assert_eq!(*at, [NONE; 3], "triangle {id} is in the buffer twice");
        *at = corners.map(|slot| {
            let vertex = tree.input_vertex(slot).unwrap();
            assert_eq!(mesh.positions()[slot as usize], log.mesh.positions[vertex as usize]);
            vertex
        });
    }
    shown
}

fn assert_same(found: &Shown, expected: &Shown, what: &str) {
    if let Some(t) = (0..expected.len()).find(|&t| found[t] != expected[t]) {
        panic!("{what}: triangle {t} is at {:?}, expected at {:?}", found[t], expected[t]);
    }
}

fn everything_unfolds_and_folds(name: &str, input: &Mesh) {
    let log = data::log(input.clone());
    assert!(log.mesh == *input, "{name}: the input has changed");
    let hierarchy = Arc::new(Hierarchy::new(&log).unwrap());
    let mut tree = InMemoryTree::new(hierarchy.clone());
    let mut mesh = ActiveMesh::new();
    let base = expected(&log, &vec![false; log.collapses.len()]);
    let base_triangles = base.iter().filter(|corners| corners[0] != NONE).count();
    assert!(
        base_triangles < input.triangles.len() / 5,
        "{name}: {base_triangles} triangles in the base mesh"
    );

    tree.base_mesh(&mut mesh).unwrap();
    assert_same(&shown(&log, &tree, &mesh), &base, &format!("{name}, base mesh"));

    let mut unfolded = Vec::new();
    let mut stack = tree.roots().to_vec();
    while let Some(node) = stack.pop() {
        assert_eq!(tree.unfold(node, &mut mesh).unwrap(), Step::Done);
        stack.extend(tree.children(node));
        unfolded.push(node);
    }
    tree.update_mesh(&mut mesh);
    assert_eq!(unfolded.len(), log.collapses.len(), "{name}");
    assert_same(&shown(&log, &tree, &mesh), &input.triangles, &format!("{name}, all unfolded"));
    assert_eq!(tree.displayed_triangles(), input.triangles.len() as u64);
    assert_eq!(mesh.displayed_vertices(), input.positions.len());

    // Folding goes another way: from the last to the first in depth-first order, not in the reverse of above.
    unfolded.sort_unstable();
    for &node in unfolded.iter().rev() {
        assert_eq!(tree.fold(node, &mut mesh).unwrap(), Step::Done);
    }
    tree.update_mesh(&mut mesh);
    assert_same(&shown(&log, &tree, &mesh), &base, &format!("{name}, all folded"));
    assert_eq!(tree.displayed_triangles(), base_triangles as u64);

    a_walk_shows_what_the_log_says(name, &log, &hierarchy);
}

/// Random views from around a mesh: slow steps and teleports.
fn a_walk_shows_what_the_log_says(name: &str, log: &CollapseLog, hierarchy: &Arc<Hierarchy>) {
    let (lo, hi) = log.mesh.bounding_box().unwrap();
    let [lo, hi] = [lo, hi].map(|p| DVec3::from(p.map(f64::from)));
    let (center, scale) = ((lo + hi) / 2.0, log.mesh.extent() / 2.0);
    let tree = InMemoryTree::new(hierarchy.clone());
    let mesh = ActiveMesh::new();
    let mut engine = Engine::new(tree, mesh, Settings { rho: 0.02 * scale, ..Settings::default() }).unwrap();
    let mut random = Random(11);
    let mut view = random_view(&mut random).with_k(500.0).unwrap();
    let (mut most, mut changes) = (0, 0);
    for frame in 0..200 {
        random_step(&mut view, &mut random);
        let report = engine.advance(&[view.with_eye(center + scale * view.eye()).unwrap()]).unwrap();
        engine.assert_well_formed();
        most = most.max(report.triangles);
        changes += report.unfolds + report.folds;
        if frame % 20 == 19 {
            let mut active = vec![false; log.collapses.len()];
            engine.for_each_active(|node| active[hierarchy.log_number(node) as usize] = true);
            let found = shown(log, engine.tree(), engine.mesh());
            assert_same(&found, &expected(log, &active), &format!("{name}, frame {frame}"));
        }
    }
    assert!(most > 1000 && changes > 1000, "{name}: {changes} changes, at most {most} triangles");
}

fn every_file(folder: &str, wanted: impl Fn(&str) -> bool) {
    let Some(folder) = data::shared(folder) else { return };
    let mut files: Vec<_> = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    for file in files {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        if wanted(&name) {
            let mesh = foldfront::mesh_io::read(&[&file], &mut |_, _| ()).unwrap();
            everything_unfolds_and_folds(&name, &mesh);
        }
    }
}

// In three parts that take about as long, for as many threads.

#[test]
fn the_buddha_unfolds_to_the_input_and_folds_to_the_base_mesh() {
    every_file("meshes", |name| name == "happy.ply");
}

#[test]
fn every_other_mesh_unfolds_to_the_input_and_folds_to_the_base_mesh() {
    every_file("meshes", |name| name != "happy.ply");
}

#[test]
fn every_city_unfolds_to_the_input_and_folds_to_the_base_mesh() {
    every_file("city", |_| true);
}

/// Triangles between any vertices at all, some of them with a doubled corner, some twice; vertices without triangles.
fn nonsense(vertices: usize, triangles: usize, random: &mut Random) -> CollapseLog {
    let positions = (0..vertices).map(|_| random.direction().as_vec3().to_array()).collect();
    let used = vertices - vertices / 10;
    let mut corner = || random.below(used) as u32;
    let mut triangles: Vec<[u32; 3]> = (0..triangles).map(|_| [corner(), corner(), corner()]).collect();
    triangles.extend_from_within(..triangles.len() / 10);
    let mut log = random_log(Mesh { positions, triangles, ..Mesh::default() }, random);
    // As many roots as come.
    log.collapses.truncate(vertices - 1 - random.below(vertices / 2));
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
        let mut random = Random(seed);
        let vertices = 5 + random.below(60);
        let triangles = random.below(200);
        let log = nonsense(vertices, triangles, &mut random);
        let hierarchy = Arc::new(Hierarchy::new(&log).unwrap());
        let mut tree = InMemoryTree::new(hierarchy.clone());
        let mut mesh = StrictMesh::default();
        tree.base_mesh(&mut mesh).unwrap();
        let mut active = vec![false; log.collapses.len()];
        let is_active = |active: &[bool], n: NodeId| active[hierarchy.log_number(n) as usize];
        let base = strictly_shown(&log, &tree, &mesh);
        for step in 0..600 {
            // Mostly unfolding for a while, then mostly folding.
            let node = NodeId(random.below(log.collapses.len()) as u32);
            let unfold = random.below(10) < if step / 100 % 2 == 0 { 8 } else { 2 };
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
            if step % 100 < 50 && random.below(8) > 0 {
                continue;
            }
            tree.update_mesh(&mut mesh);
            let found = strictly_shown(&log, &tree, &mesh);
            assert_same(&found, &expected(&log, &active), &format!("seed {seed}, step {step}"));
            assert_eq!(tree.displayed_triangles(), mesh.triangles.len() as u64);
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
