//! Text and binary files as others write them: byte order marks, encodings, lines, counts that are wrong, strips.

use super::*;

const MARK: &str = "\u{feff}";

#[test]
fn text_may_begin_with_a_byte_order_mark() {
    for (name, bytes) in samples() {
        if name != "s.stl" || bytes.starts_with(b"solid") {
            let marked = [MARK.as_bytes(), &bytes].concat();
            assert_eq!(read_bytes(name, marked).unwrap(), small(), "{name}");
        }
    }
    // A lost first vertex would show only in the shape.
    let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\nf 1 3 4\n";
    let mesh = read_bytes("s.obj", [MARK, square].concat()).unwrap();
    assert_eq!((mesh.positions.len(), areas(&mesh)), (5, (1.0, 1.0)));
    let mesh = read_bytes("s.obj", format!("v 0 0 0\nv 1 0 0\n{MARK}v 1 1 0\nf 1 2 3\n")).unwrap();
    assert_eq!(counts(&mesh), (3, 1));
    let wide: Vec<u8> = MARK.encode_utf16().chain(square.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    assert_eq!(error("s.obj", wide), "s.obj: text in UTF-16: it has to be UTF-8 or ASCII");
}

#[test]
fn lines_end_as_they_like() {
    for end in ["\r\n", "\r", "\n"] {
        for (name, bytes) in samples() {
            if let Ok(text) = String::from_utf8(bytes).map(|text| text.replace('\n', end))
                && !text.contains('\0')
            {
                assert_eq!(read_bytes(name, text).unwrap(), small(), "{name} {end:?}");
            }
        }
    }
    assert_eq!(error("s.obj", "v 0 0 0\r\nv 0 0 x\r\n"), "s.obj: line 2: expected a coordinate, found \"x\"");
    assert_eq!(error("s.obj", "v 0 0 0\rv 0 0 x\r"), "s.obj: line 2: expected a coordinate, found \"x\"");
}

#[test]
fn comments_come_in_any_encoding() {
    let mut bytes = Vec::new();
    for line in String::from_utf8(ply_text()).unwrap().lines() {
        if line.starts_with("element junk") {
            bytes.extend(b"comment TextureFile Fl\xe4che.png\nobj_info \xc4\xd6\xdc\n");
        }
        bytes.extend([line.as_bytes(), b"\n"].concat());
    }
    assert_eq!(read_bytes("s.ply", bytes).unwrap(), small());
    let mut binary = ply_binary(true);
    binary.splice(4..4, *b"comment \xff\xfe\nobj_info \xe9\n");
    // "ply\n" comes before the format.
    assert_eq!(read_bytes("s.ply", binary).unwrap(), small());
    let obj = [b"# \xe4\n", OBJ.as_bytes()].concat();
    assert_eq!(read_bytes("s.obj", obj).unwrap(), small());
    let off = [OFF.as_bytes(), b"# \xe4\n"].concat();
    assert_eq!(read_bytes("s.off", off).unwrap(), small());
    let stl = stl_text().into_bytes();
    let stl = [b"solid \xe4\n", &stl[stl.iter().position(|&b| b == b'\n').unwrap() + 1..]].concat();
    assert_eq!(read_bytes("s.stl", stl).unwrap(), small());
}

/// What nobody reads need not be a number.
#[test]
fn skipped_words_of_ply_may_be_anything() {
    for word in ["-nan(ind)", "1.#QNAN", "-1.#IND00", "nan", "inf", "0,5", "-"] {
        let ply = format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             property float nx\nproperty list uchar float uv\nelement face 2\n\
             property list uchar int vertex_indices\nproperty float quality\nelement edge 1\nproperty int a\n\
             end_header\n0 0 0 {word} 1 {word}\n1 0 0 1 0\n1 1 0 1 0\n0 1 0 1 0\n3 0 1 2 {word}\n3 0 2 3 1\n{word}\n"
        );
        assert_eq!(areas(&read_bytes("s.ply", &ply).unwrap()), (1.0, 1.0), "{word}");
        let wrong = ply.replace("0 1 0 1 0", &format!("0 {word} 0 1 0"));
        assert!(error("s.ply", wrong).starts_with("s.ply: vertex 3: "), "{word}");
    }
}

/// The strips 0 1 2 3 and 2 3 4, as one row or two, with every kind of number.
#[test]
fn strips_turn_every_second_triangle() {
    let header = |format: &str, rows: usize, kind: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
             element tristrips {rows}\nproperty list int {kind} vertex_indices\nend_header\n"
        )
    };
    let vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 1]];
    let check = |bytes: Vec<u8>, text: &str| {
        let mesh = read_bytes("s.ply", bytes).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [2, 3, 4]], "{text}");
        let (area, along_z) = areas(&mesh);
        assert!((area - 1.0 - 0.5_f64.sqrt()).abs() < 1e-6 && along_z > 0.0, "{text}");
    };
    let text: String = vertices.iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    for (rows, strips) in [
        (1, "8 0 1 2 3 -1 2 3 4\n"),
        (1, "9 0 1 2 3 -1 2 3 4 -1\n"),
        (1, "11 -1 -1 0 1 2 3 -1 -1 2 3 4\n"),
        (2, "4 0 1 2 3\n4 2 3 4 -1\n"),
        // Between two strips, as some join them: no triangle has two equal corners.
        (1, "9 0 1 2 3 3 2 2 3 4\n"),
    ] {
        check([header("ascii", rows, "int"), text.clone(), strips.into()].concat().into_bytes(), strips);
    }
    // A restart turns nothing: three strips of one triangle each, and one of two.
    let ends = "12 0 1 2 -1 2 1 3 -1 2 3 4 -1\n";
    check([header("ascii", 1, "int"), text.clone(), ends.into()].concat().into_bytes(), ends);

    for kind in ["char", "short", "int", "uint"] {
        for big in [false, true] {
            let format = if big { "binary_big_endian" } else { "binary_little_endian" };
            let mut bytes = header(format, 1, kind).into_bytes();
            let mut put = |mut number: Vec<u8>| {
                if big {
                    number.reverse();
                }
                bytes.extend(number);
            };
            vertices.as_flattened().iter().for_each(|&x| put((x as f32).to_le_bytes().into()));
            put(8_i32.to_le_bytes().into());
            for index in [0_i32, 1, 2, 3, -1, 2, 3, 4] {
                put(match kind {
                    "char" => (index as i8).to_le_bytes().into(),
                    "short" => (index as i16).to_le_bytes().into(),
                    _ => index.to_le_bytes().into(),
                });
            }
            check(bytes, kind);
        }
    }
    let wrong = [header("ascii", 1, "int"), text, "3 0 1 5\n".into()].concat();
    assert_eq!(error("s.ply", wrong), "s.ply: face 0: no vertex 5, there are 5");
    let late = "ply\nformat ascii 1.0\nelement tristrips 1\nproperty list int int vertex_indices\n\
                element vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header\n\
                3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n";
    assert_eq!(areas(&read_bytes("s.ply", late).unwrap()), (0.5, 0.5));
}

/// Of the corner of a cube.
const FACETS: [[[u8; 3]; 3]; 4] = [
    [[0, 0, 0], [0, 1, 0], [1, 0, 0]],
    [[0, 0, 0], [1, 0, 0], [0, 0, 1]],
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    [[0, 1, 0], [0, 0, 0], [0, 0, 1]],
];

fn assert_tetrahedron(bytes: impl AsRef<[u8]>, text: &str) {
    let mesh = read_bytes("s.stl", bytes).unwrap();
    assert_eq!(counts(&mesh), (4, 4), "{text}");
    let (area, along_z) = areas(&mesh);
    assert!((area - 1.5 - 0.75_f64.sqrt()).abs() < 1e-6 && along_z.abs() < 1e-6, "{text}");
}

/// With a count, and after each facet so many attribute bytes; the number of them is `attributes` where they are not there.
fn stl(count: u32, behind: [usize; 4], attributes: Option<u16>) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(count.to_le_bytes());
    for (facet, behind) in FACETS.iter().zip(behind) {
        bytes.extend([0; 12]);
        bytes.extend(facet.as_flattened().iter().flat_map(|&x| f32::from(x).to_le_bytes()));
        bytes.extend(attributes.unwrap_or(behind as u16).to_le_bytes());
        bytes.extend(vec![0xee; behind]);
    }
    bytes
}

#[test]
fn the_length_of_binary_stl_tells_how_many_facets_there_are() {
    assert_tetrahedron(stl(4, [0; 4], None), "right");
    for count in [0, 1, 2, 3] {
        assert_tetrahedron(stl(count, [0; 4], None), "too low");
    }
    assert_eq!(error("s.stl", stl(5, [0; 4], None)), "s.stl: face 4: the file ends too early");
    // Colours are where the number of attribute bytes is.
    for count in [0, 2, 4] {
        assert_tetrahedron(stl(count, [0; 4], Some(0x7fff)), "colours");
    }
    for behind in [[4; 4], [0, 0, 0, 1], [3, 0, 700, 0], [25; 4], [50; 4]] {
        assert_tetrahedron(stl(4, behind, None), "attribute bytes");
    }
    for count in [0, 3] {
        assert_tetrahedron(stl(count, [4; 4], None), "attribute bytes and a low count");
    }
    let mut cut = stl(2, [0; 4], Some(9));
    cut.truncate(cut.len() - 7);
    assert_eq!(
        error("s.stl", cut),
        "s.stl: 2 facets are announced, but 277 bytes are no whole number of them"
    );
}

#[test]
fn white_space_separates_the_words_of_stl() {
    let mut text = String::from("solid a name\n");
    for facet in FACETS {
        text += "facet normal 0 0 0\n outer loop\n";
        for [x, y, z] in facet {
            text += &format!("  vertex {x} {y} {z}\n");
        }
        text += " endloop\nendfacet\n";
    }
    text += "endsolid a name\n";
    let one_line = text.replace('\n', " ");
    let variants = [
        text.clone(),
        text.replace("end", "end "),
        text.replace("outer loop\n", "outer loop"),
        text.replace("\n  vertex", "\n  vertex\n"),
        text.replace("\n ", " ").replace("endloop\n", "endloop "),
        text.replace('\n', "\r"),
        text.replace('\n', "\r\n"),
        one_line.clone(),
        one_line.replace("end", "end "),
        one_line.replace("a name", ""),
        text.replace(' ', "\t"),
        text.to_uppercase(),
        text.replace("a name", "facet of an outer loop"),
        text.replace("normal 0 0 0", "normal nan -nan(ind) 1.#QNAN"),
        text.replace("normal 0 0 0", ""),
    ];
    for variant in variants {
        assert_tetrahedron(&variant, &variant[..variant.len().min(60)]);
    }
    for twice in [text.repeat(2), one_line.repeat(2)] {
        assert_eq!(counts(&read_bytes("s.stl", twice).unwrap()), (4, 8));
    }
    let cut = &one_line[..one_line.rfind("endfacet").unwrap()];
    assert_eq!(error("s.stl", cut), "s.stl: line 1: the file ends too early");
    let wrong = one_line.replacen("outer", "inner", 1);
    assert_eq!(error("s.stl", wrong), "s.stl: line 1: expected an STL keyword, found \"inner\"");
    let wrong = text.replacen("endloop", "end lop", 1);
    let message = "s.stl: line 7: expected loop, facet or solid behind \"end\", found \"lop\"";
    assert_eq!(error("s.stl", wrong), message);
}
