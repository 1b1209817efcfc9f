//! The Object File Format of Geomview, in text: OFF, and COFF, NOFF, … whose colours and normals are skipped.
//!
//! Behind the faces there may be blank lines and comments, but no more than that: lines that are left over say that the
//! counts are wrong, and which of them, nobody knows.

use std::path::Path;

use super::error::{MeshIoError, Place};
use super::input::Input;
use super::limits::MAX_VERTICES;
use super::polygon::FaceSender;
use super::receiver::{Contents, Receiver};
use super::text::{Line, Lines};
use crate::progress::Progress;

const KEYWORDS: [&str; 4] = ["OFF", "COFF", "NOFF", "CNOFF"];

pub(super) fn send(
    file: &Path,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<Contents, MeshIoError> {
    let mut input = Input::open(file, progress)?;
    input.skip_mark()?;
    let mut lines = Lines::new(&mut input).with_comments('#');

    let mut line = lines.expect_next()?;
    if !KEYWORDS.iter().any(|keyword| line.skip(keyword)) {
        let word = line.word().unwrap_or("");
        return Err(line.malformed("OFF, COFF, NOFF or CNOFF", word));
    }
    // The counts may follow on the same line; some files (ModelNet's) do not even leave a space.
    let (vertices, faces) = if line.is_empty() { counts(lines.expect_next()?)? } else { counts(line)? };

    for number in 0..vertices {
        if number == MAX_VERTICES as u64 {
            return Err(MeshIoError::TooManyVertices { file: file.to_owned() });
        }
        let position = lines.expect_next()?.position()?;
        receiver.position(position).map_err(MeshIoError::Receiver)?;
    }
    let vertices = vertices as usize;
    let mut sender = FaceSender::new(receiver, vertices, file);
    let mut corners = Vec::new();
    for _ in 0..faces {
        let mut line = lines.expect_next()?;
        corners.clear();
        for _ in 0..line.parse::<u64>("a number of corners")? {
            let vertex: i64 = line.parse("a vertex number")?;
            corners.push(u32::try_from(vertex).map_err(|_| line.index_out_of_range(vertex, vertices))?);
        }
        sender.send(&corners, Place::Line(line.number), 0)?;
    }
    lines.expect_end()?;
    Ok(Contents { faces: faces > 0 })
}

fn counts(mut line: Line<'_>) -> Result<(u64, u64), MeshIoError> {
    Ok((line.parse("a number of vertices")?, line.parse("a number of faces")?))
}
