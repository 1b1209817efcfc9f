//! Meshes and height maps from files, and meshes into PLY files.
//!
//! | extension | read are |
//! |---|---|
//! | `.obj` | positions and faces of all groups |
//! | `.ply` | the elements `vertex`, `face` and `tristrips`, in text or binary |
//! | `.stl` | facets in text or binary, with equal corners joined |
//! | `.off` | positions and faces, in text |
//! | `.hgt` | a height tile of 1201 or 3601 samples a side; several are one mosaic |
//! | `.zip` | the `.hgt` tiles in it |
//! | `.png` | a grey height map of 8 or 16 bits |
//! | `.tif`, `.tiff` | a height map of 8 or 16 bits unsigned, 16 bits signed or floating point, also GeoTIFF |
//!
//! Coordinates are read in the precision of the file: that of 64 bits in text but for a `float` of PLY, and of the type in binary. If
//! 32 bits hold all of them, the mesh has them as they are; otherwise its positions are about its middle, which is the origin
//! of its [`Georeference`](vertex_tree::Georeference).
//!
//! Vertices are neither split nor merged (but for STL, which has none), so that their numbers are those of the file,
//! and unused ones are kept. Polygons are triangulated, whether convex or not. What has no surface is left out: a
//! face with fewer than three corners, and a triangle that names a vertex twice.
//!
//! Terrain lies in the xy plane with x to the east, y to the north and z up, its middle at the origin. Where there
//! are voids, it has holes: triangles with a void corner, and samples that no other triangle uses, are left out.
//!
//! Text may begin with the byte order mark of UTF-8, and comments come in any encoding. A file holds what it announces, no less
//! and no more.
//!
//! A file that is damaged, or was made to do harm, gives an error; it never takes more memory than a small multiple
//! of its (uncompressed) length.

mod collector;
mod error;
mod extension;
mod geotiff;
mod hgt;
mod input;
mod limits;
mod obj;
mod off;
mod ply;
mod png_map;
mod polygon;
mod raster;
mod receiver;
mod rounding;
mod stl;
mod stl_text;
mod terrain;
mod text;
mod tiff_map;
mod tiff_tags;
mod triangulate;
mod weld;
mod words;
mod write_ply;

pub use collector::Collector;
pub use error::{MeshIoError, Place};
pub use extension::EXTENSIONS;
pub use raster::HeightScale;
pub use receiver::Receiver;
pub(crate) use rounding::{Bounds, Placing, exact};
pub use write_ply::write_ply;

use std::path::Path;

use container::DegreeMap;

use crate::progress::Progress;
use collapse_log::Mesh;
use extension::extension;
use input::Input;

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
    let mut collector = Collector::default();
    deliver(inputs, options, None, &mut collector, progress)?;
    Ok(collector.into_mesh())
}

/// Reads as [`read_with`] does, but hands the mesh on piece by piece: `.ply`, `.obj`, `.off`, `.hgt` and `.zip` take no memory
/// to speak of, whatever their size; of `.stl`, the vertices are in memory, and of height maps, the samples. Temporary files
/// are made in `folder`. A [`Collector`] that takes the mesh comes to what [`read_with`] gives.
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
    deliver(inputs, options, Some(folder), receiver, progress)
}

/// Hands a mesh on, with temporary files in `folder`, or everything that is needed in memory if there is none.
fn deliver(
    inputs: &[impl AsRef<Path>],
    options: &ReadOptions,
    folder: Option<&Path>,
    receiver: &mut dyn Receiver,
    progress: Progress<'_>,
) -> Result<(), MeshIoError> {
    let files = check(inputs)?;
    let file = files[0];
    let mut counting = Counting { receiver, vertices: 0, triangles: 0 };
    let contents = match &*extension(file) {
        "hgt" | "zip" => hgt::send(&files, folder, &mut counting, progress)?,
        "obj" if folder.is_none() => obj::read(file, &mut counting, progress)?,
        "obj" => obj::send(file, &mut counting, progress)?,
        "ply" => ply::send(file, &mut counting, progress)?,
        "stl" => stl::send(file, &mut counting, progress)?,
        "off" => off::send(file, &mut counting, progress)?,
        extension => {
            let input = Input::open(file, &mut *progress)?;
            let raster = match extension {
                "png" => png_map::read(input, options.height_scale)?,
                _ => tiff_map::read(input, options.height_scale)?,
            };
            raster.send(file, &mut counting, progress)?
        }
    };
    match counting {
        Counting { triangles: 1.., .. } => Ok(()),
        Counting { vertices: points @ 1.., .. } if !contents.faces => {
            Err(MeshIoError::PointCloud { file: file.to_owned(), points })
        }
        _ => Err(MeshIoError::Empty { file: file.to_owned() }),
    }
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

/// Counts what is on its way to another receiver.
struct Counting<'a> {
    receiver: &'a mut dyn Receiver,
    vertices: u64,
    triangles: u64,
}

impl Receiver for Counting<'_> {
    fn position(&mut self, position: [f64; 3]) -> std::io::Result<()> {
        self.vertices += 1;
        self.receiver.position(position)
    }

    fn triangle(&mut self, corners: [u32; 3]) -> std::io::Result<()> {
        self.triangles += 1;
        self.receiver.triangle(corners)
    }

    fn position_of(&mut self, vertex: u32) -> std::io::Result<[f64; 3]> {
        self.receiver.position_of(vertex)
    }

    fn georeference(&mut self, coordinate_system: &str, degrees: Option<DegreeMap>) {
        self.receiver.georeference(coordinate_system, degrees);
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
