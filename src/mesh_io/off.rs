//! The Object File Format of Geomview, in text: OFF, and COFF, NOFF, … whose colours and normals are skipped.

use super::input::Input;
use super::polygon::Faces;
use super::text::{Line, Lines};
use super::{MeshIoError, Place};
use crate::Mesh;

const KEYWORDS: [&str; 4] = ["OFF", "COFF", "NOFF", "CNOFF"];

pub(super) fn read(mut input: Input<'_>) -> Result<Mesh, MeshIoError> {
    let file = input.path;
    let mut lines = Lines::new(&mut input).with_comments('#');

    let mut line = lines.expect_next()?;
    if !KEYWORDS.iter().any(|keyword| line.skip(keyword)) {
        let word = line.word().unwrap_or("");
        return Err(line.malformed("OFF, COFF, NOFF or CNOFF", word));
    }
    // The counts may follow on the same line; some files (ModelNet's) do not even leave a space.
    let (vertices, face_count) = if line.is_empty() { counts(lines.expect_next()?)? } else { counts(line)? };

    let mut positions = Vec::new();
    for _ in 0..vertices {
        positions.push(lines.expect_next()?.position()?);
    }
    let mut faces = Faces::new(Place::Line);
    for _ in 0..face_count {
        let mut line = lines.expect_next()?;
        for _ in 0..line.parse::<u64>("a number of corners")? {
            let vertex: i64 = line.parse("a vertex number")?;
            let in_range =
                u32::try_from(vertex).map_err(|_| line.index_out_of_range(vertex, positions.len()))?;
            faces.push_corner(in_range);
        }
        faces.end_face(line.number);
    }
    faces.into_mesh(file, positions, 0)
}

fn counts(mut line: Line<'_>) -> Result<(u64, u64), MeshIoError> {
    Ok((line.parse("a number of vertices")?, line.parse("a number of faces")?))
}
