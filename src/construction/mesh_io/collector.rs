//! A mesh in memory that is taken piece by piece.

use std::io;

use container::{DegreeMap, Georeference, Rounding};

use super::receiver::Receiver;
use super::rounding::{Bounds, Placing, exact};
use crate::edge_lengths::EdgeLengths;
use collapse_log::Mesh;

/// Takes a mesh piece by piece and keeps it in memory.
///
/// Positions take 32 bits a coordinate as long as these hold them exactly, and 64 from the first on for which they do not.
#[derive(Clone, Debug, Default)]
pub struct Collector {
    mesh: Mesh,
    /// All positions, once 32 bits do not hold one of them; then there are none in `mesh`.
    wide: Option<Vec<[f64; 3]>>,
}

impl Collector {
    /// The mesh. Its origin is 0 and its positions are what has been taken, bit for bit, if 32 bits hold all of them.
    /// Otherwise they are about the middle of the bounding box, and no coordinate has moved by more than 2^-25 of the extent
    /// along its axis: see [`Georeference::rounding`](vertex_tree::Georeference::rounding).
    #[must_use]
    pub fn into_mesh(self) -> Mesh {
        let Self { mut mesh, wide: Some(wide) } = self else { return self.mesh };
        let mut bounds = Bounds::default();
        wide.iter().for_each(|&p| bounds.include(p));
        let mut placing = Placing::new(&bounds);
        mesh.positions = wide.iter().map(|&p| placing.place(p)).collect();
        let mut edges = EdgeLengths::default();
        if placing.largest_move > 0.0 {
            mesh.triangles.iter().for_each(|t| edges.add(t.map(|v| wide[v as usize])));
        }
        let rounding = Rounding { largest_move: placing.largest_move, median_edge: edges.median() };
        mesh.georeference = Georeference { origin: placing.origin, rounding, ..mesh.georeference };
        mesh
    }
}

impl Receiver for Collector {
    fn position(&mut self, position: [f64; 3]) -> io::Result<()> {
        if self.wide.is_none() {
            if let Some(short) = exact(position) {
                self.mesh.positions.push(short);
                return Ok(());
            }
            let short = std::mem::take(&mut self.mesh.positions);
            self.wide = Some(short.into_iter().map(|p| p.map(f64::from)).collect());
        }
        self.wide.iter_mut().for_each(|wide| wide.push(position));
        Ok(())
    }

    fn triangle(&mut self, corners: [u32; 3]) -> io::Result<()> {
        self.mesh.triangles.push(corners);
        Ok(())
    }

    fn position_of(&mut self, vertex: u32) -> io::Result<[f64; 3]> {
        let position = match &self.wide {
            Some(wide) => wide.get(vertex as usize).copied(),
            None => self.mesh.positions.get(vertex as usize).map(|p| p.map(f64::from)),
        };
        position.ok_or_else(|| io::ErrorKind::NotFound.into())
    }

    fn georeference(&mut self, coordinate_system: &str, degrees: Option<DegreeMap>) {
        coordinate_system.clone_into(&mut self.mesh.georeference.coordinate_system);
        self.mesh.georeference.degrees = degrees;
    }
}
