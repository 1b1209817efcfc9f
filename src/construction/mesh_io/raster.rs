//! Height maps in memory, from whatever file.

use std::ops::Range;
use std::path::Path;

use container::DegreeMap;

use super::error::MeshIoError;
use super::receiver::{Contents, Receiver};
use super::terrain::{self, HeightGrid};
use crate::progress::Progress;

/// How the samples of a `.png` or `.tif` height map become positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightScale {
    /// Distance between neighbouring samples, in object space.
    pub spacing: f64,
    /// Height of a sample of value 1 above one of value 0, in object space.
    pub vertical: f64,
    /// Height of a sample of value 0.
    pub offset: f64,
}

/// No compression that is read packs more than this many bytes into one: deflate reaches 1032, LZW about 1400.
pub(super) const MAX_COMPRESSION: u64 = 1500;
/// What a height map without scale is given: the range of its sample type, as part of its longer side.
const DEFAULT_RELIEF: f64 = 1.0 / 16.0;

/// What a file says of where its samples are.
#[derive(Debug, Default)]
pub(super) struct Location {
    /// From a sample to the next of its row, and from a row to the next: x and y, in metres if the file says what unit it has.
    pub steps: Option<[[f64; 2]; 2]>,
    /// Factor and offset that make heights of samples.
    pub heights: Option<[f64; 2]>,
    pub coordinate_system: String,
    pub degrees: Option<DegreeMap>,
}

/// A height map in memory. Its middle is the origin, its first row the north.
pub(super) struct Raster {
    columns: usize,
    /// As in the file, NaN for voids.
    samples: Vec<f32>,
    /// As in [`Location`], but that rows never run to the left of columns.
    steps: [[f64; 2]; 2],
    vertical: f64,
    offset: f64,
    coordinate_system: String,
    degrees: Option<DegreeMap>,
}

impl Raster {
    /// `scale` is the caller's, `location` the file's, and `range` the greatest value of its sample type, if there is one.
    pub fn new(
        (columns, rows): (u32, u32),
        samples: Vec<f32>,
        scale: Option<HeightScale>,
        location: Location,
        range: Option<f64>,
    ) -> Self {
        let location = if scale.is_some() { Location::default() } else { location };
        let spacing = scale.map_or(1.0, |scale| scale.spacing);
        let steps = location.steps.unwrap_or([[spacing, 0.0], [0.0, -spacing]]);
        let [vertical, offset] = match (scale, location.heights, range) {
            (Some(scale), ..) => [scale.vertical, scale.offset],
            (None, Some(heights), _) => heights,
            (None, None, Some(range)) if location.steps.is_none() => {
                let side = f64::from(columns.max(rows).saturating_sub(1));
                [side * DEFAULT_RELIEF / range, 0.0]
            }
            (None, None, _) => [1.0, 0.0],
        };
        let Location { coordinate_system, degrees, .. } = location;
        let columns = columns as usize;
        let mut raster = Self { columns, samples, steps, vertical, offset, coordinate_system, degrees };
        let [column, row] = steps;
        if column[0] * row[1] - column[1] * row[0] > 0.0 {
            raster.turn_over();
        }
        raster
    }

    /// Makes the last row the first: where the south is up, triangles would face down.
    fn turn_over(&mut self) {
        let (rows, columns) = (self.rows(), self.columns);
        for row in 0..rows / 2 {
            let (upper, lower) = self.samples.split_at_mut((rows - 1 - row) * columns);
            upper[row * columns..][..columns].swap_with_slice(&mut lower[..columns]);
        }
        self.steps[1] = self.steps[1].map(|step| -step);
    }

    /// Triangulates, piece by piece.
    pub fn send(
        &self,
        file: &Path,
        receiver: &mut dyn Receiver,
        progress: Progress<'_>,
    ) -> Result<Contents, MeshIoError> {
        receiver.georeference(&self.coordinate_system, self.degrees);
        terrain::send(self, file, receiver, progress)?;
        Ok(Contents { faces: true })
    }
}

fn from_middle(at: usize, count: usize) -> f64 {
    at as f64 - (count - 1) as f64 / 2.0
}

/// Horizontal position of a sample about the middle of a grid.
pub(super) fn centred(grid: &impl HeightGrid, row: usize, column: usize, spacing: [f64; 2]) -> [f32; 2] {
    let x = from_middle(column, grid.columns()) * spacing[0];
    let y = -from_middle(row, grid.rows()) * spacing[1];
    [x as f32, y as f32]
}

impl HeightGrid for Raster {
    fn rows(&self) -> usize {
        self.samples.len() / self.columns
    }

    fn columns(&self) -> usize {
        self.columns
    }

    fn read_row(&self, row: usize, heights: &mut [f32]) -> Result<(), MeshIoError> {
        for (height, &sample) in heights.iter_mut().zip(&self.samples[row * self.columns..]) {
            *height = (f64::from(sample) * self.vertical + self.offset) as f32;
        }
        Ok(())
    }

    fn cells(&self, _row: usize) -> impl Iterator<Item = Range<usize>> {
        std::iter::once(0..self.columns - 1)
    }

    fn position(&self, row: usize, column: usize, height: f32) -> [f32; 3] {
        let [along_row, along_column] = self.steps;
        if (along_row[1], along_column[0]) == (0.0, 0.0) {
            let [x, y] = centred(self, row, column, [along_row[0], -along_column[1]]);
            return [x, y, height];
        }
        let (column, row) = (from_middle(column, self.columns), from_middle(row, self.rows()));
        let at = |axis: usize| (column * along_row[axis] + row * along_column[axis]) as f32;
        [at(0), at(1), height]
    }
}
