//! Height maps and tiles in small.

use super::*;

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
pub(super) fn flat_tile(metres: i16) -> Vec<u8> {
    metres.to_be_bytes().repeat(1201 * 1201)
}

pub(super) fn zip(folder: &TempDir, name: &str, entries: &[(&str, &[u8])]) -> PathBuf {
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
