//! A backend of foldfront: the partitioned multi-triangulation of Holst & Schumann (Memory-Efficient View-Dependent Level
//! of Detail of High-Detailed Meshes, 2007).
//!
//! ```
//! # use std::sync::Arc;
//! # use page_store::source::FileSource;
//! # use collapse_log::CollapseLog;
//! # use vertex_tree::{NullSink, Hierarchy, VertexTree};
//! # use foldfront_mt_partition::{BuildOptions, MtFile, MtTree, Settings, write};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("example.mt");
//! # let log = CollapseLog::default();
//! write(&path, &log, &BuildOptions::default())?; // once a model
//! let file = Arc::new(MtFile::open(Arc::new(FileSource::open(&path)?))?);
//! let mut tree = MtTree::new(file, Settings::default())?; // once a viewer
//! tree.base_mesh(&mut NullSink)?;
//! # Ok(())
//! # }
//! ```
//!
//! A collapse of the log is a node of a directed acyclic graph; an arc from one node to another holds the triangles that
//! the lower one makes and the upper one takes away (`build::versions`). Nodes are merged until arcs hold about ten triangles
//! (`reduce`), laid out in partitions (`partition`), and written to a file that keeps patches with their nodes
//! (`format`, `record`). At run time the displayed mesh is a set of arcs (`display`); nodes are read by a
//! thread (`reader`) and let go of by one of five modes (`cache`).
//!
//! When to prefer it: where drawing and selection should handle patches and not single triangles, and where many objects
//! share little memory. When not: a node of this graph stands for a dozen collapses, so the cut is coarser, and shows more
//! triangles for the same error.

mod bounds;
mod build;
mod cache;
mod display;
mod error;
mod file;
mod format;
mod graph;
mod layout;
mod memory;
mod opening;
mod options;
mod order;
mod paging;
mod partition;
mod reader;
mod record;
mod reduce;
mod residents;
mod strips;
mod tree;
mod verify;

pub use build::{LEAST_MEMORY, WriteReport, write, write_within};
pub use cache::CacheMode;
pub use collapse_log;
pub use collapse_log::external::{Workspace, WorkspaceError};
pub use container::FileError;
pub use error::MtError;
pub use file::{MtFile, StoredNode};
pub use format::MAGIC;
pub use memory::Memory;
pub use options::BuildOptions;
pub use page_store;
pub use partition::QueueOrder;
pub use reader::Reader;
pub use tree::{MtTree, Settings};
pub use vertex_tree;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
