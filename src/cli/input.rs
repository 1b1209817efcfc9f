//! What a command is given to work on: meshes, hierarchy files and built-in scenes.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use collapse_log::{CollapseLog, Mesh};
use container::temporary::Temporary;

use super::progress::stage;
use crate::experiment::compare::Subject;
use crate::experiment::scene::Scene;
use crate::experiment::store::{self, Backend, BuildOptions, Store};
use crate::experiment::stored_scene;
use construction::mesh_io;
use construction::simplify;

/// One thing to work on.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Input {
    Scene(Scene),
    /// A collapse log.
    Log(PathBuf),
    /// The file of a backend that pages.
    Stored(PathBuf),
    /// Several objects: a scene file.
    Objects(PathBuf),
    /// A mesh, or the tiles of a mosaic.
    Meshes(Vec<PathBuf>),
}

impl Input {
    /// Sorts arguments into inputs, in order. All height tiles together are one mosaic.
    pub fn all(arguments: &[PathBuf]) -> Result<Vec<Self>> {
        let mut inputs = Vec::new();
        let mut tiles: Option<usize> = None;
        for argument in arguments {
            if let Some(scene) = argument.to_str().filter(|name| name.starts_with("scene:")) {
                inputs.push(Self::Scene(Scene::parse(scene)?));
                continue;
            }
            let path = argument.clone();
            if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("scene")) {
                inputs.push(Self::Objects(path));
                continue;
            }
            match backend_of(&path)? {
                Some(Backend::InMemory) => {
                    inputs.push(Self::Log(path));
                    continue;
                }
                Some(_) => {
                    inputs.push(Self::Stored(path));
                    continue;
                }
                None => {}
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
    pub fn one(arguments: &[PathBuf]) -> Result<Self> {
        let mut inputs = Self::all(arguments)?;
        match (inputs.pop(), inputs.is_empty()) {
            (Some(input), true) => Ok(input),
            _ => {
                let all: Vec<_> = arguments.iter().map(|argument| argument.to_string_lossy()).collect();
                bail!("one input is expected, not {}", all.join(" "))
            }
        }
    }

    /// The files that it is read from.
    pub fn files(&self) -> Vec<PathBuf> {
        match self {
            Self::Scene(_) => Vec::new(),
            Self::Log(path) | Self::Stored(path) => vec![path.clone()],
            Self::Objects(path) => {
                // A scene file that can not be read is complained about when it is opened.
                let objects = stored_scene::read_scene(path).unwrap_or_default();
                objects.into_iter().map(|(file, _)| file).chain([path.clone()]).collect()
            }
            Self::Meshes(paths) => paths.clone(),
        }
    }

    /// The backends that it is replayed in where none is asked for.
    pub fn backends(&self) -> Result<Vec<Backend>> {
        match self {
            Self::Stored(path) => Ok(backend_of(path)?.into_iter().collect()),
            // A scene file that can not be read is complained about when it is opened, and so is what it names.
            Self::Objects(path) => {
                let objects = stored_scene::read_scene(path).unwrap_or_default();
                let backends = objects.iter().map(|(file, _)| match backend_of(file) {
                    Ok(backend) => backend.or(Some(Backend::InMemory)),
                    Err(_) => None,
                });
                Ok(backends.flatten().collect())
            }
            Self::Scene(_) | Self::Log(_) | Self::Meshes(_) => Ok(vec![Backend::InMemory]),
        }
    }

    /// A short name for tables and file names.
    pub fn name(&self) -> String {
        let stem =
            |path: &Path| path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        match self {
            Self::Scene(scene) => scene.to_string().trim_start_matches("scene:").to_owned(),
            Self::Log(path) | Self::Stored(path) | Self::Objects(path) => stem(path),
            Self::Meshes(paths) if paths.len() == 1 => stem(&paths[0]),
            Self::Meshes(paths) => format!("{}+{}", stem(&paths[0]), paths.len() - 1),
        }
    }

    /// The mesh itself.
    pub fn mesh(&self) -> Result<Mesh> {
        let name = self.name();
        match self {
            Self::Scene(scene) => stage(&format!("{name}: making the scene"), |p| Ok(scene.mesh(p))),
            Self::Log(path) => Ok(collapse_log::read_log(path)?.mesh),
            Self::Stored(path) => {
                let subject = Subject::of_store(&name, Store::open(path)?);
                Ok(stage(&format!("{name}: reading"), |_| subject.finest())?)
            }
            Self::Objects(path) => {
                bail!("{}: a scene of several objects is for compare only", path.display())
            }
            Self::Meshes(paths) => Ok(stage(&format!("{name}: reading"), |p| mesh_io::read(paths, p))?),
        }
    }

    /// The hierarchy: read, or built. `None` as the report says that it was read.
    pub fn log(&self, merge_components: bool) -> Result<(CollapseLog, Option<simplify::Report>)> {
        match self {
            Self::Log(path) => return Ok((collapse_log::read_log(path)?, None)),
            Self::Stored(path) => {
                bail!("{}: this is a hierarchy already; a mesh or a collapse log is expected", path.display())
            }
            _ => {}
        }
        let mesh = self.mesh()?;
        let mut options = simplify::Options::default();
        options.merge_components =
            merge_components || matches!(self, Self::Scene(scene) if scene.is_many_objects());
        let built = stage(&format!("{}: building the hierarchy", self.name()), |p| {
            simplify::build(mesh, &options, p)
        });
        let (log, report) = built.with_context(|| self.name())?;
        Ok((log, Some(report)))
    }
}

/// The backend whose hierarchy a file starts like, if it does.
fn backend_of(path: &Path) -> Result<Option<Backend>> {
    let named = || path.display().to_string();
    let metadata = std::fs::metadata(path).with_context(named)?;
    if metadata.is_dir() {
        bail!("{}: is a folder", path.display());
    }
    // Inputs are opened more than once: what has been read from a pipe is gone.
    if !metadata.is_file() {
        bail!("{}: is not a file", path.display());
    }
    let mut file = std::fs::File::open(path).with_context(named)?;
    let mut start = [0; 8];
    match file.read_exact(&mut start) {
        Ok(()) => Ok(Backend::of_magic(start)),
        Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Ok(None),
        Err(e) => Err(e).with_context(named),
    }
}

/// Something to replay, and what is known of it.
pub(super) struct Replayable {
    pub subject: Subject,
    /// Of the input, where it was simplified for this.
    pub built: Option<simplify::Report>,
    pub facts: Vec<(&'static str, String)>,
    /// The collapse log that it comes from, if not from a file of a backend that pages, which may be larger than memory.
    pub log: Option<Arc<CollapseLog>>,
    /// Size of its file, where that is known.
    pub file_bytes: Option<u64>,
    /// What writing its file took, where it has been written for this.
    pub writing: Option<Duration>,
    /// The folder of its file, where it has been written for this: to be kept as long as the subject.
    pub folder: Option<Temporary>,
}

impl Input {
    /// Opens the input under a name in each of these backends; in its own, if there are none. A mesh is simplified for that,
    /// with components merged if that is asked for.
    pub fn replayable(
        &self,
        name: &str,
        backends: &[Backend],
        options: &BuildOptions,
        merge_components: bool,
    ) -> Result<Vec<Replayable>> {
        if let Self::Stored(path) = self {
            let store = Store::open(path)?;
            let own = store.backend();
            if let Some(other) = backends.iter().find(|&&backend| backend != own) {
                bail!("{}: is for {}, not for {}", path.display(), own.name(), other.name());
            }
            let facts = store.facts();
            let subject = Subject::of_store(name, store);
            let file_bytes = Some(std::fs::metadata(path)?.len());
            let (log, folder) = (None, None);
            return Ok(vec![Replayable {
                subject,
                built: None,
                facts,
                log,
                file_bytes,
                writing: None,
                folder,
            }]);
        }
        let (log, built) = self.log(merge_components)?;
        let log = Arc::new(log);
        let backends = if backends.is_empty() { &[Backend::InMemory] } else { backends };
        let open = |&backend: &Backend| {
            // A log by itself need not be written to be replayed, only to be compared.
            let (mut store, mut folder, mut file_bytes, mut writing) = (None, None, None, None);
            if backends.len() > 1 || backend != Backend::InMemory {
                let temporary = Temporary::new()?;
                let file = temporary.file("hierarchy");
                let start = Instant::now();
                stage(&format!("{name}: writing for {}", backend.name()), |_| {
                    store::write(backend, &file, &log, options)
                })?;
                writing = Some(start.elapsed());
                file_bytes = Some(std::fs::metadata(&file)?.len());
                if backend != Backend::InMemory {
                    store = Some(Store::open(&file)?);
                    folder = Some(temporary);
                }
            }
            let store = store.map_or_else(|| Store::in_memory(log.clone()), Ok)?;
            let facts = store.facts();
            let subject = Subject::of_store(name, store);
            let (built, log) = (built.clone(), Some(log.clone()));
            Ok(Replayable { subject, built, facts, log, file_bytes, writing, folder })
        };
        backends.iter().map(open).collect()
    }
}

/// Whether a file is a tile of heights, or an archive of them.
fn is_tile(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("hgt") || e.eq_ignore_ascii_case("zip"))
}
