//! What can be wrong with a scene, and in which line of its file.

use std::path::PathBuf;

use collapse_log::LogError;
use page_store::ThreadError;
use vertex_tree::TreeError;

use super::scene_file::SceneFileError;
use crate::experiment::store::StoreError;
use construction::mesh_io::MeshIoError;
use selection::view::ViewError;

/// A scene can not be opened or replayed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoredSceneError {
    /// The scene file.
    #[error(transparent)]
    Scene(#[from] SceneFileError),
    /// A file that it names can not be opened, or is damaged.
    #[error("{at}: {}", at.named(source))]
    File {
        /// Which object's.
        at: Box<ObjectLine>,
        /// Why.
        source: StoreError,
    },
    /// A file that it names is no hierarchy, and no mesh either.
    #[error("{at}: {}", at.named(source))]
    Mesh {
        /// Which object's.
        at: Box<ObjectLine>,
        /// Why.
        source: MeshIoError,
    },
    /// A mesh that it names can not be simplified.
    #[error("{at}: {}", at.named(source))]
    Build {
        /// Which object's.
        at: Box<ObjectLine>,
        /// Why.
        source: LogError,
    },
    /// A thread that reads can not be had.
    #[error(transparent)]
    Thread(#[from] ThreadError),
    /// An object can not go on.
    #[error("{at}: {}", at.named(source))]
    Tree {
        /// Which object.
        at: Box<ObjectLine>,
        /// Why.
        source: TreeError,
    },
    /// A view of the scene is none of an object.
    #[error("{at}: {}", at.named(source))]
    View {
        /// Which object.
        at: Box<ObjectLine>,
        /// What is wrong with the view.
        source: ViewError,
    },
}

/// Where an object comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObjectLine {
    /// The scene file.
    pub scene: PathBuf,
    /// The line there, counted from 1.
    pub line: usize,
    /// The file that it names.
    pub file: PathBuf,
}

impl ObjectLine {
    /// What is wrong, with the file in front, unless it says so itself.
    fn named(&self, what: &impl ToString) -> String {
        let (file, what) = (self.file.display().to_string(), what.to_string());
        if what.contains(&file) { what } else { format!("{file}: {what}") }
    }
}

impl std::fmt::Display for ObjectLine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: line {}", self.scene.display(), self.line)
    }
}
