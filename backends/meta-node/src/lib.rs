//! Meta-node trees on disk, after El-Sana & Chiang, *External Memory View-Dependent Simplification* (2000), sections
//! 3.2 and 3.3.
//!
//! The vertex hierarchy is cut into blocks of a few levels, which fill the pages of a file. Navigation keeps the pages
//! around the front in place holders, a hard limit of memory; a thread of its own reads what is asked for. No frame waits
//! for it: a change whose page is missing is put off, and its page comes sooner than what is only likely to be needed.
//!
//! ```no_run
//! # use std::{path::Path, sync::Arc};
//! # use foldfront_meta_node::{BuildOptions, MetaNodeFile, MetaNodeTree, Settings};
//! # use collapse_log::CollapseLog;
//! # use page_store::source::FileSource;
//! # use vertex_tree::{NullSink, Hierarchy, VertexTree};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let log = CollapseLog::default();
//! let path = Path::new("dragon.fold");
//! foldfront_meta_node::write(path, &log, &BuildOptions::default())?; // once
//! let file = Arc::new(MetaNodeFile::open(Arc::new(FileSource::open(path)?))?); // once a model
//! let settings = Settings { page_memory: 16 << 20, ..Settings::default() };
//! let mut tree = MetaNodeTree::new(file, settings)?; // once a viewer
//! tree.base_mesh(&mut NullSink)?;
//! # Ok(())
//! # }
//! ```

// Test files are shared with those outside of the crate, who know it by this name.
#[cfg(test)]
extern crate self as meta_node;

mod arrange;
mod arranging;
mod blocking;
mod check;
mod dependencies;
mod error;
mod file;
mod format;
mod lists;
mod page;
mod pager;
mod settings;
mod stored;
mod subtree;
mod tables;
mod tree;
mod verify;
mod write;

#[cfg(test)]
mod tests;

pub use collapse_log;
pub use collapse_log::external::{Workspace, WorkspaceError};
pub use container::FileError;
pub use dependencies::Dependencies;
pub use error::MetaNodeError;
pub use file::MetaNodeFile;
pub use format::MAGIC;
pub use page_store;
pub use settings::{InUse, Io, Settings};
pub use tree::MetaNodeTree;
pub use vertex_tree;
pub use write::{BuildOptions, WriteReport, write, write_within};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
