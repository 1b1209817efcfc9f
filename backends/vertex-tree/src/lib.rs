//! The vocabulary that the engine and every storage backend share.
//!
//! A mesh is simplified once, by half-edge collapses, into a forest of vertex merges. The engine keeps an **active
//! front** through that forest; a **backend** stores the forest and answers for it through [`VertexTree`]. This
//! crate holds the trait and the types in its signatures. It decides nothing about paging, and knows of no file.
//!
//! Terms, as in Zach & Karner (2003):
//!
//! * an inner node of the forest is a collapse; it is **active** while it is unfolded, that is, while both of the
//!   vertices that it merged are (or have descendants that are) in the displayed mesh;
//! * a **boundary node** is folded, but all its structural parents are active: it can be unfolded next;
//! * an active node whose structural children are all folded is **collapsible**: it can be folded next.
//!
//! Leaves of the forest are the input vertices. They can not be unfolded and have no [`NodeId`].

mod bounds;
mod error;
mod georeference;
mod hierarchy;
mod paging;
mod prefetch;
mod sink;
mod sparse_table;
mod tree;

pub use bounds::{Bounds, NormalCone};
pub use error::TreeError;
pub use georeference::{DegreeMap, Georeference, Rounding};
pub use hierarchy::{Hierarchy, NodeId, Refine, Step};
pub use paging::{PageStats, Prefetch};
pub use prefetch::prefetch;
pub use sink::{MeshSink, NONE, NullSink, TriangleId, VertexId};
pub use sparse_table::SparseTable;
pub use tree::VertexTree;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
