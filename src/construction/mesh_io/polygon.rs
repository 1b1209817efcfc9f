//! Faces on their way from a file to a receiver.

use std::path::Path;

use super::error::{MeshIoError, Place};
use super::limits::MAX_CORNERS;
use super::receiver::Receiver;
use super::triangulate::Triangulator;

/// The faces of a file, collected before they are triangulated: a face may come before its vertices.
pub(super) struct Faces {
    corners: Vec<u32>,
    /// For each face, its number in the file and the end of its corners in `corners`.
    ends: Vec<(u64, usize)>,
    place: fn(u64) -> Place,
}

impl Faces {
    /// No faces yet; `place` makes the place of a face from its number.
    pub fn new(place: fn(u64) -> Place) -> Self {
        Self { corners: Vec::new(), ends: Vec::new(), place }
    }

    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Adds a corner to the face that the next [`end_face`](Self::end_face) ends.
    pub fn push_corner(&mut self, vertex: u32) {
        self.corners.push(vertex);
    }

    pub fn end_face(&mut self, number: u64) {
        self.ends.push((number, self.corners.len()));
    }

    /// Hands all of them on. `first` is the number of the first vertex in the file, for the error.
    pub fn send(&self, sender: &mut FaceSender<'_>, first: i64) -> Result<(), MeshIoError> {
        let mut start = 0;
        for &(number, end) in &self.ends {
            sender.send(&self.corners[start..end], (self.place)(number), first)?;
            start = end;
        }
        Ok(())
    }
}

/// Triangulates faces as they come, for a receiver that has all their vertices.
pub(super) struct FaceSender<'a> {
    pub receiver: &'a mut dyn Receiver,
    /// How many it has.
    pub vertices: usize,
    pub file: &'a Path,
    triangulator: Triangulator,
    points: Vec<[f64; 3]>,
}

impl<'a> FaceSender<'a> {
    pub fn new(receiver: &'a mut dyn Receiver, vertices: usize, file: &'a Path) -> Self {
        Self { receiver, vertices, file, triangulator: Triangulator::default(), points: Vec::new() }
    }

    /// `first` is the number of the first vertex in the file, for the error.
    pub fn send(&mut self, corners: &[u32], place: Place, first: i64) -> Result<(), MeshIoError> {
        let file = || self.file.to_owned();
        if corners.len() > MAX_CORNERS {
            return Err(MeshIoError::TooManyCorners { file: file(), place, corners: corners.len() });
        }
        if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= self.vertices) {
            let index = i64::from(vertex) + first;
            return Err(MeshIoError::IndexOutOfRange { file: file(), place, index, vertices: self.vertices });
        }
        self.points.clear();
        if corners.len() > 3 {
            for &v in corners {
                self.points.push(self.receiver.position_of(v).map_err(MeshIoError::Receiver)?);
            }
        }
        let receiver = &mut *self.receiver;
        let mut outcome = Ok(());
        self.triangulator.triangulate(corners, &self.points, &mut |[a, b, c]| {
            // A triangle that names a vertex twice has no surface.
            if a != b && b != c && c != a && outcome.is_ok() {
                outcome = receiver.triangle([a, b, c]);
            }
        });
        outcome.map_err(MeshIoError::Receiver)
    }
}
