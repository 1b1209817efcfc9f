//! How a picture is drawn.

/// Images are at most this many pixels wide or high.
pub(super) const LARGEST: u32 = 8192;

/// How a picture is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Style {
    /// Width in pixels, from 1 to 8192; the height follows from the camera's aspect ratio, within the same limits.
    pub width: u32,
    /// How light falls on the triangles.
    pub shading: Shading,
    /// Whether the edges of triangles are drawn. They fade where triangles are only a few pixels high.
    pub wires: bool,
}

impl Default for Style {
    fn default() -> Self {
        Self { width: 1280, shading: Shading::Flat, wires: true }
    }
}

/// How light falls on the triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shading {
    /// Each by its own normal: shows the triangles.
    Flat,
    /// By normals at the vertices, averaged over the triangles around: shows the shape.
    Smooth,
}
