//! Vertices made of the corners of facets.

use std::collections::HashMap;
use std::hash::Hash;
use std::path::Path;

use super::error::MeshIoError;
use super::limits::MAX_VERTICES;
use super::receiver::Receiver;

/// Facets joined where their corners agree.
pub(super) struct Weld<'a, K> {
    receiver: &'a mut dyn Receiver,
    /// The bits of a position: fewer where all coordinates have 32.
    key: fn([f64; 3]) -> K,
    /// The vertex at each position.
    vertices: HashMap<K, u32>,
}

impl<'a, K: Hash + Eq> Weld<'a, K> {
    pub fn new(receiver: &'a mut dyn Receiver, key: fn([f64; 3]) -> K) -> Self {
        Self { receiver, key, vertices: HashMap::new() }
    }

    pub fn push(&mut self, facet: [[f64; 3]; 3], file: &Path) -> Result<(), MeshIoError> {
        let mut triangle = [0; 3];
        for (corner, position) in triangle.iter_mut().zip(facet) {
            // Adding 0 makes 0 of -0 and leaves everything else alone.
            let position = position.map(|x| x + 0.0);
            let next = self.vertices.len() as u32;
            *corner = *self.vertices.entry((self.key)(position)).or_insert(next);
            if *corner == next {
                if next as usize >= MAX_VERTICES {
                    return Err(MeshIoError::TooManyVertices { file: file.to_owned() });
                }
                self.receiver.position(position).map_err(MeshIoError::Receiver)?;
            }
        }
        let [a, b, c] = triangle;
        if a == b || b == c || c == a {
            return Ok(());
        }
        self.receiver.triangle(triangle).map_err(MeshIoError::Receiver)
    }
}
