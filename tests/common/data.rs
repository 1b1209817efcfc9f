//! Real meshes and trajectories, where they are at hand, and hierarchies of meshes.

use std::path::{Path, PathBuf};

use foldfront::cut::{Displayed, uniform_cut};
use foldfront::{CollapseLog, Mesh, mesh_io, simplify};

/// A file or folder among the shared data; `None` where there is no such data, and the test has nothing to do.
pub fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).join(name);
    path.exists().then_some(path)
}

/// A mesh among the shared data.
pub fn mesh(name: &str) -> Option<Mesh> {
    shared(name).map(|file| mesh_io::read(&[file], &mut |_, _| ()).unwrap())
}

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
