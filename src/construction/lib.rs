//! Construction: meshes and terrain from files, and their simplification into the collapse log that every backend is built
//! from.
//!
//! It may use `collapse-log`, `container` and `vertex-tree`, the file system and every core. What must never be in it: a camera, a
//! backend, anything that happens in a frame.

mod edge_lengths;
pub mod mesh_io;
pub mod progress;
pub mod simplify;

#[cfg(doctest)]
#[doc = include_str!("README.md")]
struct Readme;
