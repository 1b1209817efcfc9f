//! The reference backend: the whole hierarchy resident, nothing clever.
//!
//! ```
//! # use collapse_log::CollapseLog;
//! # use vertex_tree::{NullSink, Hierarchy, VertexTree};
//! # use foldfront_in_memory::{InMemoryHierarchy, InMemoryTree};
//! # use std::sync::Arc;
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let log = CollapseLog::default();
//! let hierarchy = Arc::new(InMemoryHierarchy::new(&log)?); // once a model
//! let mut tree = InMemoryTree::new(hierarchy); // once a viewer
//! tree.base_mesh(&mut NullSink)?;
//! # Ok(())
//! # }
//! ```

mod hierarchy;
mod tree;

pub use collapse_log;
pub use hierarchy::InMemoryHierarchy;
pub use tree::InMemoryTree;
pub use vertex_tree;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
