//! PLY files, written in little-endian binary.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::error::MeshIoError;
use collapse_log::Mesh;
use container::output;

/// Writes a mesh as binary PLY, with a colour (red, green, blue) for each vertex if there are any: to a temporary
/// name beside `path`, synced, then renamed. Coordinates are those of the world: as `float`, bit for bit those of the mesh,
/// if its origin is 0, and otherwise as `double`.
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
    let is_local = mesh.georeference.origin == [0.0; 3];
    let number = if is_local { "float" } else { "double" };
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.positions.len())?;
    writeln!(out, "property {number} x\nproperty {number} y\nproperty {number} z")?;
    if colours.is_some() {
        writeln!(out, "property uchar red\nproperty uchar green\nproperty uchar blue")?;
    }
    // Many readers know only `int` here; it serves as long as the numbers fit.
    let index = if mesh.positions.len() <= i32::MAX as usize { "int" } else { "uint" };
    writeln!(out, "element face {}", mesh.triangles.len())?;
    writeln!(out, "property list uchar {index} vertex_indices\nend_header")?;
    for (vertex, &position) in mesh.positions.iter().enumerate() {
        if is_local {
            out.write_all(position.map(f32::to_le_bytes).as_flattened())?;
        } else {
            out.write_all(mesh.georeference.world(position).map(f64::to_le_bytes).as_flattened())?;
        }
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
