//! Height maps as others write them: GeoTIFF and GDAL's tags, PNG with a transparent value, tiles across 180 degrees.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use foldfront::container::DegreeMap;

use super::heights::{flat_tile, zip};
use super::*;

enum Values<'v> {
    Short(&'v [u16]),
    Long(&'v [u32]),
    Double(&'v [f64]),
    Ascii(&'v str),
}
use Values::{Ascii, Double, Long, Short};

/// An image: its tags in ascending order but for those of the chunks, and the chunks, which are strips of `RowsPerStrip` or
/// tiles. An empty chunk is left out, as sparse files do.
struct Image<'v> {
    tags: Vec<(u16, Values<'v>)>,
    chunks: Vec<Vec<u8>>,
}

/// A TIFF of these images.
fn file(big_endian: bool, images: &[Image<'_>]) -> Vec<u8> {
    let short = |x: u16| if big_endian { x.to_be_bytes() } else { x.to_le_bytes() };
    let long = |x: u32| if big_endian { x.to_be_bytes() } else { x.to_le_bytes() };
    let double = |x: f64| if big_endian { x.to_be_bytes() } else { x.to_le_bytes() };
    let mut bytes = if big_endian { b"MM\0*".to_vec() } else { b"II*\0".to_vec() };
    bytes.extend([0; 4]);
    let mut link = 4;
    for Image { tags, chunks } in images {
        let mut offsets = Vec::new();
        for chunk in chunks {
            offsets.push(if chunk.is_empty() { 0 } else { bytes.len() as u32 });
            bytes.extend(chunk);
        }
        let lengths: Vec<u32> = chunks.iter().map(|c| c.len() as u32).collect();
        let tiled = tags.iter().any(|(tag, _)| *tag == 322);
        let mut all: Vec<(u16, &Values)> = tags.iter().map(|(tag, values)| (*tag, values)).collect();
        let (offsets, lengths) = (Long(&offsets), Long(&lengths));
        all.push((if tiled { 324 } else { 273 }, &offsets));
        all.push((if tiled { 325 } else { 279 }, &lengths));
        all.sort_by_key(|(tag, _)| *tag);
        let mut entries = Vec::new();
        for (tag, values) in all {
            let (kind, count, mut data): (u16, usize, Vec<u8>) = match values {
                Short(v) => (3, v.len(), v.iter().flat_map(|&x| short(x)).collect()),
                Long(v) => (4, v.len(), v.iter().flat_map(|&x| long(x)).collect()),
                Double(v) => (12, v.len(), v.iter().flat_map(|&x| double(x)).collect()),
                Ascii(v) => (2, v.len() + 1, [v.as_bytes(), b"\0"].concat()),
            };
            entries.extend(short(tag));
            entries.extend(short(kind));
            entries.extend(long(count as u32));
            if data.len() > 4 {
                entries.extend(long(bytes.len() as u32));
                bytes.extend(data);
            } else {
                data.resize(4, 0);
                entries.extend(data);
            }
        }
        let start = bytes.len() as u32;
        bytes[link..link + 4].copy_from_slice(&long(start));
        bytes.extend(short((entries.len() / 12) as u16));
        bytes.extend(entries);
        link = bytes.len();
        bytes.extend([0; 4]);
    }
    bytes
}

/// Six columns and five rows, which rise from 100 to 190 from the north-west to the south-east.
fn height(i: usize) -> f32 {
    100.0 + 10.0 * (i % 6 + i / 6) as f32
}

fn floats(first: f32) -> Vec<u8> {
    (0..30).flat_map(|i| if i == 0 { first } else { height(i) }.to_le_bytes()).collect()
}

fn with_floats(first: f32, tags: Vec<(u16, Values)>) -> Image {
    let mut all = vec![(256, Long(&[6])), (257, Long(&[5])), (258, Short(&[32])), (259, Short(&[1]))];
    if !tags.iter().any(|(tag, _)| *tag == 262) {
        all.push((262, Short(&[1])));
    }
    all.extend([(277, Short(&[1])), (278, Long(&[5])), (339, Short(&[3]))]);
    all.extend(tags);
    Image { tags: all, chunks: vec![floats(first)] }
}

const SPACING: Values<'static> = Double(&[30.0, 30.0, 0.0]);
const TIE_POINT: Values<'static> = Double(&[0.0, 0.0, 0.0, 500_000.0, 5_400_000.0, 0.0]);
const UTM: Values<'static> = Short(&[1, 1, 0, 3, 1024, 0, 1, 1, 1025, 0, 1, 1, 3072, 0, 1, 32633]);

/// Tags of a map in UTM, and others.
fn utm(tags: Vec<(u16, Values)>) -> Vec<(u16, Values)> {
    [(33550, SPACING), (33922, TIE_POINT), (34735, UTM)].into_iter().chain(tags).collect()
}

fn map(first: f32, tags: Vec<(u16, Values)>) -> Result<Mesh, MeshIoError> {
    read_bytes("s.tif", file(false, &[with_floats(first, tags)]))
}

fn assert_map(mesh: &Mesh, expected: [f32; 4], text: &str) {
    assert_eq!(counts(mesh), (30, 40), "{text}");
    assert_near(&bounds(mesh), &expected, text);
    let (_, along_z) = areas(mesh);
    assert_near(&[along_z as f32], &[expected[0] * expected[1]], text);
    assert_eq!(mesh.georeference.origin, [0.0; 3], "{text}");
}

/// The first sample is a void.
fn assert_void(mesh: &Mesh, text: &str) {
    assert_eq!(counts(mesh), (29, 39), "{text}");
    assert_near(&bounds(mesh), &[150.0, 120.0, 110.0, 190.0], text);
}

const FLAT: [f32; 4] = [150.0, 120.0, 100.0, 190.0];

#[test]
fn tiff_as_it_should_be() {
    let mesh = map(100.0, utm(vec![])).unwrap();
    assert_map(&mesh, FLAT, "UTM");
    assert_eq!(mesh.georeference.coordinate_system, "EPSG:32633");
    assert_eq!(mesh.georeference.degrees, None);
    assert_eq!(mesh.positions[0], [-75.0, 60.0, 100.0]);
}

#[test]
fn tiff_transformations() {
    let matrix =
        |m: [f64; 6]| [m[0], m[1], 0.0, m[2], m[3], m[4], 0.0, m[5], 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let m = matrix([30.0, 0.0, 500_000.0, 0.0, -30.0, 5_400_000.0]);
    let mesh = map(100.0, vec![(34264, Double(&m)), (34735, UTM)]).unwrap();
    assert_map(&mesh, FLAT, "north up");
    assert_eq!(mesh.positions[0], [-75.0, 60.0, 100.0]);

    // The first row is the south: it has y = -60, and triangles still face up.
    let m = matrix([30.0, 0.0, 500_000.0, 0.0, 30.0, 5_400_000.0]);
    let mesh = map(100.0, vec![(34264, Double(&m)), (34735, UTM)]).unwrap();
    assert_map(&mesh, FLAT, "south up");
    let lowest = mesh.positions.iter().find(|p| p[2] == 100.0).unwrap();
    assert_eq!(lowest, &[-75.0, -60.0, 100.0]);

    // A quarter turned: columns to the north, rows to the east.
    let m = matrix([0.0, 30.0, 0.0, 30.0, 0.0, 0.0]);
    let mesh = map(100.0, vec![(34264, Double(&m)), (34735, UTM)]).unwrap();
    assert_map(&mesh, [120.0, 150.0, 100.0, 190.0], "turned");
    let lowest = mesh.positions.iter().find(|p| p[2] == 100.0).unwrap();
    assert_eq!(lowest, &[-60.0, -75.0, 100.0]);

    // In degrees.
    let second = 1.0 / 3600.0;
    let m = matrix([second, 0.0, 10.0, 0.0, -second, 47.0]);
    let mesh = map(100.0, vec![(34264, Double(&m)), (34735, Short(&[1, 1, 0, 1, 1024, 0, 1, 2]))]).unwrap();
    assert_map(&mesh, [105.33, 123.55, 100.0, 190.0], "degrees");
    let degrees = mesh.georeference.degrees.unwrap();
    assert!((degrees.longitude - 10.0 - 3.0 * second).abs() < 1e-12, "{degrees:?}");
    assert!((degrees.latitude - 47.0 + 2.5 * second).abs() < 1e-12, "{degrees:?}");

    // Unsigned samples are heights as well where the map says how wide it is.
    let m = matrix([30.0, 0.0, 500_000.0, 0.0, -30.0, 5_400_000.0]);
    let tags = vec![(256, Long(&[6])), (257, Long(&[5])), (258, Short(&[16])), (259, Short(&[1]))];
    let more = vec![(262, Short(&[1])), (278, Long(&[5])), (34264, Double(&m)), (34735, UTM)];
    let chunks = vec![(0..30).flat_map(|i| (height(i) as u16).to_le_bytes()).collect()];
    let image = Image { tags: tags.into_iter().chain(more).collect(), chunks };
    assert_map(&read_bytes("s.tif", file(false, &[image])).unwrap(), FLAT, "unsigned");
}

/// A zlib stream of one block that is stored.
fn deflated(data: &[u8]) -> Vec<u8> {
    let (a, b) = data.iter().fold((1_u32, 0_u32), |(a, b), &x| {
        let a = (a + u32::from(x)) % 65521;
        (a, (b + a) % 65521)
    });
    let length = data.len() as u16;
    let mut bytes = vec![0x78, 0x01, 0x01];
    bytes.extend(length.to_le_bytes());
    bytes.extend((!length).to_le_bytes());
    bytes.extend(data);
    bytes.extend((b << 16 | a).to_be_bytes());
    bytes
}

/// 32 x 32 samples in four tiles, the north-eastern one left out; the same in strips, the third of four left out.
#[test]
fn sparse_tiff() {
    let sample = |row: usize, column: usize| (100 + row + column) as f32;
    let chunk = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| -> Vec<u8> {
        rows.flat_map(|r| columns.clone().flat_map(move |c| sample(r, c).to_le_bytes())).collect()
    };
    for (compression, nodata) in [(1_u16, true), (1, false), (8, true), (8, false)] {
        let pack = |data: Vec<u8>| if compression == 8 { deflated(&data) } else { data };
        let code = [compression];
        let image = |layout: Vec<(u16, Values<'static>)>, chunks: Vec<Vec<u8>>| {
            let mut tags = vec![(256, Long(&[32])), (257, Long(&[32])), (258, Short(&[32]))];
            tags.extend([(262, Short(&[1])), (277, Short(&[1])), (339, Short(&[3]))]);
            tags.extend(layout);
            tags.extend(utm(vec![]));
            if nodata {
                tags.push((42113, Ascii("-9999")));
            }
            (tags, chunks)
        };
        let tiles =
            vec![pack(chunk(0..16, 0..16)), vec![], pack(chunk(16..32, 0..16)), pack(chunk(16..32, 16..32))];
        let (mut tags, chunks) = image(vec![(322, Long(&[16])), (323, Long(&[16]))], tiles);
        tags.push((259, Short(&code)));
        let mesh = read_bytes("s.tif", file(false, &[Image { tags, chunks }])).unwrap();
        assert_eq!(mesh.triangles.len(), 1411);
        assert_near(&bounds(&mesh), &[930.0, 930.0, 100.0, 162.0], "tiles");

        let strips =
            vec![pack(chunk(0..8, 0..32)), pack(chunk(8..16, 0..32)), vec![], pack(chunk(24..32, 0..32))];
        let (mut tags, chunks) = image(vec![(278, Long(&[8]))], strips);
        tags.push((259, Short(&code)));
        let mesh = read_bytes("s.tif", file(false, &[Image { tags, chunks }])).unwrap();
        assert_eq!(counts(&mesh), (24 * 32, 2 * 31 * 15 + 2 * 31 * 7));
    }
}

#[test]
fn zero_may_be_white() {
    for big_endian in [false, true] {
        for photometric in [0, 1] {
            let image = |first: f32, tags| {
                let mut image = with_floats(first, tags);
                if big_endian {
                    image.chunks[0].chunks_exact_mut(4).for_each(<[u8]>::reverse);
                }
                read_bytes("s.tif", file(big_endian, &[image])).unwrap()
            };
            let code = [photometric];
            let text = format!("{big_endian} {photometric}");
            assert_map(&image(100.0, utm(vec![(262, Short(&code))])), FLAT, &text);
            let tags = utm(vec![(262, Short(&code)), (42113, Ascii("-9999"))]);
            assert_void(&image(-9999.0, tags), &text);
            // Heights are those that are stored, to the bit.
            let mesh = image(100.1, utm(vec![(262, Short(&code))]));
            assert_eq!(mesh.positions[0][2], 100.1);
        }
    }
    for (bits, chunk) in [
        (8, (0..30).map(|i| height(i) as u8).collect::<Vec<_>>()),
        (16, (0..30).flat_map(|i| (height(i) as u16).to_le_bytes()).collect()),
    ] {
        let bits = [bits];
        let mut tags = vec![(256, Long(&[6])), (257, Long(&[5])), (258, Short(&bits)), (259, Short(&[1]))];
        tags.extend([(262, Long(&[0])), (278, Long(&[5]))]);
        tags.extend(utm(vec![]));
        let mesh = read_bytes("s.tif", file(false, &[Image { tags, chunks: vec![chunk] }])).unwrap();
        assert_map(&mesh, FLAT, "unsigned");
    }
}

#[test]
fn voids_of_tiff() {
    for (sample, text) in [
        (-9999.0, Some("-9999")),
        (-9999.0, Some(" -9999.0 ")),
        (f32::MIN, Some("-3.40282e+38")),
        (f32::MIN, Some("-3.4028234663852886e+38")),
        (f32::MIN, Some("-9999")),
        (f32::MIN, None),
        (-3.4e38, None),
        (f32::MAX, None),
        (f32::MIN_POSITIVE, Some("1.17549e-38")),
        (f32::from_bits((-9999.9_f32).to_bits() + 1), Some("-9999.90")),
        (f32::NAN, Some("nan")),
        (f32::NAN, None),
    ] {
        let tags = text.map(|text| (42113, Ascii(text)));
        assert_void(&map(sample, utm(tags.into_iter().collect())).unwrap(), &format!("{sample:e} {text:?}"));
    }
    // 100 is near to 100.001, but no void.
    for text in ["100.001", "101", "0"] {
        assert_map(&map(100.0, utm(vec![(42113, Ascii(text))])).unwrap(), FLAT, text);
    }
    // Doubles, whose lowest is beyond 32 bits.
    let mut image = with_floats(100.0, utm(vec![(42113, Ascii("-1.79769e+308"))]));
    image.tags[2] = (258, Short(&[64]));
    let double = |i| if i == 0 { f64::MIN } else { height(i).into() };
    image.chunks = vec![(0..30).flat_map(|i| double(i).to_le_bytes()).collect()];
    assert_void(&read_bytes("s.tif", file(false, &[image])).unwrap(), "double");
}

#[test]
fn scale_and_offset_of_gdal() {
    let items = "<GDALMetadata>\n  <Item name=\"OFFSET\" sample=\"0\" role=\"offset\">5</Item>\n  \
                 <Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.1</Item>\n</GDALMetadata>\n";
    let image = |format: u16, metadata: &str| {
        let format = [format];
        let mut tags = vec![(256, Long(&[6])), (257, Long(&[5])), (258, Short(&[16])), (259, Short(&[1]))];
        tags.extend([(262, Short(&[1])), (278, Long(&[5])), (339, Short(&format))]);
        tags.extend(utm(vec![(42112, Ascii(metadata)), (42113, Ascii("1"))]));
        let chunk = (0..30).flat_map(|i| (10 * height(i) as u16).to_le_bytes()).collect();
        read_bytes("s.tif", file(false, &[Image { tags, chunks: vec![chunk] }]))
    };
    for format in [1, 2] {
        assert_map(&image(format, items).unwrap(), [150.0, 120.0, 105.0, 195.0], "scale and offset");
    }
    let scale =
        "<GDALMetadata><Item role='scale' name='SCALE'>0.1</Item><Item name=\"X\">7</Item></GDALMetadata>";
    assert_map(&image(2, scale).unwrap(), FLAT, "scale alone");
    let feet = items.replace(
        "</GDALMetadata>",
        "<Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">ft</Item></GDALMetadata>",
    );
    assert_map(&image(2, &feet).unwrap(), [150.0, 120.0, 105.0 * 0.3048, 195.0 * 0.3048], "and feet");
    let other = items.replace("sample=\"0\"", "sample=\"1\"");
    assert_map(&image(2, &other).unwrap(), [150.0, 120.0, 1000.0, 1900.0], "of another channel");
    let wrong = items.replace("0.1", "x");
    let message = image(2, &wrong).unwrap_err().to_string();
    assert!(message.ends_with("s.tif: scale \"x\" of heights"), "{message}");
}

/// The first sample is masked: by a byte, by a bit, by a strip that is left out.
#[test]
fn internal_masks() {
    let mask = |bits: u16, chunk: Vec<u8>| {
        let bits: &'static [u16] = if bits == 8 { &[8] } else { &[1] };
        let tags = vec![
            (254, Long(&[4])),
            (256, Long(&[6])),
            (257, Long(&[5])),
            (258, Short(bits)),
            (259, Short(&[1])),
            (262, Short(&[4])),
            (277, Short(&[1])),
            (278, Long(&[5])),
        ];
        Image { tags, chunks: vec![chunk] }
    };
    let bytes = || (0..30).map(|i| if i == 0 { 0 } else { 255 }).collect();
    let bits = || vec![0x7c, 0xfc, 0xfc, 0xfc, 0xfc];
    for (text, mask_image) in [("bytes", mask(8, bytes())), ("bits", mask(1, bits()))] {
        let mesh = read_bytes("s.tif", file(false, &[with_floats(0.0, utm(vec![])), mask_image]));
        assert_void(&mesh.unwrap(), text);
    }
    // A smaller image comes before, and the mask of that, which masks everything.
    let overview = |kind: &'static [u32], photometric: &'static [u16]| Image {
        tags: vec![
            (254, Long(kind)),
            (256, Long(&[3])),
            (257, Long(&[2])),
            (258, Short(&[8])),
            (259, Short(&[1])),
            (262, Short(photometric)),
            (278, Long(&[2])),
        ],
        chunks: vec![vec![0; 6]],
    };
    let images = [with_floats(0.0, utm(vec![])), overview(&[1], &[1]), overview(&[5], &[4]), mask(1, bits())];
    assert_void(&read_bytes("s.tif", file(false, &images)).unwrap(), "with overviews");
    let images = [with_floats(0.0, utm(vec![])), mask(8, vec![])];
    assert_eq!(error("s.tif", file(false, &images)), "s.tif: no triangles");
    let mut small = mask(8, bytes());
    small.tags[2] = (257, Long(&[4]));
    let message = error("s.tif", file(false, &[with_floats(0.0, utm(vec![])), small]));
    assert!(message.contains("a mask has"), "{message}");
}

#[test]
fn degrees_and_units() {
    let second = 1.0 / 3600.0;
    let geographic = |keys: &[u16]| {
        let spacing = [second, second, 0.0];
        let tags = vec![
            (33550, Double(&spacing)),
            (33922, Double(&[0.0, 0.0, 0.0, 10.0, 47.0, 0.0])),
            (34735, Short(keys)),
        ];
        map(100.0, tags).unwrap()
    };
    for keys in [
        &[1, 1, 0, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326][..],
        &[1, 1, 0, 3, 1024, 0, 1, 2, 1025, 0, 1, 1, 2048, 0, 1, 4326],
    ] {
        let mesh = geographic(keys);
        assert_map(&mesh, [105.33, 123.55, 100.0, 190.0], "degrees");
        assert_eq!(mesh.georeference.coordinate_system, "EPSG:4326");
        let DegreeMap { longitude, latitude, metres_per_degree } = mesh.georeference.degrees.unwrap();
        assert!(
            (longitude - 10.0 - 3.0 * second).abs() < 1e-12 && (latitude - 47.0 + 2.5 * second).abs() < 1e-12
        );
        assert!((metres_per_degree[1] - 111_195.0).abs() < 0.1, "{metres_per_degree:?}");
        assert!((metres_per_degree[0] / metres_per_degree[1] - latitude.to_radians().cos()).abs() < 1e-12);
    }
    let turned = geographic(&[1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 4326, 2054, 0, 1, 9105]);
    assert!(bounds(&turned)[1] < 123.55 * 0.91, "gons");

    let with_key = |keys: &[u16], doubles: &[f64], text: &str| {
        let all =
            [&[1, 1, 0, 2 + keys.len() as u16 / 4, 1024, 0, 1, 1, 3072, 0, 1, 32633][..], keys].concat();
        let mut tags = vec![(33550, SPACING), (33922, TIE_POINT), (34735, Short(&all))];
        tags.extend([(34736, Double(doubles)), (34737, Ascii(text))]);
        map(100.0, tags)
    };
    let plain = |keys: &[u16]| with_key(keys, &[0.0], "").unwrap();
    let us = 1200.0 / 3937.0;
    for (unit, metres) in [(9001, 1.0), (9002, 0.3048), (9003, us), (9036, 1000.0)] {
        let heights = [150.0, 120.0, 100.0 * metres, 190.0 * metres];
        assert_map(&plain(&[4099, 0, 1, unit]), heights, "height");
        let wide = [150.0 * metres, 120.0 * metres, 100.0, 190.0];
        assert_map(&plain(&[3076, 0, 1, unit]), wide, "length");
    }
    // The level of North America in US survey feet.
    assert_map(&plain(&[4096, 0, 1, 6360]), [150.0, 120.0, 100.0 * us, 190.0 * us], "level");
    let own = with_key(&[3076, 0, 1, 32767, 3077, 34736, 1, 1], &[7.0, 0.5], "").unwrap();
    assert_map(&own, [75.0, 60.0, 100.0, 190.0], "a unit of its own");
    let named = "NAD83 / New York Long Island (ftUS)|";
    let mesh = with_key(&[3073, 34737, named.len() as u16, 0], &[0.0], named).unwrap();
    assert_map(&mesh, [150.0 * us, 120.0 * us, 100.0, 190.0], "named");
    let message = with_key(&[4099, 0, 1, 9999], &[0.0], "").unwrap_err().to_string();
    assert!(message.ends_with("s.tif: unit of height EPSG:9999"), "{message}");
}

#[test]
fn names_of_coordinate_systems() {
    let name = |keys: &[u16], text: &str| {
        let keys = [&[1, 1, 0, keys.len() as u16 / 4][..], keys].concat();
        let tags = vec![(33550, SPACING), (34735, Short(&keys)), (34737, Ascii(text))];
        map(100.0, tags).unwrap().georeference.coordinate_system
    };
    assert_eq!(name(&[1024, 0, 1, 1, 3072, 0, 1, 25832], ""), "EPSG:25832");
    assert_eq!(name(&[1024, 0, 1, 1, 3072, 0, 1, 32767, 3073, 34737, 9, 0], "Our town|rest|"), "Our town");
    assert_eq!(name(&[1024, 0, 1, 1, 1026, 34737, 5, 9], "Our town|rest|"), "rest");
    assert_eq!(name(&[1024, 0, 1, 1], ""), "");
}

/// The first sample is transparent, with every number of bits.
#[test]
fn png_with_a_transparent_value() {
    for depth in [BitDepth::Four, BitDepth::Eight, BitDepth::Sixteen] {
        for transparent in [true, false] {
            let mut bytes = Vec::new();
            let mut encoder = png::Encoder::new(&mut bytes, 6, 5);
            encoder.set_color(ColorType::Grayscale);
            encoder.set_depth(depth);
            if transparent {
                // Twice as many bytes as matter.
                encoder.set_trns(if depth == BitDepth::Sixteen { vec![0x38, 0] } else { vec![0, 14] });
            }
            let values = |i: usize| if i == 0 { 14 } else { (i % 6 + i / 6) as u8 };
            let data: Vec<u8> = match depth {
                BitDepth::Sixteen => {
                    (0..30).flat_map(|i| if i == 0 { [0x38, 0] } else { [values(i), 1] }).collect()
                }
                BitDepth::Eight => (0..30).map(values).collect(),
                _ => (0..15).map(|i| values(2 * i) << 4 | values(2 * i + 1)).collect(),
            };
            encoder.write_header().unwrap().write_image_data(&data).unwrap();
            let mesh = read_bytes("s.png", bytes).unwrap();
            let expected = if transparent { (29, 39) } else { (30, 40) };
            assert_eq!(counts(&mesh), expected, "{depth:?}");
            assert_near(&bounds(&mesh)[..2], &[5.0, 4.0], "a transparent value");
        }
    }
    assert_eq!(
        error("s.png", png(ColorType::GrayscaleAlpha)),
        "s.png: GrayscaleAlpha samples: a height map has to be grey"
    );
}

#[test]
fn tiles_touch_across_180_degrees() {
    let folder = tempfile::tempdir().unwrap();
    let archive = zip(&folder, "a.zip", &[("N51E179.hgt", &flat_tile(1)), ("N51W180.hgt", &flat_tile(2))]);
    let mesh = read(&[archive]).unwrap();
    assert_eq!(counts(&mesh), (2401 * 1201, 5_760_000));
    assert_near(&bounds(&mesh), &[138_441.0, 111_195.0, 1.0, 2.0], "two tiles");
    // E179 is the western one, and owns the seam.
    assert_eq!([0, 1200, 1201].map(|column| mesh.positions[column][2]), [1.0, 1.0, 2.0]);
    let degrees = mesh.georeference.degrees.unwrap();
    assert_eq!((degrees.longitude, degrees.latitude), (180.0, 51.5));
    assert_eq!(mesh.georeference.coordinate_system, "EPSG:4326");

    // E180 is another name of W180, and the middle is in the east.
    let names = ["N00E180.hgt", "N00W179.hgt", "N00E179.hgt"];
    let files = names.map(|name| write(&folder, name, flat_tile(0)));
    let mesh = read(&files).unwrap();
    assert_near(&bounds(&mesh)[..2], &[3.0 * 111_190.0, 111_195.0], "three tiles");
    assert_eq!(mesh.georeference.degrees.unwrap().longitude, -179.5);
    let twice = [&files[0], &write(&folder, "N00W180.hgt", flat_tile(0))].map(PathBuf::clone);
    assert!(matches!(read(&twice), Err(MeshIoError::DuplicateTile { .. })));
    let far = write(&folder, "N00E000.hgt", flat_tile(0));
    assert!(matches!(read(&[&files[0], &far]), Err(MeshIoError::TilesTooFarApart { .. })));
}
