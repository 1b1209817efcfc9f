//! Where a backend reports how the displayed mesh changes.

/// Slot of a displayed vertex. The backend hands slots out densely and uses those of vertices that have disappeared
/// again, so a sink can index arrays by them that are no longer than the displayed mesh once was.
pub type VertexId = u32;

/// Stands for "no node", "no vertex" and "no triangle" in arrays of their numbers.
pub const NONE: u32 = u32::MAX;

/// Slot of a displayed triangle, likewise. A backend may move a triangle to another slot: it disappears and appears.
pub type TriangleId = u32;

/// Receives the changes of the displayed mesh, one call a change, in an order in which they can be applied: a
/// vertex is added before a triangle uses it and removed after the last triangle has let go of it.
///
/// A renderer can implement this to patch its buffers directly.
pub trait MeshSink {
    /// Whether the sink wants any of the calls below. A backend need not even keep track of the displayed
    /// triangles for a sink that does not. It must not vary between the calls to one tree.
    const KEEPS_MESH: bool = true;

    /// Starts to read what is kept of a triangle into the cache: it may change soon. See
    /// [`prefetch`](crate::prefetch()).
    #[inline(always)]
    fn prefetch(&self, triangle: TriangleId) {
        let _ = triangle;
    }

    /// A vertex appears at `position`, in object space.
    fn vertex_added(&mut self, vertex: VertexId, position: [f32; 3]);
    /// A vertex disappears.
    fn vertex_removed(&mut self, vertex: VertexId);
    /// A triangle appears, its corners counter-clockwise.
    fn triangle_added(&mut self, triangle: TriangleId, corners: [VertexId; 3]);
    /// A triangle disappears.
    fn triangle_removed(&mut self, triangle: TriangleId);
    /// Corner 0, 1 or 2 of a displayed triangle moves to another vertex.
    fn corner_moved(&mut self, triangle: TriangleId, corner: usize, to: VertexId);
}

/// Takes no notice of the mesh: for measuring selection alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct NullSink;

impl MeshSink for NullSink {
    const KEEPS_MESH: bool = false;

    fn vertex_added(&mut self, _: VertexId, _: [f32; 3]) {}
    fn vertex_removed(&mut self, _: VertexId) {}
    fn triangle_added(&mut self, _: TriangleId, _: [VertexId; 3]) {}
    fn triangle_removed(&mut self, _: TriangleId) {}
    fn corner_moved(&mut self, _: TriangleId, _: usize, _: VertexId) {}
}
