//! Event-driven view-dependent level of detail.

pub mod bvh;
pub mod cut;
pub mod deviation;
mod frustum;
pub mod mesh_io;
mod parallel;
pub mod path;
#[cfg(feature = "cli")]
pub mod plot;
pub mod render;
pub mod scene;
pub mod simplify;
pub mod view;

pub use vertex_tree;
pub use vertex_tree::{Bounds, Collapse, CollapseLog, Mesh, NodeId};
