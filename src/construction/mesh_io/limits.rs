//! How much is read.

/// Every vertex number, and the number of vertices, is below [`NONE`](vertex_tree::NONE).
pub(super) const MAX_VERTICES: usize = vertex_tree::NONE as usize - 1;

/// Corners of a face. Ear clipping is quadratic at worst.
pub(super) const MAX_CORNERS: usize = 1 << 14;

/// Greatest width and height of a mosaic, in degrees.
pub(super) const MAX_SPAN: i32 = 20;
