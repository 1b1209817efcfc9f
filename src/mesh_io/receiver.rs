//! Whoever takes a mesh piece by piece while it is being read.

use std::io;

use crate::Mesh;

/// Takes the vertices and triangles of a mesh in order. A triangle names vertices that have been taken before it.
pub trait Receiver {
    /// Takes a vertex. Coordinates are finite.
    ///
    /// # Errors
    /// Where it can not be kept.
    fn position(&mut self, position: [f32; 3]) -> io::Result<()>;

    /// Takes a triangle with three different corners.
    ///
    /// # Errors
    /// Where it can not be kept.
    fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()>;

    /// The position of a vertex that has been taken.
    ///
    /// # Errors
    /// Where it can not be had again.
    fn position_of(&mut self, vertex: u32) -> io::Result<[f32; 3]>;
}

impl Receiver for Mesh {
    fn position(&mut self, position: [f32; 3]) -> io::Result<()> {
        self.positions.push(position);
        Ok(())
    }

    fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()> {
        self.triangles.push(corners);
        Ok(())
    }

    fn position_of(&mut self, vertex: u32) -> io::Result<[f32; 3]> {
        self.positions.get(vertex as usize).copied().ok_or_else(|| io::ErrorKind::NotFound.into())
    }
}
