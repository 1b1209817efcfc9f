//! A surface that is nowhere below a mesh: where a camera can pass.

use glam::{DVec2, DVec3};

/// Cells a side, as a power of two.
const LEVELS: usize = 8;

/// Heights on a grid over the mesh, z up, such that the bilinear surface through them lies on or above every triangle.
///
/// A cell knows the highest triangle whose bounding rectangle touches it; a corner takes the highest of its four
/// cells, so all four corners of a cell, and every point between, are at least as high as what is in the cell.
pub(super) struct Envelope {
    low: DVec2,
    size: DVec2,
    corners: Vec<f64>,
}

const CELLS: usize = 1 << LEVELS;

impl Envelope {
    /// `low` and `high` are the corners of the bounding box; `triangles` gives the corners of each triangle.
    pub fn new(low: DVec3, high: DVec3, triangles: impl Iterator<Item = [DVec3; 3]>) -> Self {
        let base = low.truncate();
        // A mesh upright in a plane still has a grid.
        let size = (high - low).truncate().max(DVec2::splat(1e-9 * (high - low).length()));
        // Level l has 2^l x 2^l cells. A triangle goes to the finest level where it touches at most 2 x 2 of them, so
        // that each costs the same however large it is.
        let mut pyramid: Vec<Vec<f64>> = (0..=LEVELS).map(|level| vec![low.z; 1 << (2 * level)]).collect();
        for corners in triangles {
            let [a, b, c] = corners.map(DVec3::truncate);
            let (from, to) = ((a.min(b).min(c) - base) / size, (a.max(b).max(c) - base) / size);
            let top = corners[0].z.max(corners[1].z).max(corners[2].z);
            for level in (0..=LEVELS).rev() {
                let (first, last) = (cell(from, 1 << level), cell(to, 1 << level));
                if last[0] - first[0] > 1 || last[1] - first[1] > 1 {
                    continue;
                }
                for row in first[1]..=last[1] {
                    for column in first[0]..=last[0] {
                        let height = &mut pyramid[level][(row << level) + column];
                        *height = height.max(top);
                    }
                }
                break;
            }
        }
        for level in 1..=LEVELS {
            let (coarse, fine) = pyramid.split_at_mut(level);
            for (i, height) in fine[0].iter_mut().enumerate() {
                let (row, column) = (i >> level, i & ((1 << level) - 1));
                *height = height.max(coarse[level - 1][((row / 2) << (level - 1)) + column / 2]);
            }
        }
        let cells = &pyramid[LEVELS];
        let corner = |i: usize| {
            let (row, column) = (i / (CELLS + 1), i % (CELLS + 1));
            let around = |i: usize| i.saturating_sub(1)..=i.min(CELLS - 1);
            let heights = around(row).flat_map(|row| around(column).map(move |column| row * CELLS + column));
            heights.map(|cell| cells[cell]).fold(low.z, f64::max)
        };
        Self { low: base, size, corners: (0..(CELLS + 1) * (CELLS + 1)).map(corner).collect() }
    }

    /// Height at a point; beside the grid that of its nearest border point.
    pub fn height(&self, p: DVec2) -> f64 {
        let unit = ((p - self.low) / self.size).clamp(DVec2::ZERO, DVec2::ONE);
        let [column, row] = cell(unit, CELLS);
        let t = unit * CELLS as f64 - DVec2::new(column as f64, row as f64);
        let at = |i: usize, j: usize| self.corners[(row + j) * (CELLS + 1) + column + i];
        let low = at(0, 0) + (at(1, 0) - at(0, 0)) * t.x;
        let high = at(0, 1) + (at(1, 1) - at(0, 1)) * t.x;
        low + (high - low) * t.y
    }
}

/// Column and row of the cell of a point in the unit square.
fn cell(unit: DVec2, cells: usize) -> [usize; 2] {
    // The cast of a negative number or of NaN gives 0.
    [unit.x, unit.y].map(|x| ((x * cells as f64) as usize).min(cells - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_nowhere_below_the_triangles() {
        // A large slope with a small tower on it.
        let slope = [DVec3::ZERO, DVec3::new(100.0, 0.0, 10.0), DVec3::new(0.0, 100.0, 0.0)];
        let tower = [[70.0, 20.0, 30.0], [70.5, 20.0, 40.0], [70.0, 20.6, 30.0]].map(DVec3::from_array);
        let envelope = Envelope::new(DVec3::ZERO, DVec3::new(100.0, 100.0, 40.0), [slope, tower].into_iter());
        for triangle in [slope, tower] {
            for i in 0..=40 {
                for j in 0..=40 - i {
                    let (u, v) = (f64::from(i) / 40.0, f64::from(j) / 40.0);
                    let p = triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v;
                    assert!(envelope.height(p.truncate()) >= p.z - 1e-9);
                }
            }
        }
        // Away from the tower it is no higher than the slope's own top.
        assert!(envelope.height(DVec2::new(30.0, 70.0)) <= 10.0);
    }
}
