//! Event-driven view-dependent level of detail.

pub mod active_mesh;
pub mod budget;
pub mod bvh;
#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "cli")]
pub mod compare;
pub mod criterion;
pub mod cut;
pub mod deviation;
pub mod engine;
mod filter;
pub mod front;
mod frustum;
pub mod mesh_io;
pub mod motion;
pub mod oracle;
pub mod output;
mod packed;
mod parallel;
pub mod path;
#[cfg(feature = "cli")]
pub mod plot;
pub mod progress;
pub mod queue;
pub mod refine;
pub mod render;
#[cfg(feature = "cli")]
pub mod report;
pub mod scene;
pub mod simplify;
pub mod view;

pub use vertex_tree;
pub use vertex_tree::{Bounds, Collapse, CollapseLog, Mesh, NodeId};
