//! Height grids into meshes.
//!
//! Each cell between four samples becomes two triangles. They share the diagonal whose ends differ less in height,
//! so that ridges and valleys run along edges instead of being cut into teeth; the one from north-west to
//! south-east if both differ equally. A triangle with a void corner is left out, and so is a sample that no
//! triangle uses. Vertices are numbered row by row from the north-west, triangles cell by cell likewise.

use std::ops::Range;
use std::path::Path;

use super::error::{MeshIoError, Place};
use super::limits::MAX_VERTICES;
use super::receiver::Receiver;
use crate::progress::Progress;

/// Rows of samples from north to south, and columns from west to east.
pub(super) trait HeightGrid {
    fn rows(&self) -> usize;
    fn columns(&self) -> usize;
    /// Sets `heights`, one for each column, to row `row`, with NaN where there is none.
    ///
    /// # Errors
    /// Where rows are read only now, whatever is wrong with the file.
    fn read_row(&self, row: usize, heights: &mut [f32]) -> Result<(), MeshIoError>;
    /// The cells between rows `row` and `row + 1`; cell `c` is between columns `c` and `c + 1`.
    fn cells(&self, row: usize) -> impl Iterator<Item = Range<usize>>;
    /// Object space position of a sample.
    fn position(&self, row: usize, column: usize, height: f32) -> [f32; 3];
}

/// A corner of a triangle between two rows: its column, in the southern row or the northern one.
#[derive(Clone, Copy)]
struct Corner {
    south: bool,
    column: usize,
}

/// Triangulates a grid read from `file`, piece by piece.
pub(super) fn send(
    grid: &impl HeightGrid,
    file: &Path,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<(), MeshIoError> {
    let (rows, columns) = (grid.rows(), grid.columns());
    let mut sent = 0;
    let mut heights = vec![f32::NAN; columns];
    let mut heights_south = heights.clone();
    // Whether a triangle uses a sample of this row, and of the next.
    let mut used = vec![false; columns];
    let mut used_south = used.clone();
    // Vertex numbers of the row to the north and of this one.
    let mut vertices_north = vec![0; columns];
    let mut vertices = vertices_north.clone();
    // The triangles between those two rows, and between this one and the next. They are held back for a row,
    // because only the triangles on both sides of a row tell which of its samples become vertices.
    let mut strip_north: Vec<[Corner; 3]> = Vec::new();
    let mut strip = strip_north.clone();

    grid.read_row(0, &mut heights)?;
    for row in 0..rows {
        if row + 1 < rows {
            grid.read_row(row + 1, &mut heights_south)?;
            for column in grid.cells(row).flatten() {
                split_cell(&heights, &heights_south, column, &mut strip);
            }
        }
        for corner in strip.as_flattened() {
            let used = if corner.south { &mut used_south } else { &mut used };
            used[corner.column] = true;
        }
        for column in (0..columns).filter(|&c| used[c]) {
            let position = grid.position(row, column, heights[column]);
            if let Some(&bad) = position.iter().find(|x| !x.is_finite()) {
                let place = Place::Sample { row, column };
                return Err(MeshIoError::NotFinite { file: file.to_owned(), place, value: f64::from(bad) });
            }
            if sent == MAX_VERTICES {
                return Err(MeshIoError::TooManyVertices { file: file.to_owned() });
            }
            vertices[column] = sent as u32;
            sent += 1;
            receiver.position(position.map(f64::from)).map_err(MeshIoError::Receiver)?;
        }
        for triangle in &strip_north {
            let vertex = |c: Corner| if c.south { vertices[c.column] } else { vertices_north[c.column] };
            receiver.triangle(triangle.map(vertex)).map_err(MeshIoError::Receiver)?;
        }

        std::mem::swap(&mut heights, &mut heights_south);
        std::mem::swap(&mut used, &mut used_south);
        used_south.fill(false);
        std::mem::swap(&mut vertices_north, &mut vertices);
        std::mem::swap(&mut strip_north, &mut strip);
        strip.clear();
        progress(row as u64 + 1, rows as u64);
    }
    Ok(())
}

/// Appends the triangles of the cell to the right of `column`, counter-clockwise seen from above.
fn split_cell(north: &[f32], south: &[f32], column: usize, triangles: &mut Vec<[Corner; 3]>) {
    let [nw, ne] = [column, column + 1].map(|column| Corner { south: false, column });
    let [sw, se] = [column, column + 1].map(|column| Corner { south: true, column });
    let height = |c: Corner| if c.south { south[c.column] } else { north[c.column] };
    let falling = (height(nw) - height(se)).abs();
    let rising = (height(sw) - height(ne)).abs();
    // With one void corner the diagonal that misses it leaves one triangle: the difference along the other is NaN.
    let split = if falling <= rising || rising.is_nan() {
        [[nw, sw, se], [nw, se, ne]]
    } else {
        [[nw, sw, ne], [ne, sw, se]]
    };
    triangles.extend(split.into_iter().filter(|triangle| !triangle.iter().any(|&c| height(c).is_nan())));
}

#[cfg(test)]
mod tests {
    use super::super::collector::Collector;
    use super::*;
    use collapse_log::Mesh;

    struct Text<'a>(&'a [&'a str]);

    impl HeightGrid for Text<'_> {
        fn rows(&self) -> usize {
            self.0.len()
        }
        fn columns(&self) -> usize {
            self.0[0].len()
        }
        fn read_row(&self, row: usize, heights: &mut [f32]) -> Result<(), MeshIoError> {
            for (height, digit) in heights.iter_mut().zip(self.0[row].chars()) {
                *height = digit.to_digit(10).map_or(f32::NAN, |d| d as f32);
            }
            Ok(())
        }
        fn cells(&self, _: usize) -> impl Iterator<Item = Range<usize>> {
            std::iter::once(0..self.columns() - 1)
        }
        fn position(&self, row: usize, column: usize, height: f32) -> [f32; 3] {
            [column as f32, -(row as f32), height]
        }
    }

    fn mesh(rows: &[&str]) -> Mesh {
        let mut collector = Collector::default();
        send(&Text(rows), Path::new("grid"), &mut collector, &mut |_, _| ()).unwrap();
        collector.into_mesh()
    }

    #[test]
    fn the_diagonal_follows_the_ridge() {
        assert_eq!(mesh(&["94", "08"]).triangles, [[0, 2, 3], [0, 3, 1]]);
        assert_eq!(mesh(&["90", "07"]).triangles, [[0, 2, 1], [1, 2, 3]]);
        assert_eq!(mesh(&["00", "00"]).triangles, [[0, 2, 3], [0, 3, 1]]);
    }

    #[test]
    fn a_void_takes_its_triangles_along_and_no_others() {
        for (cell, kept) in
            [("_000", [1, 2, 3]), ("0_00", [0, 2, 3]), ("00_0", [0, 3, 1]), ("000_", [0, 2, 1])]
        {
            let rows = [&cell[..2], &cell[2..]];
            let full = Text(&rows);
            let corner = |i: usize| full.position(i / 2, i % 2, 0.0);
            let mesh = mesh(&rows);
            assert_eq!(mesh.positions.len(), 3, "{cell}");
            assert_eq!(mesh.triangles.len(), 1, "{cell}");
            let mut found = mesh.triangles[0].map(|v| mesh.positions[v as usize]);
            while found[0] != corner(kept[0]) {
                found.rotate_left(1);
            }
            assert_eq!(found, kept.map(corner), "{cell}");
        }
        assert_eq!(mesh(&["_0", "0_"]).triangles.len(), 0);
    }

    #[test]
    fn vertices_are_numbered_row_by_row_without_the_unused() {
        // The 5 has voids on three sides: no triangle is left for it.
        let mesh = mesh(&["123_5", "123__", "123__"]);
        let heights: Vec<_> = mesh.positions.iter().map(|p| p[2]).collect();
        assert_eq!(heights, [1.0, 2.0, 3.0, 1.0, 2.0, 3.0, 1.0, 2.0, 3.0]);
        assert_eq!(mesh.triangles.len(), 8);
    }
}
