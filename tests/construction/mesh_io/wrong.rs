//! Files that are wrong, and what is said of them.

use super::*;

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
    assert_eq!(change("1 3 0 1 4", "1 x 0 1 4"), "s.ply: face 1: expected a whole number, found \"x\"");
    assert_eq!(change("1 3 0 1 4", "1 -3 0 1 4"), "s.ply: face 1: Negative list count");
    assert_eq!(change("uint vertex_index", "uint indices"), "s.ply: face 0: missing field `vertex_indices`");
    // The rows of faces are taken for vertices.
    assert_eq!(change("vertex 5", "vertex 4000000000"), "s.ply: vertex 6: the file ends too early");
    assert_eq!(change("ply", "plx"), "s.ply: not a PLY file");
    assert_eq!(error("s.ply", png(ColorType::Grayscale)), "s.ply: not a PLY file");
    assert_eq!(error("s.ply", ""), "s.ply: not a PLY file");
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
    assert_eq!(read(&[&path]).unwrap_err().to_string(), format!("{}: is not a file", path.display()));
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

/// Nobody writes to the pipe: to open it would take for ever.
#[cfg(unix)]
#[test]
fn a_pipe_is_not_a_file() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["p.ply", "p.obj", "p.stl", "p.off", "p.png", "p.tif", "p.zip", "N00E000.hgt"] {
        let path = folder.path().join(name);
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        assert_eq!(read(&[&path]).unwrap_err().to_string(), format!("{}: is not a file", path.display()));
    }
}

#[test]
fn points_alone_are_a_point_cloud() {
    let header =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
    let faces = "element face 0\nproperty list uchar int vertex_indices\n";
    let points = "end_header\n0 0 0\n1 1 1\n";
    assert_eq!(error("s.ply", [header, points].concat()), "s.ply: a point cloud: 2 points and no faces");
    assert_eq!(
        error("s.ply", [header, faces, points].concat()),
        "s.ply: a point cloud: 2 points and no faces"
    );
    let obj = "v 0 0 0\nvn 0 0 1\nv 1 1 1\nv 0 0 1\n";
    assert_eq!(error("s.obj", obj), "s.obj: a point cloud: 3 points and no faces");
    assert_eq!(error("s.obj", [obj, "l 1 2\n"].concat()), "s.obj: no triangles");
    assert_eq!(error("s.off", "OFF\n1 0 0\n0 0 0\n"), "s.off: a point cloud: 1 points and no faces");
}

/// Too many vertices, too few of them, a face too many, and comments, which do not count.
#[test]
fn off_holds_what_it_announces() {
    let square = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";
    let off = |counts: &str| error("s.off", format!("OFF\n{counts}\n{square}"));
    assert_eq!(off("4 1 0"), "s.off: line 8: more than is announced: \"3 0 2 3\"");
    assert_eq!(off("3 1 0"), "s.off: line 7: more than is announced: \"3 0 1 2\"");
    assert_eq!(off("3 2 0"), "s.off: line 8: more than is announced: \"3 0 2 3\"");
    assert_eq!(off("4 3 0"), "s.off: line 9: the file ends too early");
    assert_eq!(off("5 2 0"), "s.off: line 9: the file ends too early");
    let commented = format!("OFF\n4 2 0\n{square}\n  \n# end\n");
    assert_eq!(counts(&read_bytes("s.off", commented).unwrap()), (4, 2));
}

const PLY_SQUARE: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                          element face 2\nproperty list uchar int vertex_indices\nend_header\n";

#[test]
fn ply_rows_fit_the_header() {
    let vertices = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
    let ply = |body: &str| error("s.ply", [PLY_SQUARE, body].concat());
    let with = |faces: &str| ply(&[vertices, faces].concat());
    assert_eq!(with("3 0 1 2 0\n3 0 2 3 0\n"), "s.ply: line 15: more than is announced: \"3 0 2 3 0\"");
    assert_eq!(with("3 0 1\n3 0 2 3\n"), "s.ply: line 15: more than is announced: \"2 3\"");
    assert_eq!(with("3 0 1 2\n3 0 2 3\n3 0 1 3\nx\n"), "s.ply: line 16: more than is announced: \"3 0 1 3\"");
    assert_eq!(with("3 0 1 2\n3 0 2\n"), "s.ply: face 1: the file ends too early");
    let wide = "0 0 0 7\n1 0 0 7\n1 1 0 7\n0 1 0 7\n3 0 1 2\n3 0 2 3\n";
    assert!(ply(wide).contains("more than is announced"), "{}", ply(wide));
    // Rows over several lines, and several on one.
    for body in
        ["0 0\n0 1 0 0\n1 1 0 0 1 0\n3\n0 1 2\n3 0\n2 3", "0 0 0 1 0 0 1 1 0 0 1 0 3 0 1 2 3 0 2 3 \n\n"]
    {
        assert_eq!(areas(&read_bytes("s.ply", [PLY_SQUARE, body].concat()).unwrap()), (1.0, 1.0));
    }

    let mut binary = ply_binary(false);
    let end = binary.len();
    binary.extend([0, 0, b'\n']);
    assert_eq!(read_bytes("s.ply", &binary).unwrap(), small());
    binary.extend([1, 2]);
    assert_eq!(error("s.ply", &binary), format!("s.ply: byte {end}: more than is announced: 5 bytes"));
}
