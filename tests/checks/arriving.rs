//! A trajectory that comes to a mesh moves as a camera should there.

use foldfront::Mesh;
use foldfront::experiment::path::import::{Mode, Options};
use foldfront::experiment::path::{Path, Summary};

/// In every mode, a path of at least so many frames, neither at rest nor in leaps.
pub fn comes_to_in_every_mode(mesh: &Mesh, frames: usize, import: impl Fn(&Options) -> Path) {
    for mode in [Mode::Fly, Mode::Walk, Mode::Orbit] {
        let path = import(&Options { mode, ..Options::default() });
        let Summary { motion: [_, usual, largest], .. } = path.summary();
        let what = format!("{} {mode:?} {}", path.name, mesh.positions.len());
        assert!(path.frames.len() > frames, "{what}: {}", path.frames.len());
        assert!(usual.rho > 0.0 && usual.rho < 0.02 * mesh.extent(), "{what}: {usual:?}");
        assert!(largest.omega < 0.5, "{what}: {largest:?}");
    }
}
