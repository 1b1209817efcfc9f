//! Mesh files: the real data, every format in small, and every way in which a file can be wrong.

use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use foldfront::Mesh;
use foldfront::mesh_io::{self, Collector, HeightScale, MeshIoError, ReadOptions};
use png::{BitDepth, ColorType};
use proptest::prelude::*;
use tempfile::TempDir;
use tiff::encoder::{TiffEncoder, colortype};
use tiff::tags::Tag;

/// Reads at once, and piece by piece, which has to come to the same.
fn read(inputs: &[impl AsRef<Path>]) -> Result<Mesh, MeshIoError> {
    let whole = mesh_io::read(inputs, &mut |_, _| ());
    let mut pieces = Collector::default();
    let folder = std::env::temp_dir();
    let sent = mesh_io::send(inputs, &ReadOptions::default(), &folder, &mut pieces, &mut |_, _| ());
    let sent = sent.map(|()| pieces.into_mesh());
    match (&whole, &sent) {
        (Ok(whole), Ok(pieces)) => assert_eq!(whole, pieces),
        // Of several errors, another may be met first.
        (Err(_), Err(_)) => {}
        _ => panic!("at once {whole:?}, piece by piece {sent:?}"),
    }
    whole
}

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

fn counts(mesh: &Mesh) -> (usize, usize) {
    (mesh.positions.len(), mesh.triangles.len())
}

fn assert_well_formed(mesh: &Mesh) {
    assert!(mesh.positions.as_flattened().iter().all(|x| x.is_finite()));
    assert!(mesh.triangles.as_flattened().iter().all(|&v| (v as usize) < mesh.positions.len()));
    assert!(!mesh.triangles.is_empty());
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

#[test]
fn wrong_text_files() {
    for (name, text, message) in [
        ("s.obj", "v 0 0 0\nv 0 0\n", "s.obj: line 2: expected a coordinate, found \"\""),
        ("s.obj", "v 0 0 zero\n", "s.obj: line 1: expected a coordinate, found \"zero\""),
        ("s.obj", "v 0 nan 0\n", "s.obj: line 1: coordinate NaN is not a finite 32-bit number"),
        ("s.obj", "\nv 0 0 -4e38\n", "s.obj: line 2: coordinate -4e38 is not a finite 32-bit number"),
        ("s.obj", "v 0 0 0\nf 1 1 2\n", "s.obj: line 2: no vertex 2, there are 1"),
        ("s.obj", "v 0 0 0\nf 1 0 1\n", "s.obj: line 2: no vertex 0, there are 1"),
        ("s.obj", "v 0 0 0\nf 1 -2 1\n", "s.obj: line 2: no vertex -2, there are 1"),
        ("s.obj", "f 1 1 9999999999\n", "s.obj: line 1: no vertex 9999999999, there are 0"),
        ("s.obj", "f 1 x/1 1\n", "s.obj: line 1: expected a vertex number, found \"x/1\""),
        ("s.obj", "v 0 0 0\nf 1 1 1\n", "s.obj: no triangles"),
        ("s.obj", "", "s.obj: no triangles"),
        ("s.off", "PLY\n", "s.off: line 1: expected OFF, COFF, NOFF or CNOFF, found \"PLY\""),
        ("s.off", "OFF BINARY\n", "s.off: line 1: expected a number of vertices, found \"BINARY\""),
        ("s.off", "OFF\n3 1 0\n0 0 0\n", "s.off: line 4: the file ends too early"),
        ("s.off", "OFF\n1 1 0\n0 0 0\n3 0 0\n", "s.off: line 4: expected a vertex number, found \"\""),
        ("s.off", "OFF\n1 1 0\n0 0 0\n3 0 0 1\n", "s.off: line 4: no vertex 1, there are 1"),
        ("s.off", "OFF\n1 1 0\n0 0 0\n3 0 -1 0\n", "s.off: line 4: no vertex -1, there are 1"),
        (
            "s.off",
            "OFF\n99999999999 1 0\n0 0 inf\n",
            "s.off: line 3: coordinate inf is not a finite 32-bit number",
        ),
        (
            "s.stl",
            "solid\nfacet\nvertex 0 0 0\nendfacet\n",
            "s.stl: line 4: expected three vertices, found \"1\"",
        ),
        (
            "s.stl",
            "solid\nfacet\nvertex 0 0 inf\n",
            "s.stl: line 3: coordinate inf is not a finite 32-bit number",
        ),
        ("s.stl", "solid\nfacet\nvertex 0 0 0\n", "s.stl: line 4: the file ends too early"),
        ("s.stl", "solid\nfoo\n", "s.stl: line 2: expected an STL keyword, found \"foo\""),
        (
            "s.xyz",
            "",
            "s.xyz: unknown extension \"xyz\": expected obj, ply, stl, off, hgt, zip, png, tif, tiff",
        ),
        ("plain", "", "plain: unknown extension \"\": expected obj, ply, stl, off, hgt, zip, png, tif, tiff"),
    ] {
        assert_eq!(error(name, text), message);
    }
    // Looking at all blank lines again for each further one would take hours.
    assert_eq!(error("s.obj", "\n".repeat(1 << 22)), "s.obj: no triangles");
    let wide = format!("v 0 0 0\nf{}\n", " 1".repeat(20_000));
    assert_eq!(error("s.obj", wide), "s.obj: line 2: 20000 corners, at most 16384 are read");
}

#[test]
fn wrong_ply_and_stl_files() {
    let text = String::from_utf8(ply_text()).unwrap();
    let change = |from: &str, to: &str| {
        assert!(text.contains(from));
        error("s.ply", text.replacen(from, to, 1))
    };
    assert_eq!(
        change("1 0 0 0 0", "1 0 nan 0 0"),
        "s.ply: vertex 0: coordinate NaN is not a finite 32-bit number"
    );
    assert_eq!(change("-1 4 0 1 2 3", "-1 4 0 1 2 5"), "s.ply: face 0: no vertex 5, there are 5");
    assert_eq!(change("1 3 0 1 4", "1 3 0 1 9"), "s.ply: face 1: no vertex 9, there are 5");
    assert_eq!(change("1 3 0 1 4", "1 3 0 1"), "s.ply: face 1: the file ends too early");
    assert_eq!(change("1 3 0 1 4", "1 x 0 1 4"), "s.ply: face 1: Failed to parse i32 from ASCII");
    assert_eq!(change("1 3 0 1 4", "1 -3 0 1 4"), "s.ply: face 1: Negative list count");
    assert_eq!(change("uint vertex_index", "uint indices"), "s.ply: face 0: missing field `vertex_indices`");
    assert_eq!(change("vertex 5", "vertex 4000000000"), "s.ply: vertex 5: Failed to parse u8 from ASCII");
    assert_eq!(change("ply", "plx"), "s.ply: byte 4: File must start with 'ply'");
    // A header is read to the end of the line that is wrong, or of what is taken for one.
    for (from, to, until, message) in [
        ("vertex 5", "vertex x", "vertex x\n", "Invalid element count: x"),
        (
            "property char flag\nproperty list int uint vertex_index\n",
            "",
            "end_header\n",
            "element face has no properties",
        ),
        ("end_header", "end", "1 3 0 1 4", "the file ends too early"),
    ] {
        let changed = text.replacen(from, to, 1);
        let end = changed.find(until).unwrap() + until.len();
        assert_eq!(change(from, to), format!("s.ply: byte {end}: {message}"));
    }

    let mut binary = ply_binary(false);
    binary.pop();
    assert_eq!(error("s.ply", &binary), format!("s.ply: byte {}: the file ends too early", binary.len()));
    binary.pop();
    assert_eq!(error("s.ply", &binary), "s.ply: face 1: the file ends too early");

    let stl = stl_binary(b"");
    assert_eq!(error("s.stl", &stl[..stl.len() - 1]), "s.stl: face 2: the file ends too early");
    assert_eq!(error("s.stl", &stl[..60]), "s.stl: byte 0: the file ends too early");
    let mut stl = stl;
    stl[84 + 50 + 12..][..4].copy_from_slice(&f32::NEG_INFINITY.to_le_bytes());
    assert_eq!(error("s.stl", &stl), "s.stl: face 1: coordinate -inf is not a finite 32-bit number");
    stl[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    stl.truncate(84 + 50);
    assert_eq!(error("s.stl", &stl), "s.stl: face 1: the file ends too early");
}

#[test]
fn wrong_inputs() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(read(&[] as &[PathBuf]).unwrap_err().to_string(), "no input file");
    for name in ["gone.obj", "gone.ply", "N00E000.hgt", "gone.zip", "gone.png", "gone.tif"] {
        let path = folder.path().join(name);
        let error = read(&[&path]).unwrap_err();
        assert!(matches!(error, MeshIoError::Missing { .. }), "{error:?}");
        assert_eq!(error.to_string(), format!("{}: no such file", path.display()));
    }
    let error = read(&["N00E000.hgt", "b.obj"]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "b.obj: only height tiles (.hgt, .zip) can be read together with other files"
    );
    let path = folder.path().join("folder.obj");
    fs::create_dir(&path).unwrap();
    assert!(matches!(read(&[&path]).unwrap_err(), MeshIoError::Io { .. }));
}

#[test]
fn no_prefix_of_a_file_panics() {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in
        samples().into_iter().chain([("s.png", png(ColorType::Grayscale)), ("s.tif", tiff())])
    {
        for length in 0..bytes.len() {
            match read(&[write(&folder, name, &bytes[..length])]) {
                Ok(mesh) => assert_well_formed(&mesh),
                Err(error) => assert!(!error.to_string().contains('\n')),
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn no_flipped_bytes_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let folder = tempfile::tempdir().unwrap();
        let images = [("s.png", png(ColorType::Grayscale)), ("s.tif", tiff())];
        for (name, mut bytes) in samples().into_iter().chain(images) {
            for (at, value) in &flips {
                let at = at.index(bytes.len());
                bytes[at] ^= value;
            }
            if let Ok(mesh) = read(&[write(&folder, name, &bytes)]) {
                assert_well_formed(&mesh);
            }
        }
    }
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

#[test]
fn png_heights() {
    let mesh = read_bytes("s.png", png(ColorType::Grayscale)).unwrap();
    assert_eq!(counts(&mesh), (12, 12));
    assert_eq!(mesh.positions[0], [-1.5, 1.0, 0.0]);
    let top = 11_000.0 / 65_535.0 * 3.0 / 16.0;
    let [x, y, z] = mesh.positions[11];
    assert!((x, y) == (1.5, -1.0) && (z - top).abs() < 1e-6, "{z}");

    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder, "s.png", png(ColorType::Grayscale));
    let scale = HeightScale { spacing: 10.0, vertical: 0.5, offset: -100.0 };
    let options = ReadOptions { height_scale: Some(scale) };
    let mesh = mesh_io::read_with(&[path], &options, &mut |_, _| ()).unwrap();
    assert_eq!(mesh.positions[11], [15.0, -10.0, 5400.0]);

    assert_eq!(error("s.png", png(ColorType::Rgb)), "s.png: Rgb samples: a height map has to be grey");
}

#[test]
fn tiff_heights() {
    let mesh = read_bytes("s.TIFF", tiff()).unwrap();
    // Of the six cells, the last has one sample left and the one before it three.
    assert_eq!(counts(&mesh), (10, 9));
    assert_eq!(mesh.positions[0], [-45.0, 20.0, 0.5]);
    assert_eq!(mesh.positions[9], [-15.0, -20.0, 9.0]);

    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap();
    let mut image = encoder.new_image::<colortype::GrayI16>(2, 3).unwrap();
    let tags = image.encoder();
    tags.write_tag(Tag::ModelPixelScaleTag, &[0.5_f64, 0.5, 0.0][..]).unwrap();
    tags.write_tag(Tag::ModelTiepointTag, &[0.0_f64, 0.0, 0.0, 10.0, 60.75, 0.0][..]).unwrap();
    tags.write_tag(Tag::GeoKeyDirectoryTag, &[1_u16, 1, 0, 1, 1024, 0, 1, 2][..]).unwrap();
    image.write_data(&[-5, 2, 3, 4, 5, -32768]).unwrap();
    let mesh = read_bytes("s.tif", bytes.into_inner()).unwrap();
    assert_eq!(counts(&mesh), (5, 3));
    // Half a degree at 60 north is a quarter of a degree long, and half of that lies west of the middle.
    let [x, y, z] = mesh.positions[0];
    assert!((x + 111_195.0 / 8.0).abs() < 1.0 && (y - 111_195.0 / 2.0).abs() < 1.0 && z == -5.0, "{x} {y}");

    assert_eq!(error("s.tif", "II*"), "s.tif: byte 3: the file ends too early");
}

/// A tile whose height is `metres` everywhere.
fn flat_tile(metres: i16) -> Vec<u8> {
    metres.to_be_bytes().repeat(1201 * 1201)
}

fn zip(folder: &TempDir, name: &str, entries: &[(&str, &[u8])]) -> PathBuf {
    let path = folder.path().join(name);
    let mut archive = zip::ZipWriter::new(fs::File::create(&path).unwrap());
    for (name, bytes) in entries {
        archive.start_file(*name, zip::write::SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap();
    path
}

#[test]
fn tiles_from_files_and_archives_make_one_mosaic() {
    let folder = tempfile::tempdir().unwrap();
    let west = write(&folder, "n00w001.HGT", flat_tile(1));
    let entries =
        [("readme.txt", &b"tiles"[..]), ("a/._N00E000.hgt", b"x"), ("a/N00E000.hgt", &flat_tile(2))];
    let east = zip(&folder, "east.zip", &entries);
    let mesh = read(&[&east, &west]).unwrap();
    assert_eq!(counts(&mesh), (2401 * 1201, 2 * 2400 * 1200));
    // The western tile owns the seam.
    assert_eq!([1199, 1200, 1201].map(|column| mesh.positions[column][2]), [1.0, 1.0, 2.0]);

    let again = write(&folder, "N00E000.hgt", flat_tile(3));
    let strip = |e: MeshIoError| e.to_string().replace(&format!("{}/", folder.path().display()), "");
    assert_eq!(
        strip(read(&[&east, &again]).unwrap_err()),
        "N00E000.hgt: the same tile as east.zip/N00E000.hgt"
    );
    let far = write(&folder, "S20W001.hgt", flat_tile(3));
    assert_eq!(
        strip(read(&[&west, &far]).unwrap_err()),
        "n00w001.HGT: more than 20 degrees from S20W001.hgt"
    );
    let fine = write(&folder, "N01W001.hgt", vec![0; 2 * 3601 * 3601]);
    assert_eq!(
        strip(read(&[&west, &fine]).unwrap_err()),
        "n00w001.HGT: 1201 samples a side, but N01W001.hgt has 3601"
    );
    let none = zip(&folder, "none.zip", &entries[..2]);
    assert_eq!(strip(read(&[&none]).unwrap_err()), "none.zip: no .hgt file in the archive");
    let short = zip(&folder, "short.zip", &[("N00E000.hgt", b"abc")]);
    assert_eq!(
        strip(read(&[&short]).unwrap_err()),
        "short.zip/N00E000.hgt: 3 bytes, a height tile has 2884802 (1201 a side) or 25934402 (3601 a side)"
    );
    let sea = write(&folder, "sea.hgt", flat_tile(0));
    assert_eq!(
        strip(read(&[&sea]).unwrap_err()),
        "sea.hgt: the name of a height tile is its south-west corner, like N36W118.hgt"
    );
    let void = write(&folder, "S01W001.hgt", flat_tile(i16::MIN));
    assert_eq!(strip(read(&[&void]).unwrap_err()), "S01W001.hgt: no triangles");
    let mut bytes = fs::read(&east).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x55;
    let damaged = write(&folder, "damaged.zip", bytes);
    assert!(read(&[&damaged]).is_err());
    assert!(matches!(read(&[write(&folder, "no.zip", "no")]).unwrap_err(), MeshIoError::Decode { .. }));
}

/// The folder of real files, where it is there.
fn data() -> Option<PathBuf> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    folder.is_dir().then(|| folder.to_owned())
}

#[test]
fn real_meshes() {
    let Some(data) = data() else { return };
    for (name, vertices, triangles) in [
        ("meshes/armadillo_100k.ply", 49_990, 99_976),
        ("meshes/beast.ply", 32_311, 64_618),
        ("meshes/bunny.ply", 34_834, 69_451),
        ("meshes/dragon.ply", 437_645, 871_414),
        ("meshes/happy.ply", 543_652, 1_087_716),
        ("meshes/horse.ply", 48_485, 96_966),
        ("meshes/lucy_100k.ply", 49_987, 99_970),
        ("meshes/ogre.ply", 62_194, 124_008),
        ("meshes/turbineblade_200k.ply", 99_519, 199_034),
        ("city/boston_blocks.obj", 436_528, 610_365),
        ("city/denhaag01_lod2_terrain.obj", 24_835, 41_183),
    ] {
        let mesh = read(&[data.join(name)]).unwrap();
        assert_eq!(counts(&mesh), (vertices, triangles), "{name}");
        assert_well_formed(&mesh);
    }
    let mesh = read(&[data.join("meshes/bunny.ply")]).unwrap();
    let (low, high) = mesh.bounding_box().unwrap();
    for (found, listed) in
        low.into_iter().chain(high).zip([-0.09469, 0.03299, -0.06187, 0.06101, 0.18732, 0.0588])
    {
        assert!((found - listed).abs() < 1e-5, "{found} {listed}");
    }
}

#[test]
fn real_terrain() {
    let Some(data) = data() else { return };
    let terrain = |name: &str| data.join("terrain").join(name);
    let full = (1201 * 1201, 2 * 1200 * 1200);
    for name in ["N36W118.hgt", "N36W119.hgt", "N37W118.hgt", "N37W119.hgt", "N47E009.hgt"] {
        assert_eq!(counts(&read(&[terrain(name)]).unwrap()), full, "{name}");
    }
    for (name, voids) in [("N27E086.hgt", 130_953), ("N46W122.hgt", 9_033)] {
        let mesh = read(&[terrain(name)]).unwrap();
        assert!(
            mesh.positions.len() <= full.0 - voids && mesh.positions.len() > full.0 - 2 * voids,
            "{name}"
        );
        assert!(mesh.triangles.len() < full.1 && mesh.triangles.len() > full.1 - 6 * voids, "{name}");
        assert_well_formed(&mesh);
    }
    for (name, side, relief) in [
        ("alps_montblanc_647_16bit.png", 647, 4356.0 * 646.0 / 60_000.0),
        ("gcanyon_elev_1200_8bit.png", 1200, 152.0 * 0.2334),
    ] {
        let mesh = read(&[terrain(name)]).unwrap();
        assert_eq!(counts(&mesh), (side * side, 2 * (side - 1) * (side - 1)), "{name}");
        // Without a word about the scale, the relief is near the true one, in units of the spacing.
        let (low, high) = mesh.bounding_box().unwrap();
        let ratio = (high[2] - low[2]) / relief;
        assert!((0.7..1.3).contains(&ratio), "{name}: {ratio}");
    }
}

#[test]
fn real_mosaic() {
    let Some(data) = data() else { return };
    let tiles = ["N36W118", "N36W119", "N37W118", "N37W119"].map(|n| data.join(format!("terrain/{n}.hgt")));
    let mesh = read(&tiles).unwrap();
    assert_eq!(counts(&mesh), (2401 * 2401, 2 * 2400 * 2400));
    let (low, high) = mesh.bounding_box().unwrap();
    assert_eq!((low[2], high[2]), (-80.0, 4404.0));
    // Two degrees of latitude, and as many of longitude at 37 north.
    assert!((high[1] - low[1] - 222_390.0).abs() < 1.0 && (high[0] - low[0] - 177_608.0).abs() < 10.0);
}
