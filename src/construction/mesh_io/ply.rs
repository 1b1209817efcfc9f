//! The Stanford polygon format: read in text and both binary forms.
//!
//! Vertices are the properties `x y z` of the element `vertex`, faces the list `vertex_indices` or `vertex_index` of
//! the element `face`, whatever their types and order; everything else is skipped. The same list of the element `tristrips`
//! holds triangle strips, as scanners wrote them: each further vertex makes a triangle with the two before it, every second of which
//! is turned, and a negative number ends a strip. (Turk, "The PLY polygon file format", 1994, and what Stanford's own
//! files do.)
//!
//! A row of a text file may go over several lines, and several rows may be on one. Rows that do not fit the header are noticed by what is
//! left over in the end.

mod body;
mod header;

use std::path::Path;

use serde_ply::{ElementDef, PropertyType, ScalarType};

use super::error::{MeshIoError, Place};
use super::input::Input;
use super::limits::{MAX_CORNERS, MAX_VERTICES};
use super::polygon::FaceSender;
use super::receiver::{Contents, Receiver};
use super::text::check_coordinate;
use crate::progress::Progress;
use body::{Body, is_float};

const STRIPS: [&str; 2] = ["tristrips", "tristrip"];

/// Hands the mesh on. Where faces come before the vertices, the file is read twice.
pub(super) fn send(
    file: &Path,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<Contents, MeshIoError> {
    let mut reading =
        Reading { file, receiver, vertices: 0, with_vertices: true, late_faces: false, faces: false };
    reading.read(&mut *progress)?;
    if reading.late_faces {
        reading.with_vertices = false;
        reading.read(progress)?;
    }
    Ok(Contents { faces: reading.faces })
}

struct Reading<'r> {
    file: &'r Path,
    receiver: &'r mut dyn Receiver,
    /// How many have been handed on.
    vertices: usize,
    /// Whether vertices are asked for, or else are there already.
    with_vertices: bool,
    /// Whether there are faces before the vertices.
    late_faces: bool,
    /// Whether there are any.
    faces: bool,
}

impl Reading<'_> {
    /// Reads the file once, and hands on vertices, if they are asked for, and those faces that come when there are vertices.
    fn read(&mut self, progress: Progress<'_>) -> Result<(), MeshIoError> {
        let mut input = Input::open(self.file, progress)?;
        let (header, lines) = header::read(&mut input)?;
        let mut body = Body::new(&mut input, header.format, lines);
        let last_vertices = header.elem_defs.iter().rposition(|e| e.name == "vertex" && e.count > 0);
        for (number, element) in header.elem_defs.iter().enumerate() {
            let is_strips = STRIPS.contains(&&*element.name);
            let is_late = self.with_vertices && last_vertices.is_some_and(|last| number < last);
            // What is late now comes the second time, and what has come already does not.
            let is_wanted =
                if self.with_vertices { !is_late } else { last_vertices.is_some_and(|last| number < last) };
            match element.name.as_str() {
                "vertex" if self.with_vertices => self.read_vertices(element, &mut body)?,
                "face" | "tristrips" | "tristrip" if element.count > 0 => {
                    self.faces = true;
                    self.late_faces |= is_late;
                    match is_wanted {
                        true if is_strips => self.read_strips(element, &mut body)?,
                        true => self.read_faces(element, &mut body)?,
                        false => skip_rows(element, Place::Face, &mut body)?,
                    }
                }
                "vertex" => skip_rows(element, Place::Vertex, &mut body)?,
                _ => skip_rows(element, |_| Place::Byte(0), &mut body)?,
            }
        }
        body.expect_end()
    }

    fn read_vertices(&mut self, element: &ElementDef, body: &mut Body<'_, '_>) -> Result<(), MeshIoError> {
        let axes: Vec<Option<usize>> = element
            .properties
            .iter()
            .map(|p| ["x", "y", "z"].iter().position(|axis| *axis == p.name))
            .collect();
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            let is_there = element.properties.iter().zip(&axes).any(|(property, found)| {
                *found == Some(axis) && matches!(property.property_type, PropertyType::Scalar(_))
            });
            if !is_there && element.count > 0 {
                return Err(
                    body.refuse(Place::Vertex(self.vertices as u64), &format!("missing field `{name}`"))
                );
            }
        }
        for _ in 0..element.count {
            let place = Place::Vertex(self.vertices as u64);
            let mut position = [0.0; 3];
            for (property, axis) in element.properties.iter().zip(&axes) {
                match (&property.property_type, axis) {
                    (&PropertyType::Scalar(kind), &Some(axis)) => {
                        position[axis] = check_coordinate(self.file, place, body.number(kind, place)?)?;
                    }
                    (kind, _) => skip(kind, place, body)?,
                }
            }
            if self.vertices == MAX_VERTICES {
                return Err(MeshIoError::TooManyVertices { file: self.file.to_owned() });
            }
            self.receiver.position(position).map_err(MeshIoError::Receiver)?;
            self.vertices += 1;
        }
        Ok(())
    }

    fn read_faces(&mut self, element: &ElementDef, body: &mut Body<'_, '_>) -> Result<(), MeshIoError> {
        let vertices = self.vertices;
        let mut sender = FaceSender::new(self.receiver, vertices, self.file);
        let mut corners = Vec::new();
        for_each_list(element, body, |count, kind, place, body| {
            if count > MAX_CORNERS as u64 {
                let corners = usize::try_from(count).unwrap_or(usize::MAX);
                return Err(MeshIoError::TooManyCorners { file: sender.file.to_owned(), place, corners });
            }
            corners.clear();
            for _ in 0..count {
                let index = body.whole(kind, place)?;
                let vertex = u32::try_from(index).map_err(|_| {
                    let file = sender.file.to_owned();
                    MeshIoError::IndexOutOfRange { file, place, index, vertices }
                })?;
                corners.push(vertex);
            }
            sender.send(&corners, place, 0)
        })
    }

    fn read_strips(&mut self, element: &ElementDef, body: &mut Body<'_, '_>) -> Result<(), MeshIoError> {
        let vertices = self.vertices;
        let mut sender = FaceSender::new(self.receiver, vertices, self.file);
        for_each_list(element, body, |count, kind, place, body| {
            let mut before: [Option<u32>; 2] = [None; 2];
            let mut is_turned = false;
            for _ in 0..count {
                let index = body.whole(kind, place)?;
                // Where numbers have no sign, -1 is written as the largest.
                if index < 0 || kind == ScalarType::U32 && index == i64::from(u32::MAX) {
                    (before, is_turned) = ([None; 2], false);
                    continue;
                }
                let Some(vertex) = u32::try_from(index).ok().filter(|&v| (v as usize) < vertices) else {
                    let file = sender.file.to_owned();
                    return Err(MeshIoError::IndexOutOfRange { file, place, index, vertices });
                };
                if let [Some(a), Some(b)] = before {
                    let triangle = if is_turned { [b, a, vertex] } else { [a, b, vertex] };
                    sender.send(&triangle, place, 0)?;
                    is_turned = !is_turned;
                }
                before = [before[1], Some(vertex)];
            }
            Ok(())
        })
    }
}

/// Calls `take` for each row when its list of vertices comes, with the number of items, which it has to read.
fn for_each_list(
    element: &ElementDef,
    body: &mut Body<'_, '_>,
    mut take: impl FnMut(u64, ScalarType, Place, &mut Body<'_, '_>) -> Result<(), MeshIoError>,
) -> Result<(), MeshIoError> {
    let list = element.properties.iter().position(|property| {
        ["vertex_indices", "vertex_index"].contains(&&*property.name)
            && matches!(property.property_type, PropertyType::List { .. })
    });
    let list = list.ok_or_else(|| body.refuse(Place::Face(0), "missing field `vertex_indices`"))?;
    for row in 0..element.count as u64 {
        let place = Place::Face(row);
        for (number, property) in element.properties.iter().enumerate() {
            match &property.property_type {
                &PropertyType::List { count_type, data_type } if number == list => {
                    if is_float(data_type) {
                        return Err(body.refuse(place, "the numbers of vertices are not whole numbers"));
                    }
                    let count = body.count(count_type, place)?;
                    take(count, data_type, place, body)?;
                }
                kind => skip(kind, place, body)?,
            }
        }
    }
    Ok(())
}

fn skip_rows(
    element: &ElementDef,
    place: impl Fn(u64) -> Place,
    body: &mut Body<'_, '_>,
) -> Result<(), MeshIoError> {
    for row in 0..element.count as u64 {
        for property in &element.properties {
            skip(&property.property_type, place(row), body)?;
        }
    }
    Ok(())
}

fn skip(kind: &PropertyType, place: Place, body: &mut Body<'_, '_>) -> Result<(), MeshIoError> {
    match *kind {
        PropertyType::Scalar(kind) => body.skip(1, kind, place),
        PropertyType::List { count_type, data_type } => {
            let count = body.count(count_type, place)?;
            body.skip(count, data_type, place)
        }
    }
}
