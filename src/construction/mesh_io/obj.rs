//! Wavefront OBJ: positions and faces; all groups and objects make one mesh.
//!
//! Vertices keep their order, faces may use vertices further down, and what is neither `v` nor `f` is skipped, and
//! so are a vertex's weight or colour and a corner's texture and normal index.

use std::path::Path;

use super::error::{MeshIoError, Place};
use super::input::Input;
use super::limits::MAX_VERTICES;
use super::polygon::{FaceSender, Faces};
use super::receiver::{Contents, Receiver};
use super::text::{Line, Lines};
use crate::progress::Progress;

/// Hands the mesh on, with the faces in memory until their vertices are there.
pub(super) fn read(
    file: &Path,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<Contents, MeshIoError> {
    let mut faces = Faces::new(Place::Line);
    let (mut vertices, mut others) = (0, false);
    let mut input = Input::open(file, progress)?;
    let mut lines = lines(&mut input)?;
    while let Some(mut line) = lines.next()? {
        match line.word() {
            Some("v") => send_vertex(&mut line, file, &mut vertices, receiver)?,
            Some("f") => {
                while let Some(word) = line.word() {
                    faces.push_corner(vertex(&line, word, vertices)?);
                }
                faces.end_face(line.number);
            }
            word => others |= is_shape(word),
        }
    }
    faces.send(&mut FaceSender::new(receiver, vertices, file), 1)?;
    Ok(Contents { faces: others || !faces.is_empty() })
}

/// As [`read`], but piece by piece: once through the file for the vertices, once for the faces.
pub(super) fn send(
    file: &Path,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<Contents, MeshIoError> {
    let mut vertices = 0;
    let mut input = Input::open(file, &mut *progress)?;
    let mut first = lines(&mut input)?;
    while let Some(mut line) = first.next()? {
        if line.word() == Some("v") {
            send_vertex(&mut line, file, &mut vertices, receiver)?;
        }
    }
    let mut sender = FaceSender::new(receiver, vertices, file);
    let mut input = Input::open(file, progress)?;
    let mut second = lines(&mut input)?;
    let (mut so_far, mut corners, mut faces) = (0, Vec::new(), false);
    while let Some(mut line) = second.next()? {
        match line.word() {
            Some("v") => so_far += 1,
            Some("f") => {
                corners.clear();
                while let Some(word) = line.word() {
                    corners.push(vertex(&line, word, so_far)?);
                }
                sender.send(&corners, Place::Line(line.number), 1)?;
                faces = true;
            }
            word => faces |= is_shape(word),
        }
    }
    Ok(Contents { faces })
}

fn lines<'i, 'a>(input: &'i mut Input<'a>) -> Result<Lines<'i, 'a>, MeshIoError> {
    input.skip_mark()?;
    Ok(Lines::new(input).with_comments('#').with_continuation())
}

fn send_vertex(
    line: &mut Line<'_>,
    file: &Path,
    vertices: &mut usize,
    receiver: &mut dyn Receiver,
) -> Result<(), MeshIoError> {
    if *vertices == MAX_VERTICES {
        return Err(MeshIoError::TooManyVertices { file: file.to_owned() });
    }
    *vertices += 1;
    receiver.position(line.position()?).map_err(MeshIoError::Receiver)
}

/// Whether a line shows something that is not read: lines, curves and surfaces.
fn is_shape(keyword: Option<&str>) -> bool {
    matches!(keyword, Some("l" | "curv" | "curv2" | "surf"))
}

/// The vertex of a corner `v`, `v/vt`, `v//vn` or `v/vt/vn`, counted from 0. In the file it counts from 1, or from
/// -1 backwards through the `so_far` vertices that have been read.
fn vertex(line: &Line<'_>, corner: &str, so_far: usize) -> Result<u32, MeshIoError> {
    let word = corner.split('/').next().unwrap_or("");
    let index: i64 = word.parse().map_err(|_| line.malformed("a vertex number", corner))?;
    let zero_based = if index < 0 { (so_far as i64).checked_add(index) } else { index.checked_sub(1) };
    zero_based.and_then(|v| u32::try_from(v).ok()).ok_or_else(|| line.index_out_of_range(index, so_far))
}
