//! Event-driven view-dependent level of detail.

pub mod mesh_io;
pub mod path;
pub mod progress;
pub mod scene;
pub mod simplify;
pub mod view;

pub use vertex_tree;
pub use vertex_tree::{Bounds, Collapse, CollapseLog, Mesh, NodeId};
