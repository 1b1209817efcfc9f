//! Wavefront OBJ: positions and faces; all groups and objects make one mesh.
//!
//! Vertices keep their order, faces may use vertices further down, and what is neither `v` nor `f` is skipped, and
//! so are a vertex's weight or colour and a corner's texture and normal index.

use std::path::Path;

use super::input::Input;
use super::polygon::{FaceSender, Faces};
use super::text::{Line, Lines};
use super::{MAX_VERTICES, MeshIoError, Place, Receiver};
use crate::Mesh;
use crate::progress::Progress;

pub(super) fn read(mut input: Input<'_>) -> Result<Mesh, MeshIoError> {
    let file = input.path;
    let mut positions = Vec::new();
    let mut faces = Faces::new(Place::Line);
    let mut lines = Lines::new(&mut input).with_comments('#').with_continuation();
    while let Some(mut line) = lines.next()? {
        match line.word() {
            Some("v") => positions.push(line.position()?),
            Some("f") => {
                while let Some(word) = line.word() {
                    faces.push_corner(vertex(&line, word, positions.len())?);
                }
                faces.end_face(line.number);
            }
            _ => {}
        }
    }
    faces.into_mesh(file, positions, 1)
}

/// As [`read`], but piece by piece: once through the file for the vertices, once for the faces.
pub(super) fn send(
    file: &Path,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<(), MeshIoError> {
    let mut vertices = 0;
    let mut input = Input::open(file, &mut *progress)?;
    let mut lines = Lines::new(&mut input).with_comments('#').with_continuation();
    while let Some(mut line) = lines.next()? {
        if line.word() == Some("v") {
            if vertices == MAX_VERTICES {
                return Err(MeshIoError::TooManyVertices { file: file.to_owned() });
            }
            receiver.position(line.position()?).map_err(MeshIoError::Receiver)?;
            vertices += 1;
        }
    }
    let mut sender = FaceSender::new(receiver, vertices, file);
    let mut input = Input::open(file, progress)?;
    let mut lines = Lines::new(&mut input).with_comments('#').with_continuation();
    let (mut so_far, mut corners) = (0, Vec::new());
    while let Some(mut line) = lines.next()? {
        match line.word() {
            Some("v") => so_far += 1,
            Some("f") => {
                corners.clear();
                while let Some(word) = line.word() {
                    corners.push(vertex(&line, word, so_far)?);
                }
                sender.send(&corners, Place::Line(line.number), 1)?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// The vertex of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 0. In the file it counts from 1, or from
/// -1 backwards through the `so_far` vertices that have been read.
fn vertex(line: &Line<'_>, corner: &str, so_far: usize) -> Result<u32, MeshIoError> {
    let word = corner.split('/').next().unwrap_or("");
    let index: i64 = word.parse().map_err(|_| line.malformed("a vertex number", corner))?;
    let zero_based = if index < 0 { (so_far as i64).checked_add(index) } else { index.checked_sub(1) };
    zero_based.and_then(|v| u32::try_from(v).ok()).ok_or_else(|| line.index_out_of_range(index, so_far))
}
