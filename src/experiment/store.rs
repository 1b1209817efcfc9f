//! Hierarchies in files, whatever the backend: built, opened, described and verified under one name.

mod any_tree;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use collapse_log::{
    CollapseLog, LogError, LogFile, LogFileError, LogSource, read_log, write_log, write_log_from,
};
use container::Georeference;
use detail_block::{XfmError, XfmFile, XfmTree};
use in_memory::{InMemoryHierarchy, InMemoryTree};
use meta_node::{Dependencies, MetaNodeError, MetaNodeFile, MetaNodeTree};
use mt_partition::{MtError, MtFile, MtTree};
use page_store::source::{FileSource, PageSource};

pub use any_tree::{AnyTree, TreeSettings};

/// Where a hierarchy is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Backend {
    /// The whole hierarchy resident, from a collapse log.
    InMemory,
    /// Meta-node trees (El-Sana & Chiang).
    MetaNode,
    /// XFastMesh (DeCoro & Pajarola).
    DetailBlock,
    /// A partitioned multi-triangulation (Holst & Schumann).
    MtPartition,
}

impl Backend {
    /// All of them, in the order of reports.
    pub const ALL: [Self; 4] = [Self::InMemory, Self::MetaNode, Self::DetailBlock, Self::MtPartition];

    /// The name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::InMemory => "in-memory",
            Self::MetaNode => "meta-node",
            Self::DetailBlock => "detail-block",
            Self::MtPartition => "mt-partition",
        }
    }

    /// Whether a node may wait for one that is neither above nor below it, where meta-nodes have this rule.
    #[must_use]
    pub fn has_dependencies(self, of_meta_nodes: Dependencies) -> bool {
        match self {
            Self::InMemory | Self::MtPartition => false,
            Self::MetaNode => of_meta_nodes != Dependencies::Off,
            Self::DetailBlock => true,
        }
    }

    /// The backend whose files start with these bytes.
    #[must_use]
    pub fn of_magic(magic: [u8; 8]) -> Option<Self> {
        match magic {
            meta_node::MAGIC => Some(Self::MetaNode),
            detail_block::MAGIC => Some(Self::DetailBlock),
            mt_partition::MAGIC => Some(Self::MtPartition),
            _ if &magic == b"FFCOLLOG" => Some(Self::InMemory),
            _ => None,
        }
    }
}

/// How to write a hierarchy, in the terms of each backend.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BuildOptions {
    /// Levels of the binary tree in a meta-node or a detail block.
    pub levels: Option<u32>,
    /// Whether nodes of detail blocks are quantised.
    pub quantize: bool,
    /// Triangles that the arcs of a multi-triangulation hold on average.
    pub patch: Option<f64>,
    /// Most nodes in a partition.
    pub partition: Option<u32>,
}

impl From<&BuildOptions> for mt_partition::BuildOptions {
    fn from(options: &BuildOptions) -> Self {
        let mut build = Self::default();
        build.patch = options.patch.unwrap_or(build.patch);
        build.partition = options.partition.unwrap_or(build.partition);
        build
    }
}

/// A hierarchy could not be written, opened or verified.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The operating system said no.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is none that `build` wrote.
    #[error("{}: no hierarchy", file.display())]
    Foreign {
        /// The file.
        file: PathBuf,
    },
    /// There is not as much room for temporary files as will be needed.
    #[error(
        "temporary files in {}: about {} MB will be needed for a file of {}, {} MB are free",
        folder.display(), needed >> 20, backend.name(), free >> 20
    )]
    Room {
        /// The backend.
        backend: Backend,
        /// Where they are made.
        folder: PathBuf,
        /// Bytes, as estimated.
        needed: u64,
        /// Bytes.
        free: u64,
    },
    /// A collapse log is damaged.
    #[error(transparent)]
    LogFile(#[from] LogFileError),
    /// A collapse log does not make sense.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A file of meta-nodes.
    #[error(transparent)]
    MetaNode(#[from] MetaNodeError),
    /// A file of detail blocks.
    #[error(transparent)]
    DetailBlock(#[from] XfmError),
    /// A file of partitions.
    #[error(transparent)]
    MtPartition(#[from] MtError),
}

/// A hierarchy that trees can be opened from.
#[derive(Clone)]
pub enum Store {
    /// With the log that it came from.
    InMemory(Arc<InMemoryHierarchy>, Arc<CollapseLog>),
    /// See [`Backend::MetaNode`].
    MetaNode(Arc<MetaNodeFile>),
    /// See [`Backend::DetailBlock`].
    DetailBlock(Arc<XfmFile>),
    /// See [`Backend::MtPartition`].
    MtPartition(Arc<MtFile>),
}

/// Writes a log as the file of a backend, whole or not at all.
///
/// # Errors
/// What the backend says.
pub fn write(
    backend: Backend,
    file: &Path,
    log: &CollapseLog,
    options: &BuildOptions,
) -> Result<(), StoreError> {
    match backend {
        Backend::InMemory => write_log(file, log)?,
        Backend::MetaNode => {
            let options = meta_node::BuildOptions { levels: options.levels, ..Default::default() };
            meta_node::write(file, log, &options)?;
        }
        Backend::DetailBlock => {
            let mut build = detail_block::BuildOptions { quantize: options.quantize, ..Default::default() };
            build.levels = options.levels.unwrap_or(build.levels);
            detail_block::write(file, log, &build)?;
        }
        Backend::MtPartition => {
            mt_partition::write(file, log, &options.into())?;
        }
    }
    Ok(())
}

/// The limits of [`write_within`].
#[derive(Clone, Debug)]
pub struct WriteLimits<'a> {
    /// Bytes of memory.
    pub memory: u64,
    /// Where temporary files are made.
    pub temporary: PathBuf,
    /// Set by whoever wants it to end.
    pub stop: &'a AtomicBool,
}

impl WriteLimits<'_> {
    /// Fails if so many bytes of temporary files will not fit.
    fn check_room(&self, backend: Backend, needed: u64) -> Result<(), StoreError> {
        match fs4::available_space(&self.temporary) {
            Ok(free) if free < needed => {
                Err(StoreError::Room { backend, folder: self.temporary.clone(), needed, free })
            }
            // Where nobody can say, it will be seen.
            _ => Ok(()),
        }
    }
}

/// Writes a log that is in a file as the file of a backend, whole or not at all, within limits.
///
/// # Errors
/// [`StoreError::Room`], and what the backend says.
pub fn write_within(
    backend: Backend,
    file: &Path,
    log: &LogFile,
    options: &BuildOptions,
    limits: &WriteLimits<'_>,
) -> Result<(), StoreError> {
    let counts = log.counts();
    match backend {
        Backend::InMemory => {
            let (positions, triangles) = (log.positions(), log.triangles());
            write_log_from(file, counts, log.georeference(), positions, triangles, log.collapses())?;
        }
        Backend::MetaNode => {
            let options = meta_node::BuildOptions { levels: options.levels, ..Default::default() };
            // What the writer needs beside its workspace.
            let memory = limits.memory.saturating_sub(7 * counts.vertices);
            let workspace =
                meta_node::Workspace { folder: limits.temporary.clone(), memory, stop: limits.stop };
            meta_node::write_within(file, log, &options, &workspace)?;
        }
        Backend::DetailBlock => {
            let mut build = detail_block::BuildOptions { quantize: options.quantize, ..Default::default() };
            build.levels = options.levels.unwrap_or(build.levels);
            if limits.memory < detail_block::needed_bytes(counts.vertices, counts.triangles) {
                let needed = detail_block::needed_disk_bytes(counts.vertices, counts.triangles);
                limits.check_room(backend, needed)?;
            }
            let workspace = detail_block::Workspace {
                folder: limits.temporary.clone(),
                memory: limits.memory,
                stop: limits.stop,
            };
            detail_block::write_within(file, log, &build, &workspace)?;
        }
        Backend::MtPartition => {
            let (memory, folder) = (limits.memory, limits.temporary.clone());
            let workspace = mt_partition::Workspace { folder, memory, stop: limits.stop };
            mt_partition::write_within(file, log, &options.into(), &workspace)?;
        }
    }
    Ok(())
}

/// Opens a file that `build` wrote, and a tree over it.
///
/// # Errors
/// As for [`Store::open`] and [`Store::tree`].
pub fn open(file: &Path, settings: &TreeSettings) -> Result<AnyTree, StoreError> {
    Store::open(file)?.tree(settings)
}

impl Store {
    /// A tree that is wholly folded. Trees over one store share what is in memory of its tables, and whatever their settings have them
    /// share.
    ///
    /// # Errors
    /// What the backend says.
    pub fn tree(&self, settings: &TreeSettings) -> Result<AnyTree, StoreError> {
        Ok(match self {
            Self::InMemory(hierarchy, _) => AnyTree::InMemory(InMemoryTree::new(hierarchy.clone())),
            Self::MetaNode(file) => AnyTree::MetaNode(MetaNodeTree::new(file.clone(), settings.meta_node)?),
            Self::DetailBlock(file) => {
                AnyTree::DetailBlock(XfmTree::new(file.clone(), settings.detail_block)?)
            }
            Self::MtPartition(file) => {
                AnyTree::MtPartition(MtTree::new(file.clone(), settings.mt_partition.clone())?)
            }
        })
    }

    /// Arranges a log for the in-memory tree.
    ///
    /// # Errors
    /// [`StoreError::Log`].
    pub fn in_memory(log: Arc<CollapseLog>) -> Result<Self, StoreError> {
        Ok(Self::InMemory(Arc::new(InMemoryHierarchy::new(&log)?), log))
    }

    /// Opens a file that `build` wrote.
    ///
    /// # Errors
    /// [`StoreError::Foreign`], and what is wrong with the file.
    pub fn open(file: &Path) -> Result<Self, StoreError> {
        let io = |source| StoreError::Io { file: file.to_owned(), source };
        let source = FileSource::open(file).map_err(io)?;
        let mut magic = [0; 8];
        let backend = match source.read_at(0, &mut magic) {
            Ok(()) => Backend::of_magic(magic),
            Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => None,
            Err(e) => return Err(io(e)),
        };
        let source: Arc<dyn PageSource> = Arc::new(source);
        match backend {
            None => Err(StoreError::Foreign { file: file.to_owned() }),
            Some(Backend::InMemory) => Self::in_memory(Arc::new(read_log(file)?)),
            Some(Backend::MetaNode) => Ok(Self::MetaNode(Arc::new(MetaNodeFile::open(source)?))),
            Some(Backend::DetailBlock) => Ok(Self::DetailBlock(Arc::new(XfmFile::open(source)?))),
            Some(Backend::MtPartition) => Ok(Self::MtPartition(Arc::new(MtFile::open(source)?))),
        }
    }

    /// Opens what a paging backend wrote, wherever it is kept. Collapse logs are read from files alone.
    ///
    /// # Errors
    /// [`StoreError::Foreign`], and what is wrong with it.
    pub fn from_source(source: Arc<dyn PageSource>) -> Result<Self, StoreError> {
        let file = PathBuf::from(source.name());
        let mut magic = [0; 8];
        source.read_at(0, &mut magic).map_err(|source| StoreError::Io { file: file.clone(), source })?;
        match Backend::of_magic(magic) {
            None | Some(Backend::InMemory) => Err(StoreError::Foreign { file }),
            Some(Backend::MetaNode) => Ok(Self::MetaNode(Arc::new(MetaNodeFile::open(source)?))),
            Some(Backend::DetailBlock) => Ok(Self::DetailBlock(Arc::new(XfmFile::open(source)?))),
            Some(Backend::MtPartition) => Ok(Self::MtPartition(Arc::new(MtFile::open(source)?))),
        }
    }

    /// The backend that it is for.
    #[must_use]
    pub fn backend(&self) -> Backend {
        match self {
            Self::InMemory(..) => Backend::InMemory,
            Self::MetaNode(_) => Backend::MetaNode,
            Self::DetailBlock(_) => Backend::DetailBlock,
            Self::MtPartition(_) => Backend::MtPartition,
        }
    }

    /// What is in a paging backend's file, as name and value; nothing for a log, which speaks for itself.
    #[must_use]
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        match self {
            Self::InMemory(..) => Vec::new(),
            Self::MetaNode(file) => file.facts(),
            Self::DetailBlock(file) => file.facts(),
            Self::MtPartition(file) => file.facts(),
        }
    }

    /// Where the mesh lies in the world.
    #[must_use]
    pub fn georeference(&self) -> Georeference {
        match self {
            Self::InMemory(_, log) => &log.mesh.georeference,
            Self::MetaNode(file) => file.georeference(),
            Self::DetailBlock(file) => file.georeference(),
            Self::MtPartition(file) => file.georeference(),
        }
        .clone()
    }

    /// Triangles of the input.
    #[must_use]
    pub fn triangles(&self) -> u64 {
        if let Self::InMemory(_, log) = self {
            return log.mesh.triangles.len() as u64;
        }
        // Each of the files says so among its facts.
        let facts = self.facts();
        facts
            .iter()
            .find(|(name, _)| *name == "triangles")
            .and_then(|(_, value)| value.parse().ok())
            .unwrap_or(0)
    }

    /// Reads and checks every page.
    ///
    /// # Errors
    /// What is wrong.
    pub fn verify(&self) -> Result<(), StoreError> {
        match self {
            Self::InMemory(..) => {}
            Self::MetaNode(file) => file.verify()?,
            Self::DetailBlock(file) => file.verify()?,
            Self::MtPartition(file) => file.verify()?,
        }
        Ok(())
    }
}
