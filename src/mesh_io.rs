//! Meshes and height maps from files, and meshes into PLY files.
//!
//! | extension | read are |
//! |---|---|
//! | `.obj` | positions and faces of all groups |
//! | `.ply` | the elements `vertex` and `face`, in text or binary |
//! | `.stl` | facets in text or binary, with equal corners joined |
//! | `.off` | positions and faces, in text |
//! | `.hgt` | a height tile of 1201 or 3601 samples a side; several are one mosaic |
//! | `.zip` | the `.hgt` tiles in it |
//! | `.png` | a grey height map of 8 or 16 bits |
//! | `.tif`, `.tiff` | a height map of 8 or 16 bits unsigned, 16 bits signed or floating point, also GeoTIFF |
//!
//! Vertices are neither split nor merged (but for STL, which has none), so that their numbers are those of the file,
//! and unused ones are kept. Polygons are triangulated, whether convex or not. What has no surface is left out: a
//! face with fewer than three corners, and a triangle that names a vertex twice.
//!
//! Terrain lies in the xy plane with x to the east, y to the north and z up, its middle at the origin. Where there
//! are voids, it has holes: triangles with a void corner, and samples that no other triangle uses, are left out.
//!
//! A file that is damaged, or was made to do harm, gives an error; it never takes more memory than a small multiple
//! of its (uncompressed) length.

mod error;
mod hgt;
mod input;
mod obj;
mod off;
mod ply;
mod polygon;
mod raster;
mod receiver;
mod stl;
mod terrain;
mod text;

pub use error::{MeshIoError, Place};
pub use ply::write_ply;
pub use receiver::Receiver;

use std::path::Path;

use crate::Mesh;
use crate::progress::Progress;
use input::Input;

/// The extensions that are read, in lower case.
pub const EXTENSIONS: [&str; 9] = ["obj", "ply", "stl", "off", "hgt", "zip", "png", "tif", "tiff"];

/// Every vertex number, and the number of vertices, is below [`NONE`](crate::vertex_tree::NONE).
const MAX_VERTICES: usize = crate::vertex_tree::NONE as usize - 1;

/// How the samples of a `.png` or `.tif` height map become positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeightScale {
    /// Distance between neighbouring samples, in object space.
    pub spacing: f64,
    /// Height of a sample of value 1 above one of value 0, in object space.
    pub vertical: f64,
    /// Height of a sample of value 0.
    pub offset: f64,
}

/// What may be said about inputs that do not say it themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Scale of a `.png` or `.tif` height map.
    ///
    /// Without it, a GeoTIFF has the spacing of its tags and heights as they are; spacing in degrees is turned into
    /// metres. Other files have spacing 1. There unsigned samples are scaled so that the whole range of their type
    /// would rise by 1/16 of the longer side: steep, but within 30 percent of the true relief of a map of the Mont
    /// Blanc and one of the Grand Canyon. Signed and floating point samples are taken as heights.
    pub height_scale: Option<HeightScale>,
}

/// Reads one file, or several height tiles (`.hgt`, or `.zip` archives of them) as one mosaic.
///
/// Progress counts bytes, then rows of a height map.
///
/// # Errors
/// Whatever is wrong with the files. A mesh that is returned has a triangle, and is as [`Mesh`] demands.
pub fn read(inputs: &[impl AsRef<Path>], progress: Progress<'_>) -> Result<Mesh, MeshIoError> {
    read_with(inputs, &ReadOptions::default(), progress)
}

/// As [`read`], with options.
///
/// # Errors
/// As [`read`].
pub fn read_with(
    inputs: &[impl AsRef<Path>],
    options: &ReadOptions,
    progress: Progress<'_>,
) -> Result<Mesh, MeshIoError> {
    let inputs = check(inputs)?;
    let first = inputs[0];
    let mesh = match &*extension(first) {
        "hgt" | "zip" => hgt::read(&inputs, progress)?,
        extension => {
            let input = Input::open(first, &mut *progress)?;
            match extension {
                "obj" => obj::read(input)?,
                "ply" => ply::read(input)?,
                "stl" => stl::read(input)?,
                "off" => off::read(input)?,
                "png" => terrain::to_mesh(&raster::read_png(input, options.height_scale)?, first, progress)?,
                _ => terrain::to_mesh(&raster::read_tiff(input, options.height_scale)?, first, progress)?,
            }
        }
    };
    if mesh.triangles.is_empty() {
        return Err(MeshIoError::Empty { file: first.to_owned() });
    }
    Ok(mesh)
}

/// Reads as [`read_with`] does, but hands the mesh on piece by piece: `.ply`, `.obj`, `.hgt` and `.zip` take no memory to
/// speak of, whatever their size; the other formats are in memory until they have been handed on. Temporary files are
/// made in `folder`.
///
/// # Errors
/// As [`read`], and [`MeshIoError::Receiver`].
pub fn send(
    inputs: &[impl AsRef<Path>],
    options: &ReadOptions,
    folder: &Path,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<(), MeshIoError> {
    let files = check(inputs)?;
    let mut counting = Counting { receiver, triangles: 0 };
    match &*extension(files[0]) {
        "hgt" | "zip" => hgt::send(&files, folder, &mut counting, progress)?,
        "obj" => obj::send(files[0], &mut counting, progress)?,
        "ply" => ply::send(files[0], &mut counting, progress)?,
        _ => {
            let mesh = read_with(inputs, options, progress)?;
            mesh.positions.iter().try_for_each(|&p| counting.position(p)).map_err(MeshIoError::Receiver)?;
            mesh.triangles.iter().try_for_each(|&t| counting.triangle(t)).map_err(MeshIoError::Receiver)?;
        }
    }
    if counting.triangles == 0 { Err(MeshIoError::Empty { file: files[0].to_owned() }) } else { Ok(()) }
}

/// About how many triangles there are in files, by their lengths alone; 0 where that says nothing.
#[must_use]
pub fn expected_triangles(files: &[impl AsRef<Path>]) -> u64 {
    let expected = |file: &Path| {
        let bytes = std::fs::metadata(file).map_or(0, |m| m.len());
        match &*extension(file) {
            // Two bytes a sample, two triangles a cell; archived tiles are a half as large or less.
            "hgt" => bytes,
            "zip" => 2 * bytes,
            // As text, and half as many as there are in a binary file.
            "ply" | "obj" | "off" => bytes / 40,
            "stl" => bytes / 50,
            _ => 0,
        }
    };
    files.iter().map(|file| expected(file.as_ref())).sum()
}

/// Counts the triangles on their way to another receiver.
struct Counting<'a> {
    receiver: &'a mut dyn Receiver,
    triangles: u64,
}

impl Receiver for Counting<'_> {
    fn position(&mut self, position: [f32; 3]) -> std::io::Result<()> {
        self.receiver.position(position)
    }

    fn triangle(&mut self, corners: [u32; 3]) -> std::io::Result<()> {
        self.triangles += 1;
        self.receiver.triangle(corners)
    }

    fn position_of(&mut self, vertex: u32) -> std::io::Result<[f32; 3]> {
        self.receiver.position_of(vertex)
    }
}

/// Checks that there are inputs, that their formats are known, and that several are tiles.
fn check(inputs: &[impl AsRef<Path>]) -> Result<Vec<&Path>, MeshIoError> {
    let inputs: Vec<&Path> = inputs.iter().map(AsRef::as_ref).collect();
    if inputs.is_empty() {
        return Err(MeshIoError::NoInput);
    }
    for file in &inputs {
        let extension = extension(file);
        if !EXTENSIONS.contains(&&*extension) {
            return Err(MeshIoError::UnknownExtension { file: file.to_path_buf(), extension });
        }
        if inputs.len() > 1 && !["hgt", "zip"].contains(&&*extension) {
            return Err(MeshIoError::NotATile { file: file.to_path_buf() });
        }
    }
    Ok(inputs)
}

/// The extension in lower case, empty if there is none.
fn extension(file: &Path) -> String {
    file.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}
