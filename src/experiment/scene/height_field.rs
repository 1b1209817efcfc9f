//! A square grid of heights, z up.

use collapse_log::Mesh;
use glam::DVec3;

/// Heights sampled on a square grid, in metres, row by row with x running fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    side: usize,
    spacing: f64,
    origin: [f64; 2],
    heights: Vec<f32>,
}

impl HeightField {
    /// `side` x `side` samples from `height(column, row)`; sample (0, 0) lies at `origin`.
    pub(crate) fn from_fn(
        side: usize,
        spacing: f64,
        origin: [f64; 2],
        mut height: impl FnMut(usize, usize) -> f64,
    ) -> Self {
        let mut heights = Vec::with_capacity(side * side);
        for row in 0..side {
            heights.extend((0..side).map(|column| height(column, row) as f32));
        }
        Self { side, spacing, origin, heights }
    }

    /// Samples along each side.
    #[must_use]
    pub fn side(&self) -> usize {
        self.side
    }

    /// Distance between neighbouring samples.
    #[must_use]
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Position of a sample; `column` and `row` are below [`side`](Self::side).
    #[must_use]
    pub fn sample(&self, column: usize, row: usize) -> DVec3 {
        DVec3::new(
            self.origin[0] + column as f64 * self.spacing,
            self.origin[1] + row as f64 * self.spacing,
            f64::from(self.heights[row * self.side + column]),
        )
    }

    pub(crate) fn raise_to(&mut self, column: usize, row: usize, height: f64) {
        let sample = &mut self.heights[row * self.side + column];
        *sample = sample.max(height as f32);
    }

    /// Columns (rows) whose samples lie in `low..=high` along x (`axis` 0) or y (`axis` 1).
    pub(crate) fn span(&self, axis: usize, low: f64, high: f64) -> std::ops::Range<usize> {
        let index = |x: f64| ((x - self.origin[axis]) / self.spacing).clamp(0.0, self.side as f64);
        index(low).ceil() as usize..((index(high).floor() + 1.0) as usize).min(self.side)
    }

    /// Height at a point, bilinear between samples; outside of the grid that of its nearest border point.
    #[must_use]
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let last = (self.side - 1) as f64;
        let column = ((x - self.origin[0]) / self.spacing).clamp(0.0, last);
        let row = ((y - self.origin[1]) / self.spacing).clamp(0.0, last);
        let (i, j) = ((column as usize).min(self.side - 2), (row as usize).min(self.side - 2));
        let (u, v) = (column - i as f64, row - j as f64);
        let at = |i: usize, j: usize| f64::from(self.heights[j * self.side + i]);
        let low = at(i, j) + (at(i + 1, j) - at(i, j)) * u;
        let high = at(i, j + 1) + (at(i + 1, j + 1) - at(i, j + 1)) * u;
        low + (high - low) * v
    }

    /// The highest sample within `radius` of a point (in the square around it), but at least [`height`](Self::height).
    #[must_use]
    pub fn highest(&self, x: f64, y: f64, radius: f64) -> f64 {
        let mut highest = self.height(x, y);
        for row in self.span(1, y - radius, y + radius) {
            for column in self.span(0, x - radius, x + radius) {
                highest = highest.max(f64::from(self.heights[row * self.side + column]));
            }
        }
        highest
    }

    /// Two triangles a cell, counter-clockwise from above, with the diagonal alternating like a chess board so that
    /// the triangulation prefers no direction.
    #[must_use]
    pub fn mesh(&self) -> Mesh {
        let cells = self.side - 1;
        let mut mesh = Mesh {
            positions: Vec::with_capacity(self.side * self.side),
            triangles: Vec::with_capacity(2 * cells * cells),
            ..Mesh::default()
        };
        for row in 0..self.side {
            mesh.positions.extend((0..self.side).map(|column| self.sample(column, row).as_vec3().to_array()));
        }
        for row in 0..cells {
            for column in 0..cells {
                let a = (row * self.side + column) as u32;
                let (b, d) = (a + 1, a + self.side as u32);
                let c = d + 1;
                if (row + column) % 2 == 0 {
                    mesh.triangles.extend([[a, b, c], [a, c, d]]);
                } else {
                    mesh.triangles.extend([[a, b, d], [b, c, d]]);
                }
            }
        }
        mesh
    }
}
