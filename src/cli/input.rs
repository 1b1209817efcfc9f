//! What a command is given to work on: meshes, hierarchy files and built-in scenes.

use std::io::Read;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use vertex_tree::{CollapseLog, Mesh};

use super::progress::stage;
use crate::mesh_io;
use crate::scene::Scene;
use crate::simplify;

/// One thing to work on.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Input {
    Scene(Scene),
    /// A hierarchy file.
    Log(PathBuf),
    /// A mesh, or the tiles of a mosaic.
    Meshes(Vec<PathBuf>),
}

impl Input {
    /// Sorts arguments into inputs, in order. All height tiles together are one mosaic.
    pub fn all(arguments: &[String]) -> Result<Vec<Self>> {
        let mut inputs = Vec::new();
        let mut tiles: Option<usize> = None;
        for argument in arguments {
            if argument.starts_with("scene:") {
                inputs.push(Self::Scene(Scene::parse(argument)?));
                continue;
            }
            let path = PathBuf::from(argument);
            if is_log(&path)? {
                inputs.push(Self::Log(path));
                continue;
            }
            if is_tile(&path) {
                if let Some(Self::Meshes(paths)) = tiles.and_then(|at| inputs.get_mut(at)) {
                    paths.push(path);
                    continue;
                }
                tiles = Some(inputs.len());
            }
            inputs.push(Self::Meshes(vec![path]));
        }
        Ok(inputs)
    }

    /// The one input that the arguments name.
    pub fn one(arguments: &[String]) -> Result<Self> {
        let mut inputs = Self::all(arguments)?;
        match (inputs.pop(), inputs.is_empty()) {
            (Some(input), true) => Ok(input),
            _ => bail!("one input is expected, not {}", arguments.join(" ")),
        }
    }

    /// A short name for tables and file names.
    pub fn name(&self) -> String {
        let stem =
            |path: &Path| path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        match self {
            Self::Scene(scene) => scene.to_string().trim_start_matches("scene:").to_owned(),
            Self::Log(path) => stem(path),
            Self::Meshes(paths) if paths.len() == 1 => stem(&paths[0]),
            Self::Meshes(paths) => format!("{}+{}", stem(&paths[0]), paths.len() - 1),
        }
    }

    /// The mesh itself.
    pub fn mesh(&self) -> Result<Mesh> {
        let name = self.name();
        match self {
            Self::Scene(scene) => stage(&format!("{name}: making the scene"), |p| Ok(scene.mesh(p))),
            Self::Log(path) => Ok(vertex_tree::read_log(path)?.mesh),
            Self::Meshes(paths) => Ok(stage(&format!("{name}: reading"), |p| mesh_io::read(paths, p))?),
        }
    }

    /// The hierarchy: read, or built. `None` as the report says that it was read.
    pub fn log(&self, merge_components: bool) -> Result<(CollapseLog, Option<simplify::Report>)> {
        if let Self::Log(path) = self {
            return Ok((vertex_tree::read_log(path)?, None));
        }
        let mesh = self.mesh()?;
        let options = simplify::Options {
            merge_components: merge_components
                || matches!(self, Self::Scene(scene) if scene.is_many_objects()),
        };
        let built = stage(&format!("{}: building the hierarchy", self.name()), |p| {
            simplify::build(mesh, &options, p)
        });
        let (log, report) = built.with_context(|| self.name())?;
        Ok((log, Some(report)))
    }
}

/// Whether a file starts like a hierarchy.
fn is_log(path: &Path) -> Result<bool> {
    let named = || path.display().to_string();
    let mut file = std::fs::File::open(path).with_context(named)?;
    if file.metadata().with_context(named)?.is_dir() {
        bail!("{}: is a folder", path.display());
    }
    let mut start = [0; 8];
    match file.read_exact(&mut start) {
        Ok(()) => Ok(&start == b"FFCOLLOG"),
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(e).with_context(named),
    }
}

fn is_tile(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("hgt"))
}
