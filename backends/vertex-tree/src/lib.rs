//! The vocabulary that the engine and every storage backend share.
//!
//! A mesh is simplified once, by half-edge collapses, into a forest of vertex merges. The engine keeps an **active
//! front** through that forest; a **backend** stores the forest and answers for it through [`VertexTree`]. This
//! crate holds the trait, the types in its signatures, and the [`CollapseLog`] that every backend is built from.
//! It decides nothing about paging. A backend depends on this crate alone.
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
mod curve;
mod error;
pub mod external;
mod georeference;
mod hierarchy;
mod leaf_map;
mod leaf_set;
mod log;
mod log_file;
mod log_source;
mod look_ahead;
mod mesh;
pub mod output;
mod paging;
mod prefetch;
pub mod sections;
pub mod simulated;
mod sink;
pub mod source;
mod star_mesh;
mod stars;
mod tree;

pub use bounds::{Bounds, NormalCone};
pub use curve::z_order;
pub use error::TreeError;
pub use georeference::{DegreeMap, Georeference, Rounding};
pub use hierarchy::{Hierarchy, NodeId, Refine, Step};
pub use log::{Collapse, CollapseLog, Forest, LogError, NONE};
pub use log_file::{LogCounts, LogFileError, log_file_version, read_log, write_log, write_log_from};
pub use log_source::{LogFile, LogSource, Records};
pub use look_ahead::LookAhead;
pub use mesh::Mesh;
pub use paging::{PageStats, Prefetch};
pub use prefetch::prefetch;
pub use sink::{MeshSink, NullSink, TriangleId, VertexId};
pub use star_mesh::{LeafTriangle, StarMesh};
pub use tree::VertexTree;
