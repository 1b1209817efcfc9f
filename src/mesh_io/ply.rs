//! The Stanford polygon format: read in text and both binary forms, written in little-endian binary.
//!
//! Vertices are the properties `x y z` of the element `vertex`, faces the list `vertex_indices` or `vertex_index` of
//! the element `face`, whatever their types and order; everything else is skipped.

use std::cell::RefCell;
use std::fs::File;
use std::io::{self, BufRead, BufWriter, Read, Write};
use std::path::Path;

use serde::Deserialize;
use serde::de::MapAccess;
use serde_ply::{DeserializeError, PlyFormat, PlyReader, RowVisitor};

use super::input::Input;
use super::polygon::{FaceSender, Faces};
use super::{MAX_VERTICES, MeshIoError, Place, Receiver};
use crate::progress::Progress;
use crate::{Mesh, output};

#[derive(Deserialize)]
struct Vertex {
    x: f32,
    y: f32,
    z: f32,
}

#[derive(Deserialize)]
struct Face {
    #[serde(alias = "vertex_index")]
    vertex_indices: Vec<i64>,
}

#[derive(Deserialize)]
struct Skipped {}

/// What has been read, and how far.
struct Contents {
    positions: Vec<[f32; 3]>,
    faces: Faces,
    face_count: u64,
    /// The first coordinate or index that no mesh can have.
    wrong: Option<Wrong>,
    /// The row being read, where it belongs to an element of interest.
    place: Option<Place>,
}

enum Wrong {
    Coordinate { vertex: u64, value: f64 },
    Index { face: u64, index: i64 },
}

pub(super) fn read(mut input: Input<'_>) -> Result<Mesh, MeshIoError> {
    let mut contents = Contents {
        positions: Vec::new(),
        faces: Faces::new(Place::Face),
        face_count: 0,
        wrong: None,
        place: None,
    };
    // The library wants white space behind the last word of a text file. In a binary file it would be data.
    let mut line_end = &b"\n"[..];
    let outcome = contents.read_from((&mut input).chain(&mut line_end));
    let file = || input.path.to_owned();
    let place = contents.place.unwrap_or(Place::Byte(input.position));
    match outcome {
        Ok(PlyFormat::Ascii) => {}
        Ok(_) if line_end.is_empty() => return Err(MeshIoError::Truncated { file: file(), place }),
        Ok(_) => {}
        Err(DeserializeError(error)) => return Err(input.io(place, error)),
    }
    match contents.wrong {
        None => contents.faces.into_mesh(input.path, contents.positions, 0),
        Some(Wrong::Coordinate { vertex, value }) => {
            Err(MeshIoError::NotFinite { file: file(), place: Place::Vertex(vertex), value })
        }
        Some(Wrong::Index { face, index }) => {
            let vertices = contents.positions.len();
            Err(MeshIoError::IndexOutOfRange { file: file(), place: Place::Face(face), index, vertices })
        }
    }
}

impl Contents {
    fn read_from(&mut self, reader: impl BufRead) -> Result<PlyFormat, DeserializeError> {
        let mut reader = PlyReader::from_reader(reader)?;
        let format = reader.header().format;
        check_elements(&reader)?;
        while let Some(element) = reader.current_element() {
            match element.name.as_str() {
                "vertex" => {
                    self.place = Some(Place::Vertex(0));
                    let rows = &mut RowVisitor::new(|vertex| self.push_vertex(&vertex));
                    (&mut reader).next_value_seed(rows)?;
                }
                "face" => {
                    self.place = Some(Place::Face(0));
                    let rows = &mut RowVisitor::new(|face| self.push_face(&face));
                    (&mut reader).next_value_seed(rows)?;
                }
                _ => (&mut reader).next_value_seed(&mut RowVisitor::new(|_: Skipped| {}))?,
            }
            self.place = None;
        }
        Ok(format)
    }

    fn push_vertex(&mut self, &Vertex { x, y, z }: &Vertex) {
        let vertex = self.positions.len() as u64;
        if let Some(value) = [x, y, z].into_iter().find(|c| !c.is_finite()) {
            self.wrong.get_or_insert(Wrong::Coordinate { vertex, value: f64::from(value) });
        }
        self.positions.push([x, y, z]);
        self.place = Some(Place::Vertex(vertex + 1));
    }

    fn push_face(&mut self, Face { vertex_indices }: &Face) {
        let face = self.face_count;
        for &index in vertex_indices {
            match u32::try_from(index) {
                Ok(vertex) => self.faces.push_corner(vertex),
                Err(_) => drop(self.wrong.get_or_insert(Wrong::Index { face, index })),
            }
        }
        self.faces.end_face(face);
        self.face_count += 1;
        self.place = Some(Place::Face(self.face_count));
    }
}

/// Refuses elements without properties: their rows would take no bytes, and reading them all could take forever.
fn check_elements<R: BufRead>(reader: &PlyReader<R>) -> Result<(), DeserializeError> {
    let mut elements = reader.header().elem_defs.iter();
    match elements.find(|e| e.properties.is_empty() && e.count > 0) {
        None => Ok(()),
        Some(element) => {
            let message = format!("element {} has no properties", element.name);
            Err(io::Error::new(io::ErrorKind::InvalidData, message).into())
        }
    }
}

/// As [`read`], but piece by piece. Where faces come before the vertices, the file is read twice.
pub(super) fn send(
    file: &Path,
    receiver: &mut dyn Receiver,
    mut progress: Progress<'_>,
) -> Result<(), MeshIoError> {
    let mut vertices = 0;
    let are_late = send_elements(file, receiver, &mut vertices, true, &mut progress)?;
    if are_late {
        send_elements(file, receiver, &mut vertices, false, &mut progress)?;
    }
    Ok(())
}

/// Reads the file once, and hands on vertices, if they are asked for, and those faces that come when there are vertices.
/// Says whether there are others.
fn send_elements(
    path: &Path,
    receiver: &mut dyn Receiver,
    vertices: &mut usize,
    with_vertices: bool,
    progress: Progress<'_>,
) -> Result<bool, MeshIoError> {
    let mut input = Input::open(path, progress)?;
    // What a row has led to: rows can not fail, so the file seems to end there.
    let failed = RefCell::new(None);
    let fail = |error| {
        failed.borrow_mut().get_or_insert(error);
    };
    let mut are_late = false;
    let mut place = None;
    let mut line_end = &b"\n"[..];
    let outcome = (|| -> Result<PlyFormat, DeserializeError> {
        let reader = Stopping { reader: (&mut input).chain(&mut line_end), failed: &failed };
        let mut reader = PlyReader::from_reader(reader)?;
        let format = reader.header().format;
        check_elements(&reader)?;
        while let Some(element) = reader.current_element() {
            match element.name.as_str() {
                "vertex" if with_vertices => {
                    place = Some(Place::Vertex(*vertices as u64));
                    let rows = &mut RowVisitor::new(|Vertex { x, y, z }: Vertex| {
                        let here = Place::Vertex(*vertices as u64);
                        let wrong = [x, y, z].into_iter().find(|c| !c.is_finite());
                        if failed.borrow().is_some() {
                        } else if let Some(value) = wrong.map(f64::from) {
                            fail(MeshIoError::NotFinite { file: path.to_owned(), place: here, value });
                        } else if *vertices == MAX_VERTICES {
                            fail(MeshIoError::TooManyVertices { file: path.to_owned() });
                        } else if let Err(error) = receiver.position([x, y, z]) {
                            fail(MeshIoError::Receiver(error));
                        }
                        *vertices += 1;
                        place = Some(Place::Vertex(*vertices as u64));
                    });
                    (&mut reader).next_value_seed(rows)?;
                }
                "face" if *vertices > 0 => {
                    place = Some(Place::Face(0));
                    let mut sender = FaceSender::new(&mut *receiver, *vertices, path);
                    let (mut number, mut corners) = (0, Vec::new());
                    let rows = &mut RowVisitor::new(|Face { vertex_indices }: Face| {
                        let here = Place::Face(number);
                        number += 1;
                        place = Some(Place::Face(number));
                        corners.clear();
                        corners.extend(vertex_indices.iter().filter_map(|&v| u32::try_from(v).ok()));
                        if failed.borrow().is_some() {
                        } else if let Some(&index) =
                            vertex_indices.iter().find(|&&v| u32::try_from(v).is_err())
                        {
                            let vertices = sender.vertices;
                            fail(MeshIoError::IndexOutOfRange {
                                file: path.to_owned(),
                                place: here,
                                index,
                                vertices,
                            });
                        } else if let Err(error) = sender.send(&corners, here, 0) {
                            fail(error);
                        }
                    });
                    (&mut reader).next_value_seed(rows)?;
                }
                name => {
                    are_late |= name == "face";
                    (&mut reader).next_value_seed(&mut RowVisitor::new(|_: Skipped| {}))?;
                }
            }
            place = None;
        }
        Ok(format)
    })();
    if let Some(error) = failed.into_inner() {
        return Err(error);
    }
    let place = place.unwrap_or(Place::Byte(input.position));
    match outcome {
        Ok(PlyFormat::Ascii) => Ok(are_late),
        Ok(_) if line_end.is_empty() => Err(MeshIoError::Truncated { file: path.to_owned(), place }),
        Ok(_) => Ok(are_late),
        Err(DeserializeError(error)) => Err(input.io(place, error)),
    }
}

/// A reader that ends when something else has gone wrong.
struct Stopping<'f, R> {
    reader: R,
    failed: &'f RefCell<Option<MeshIoError>>,
}

impl<R: BufRead> Read for Stopping<'_, R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.failed.borrow().is_some() { Ok(0) } else { self.reader.read(buffer) }
    }
}

impl<R: BufRead> BufRead for Stopping<'_, R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.failed.borrow().is_some() { Ok(&[]) } else { self.reader.fill_buf() }
    }

    fn consume(&mut self, bytes: usize) {
        self.reader.consume(bytes);
    }
}

/// Writes a mesh as binary PLY, with a colour (red, green, blue) for each vertex if there are any: to a temporary
/// name beside `path`, synced, then renamed.
///
/// # Errors
/// [`MeshIoError::Io`], and [`MeshIoError::ColourCount`] if there are more or fewer colours than vertices.
pub fn write_ply(path: &Path, mesh: &Mesh, colours: Option<&[[u8; 3]]>) -> Result<(), MeshIoError> {
    let vertices = mesh.positions.len();
    if let Some(colours) = colours.map(<[_]>::len).filter(|&n| n != vertices) {
        return Err(MeshIoError::ColourCount { file: path.to_owned(), colours, vertices });
    }
    let io = |source| MeshIoError::Io { file: path.to_owned(), source };
    output::write_with(path, |file| write_to(file, mesh, colours)).map_err(io)
}

fn write_to(file: &mut File, mesh: &Mesh, colours: Option<&[[u8; 3]]>) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 20, file);
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.positions.len())?;
    writeln!(out, "property float x\nproperty float y\nproperty float z")?;
    if colours.is_some() {
        writeln!(out, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
    }
    // Many readers know only `int` here; it serves as long as the numbers fit.
    let index = if mesh.positions.len() <= i32::MAX as usize { "int" } else { "uint" };
    writeln!(out, "element face {}", mesh.triangles.len())?;
    writeln!(out, "property list uchar {index} vertex_indices\nend_header")?;
    for (vertex, position) in mesh.positions.iter().enumerate() {
        out.write_all(position.map(f32::to_le_bytes).as_flattened())?;
        if let Some(colours) = colours {
            out.write_all(&colours[vertex])?;
        }
    }
    for triangle in &mesh.triangles {
        out.write_all(&[3])?;
        out.write_all(triangle.map(u32::to_le_bytes).as_flattened())?;
    }
    out.flush()
}
