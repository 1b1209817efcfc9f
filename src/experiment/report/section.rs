//! All about one scene in one backend.

use std::time::Duration;

use crate::experiment::compare::Run;
use crate::experiment::store::Backend;

/// A picture with what it shows.
#[derive(Clone, Debug)]
pub struct Picture {
    /// One sentence.
    pub caption: String,
    /// The picture, as a PNG file.
    pub png: Vec<u8>,
}

/// All about one scene in one backend.
#[derive(Clone, Debug)]
pub struct Section {
    /// A name that no other section has.
    pub name: String,
    /// What was looked at.
    pub scene: String,
    /// The name of the backend in which the hierarchy was kept, or a word for several.
    pub backend: &'static str,
    /// Triangles of the input; 0 where they were not counted.
    pub triangles: u64,
    /// Size of the hierarchy's file.
    pub file_bytes: Option<u64>,
    /// What making the collapse log took, and what writing it for the backend did.
    pub simplification: Option<Duration>,
    /// See [`Self::simplification`].
    pub writing: Option<Duration>,
    /// Figures of the hierarchy, as name and value.
    pub facts: Vec<(&'static str, String)>,
    /// Every strategy and every way to prefetch along every path, the strategies of one path and way together.
    pub runs: Vec<Run>,
    /// What it looks like.
    pub pictures: Vec<Picture>,
}

impl Section {
    /// With nothing but its runs.
    #[must_use]
    pub fn new(scene: &str, backend: &'static str, runs: Vec<Run>) -> Self {
        Self {
            name: scene.to_owned(),
            scene: scene.to_owned(),
            backend,
            triangles: 0,
            file_bytes: None,
            simplification: None,
            writing: None,
            facts: Vec::new(),
            runs,
            pictures: Vec::new(),
        }
    }

    /// The strategies of each path and way to prefetch.
    pub(super) fn replays(&self) -> impl Iterator<Item = &[Run]> {
        self.runs.chunk_by(|a, b| a.path == b.path && a.prefetch == b.prefetch)
    }

    pub(super) fn title(&self, runs: &[Run]) -> String {
        let prefetch = match self.backend {
            backend if backend == Backend::InMemory.name() => String::new(),
            _ => format!(", prefetch {}", runs[0].prefetch.name()),
        };
        format!("{}, {}, path {}{prefetch}", self.scene, self.backend, runs[0].path)
    }
}
