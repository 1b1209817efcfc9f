//! What every backend and strategy has to do: follow the brute-force cut in every frame.
//!
//! It may use `selection`, `vertex-tree` and the collapse log. What must never be in it: a backend, or anything that the cut it
//! judges was found with.

pub mod brute_force;
pub mod conformance;
pub mod cut;
pub mod oracle;
pub mod strict_mesh;
pub mod walk;

pub use conformance::{conforms, conforms_with_mesh};
pub use selection;
pub use vertex_tree;

#[cfg(test)]
mod tests;

#[cfg(doctest)]
#[doc = include_str!("README.md")]
struct Readme;
