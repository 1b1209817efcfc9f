//! The objects of a `.scene` file, opened: every object a tree of the partitioned multi-triangulation, all of them with one
//! memory budget and one reader.
//!
//! Objects that name the same file share what is in memory of its tables, not its nodes: each has a cut of its own.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use mt_partition::{MtError, MtFile, MtTree, Reader};
use rustc_hash::FxHashMap;
use vertex_tree::NullSink;
use vertex_tree::source::FileSource;

use super::{Objects, ObjectsError, Placement, SceneFileError, read_scene};
use crate::engine::{FrameReport, Settings};
use crate::view::View;

/// A scene can not be opened or replayed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoredSceneError {
    /// The scene file.
    #[error(transparent)]
    Scene(#[from] SceneFileError),
    /// A file that it names can not be read.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file that it names is damaged, or of another backend.
    #[error(transparent)]
    File(#[from] MtError),
    /// An object can not go on.
    #[error(transparent)]
    Objects(#[from] ObjectsError),
}

/// The files of a scene, and where its objects are.
#[derive(Clone, Debug)]
pub struct StoredScene {
    files: Vec<Arc<MtFile>>,
    /// Of each object, which file, and where it is placed.
    objects: Vec<(usize, Placement)>,
}

/// Rounds of waiting for the pages of a frame. A frame that has not all of them by then goes on without.
const ROUNDS: usize = 1000;

impl StoredScene {
    /// Reads a scene file and opens the files that it names, each once.
    ///
    /// # Errors
    /// What can not be read.
    pub fn open(path: &Path) -> Result<Self, StoredSceneError> {
        let mut scene = Self { files: Vec::new(), objects: Vec::new() };
        let mut known: FxHashMap<PathBuf, usize> = FxHashMap::default();
        for (file, placement) in read_scene(path)? {
            let number = match known.get(&file) {
                Some(&number) => number,
                None => {
                    let io = |source| StoredSceneError::Io { file: file.clone(), source };
                    scene.files.push(Arc::new(MtFile::open(Arc::new(FileSource::open(&file).map_err(io)?))?));
                    known.insert(file, scene.files.len() - 1);
                    scene.files.len() - 1
                }
            };
            scene.objects.push((number, placement));
        }
        Ok(scene)
    }

    /// The files, each once.
    #[must_use]
    pub fn files(&self) -> &[Arc<MtFile>] {
        &self.files
    }

    /// Of each object, the number of its file and where it is placed.
    #[must_use]
    pub fn objects(&self) -> &[(usize, Placement)] {
        &self.objects
    }

    /// Bytes of memory that the objects need at least, as they share it.
    #[must_use]
    pub fn least_memory(&self) -> u64 {
        self.files.iter().map(|file| file.least_memory()).max().unwrap_or(0)
    }

    /// Trees for all objects, which share the memory of `paging`, and its reader or else a thread.
    ///
    /// # Errors
    /// [`MtError::Memory`] if it is too little, and what the trees report.
    pub fn trees(
        &self,
        settings: Settings,
        paging: &mt_partition::Settings,
    ) -> Result<Objects<MtTree, NullSink>, StoredSceneError> {
        let thread = |source| StoredSceneError::Io { file: PathBuf::new(), source };
        let reader = paging.reader.clone().map_or_else(|| Reader::new().map_err(thread), Ok)?;
        let paging = mt_partition::Settings { reader: Some(reader), ..paging.clone() };
        let parts: Vec<_> = self
            .objects
            .iter()
            .map(|&(file, placement)| {
                Ok((MtTree::new(self.files[file].clone(), paging.clone())?, NullSink, placement))
            })
            .collect::<Result<_, MtError>>()?;
        Ok(Objects::new(parts, settings)?)
    }

    /// Replays views of the scene. Without a time for a frame, each waits for its pages, and what all of its advances did
    /// is reported as one; otherwise so much virtual time passes before each.
    ///
    /// # Errors
    /// See [`trees`](Self::trees).
    pub fn replay(
        &self,
        views: &[View],
        settings: Settings,
        paging: &mt_partition::Settings,
        frame_time: Option<Duration>,
    ) -> Result<Vec<FrameReport>, StoredSceneError> {
        let mut objects = self.trees(settings, paging)?;
        let mut reports = Vec::with_capacity(views.len());
        for (frame, view) in views.iter().enumerate() {
            let views = std::slice::from_ref(view);
            // A viewer shows nothing before it has what its first frame needs.
            let is_settled = frame == 0 || frame_time.is_none();
            if let Some(time) = frame_time.filter(|_| frame > 0) {
                objects.pass(time)?;
            }
            let mut all = objects.advance(views)?;
            for _ in 0..ROUNDS {
                if !is_settled || all.misses == 0 {
                    break;
                }
                objects.settle()?;
                let report = objects.advance(views)?;
                all = all.followed_by(&report);
            }
            reports.push(all);
        }
        Ok(reports)
    }
}
