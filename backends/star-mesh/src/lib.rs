//! The displayed mesh of a tree whose leaves are numbered depth-first: what a backend keeps to report changes.
//!
//! A corner of a triangle belongs to an input vertex, that is, to a leaf, and is shown at the vertex that stands for
//! the subtree the leaf is in. If leaves are numbered so that every subtree is an interval that starts with the leaf
//! whose vertex stands for it (a collapse keeps the place of its kept vertex), then
//!
//! * when a node splits, a corner stays or moves by one comparison with the first leaf of the removed side;
//! * the vertex at which a new triangle's far corner is shown is the nearest shown vertex at or below its leaf: a
//!   look-up in a set of leaves, not a walk along parents;
//! * the triangles that disappear when a node folds are those that its split has brought.
//!
//! Vertices and triangles live in slots that are used again, so everything here is as large as the displayed mesh and
//! not as the hierarchy. A triangle is half a cache line, the corners at a vertex are another.
//!
//! Changes of status are noted, and the mesh [follows](StarMesh::update) all those of a frame together, so that the misses of many
//! overlap.

mod leaf_map;
mod leaf_set;
mod leaf_triangle;
mod star_mesh;
mod stars;

pub use leaf_triangle::LeafTriangle;
pub use star_mesh::StarMesh;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
