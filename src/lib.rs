//! Event-driven view-dependent level of detail.

pub mod active_mesh;
pub mod budget;
pub mod criterion;
pub mod engine;
pub mod front;
pub mod mesh_io;
pub mod motion;
pub mod oracle;
pub mod path;
pub mod queue;
pub mod refine;
pub mod progress;
pub mod scene;
pub mod simplify;
pub mod view;

pub use vertex_tree;
pub use vertex_tree::{Bounds, Collapse, CollapseLog, Mesh, NodeId};
