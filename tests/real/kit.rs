//! Trials that need real data. Nothing else among the tests knows where those are.

use std::env;
use std::path::{Path, PathBuf};

use foldfront::construction::mesh_io;
use foldfront::{CollapseLog, Mesh};
use libtest_mimic::{Completion, Trial};

use crate::common::data;

/// The variable that names another folder.
const VARIABLE: &str = "FOLDFRONT_DATA";

/// Where the data are: beside the checkout, unless it is said where.
fn folder() -> PathBuf {
    let beside = || Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")).to_owned();
    env::var_os(VARIABLE).map_or_else(beside, PathBuf::from)
}

/// Whoever says where the data are wants them to be used.
///
/// # Panics
/// If what the variable names is no folder.
pub fn assert_folder() {
    if let Some(named) = env::var_os(VARIABLE) {
        assert!(Path::new(&named).is_dir(), "{VARIABLE}: {} is not a folder", named.display());
    }
}

/// A trial over these files, which runs where all of them are. Elsewhere it is ignored, and says which one is missing.
pub fn needs<const N: usize>(
    name: &str,
    files: [&str; N],
    check: impl FnOnce([PathBuf; N]) + Send + 'static,
) -> Trial {
    let folder = folder();
    let missing =
        files.iter().find(|file| !folder.join(file).exists()).map(|file| format!("{file} is not there"));
    let files = files.map(|file| folder.join(file));
    Trial::ignorable_test(name, move || {
        Ok(match missing {
            Some(missing) => Completion::ignored_with(missing),
            None => {
                check(files);
                Completion::Completed
            }
        })
    })
}

/// The mesh in a file.
pub fn mesh(file: PathBuf) -> Mesh {
    mesh_io::read(&[file], &mut |_, _| ()).unwrap()
}

/// The hierarchy of the mesh in a file.
pub fn log(file: PathBuf) -> CollapseLog {
    data::log(mesh(file))
}

/// What a file is called, for the name of a trial.
pub fn stem(file: &str) -> &str {
    let name = file.rsplit('/').next().unwrap_or(file);
    name.split('.').next().unwrap_or(name)
}
