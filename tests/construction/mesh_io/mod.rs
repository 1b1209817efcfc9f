//! Mesh files: every format in small, and every way in which a file can be wrong.

mod heights;
mod layout;
mod maps;
mod polygons;
mod precision;
mod wrong;

use std::fs;
use std::io::{Cursor, Write};
use std::path::PathBuf;

use crate::reading::{assert_well_formed, counts, read};
use foldfront::Mesh;
use foldfront::construction::mesh_io::{self, Collector, HeightScale, MeshIoError, ReadOptions};
use png::{BitDepth, ColorType};
use proptest::prelude::*;
use tempfile::TempDir;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;

/// Reads `bytes` as a file of this name.
fn read_bytes(name: &str, bytes: impl AsRef<[u8]>) -> Result<Mesh, MeshIoError> {
    let folder = tempfile::tempdir().unwrap();
    read(&[write(&folder, name, bytes)])
}

fn write(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// The message for a file that can not be read, without the name of its folder. It has to be one line.
fn error(name: &str, bytes: impl AsRef<[u8]>) -> String {
    let folder = tempfile::tempdir().unwrap();
    let message = read(&[write(&folder, name, bytes)]).unwrap_err().to_string();
    assert!(!message.contains('\n'), "{message}");
    message.replace(&format!("{}/", folder.path().display()), "")
}

/// The area of all triangles, and that of those that turn as the z axis does, less the others, seen along it.
fn areas(mesh: &Mesh) -> (f64, f64) {
    let mut sums = (0.0, 0.0);
    for facet in facets(mesh) {
        let [a, b, c] = facet.map(|p| p.map(f64::from));
        let [u, v] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        let cross = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        sums.0 += cross.iter().map(|x| x * x).sum::<f64>().sqrt() / 2.0;
        sums.1 += cross[2] / 2.0;
    }
    sums
}

/// Width, depth and lowest and highest height.
fn bounds(mesh: &Mesh) -> [f32; 4] {
    let (low, high) = mesh.bounding_box().unwrap();
    [high[0] - low[0], high[1] - low[1], low[2], high[2]]
}

fn assert_near(found: &[f32], expected: &[f32], text: &str) {
    let near = found.iter().zip(expected).all(|(f, e)| (f - e).abs() <= 1e-4 * e.abs());
    assert!(near && found.len() == expected.len(), "{text}: {found:?}, not {expected:?}");
}

/// A square in the plane z = 0, and a triangle standing on its first edge.
const OBJ: &str = "\
# comment
o thing
v 0 0 0
v 1 0 0 1.0
v 1 1 0 0.5 0.5 0.5
v 0 1 0
vt 0 0
vn 0 0 1
g part
usemtl \u{e9}
v 0.5 0 1 # a tip
f 1/1/1 2/1/1 3//1 4/1
f -5 \\
  2 -1
";

fn small() -> Mesh {
    Mesh {
        positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.0, 1.0]],
        triangles: vec![[0, 1, 2], [0, 2, 3], [0, 1, 4]],
        ..Mesh::default()
    }
}

const OFF: &str = "OFF # comment\n\n5 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n0.5 0 1\n4 0 1 2 3\n3 0 1 4 255 0 0\n";

const PLY_HEADER: &str = "\
element junk 2
property list uchar short values
property double weight
element vertex 5
property uchar red
property double z
property float x
property list ushort float numbers
property short y
element face 2
property char flag
property list int uint vertex_index
end_header
";

const PLY_BODY: &str = "\
2 -7 8 0.25
0 1e3
1 0 0 0 0
2 0 1 2 0.5 0.5 0
3 0 1 0 1
4 0 0 0 1
5 1 0.5 0 0
-1 4 0 1 2 3
1 3 0 1 4";

fn ply_text() -> Vec<u8> {
    format!("ply\nformat ascii 1.0\ncomment \u{df}\n{PLY_HEADER}{PLY_BODY}").into_bytes()
}

/// The same in binary: each word of the text in the type that the header gives it.
fn ply_binary(big: bool) -> Vec<u8> {
    let mut bytes =
        format!("ply\nformat binary_{}_endian 1.0\n{PLY_HEADER}", if big { "big" } else { "little" })
            .into_bytes();
    let mut words = PLY_BODY.split_whitespace();
    let mut put = |kind: &str| -> usize {
        let word: f64 = words.next().unwrap().parse().unwrap();
        let mut number = match kind {
            "uchar" => vec![word as u8],
            "char" => (word as i8).to_le_bytes().to_vec(),
            "short" => (word as i16).to_le_bytes().to_vec(),
            "ushort" => (word as u16).to_le_bytes().to_vec(),
            "int" => (word as i32).to_le_bytes().to_vec(),
            "uint" => (word as u32).to_le_bytes().to_vec(),
            "float" => (word as f32).to_le_bytes().to_vec(),
            _ => word.to_le_bytes().to_vec(),
        };
        if big {
            number.reverse();
        }
        bytes.extend(number);
        word as usize
    };
    for (rows, properties) in [
        (2, &["uchar short", "double"][..]),
        (5, &["uchar", "double", "float", "ushort float", "short"]),
        (2, &["char", "int uint"]),
    ] {
        for property in (0..rows).flat_map(|_| properties) {
            match property.split_once(' ') {
                Some((count, item)) => {
                    for _ in 0..put(count) {
                        put(item);
                    }
                }
                None => {
                    put(property);
                }
            }
        }
    }
    bytes
}

fn facets(mesh: &Mesh) -> impl Iterator<Item = [[f32; 3]; 3]> {
    mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize]))
}

fn stl_text() -> String {
    let mut text = "solid some name\n".to_owned();
    for facet in facets(&small()) {
        text += "facet normal 0 0 0\n outer loop\n";
        for [x, y, z] in facet {
            text += &format!("  vertex {x:e} {y} {z}\n");
        }
        text += " endloop\nendfacet\n";
    }
    text + "endsolid some name\n"
}

fn stl_binary(header: &[u8]) -> Vec<u8> {
    let mut bytes = header.to_vec();
    bytes.resize(80, b' ');
    bytes.extend(3_u32.to_le_bytes());
    for facet in facets(&small()) {
        bytes.extend([0; 12]);
        bytes.extend(facet.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        bytes.extend([7, 7]);
    }
    bytes
}

/// The vertices are in the order in which the faces use them, so that even STL gives them back.
#[test]
fn every_format_gives_the_same_mesh() {
    for (name, bytes) in samples() {
        assert_eq!(read_bytes(name, bytes).unwrap(), small(), "{name}");
    }
    assert_eq!(read_bytes("s.STL", stl_binary(b"solid but binary")).unwrap(), small());
    assert_eq!(read_bytes("s.off", OFF.replace("OFF # comment\n\n5", "OFF5")).unwrap(), small());
    assert_eq!(read_bytes("s.off", OFF.replace("OFF", "COFF")).unwrap(), small());
    assert_eq!(read_bytes("s.off", OFF.replace('\n', "\r\n")).unwrap(), small());
    assert_eq!(read_bytes("s.obj", OBJ.replace('\n', "\r\n")).unwrap(), small());
}

fn samples() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("s.obj", OBJ.into()),
        ("s.off", OFF.into()),
        ("s.ply", ply_text()),
        ("s.ply", ply_binary(false)),
        ("s.ply", ply_binary(true)),
        ("s.stl", stl_text().into()),
        ("s.stl", stl_binary(b"")),
    ]
}

#[test]
fn write_ply_and_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.ply");
    let mut mesh = small();
    mesh.positions.push([f32::MIN_POSITIVE, -0.0, f32::MAX]);
    mesh_io::write_ply(&path, &mesh, None).unwrap();
    assert_eq!(read(&[&path]).unwrap(), mesh);
    mesh_io::write_ply(&path, &mesh, Some(&[[10, b'\n', 255]; 6])).unwrap();
    assert_eq!(read(&[&path]).unwrap(), mesh);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    let error = mesh_io::write_ply(&path, &mesh, Some(&[])).unwrap_err();
    assert_eq!(error.to_string(), format!("{}: 0 colours for 6 vertices", path.display()));
}

#[test]
fn stl_welds_negative_zero_and_drops_what_collapses() {
    let text = "SOLID\nFACET NORMAL 0 0 0\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nENDFACET\n\
                facet\nvertex -0 0 -0\nvertex 0 1 0\nvertex 0 0 1\nendfacet\n\
                facet\nvertex 0 -0 0\nvertex 0 1 0\nvertex 0 1 0\nendfacet\nendsolid";
    let mesh = read_bytes("s.stl", text).unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.positions[0].map(f32::to_bits), [0; 3]);
}

#[test]
fn faces_may_come_before_their_vertices_and_without_surface() {
    let mesh = read_bytes("s.obj", "f 1 2 3\nf 1 2\nf 1 1 2\nv 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\n").unwrap();
    assert_eq!(mesh.triangles, [[0, 1, 2]]);
}

/// Three rows of four 16-bit samples: 0, 1000, 2000, …
fn png(colour: ColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 4, 3);
    encoder.set_color(colour);
    encoder.set_depth(BitDepth::Sixteen);
    let data: Vec<u8> = (0..12 * colour.samples() as u16).flat_map(|i| (1000 * i).to_be_bytes()).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
    bytes
}

/// Three rows of four floating point heights with GeoTIFF's and GDAL's tags; the last is a void.
fn tiff() -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    let mut image = encoder.new_image::<colortype::Gray32Float>(4, 3).unwrap();
    let tags = image.encoder();
    tags.write_tag(Tag::ModelPixelScaleTag, &[30.0_f64, 20.0, 0.0][..]).unwrap();
    tags.write_tag(Tag::GdalNodata, "-9999").unwrap();
    image.write_data(&[0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, f32::NAN, -9999.0]).unwrap();
    bytes.into_inner()
}
