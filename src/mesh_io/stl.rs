//! STL, binary and text.
//!
//! The format repeats the corners for every facet. Corners with the same coordinates become one vertex (-0 is 0;
//! nothing is merged that differs in the last bit), in the order of first use. Facets that name a vertex twice then
//! are left out; normals, colours and names are skipped.

use std::collections::HashMap;
use std::io::{BufRead, Read};
use std::path::Path;

use super::input::{Input, read_error};
use super::polygon::push_triangle;
use super::text::Lines;
use super::{MAX_VERTICES, MeshIoError, Place};
use crate::Mesh;

const HEADER_BYTES: usize = 84;
const FACET_BYTES: usize = 50;

pub(super) fn read(mut input: Input<'_>) -> Result<Mesh, MeshIoError> {
    let file = input.path;
    let start = input.fill_buf().map_err(|e| read_error(file, Place::Byte(0), e))?;
    let start = &start[..start.len().min(HEADER_BYTES)];
    // Binary files, too, may begin with "solid", but no text has the zero bytes of a short name and a small count.
    let text = start.trim_ascii_start().get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"))
        && !start.contains(&0);
    let mut weld = Weld::default();
    if text {
        read_text(&mut input, &mut weld)?;
    } else {
        read_binary(&mut input, &mut weld)?;
    }
    Ok(weld.mesh)
}

fn read_text(input: &mut Input<'_>, weld: &mut Weld) -> Result<(), MeshIoError> {
    let file = input.path;
    let mut lines = Lines::new(input);
    let mut corners = Vec::new();
    let mut open = false;
    while let Some(mut line) = lines.next()? {
        let word = line.word().unwrap_or("");
        match word.to_ascii_lowercase().as_str() {
            "solid" => open = true,
            "vertex" if corners.len() < 3 => corners.push(line.position()?),
            "endfacet" => {
                let Ok(facet) = <[_; 3]>::try_from(&*corners) else {
                    return Err(line.malformed("three vertices", &corners.len().to_string()));
                };
                weld.push(facet, file)?;
                corners.clear();
            }
            "endsolid" => open = false,
            "facet" | "outer" | "endloop" => {}
            _ => return Err(line.malformed("an STL keyword", word)),
        }
    }
    if open { Err(lines.truncated(lines.number)) } else { Ok(()) }
}

/// 80 bytes of anything, the number of facets, and for each its normal, its corners and two bytes of anything.
fn read_binary(input: &mut Input<'_>, weld: &mut Weld) -> Result<(), MeshIoError> {
    let mut header = [0; HEADER_BYTES];
    input.read_exact(&mut header).map_err(|e| input.io(Place::Byte(0), e))?;
    let facets = u32::from_le_bytes([header[80], header[81], header[82], header[83]]);
    for number in 0..u64::from(facets) {
        let place = Place::Face(number);
        let mut record = [0; FACET_BYTES];
        input.read_exact(&mut record).map_err(|e| input.io(place, e))?;
        let float = |i: usize| {
            let at = 12 + 4 * i;
            f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
        };
        let facet: [[f32; 3]; 3] = std::array::from_fn(|v| std::array::from_fn(|axis| float(3 * v + axis)));
        if let Some(&bad) = facet.as_flattened().iter().find(|x| !x.is_finite()) {
            return Err(MeshIoError::NotFinite { file: input.path.to_owned(), place, value: f64::from(bad) });
        }
        weld.push(facet, input.path)?;
    }
    Ok(())
}

/// Facets joined where their corners agree.
#[derive(Default)]
struct Weld {
    mesh: Mesh,
    /// The vertex at each position, by the bits of its coordinates.
    vertices: HashMap<[u32; 3], u32>,
}

impl Weld {
    fn push(&mut self, facet: [[f32; 3]; 3], file: &Path) -> Result<(), MeshIoError> {
        let mut triangle = [0; 3];
        for (corner, position) in triangle.iter_mut().zip(facet) {
            // Adding 0 makes 0 of -0 and leaves everything else alone.
            let position = position.map(|x| x + 0.0);
            let next = self.mesh.positions.len() as u32;
            *corner = *self.vertices.entry(position.map(f32::to_bits)).or_insert(next);
            if *corner == next {
                if next as usize >= MAX_VERTICES {
                    return Err(MeshIoError::TooManyVertices { file: file.to_owned() });
                }
                self.mesh.positions.push(position);
            }
        }
        push_triangle(&mut self.mesh.triangles, triangle);
        Ok(())
    }
}
