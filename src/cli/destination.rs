//! Whether a file may be written where it is asked for: said before the work, not after it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};
use container::output;
use same_file::Handle;

use crate::experiment::store::Backend;

/// What is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    Hierarchy(Backend),
    Mesh,
    Picture,
    Path,
}

impl Content {
    fn name(self) -> &'static str {
        match self {
            Self::Hierarchy(_) => "a hierarchy",
            Self::Mesh => "a PLY file",
            Self::Picture => "a PNG file",
            Self::Path => "a path",
        }
    }

    /// Whether a file of this kind may have an extension that others have a use for.
    fn may_be_called(self, extension: &str) -> bool {
        match self {
            // Whatever the backend, FILE.fold is what `build` wrote.
            Self::Hierarchy(backend) => {
                extension == "fold"
                    || match backend {
                        Backend::InMemory => false,
                        Backend::MetaNode => extension == "meta",
                        Backend::DetailBlock => extension == "xfm",
                        Backend::MtPartition => extension == "mt",
                    }
            }
            Self::Mesh => extension == "ply",
            Self::Picture => extension == "png",
            Self::Path => extension == "path",
        }
    }
}

/// Extensions that promise a format.
const PROMISES: [&str; 27] = [
    "obj", "ply", "stl", "off", "glb", "gltf", "hgt", "zip", "png", "jpg", "jpeg", "tif", "tiff", "path",
    "frames", "scene", "fold", "meta", "xfm", "mt", "las", "laz", "csv", "svg", "html", "json", "spz",
];

/// Fails unless a file could be written there that is no input, and whose name promises nothing else.
pub(super) fn check_file(file: &Path, content: Content, inputs: &[PathBuf]) -> Result<()> {
    let name = || file.display().to_string();
    ensure!(file != Path::new("-"), "-: results are written to files, not to standard output");
    let extension = file.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if PROMISES.contains(&&*extension) && !content.may_be_called(&extension) {
        bail!("{}: what is written is {}, and .{extension} promises another format", name(), content.name());
    }
    ensure!(!file.is_dir(), "{}: is a folder", name());
    // A rename would put a file in the place of /dev/null.
    ensure!(!file.exists() || file.is_file(), "{}: is not a file", name());
    refuse_input(file, inputs)?;
    tempfile::tempfile_in(output::folder_of(file)).with_context(name)?;
    Ok(())
}

/// Fails unless files could be written to a folder, which is made when it is needed. `is_written` says of a file in it
/// whether it will be written anew; none of these may be an input.
pub(super) fn check_folder(
    folder: &Path,
    is_written: impl Fn(&str) -> bool,
    inputs: &[PathBuf],
) -> Result<()> {
    let there = folder.ancestors().find(|f| f.exists()).unwrap_or(Path::new("."));
    ensure!(there.is_dir(), "{}: is not a folder", there.display());
    tempfile::tempfile_in(there).with_context(|| folder.display().to_string())?;
    if folder.is_dir() {
        for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
            let entry = entry.with_context(|| folder.display().to_string())?;
            if entry.file_name().to_str().is_some_and(&is_written) {
                refuse_input(&entry.path(), inputs)?;
            }
        }
    }
    Ok(())
}

/// Fails if a file that is there is one of the inputs, by whatever name: by device and inode, links followed.
fn refuse_input(file: &Path, inputs: &[PathBuf]) -> Result<()> {
    if !file.is_file() {
        return Ok(());
    }
    let own = Handle::from_path(file).with_context(|| file.display().to_string())?;
    for input in inputs.iter().filter(|input| input.is_file()) {
        if Handle::from_path(input).with_context(|| input.display().to_string())? == own {
            bail!("{}: is the input too", file.display());
        }
    }
    Ok(())
}
