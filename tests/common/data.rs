//! Hierarchies of meshes.

use foldfront::construction::simplify;
use foldfront::testing::cut::{Displayed, uniform_cut};
use foldfront::{CollapseLog, Mesh};

/// The hierarchy of a mesh.
pub fn log(mesh: Mesh) -> CollapseLog {
    simplify::build(mesh, &simplify::Options::default(), &mut |_, _| ()).unwrap().0
}

/// The hierarchy of a mesh of about so many vertices, simplified evenly from that of `fine`.
pub fn reduced(fine: &CollapseLog, vertices: usize) -> CollapseLog {
    let forest = fine.forest().unwrap();
    let mut errors: Vec<f32> = fine.collapses.iter().map(|c| c.bounds.eps).collect();
    errors.sort_by(f32::total_cmp);
    let cut = uniform_cut(fine, &forest, errors[errors.len() - vertices]);
    log(Displayed::new(fine, &cut).compact_mesh(&fine.mesh))
}
