//! Hierarchies that benchmarks keep in the target folder: construction takes longer than they do.

use std::path::PathBuf;

use foldfront::collapse_log::{read_log, write_log};
use foldfront::construction::simplify;
use foldfront::{CollapseLog, Mesh};

/// The log of a mesh, made the first time that it is asked for by this name.
pub fn log(name: &str, build: &simplify::Options, mesh: impl FnOnce() -> Mesh) -> CollapseLog {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("strategies");
    std::fs::create_dir_all(&folder).expect("target is writable");
    let file = folder.join(format!("{name}.log"));
    read_log(&file).unwrap_or_else(|_| {
        let (log, _) = simplify::build(mesh(), build, &mut |_, _| {}).expect("the mesh is valid");
        write_log(&file, &log).expect("target is writable");
        log
    })
}
