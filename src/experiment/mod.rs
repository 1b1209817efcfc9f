//! The laboratory: scenes and paths, strategies and backends compared along them, and what is reported of it.
//!
//! It may use every other room but `cli`, and every backend. It reads and writes files, takes the time and works on all cores. What must
//! never be in it: anything that an embedder's frame needs, or a decision about a node.

pub mod bvh;
pub mod compare;
pub mod deviation;
mod frustum;
pub mod path;
pub mod plot;
pub mod render;
pub mod report;
pub mod scene;
pub mod store;
pub mod stored_scene;
