//! What the nesting of bounds is told of a collapse.

use crate::half_edges::{Adjacent, HalfEdge};

/// A collapse about to be made.
pub(crate) struct Step<'a> {
    pub removed: u32,
    pub kept: u32,
    pub children: [u32; 2],
    /// The half-edges to the kept vertex and back.
    pub edge: [HalfEdge; 2],
    pub adjacent: Adjacent,
    /// The half-edges that start at the removed vertex in triangles that remain.
    pub fan: &'a [HalfEdge],
    pub far: [u32; 2],
    pub eps: f32,
}
