//! Selection: which nodes of a hierarchy are refined for the cameras of a frame, found by testing a node only when the camera
//! could have changed the answer.
//!
//! The [`engine`] works over any [`Hierarchy`](vertex_tree::Hierarchy) that can [`Refine`](vertex_tree::Refine) into a sink, with
//! a strategy of [`refine`]: the event [`queue`], a scan of the [`front`], or top-down. [`active_mesh`] is a sink with vertex and index buffers.
//!
//! It may use `vertex-tree` and nothing else of the workspace. What must never be in it: files, threads, clocks, the platform's
//! mathematical library, a mesh, a backend.

#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod active_mesh;
pub mod budget;
mod carried;
pub mod clock;
pub mod criterion;
pub mod engine;
mod filter;
mod foresight;
pub mod front;
pub mod in_play;
pub mod motion;
pub mod normal_cone;
pub mod objects;
mod packed;
pub mod queue;
pub mod refine;
pub mod settled;
pub mod view;
mod waiting;

pub use glam;
pub use vertex_tree;

#[cfg(doctest)]
#[doc = include_str!("README.md")]
struct Readme;
