//! All that a hierarchy shows in memory: unfolded, folded, and along a walk.

use std::sync::Arc;

use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::testing::cut::Displayed;
use foldfront::vertex_tree::{Hierarchy, NONE, Step, VertexTree};
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;
use in_memory::{InMemoryHierarchy, InMemoryTree};

use crate::common::{data, random_step, random_view, seeded};

/// For each input triangle the input vertices at which its corners are shown, [`NONE`] where it is hidden.
pub type Shown = Vec<[u32; 3]>;

/// What a set of active nodes should show.
pub fn expected(log: &CollapseLog, active: &[bool]) -> Shown {
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
    assert_eq!(mesh.displayed() as u64, tree.displayed());
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

pub fn assert_same(found: &Shown, expected: &Shown, what: &str) {
    if let Some(t) = (0..expected.len()).find(|&t| found[t] != expected[t]) {
        panic!("{what}: triangle {t} is at {:?}, expected at {:?}", found[t], expected[t]);
    }
}

/// Wholly unfolded a mesh is the input, wholly folded the base mesh; and then along a walk. `name` is for messages.
pub fn everything_unfolds_and_folds(name: &str, input: &Mesh) {
    let log = data::log(input.clone());
    assert!(log.mesh == *input, "{name}: the input has changed");
    let hierarchy = Arc::new(InMemoryHierarchy::new(&log).unwrap());
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
    assert_eq!(tree.displayed(), input.triangles.len() as u64);
    assert_eq!(mesh.displayed_vertices(), input.positions.len());

    // Folding goes another way: from the last to the first in depth-first order, not in the reverse of above.
    unfolded.sort_unstable();
    for &node in unfolded.iter().rev() {
        assert_eq!(tree.fold(node, &mut mesh).unwrap(), Step::Done);
    }
    tree.update_mesh(&mut mesh);
    assert_same(&shown(&log, &tree, &mesh), &base, &format!("{name}, all folded"));
    assert_eq!(tree.displayed(), base_triangles as u64);

    a_walk_shows_what_the_log_says(name, &log, &hierarchy);
}

/// Random views from around a mesh: slow steps and teleports.
fn a_walk_shows_what_the_log_says(name: &str, log: &CollapseLog, hierarchy: &Arc<InMemoryHierarchy>) {
    let (lo, hi) = log.mesh.bounding_box().unwrap();
    let [lo, hi] = [lo, hi].map(|p| DVec3::from(p.map(f64::from)));
    let (center, scale) = ((lo + hi) / 2.0, log.mesh.extent() / 2.0);
    let tree = InMemoryTree::new(hierarchy.clone());
    let mesh = ActiveMesh::new();
    let mut engine = Engine::new(tree, mesh, Settings { rho: 0.02 * scale, ..Settings::default() }).unwrap();
    let mut random = seeded(11);
    let mut view = random_view(&mut random).with_k(500.0).unwrap();
    let (mut most, mut changes) = (0, 0);
    for frame in 0..200 {
        random_step(&mut view, &mut random);
        let report = engine.advance(&[view.with_eye(center + scale * view.eye()).unwrap()]).unwrap();
        engine.assert_well_formed();
        most = most.max(report.displayed);
        changes += report.unfolds + report.folds;
        if frame % 20 == 19 {
            let mut active = vec![false; log.collapses.len()];
            engine.for_each_active(|node| active[hierarchy.log_number(node) as usize] = true);
            let found = shown(log, engine.tree(), engine.sink());
            assert_same(&found, &expected(log, &active), &format!("{name}, frame {frame}"));
        }
    }
    assert!(most > 1000 && changes > 1000, "{name}: {changes} changes, at most {most} triangles");
}
