//! XFastMesh: half-edge collapses in detail blocks, paged from disk.
//!
//! After DeCoro & Pajarola, XFastMesh: Fast View-dependent Meshing from External Memory, 2002.
//!
//! ```
//! # use std::sync::Arc;
//! # use foldfront_detail_block::{BuildOptions, Settings, XfmFile, XfmTree};
//! # use page_store::source::FileSource;
//! # use collapse_log::CollapseLog;
//! # use vertex_tree::{NullSink, Hierarchy, VertexTree};
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let (log, folder) = (CollapseLog::default(), tempfile::tempdir()?);
//! # let path = &folder.path().join("empty.xfm");
//! foldfront_detail_block::write(path, &log, &BuildOptions::default())?; // once a model
//! let file = Arc::new(XfmFile::open(Arc::new(FileSource::open(path)?))?); // once a process
//! let mut tree = XfmTree::new(file, Settings::default())?; // once a viewer
//! tree.base_mesh(&mut NullSink)?;
//! # Ok(())
//! # }
//! ```
//!
//! The merge-tree forest is cut into complete subtrees of a few levels, the detail blocks, which are packed in the file and
//! loaded one by one (the file: `format`; numbers: `numbering`; building: [`write()`]). The displayed mesh is one of directed
//! half-edges that vertex splits and half-edge collapses change ([`XfmTree`]). A block stays in memory while something in it
//! is active, and goes when quotas say so, the least recently used first.

mod arrange;
mod arrangement;
mod block;
mod blocks;
mod build;
mod cone;
mod error;
mod file;
mod foresight;
mod format;
mod half_edges;
mod header;
mod layout;
mod nesting;
mod node;
mod node_memory;
mod numbering;
mod options;
mod paging;
mod quantize;
mod removal;
mod renumber;
mod replay;
mod returns;
mod settings;
mod shown;
mod step;
mod storage;
mod stored;
mod surface;
mod tables;
mod tree;
mod vector;
mod verify;
mod waiting;
mod well_formed;
mod writing;

#[cfg(test)]
mod tests;

pub use arrangement::Arrangement;
pub use build::{needed_bytes, needed_disk_bytes, write, write_within};
pub use collapse_log;
pub use collapse_log::external::{Workspace, WorkspaceError};
pub use container::FileError;
pub use error::XfmError;
pub use file::XfmFile;
pub use format::MAGIC;
pub use options::{BuildOptions, WriteReport};
pub use page_store;
pub use paging::{ATTEMPTS, PagingCounts};
pub use returns::SOON;
pub use settings::{Io, Settings};
pub use tree::XfmTree;
pub use vertex_tree;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
