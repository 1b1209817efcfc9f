//! Whoever takes a mesh piece by piece while it is being read.

use std::io;

use container::DegreeMap;

/// Takes the vertices and triangles of a mesh in order. A triangle names vertices that have been taken before it.
pub trait Receiver {
    /// Takes a vertex, in world coordinates. They are finite, and within the range of 32 bits.
    ///
    /// # Errors
    /// Where it can not be kept.
    fn position(&mut self, position: [f64; 3]) -> io::Result<()>;

    /// Takes a triangle with three different corners.
    ///
    /// # Errors
    /// Where it can not be kept.
    fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()>;

    /// The position of a vertex that has been taken, to the bit.
    ///
    /// # Errors
    /// Where it can not be had again.
    fn position_of(&mut self, vertex: u32) -> io::Result<[f64; 3]>;

    /// Takes what the file says of where the mesh lies: the name of the coordinate system, empty where it gives none, and
    /// how degrees have been laid on a plane. At most once, at any time.
    fn georeference(&mut self, coordinate_system: &str, degrees: Option<DegreeMap>);
}

/// What a file is found to hold.
pub(super) struct Contents {
    /// Whether it has faces, or anything else that joins vertices, be it without surface.
    pub faces: bool,
}
