//! Collapse logs as files: what is written is what is read, and nothing else is.

use std::path::{Path, PathBuf};

use crate::{
    Collapse, CollapseLog, LogCounts, LogError, LogFile, LogFileError, Mesh, log_file_version, read_log,
    write_log, write_log_from,
};
use container::{DegreeMap, Georeference, Kind, Rounding, SectionError};
use vertex_tree::Bounds;

/// Two triangles; 3 merges into 2 and 2 into 0.
///
/// ```text
///   3 --- 2
///   |   / |
///   | /   |
///   0 --- 1
/// ```
fn square() -> CollapseLog {
    let collapse = |removed, kept, eps| {
        let bounds = Bounds { center: [0.5, 0.5, -0.25], radius: 2.0, eps };
        Collapse { removed, kept, bounds }
    };
    CollapseLog {
        mesh: Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, -0.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Mesh::default()
        },
        collapses: vec![collapse(3, 2, 0.0), collapse(2, 0, 0.125)],
    }
}

/// The file of [`square`] in version 1. Files of version 1 are to be read for ever: these bytes do not change.
const SQUARE_1: &str = "
    46 46 43 4f 4c 4c 4f 47  01 00 00 00  00 00 00 00
    04 00 00 00 00 00 00 00  02 00 00 00 00 00 00 00  02 00 00 00 00 00 00 00
    36 35 fc 61
    00 00 00 00  00 00 00 00  00 00 00 00
    00 00 80 3f  00 00 00 00  00 00 00 00
    00 00 80 3f  00 00 80 3f  00 00 00 00
    00 00 00 00  00 00 80 3f  00 00 00 80
    00 00 00 00  01 00 00 00  02 00 00 00
    00 00 00 00  02 00 00 00  03 00 00 00
    03 00 00 00  02 00 00 00  00 00 00 3f  00 00 00 3f  00 00 80 be  00 00 00 40  00 00 00 00
    02 00 00 00  00 00 00 00  00 00 00 3f  00 00 00 3f  00 00 80 be  00 00 00 40  00 00 00 3e
    f2 36 eb 07  96 7c 96 11  d1 7d ce ad
";

/// And in version 2.
const SQUARE: &str = "
    46 46 43 4f 4c 4c 4f 47  02 00 00 00  00 00 00 00
    04 00 00 00 00 00 00 00  02 00 00 00 00 00 00 00  02 00 00 00 00 00 00 00
    89 3d e3 a8  00 00 00 00
    03 00 00 00  43 e9 9c d8
    50 4f 53 49  01 00 00 00  98 00 00 00 00 00 00 00  30 00 00 00 00 00 00 00  f2 36 eb 07  00 00 00 00
    54 52 49 41  01 00 00 00  c8 00 00 00 00 00 00 00  18 00 00 00 00 00 00 00  96 7c 96 11  00 00 00 00
    43 4f 4c 4c  01 00 00 00  e0 00 00 00 00 00 00 00  38 00 00 00 00 00 00 00  d1 7d ce ad  00 00 00 00
    00 00 00 00  00 00 00 00  00 00 00 00
    00 00 80 3f  00 00 00 00  00 00 00 00
    00 00 80 3f  00 00 80 3f  00 00 00 00
    00 00 00 00  00 00 80 3f  00 00 00 80
    00 00 00 00  01 00 00 00  02 00 00 00
    00 00 00 00  02 00 00 00  03 00 00 00
    03 00 00 00  02 00 00 00  00 00 00 3f  00 00 00 3f  00 00 80 be  00 00 00 40  00 00 00 00
    02 00 00 00  00 00 00 00  00 00 00 3f  00 00 00 3f  00 00 80 be  00 00 00 40  00 00 00 3e
";

fn bytes_of(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn square_bytes() -> Vec<u8> {
    bytes_of(SQUARE)
}

const TABLE_AT: usize = 48;
const POSITIONS_AT: usize = TABLE_AT + 8 + 3 * 32;
const TRIANGLES_AT: usize = POSITIONS_AT + 4 * 12;
const COLLAPSES_AT: usize = TRIANGLES_AT + 2 * 12;
const END: usize = COLLAPSES_AT + 2 * 28;

/// Makes the checksums of a file with the sections of [`square`] right again.
fn mend(bytes: &mut [u8]) {
    let mut put = |section: std::ops::Range<usize>, at: usize| {
        let sum = crc32fast::hash(&bytes[section]);
        bytes[at..at + 4].copy_from_slice(&sum.to_le_bytes());
    };
    put(0..40, 40);
    for (i, section) in
        [POSITIONS_AT..TRIANGLES_AT, TRIANGLES_AT..COLLAPSES_AT, COLLAPSES_AT..END].into_iter().enumerate()
    {
        put(section, TABLE_AT + 8 + 32 * i + 24);
    }
    let table = [&bytes[TABLE_AT..TABLE_AT + 4], &bytes[TABLE_AT + 8..POSITIONS_AT]].concat();
    bytes[TABLE_AT + 4..TABLE_AT + 8].copy_from_slice(&crc32fast::hash(&table).to_le_bytes());
}

/// The same for the first version.
fn mend_1(bytes: &mut [u8]) {
    const SUMS_AT: usize = 172;
    for (section, at) in [(0..40, 40), (44..92, SUMS_AT), (92..116, SUMS_AT + 4), (116..SUMS_AT, SUMS_AT + 8)]
    {
        let sum = crc32fast::hash(&bytes[section]);
        bytes[at..at + 4].copy_from_slice(&sum.to_le_bytes());
    }
}

/// A file in a folder of its own.
struct Place {
    _folder: tempfile::TempDir,
    file: PathBuf,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Self { file: folder.path().join("tiny.log"), _folder: folder }
    }

    fn read(&self, bytes: &[u8]) -> Result<CollapseLog, LogFileError> {
        std::fs::write(&self.file, bytes).unwrap();
        read_log(&self.file)
    }

    fn written(&self, log: &CollapseLog) -> Vec<u8> {
        write_log(&self.file, log).unwrap();
        std::fs::read(&self.file).unwrap()
    }

    /// Writes a log that may be nonsense, with checksums that are right, and reads it.
    fn log_error(&self, change: impl FnOnce(&mut CollapseLog)) -> LogError {
        let mut log = square();
        change(&mut log);
        write_log(&self.file, &log).unwrap();
        match read_log(&self.file) {
            Err(LogFileError::Log { file, source }) if file == self.file => source,
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn each_version_has_these_bytes() {
    let place = Place::new();
    assert_eq!(place.written(&square()), square_bytes());
    assert_eq!(log_file_version(&place.file).unwrap(), 2);
    assert_eq!(place.read(&square_bytes()).unwrap(), square());
    assert_eq!(place.read(&bytes_of(SQUARE_1)).unwrap(), square());
    assert_eq!(log_file_version(&place.file).unwrap(), 1);
    assert_eq!(LogFile::open(&place.file).unwrap().version(), 1);
}

/// Somewhere in Germany.
fn germany() -> Georeference {
    Georeference {
        origin: [691_000.125, 5_334_000.0, -0.5],
        coordinate_system: "EPSG:25832".to_owned(),
        degrees: Some(DegreeMap {
            longitude: 11.5,
            latitude: 48.25,
            metres_per_degree: [74_000.5, 111_000.25],
        }),
        rounding: Rounding { largest_move: 0.015, median_edge: 0.75 },
    }
}

#[test]
fn a_log_stays_where_it_is_in_the_world() {
    let place = Place::new();
    let cases = [
        germany(),
        Georeference { degrees: None, ..germany() },
        Georeference { coordinate_system: "ü".repeat(2048), ..Georeference::default() },
        Georeference { origin: [0.0, 0.0, Georeference::FARTHEST], ..Georeference::default() },
    ];
    for georeference in cases {
        let mut log = square();
        log.mesh.georeference = georeference.clone();
        let bytes = place.written(&log);
        assert_eq!(read_log(&place.file).unwrap(), log);
        assert_eq!(LogFile::open(&place.file).unwrap().georeference(), &georeference);
        // Necessary where the mesh would be somewhere else without it.
        assert_eq!(bytes[TABLE_AT + 8..TABLE_AT + 12], *b"GEOR");
        assert_eq!(u32::from(bytes[TABLE_AT + 12]), u32::from(georeference.origin != [0.0; 3]));
        for at in (0..bytes.len()).step_by(1 + bytes.len() / 400) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x10;
            assert!(place.read(&damaged).is_err(), "byte {at}");
            assert!(LogFile::open(&place.file).is_err(), "byte {at}");
        }
    }
    for wrong in [
        Georeference { origin: [f64::NAN, 0.0, 0.0], ..germany() },
        Georeference { coordinate_system: "x".repeat(4097), ..germany() },
        Georeference { rounding: Rounding { largest_move: -1.0, median_edge: 0.0 }, ..germany() },
    ] {
        let mut log = square();
        log.mesh.georeference = wrong;
        std::fs::remove_file(&place.file).ok();
        let error = write_log(&place.file, &log).unwrap_err();
        assert!(matches!(error, LogFileError::Io { .. }), "{error}");
        assert!(!place.file.exists());
    }
}

/// A georeference that lies, with checksums that are right.
#[test]
fn a_georeference_that_is_none_is_named() {
    let place = Place::new();
    let mut log = square();
    log.mesh.georeference = germany();
    let bytes = place.written(&log);
    let table_end = TABLE_AT + 8 + 4 * 32;
    let length = 80 + "EPSG:25832".len();
    assert_eq!(bytes[table_end + 80..table_end + length], *b"EPSG:25832");
    let lie = |change: &dyn Fn(&mut [u8])| {
        let mut lying = bytes.clone();
        change(&mut lying[table_end..table_end + length]);
        let sum = crc32fast::hash(&lying[table_end..table_end + length]);
        lying[TABLE_AT + 8 + 24..TABLE_AT + 8 + 28].copy_from_slice(&sum.to_le_bytes());
        let table = [&lying[TABLE_AT..TABLE_AT + 4], &lying[TABLE_AT + 8..table_end]].concat();
        lying[TABLE_AT + 4..TABLE_AT + 8].copy_from_slice(&crc32fast::hash(&table).to_le_bytes());
        lying
    };
    assert!(place.read(&lie(&|_| {})).unwrap() == log);
    let nan = |at: usize| move |bytes: &mut [u8]| bytes[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    for (at, change, named) in [
        (0, &nan(0) as &dyn Fn(&mut [u8]), "x of the origin"),
        (24, &nan(24), "the largest move"),
        (32, &|b: &mut [u8]| b[32..40].copy_from_slice(&(-1.0_f64).to_le_bytes()), "the median edge"),
        (48, &nan(48), "the longitude"),
        (72, &nan(72), "metres a degree of latitude"),
        (40, &|b: &mut [u8]| b[40] = 3, "flags"),
        (48, &|b: &mut [u8]| b[40] = 0, "the longitude"),
        (44, &|b: &mut [u8]| b[44] += 1, "the length of the name"),
        (80, &|b: &mut [u8]| b[82] = 0xff, "the name"),
    ] {
        match place.read(&lie(change)) {
            Err(LogFileError::Sections {
                source: SectionError::Georeference { offset, field, .. }, ..
            }) => assert_eq!((offset, field), ((table_end + at) as u64, named)),
            other => panic!("{named}: {other:?}"),
        }
    }
}

#[test]
fn what_is_written_is_read() {
    let place = Place::new();
    // More than one chunk of everything, with numbers that are easily lost.
    let odd = [-0.0, f32::MIN_POSITIVE / 2.0, f32::MAX / 4.0, -1.0e-30, 0.1];
    let count = 10_000_u32;
    let coordinate = |i: u32| odd[i as usize % 5] * (1 + i % 3) as f32 / 3.0;
    let long = CollapseLog {
        mesh: Mesh {
            positions: (0..count).map(|v| [v, v + 1, v + 2].map(coordinate)).collect(),
            triangles: (0..2 * count).map(|t| [t % count, t / 3, (t / 7) % count]).collect(),
            ..Mesh::default()
        },
        collapses: (1..count)
            .map(|v| Collapse {
                removed: v,
                kept: 0,
                bounds: Bounds { center: [v, 1, 2].map(coordinate), radius: v as f32, eps: 0.1 },
            })
            .collect(),
    };
    let lone =
        CollapseLog { mesh: Mesh { positions: vec![[1.0, 2.0, 3.0]], ..Mesh::default() }, collapses: vec![] };
    for log in [CollapseLog::default(), lone, square(), long] {
        let bytes = place.written(&log);
        let read = read_log(&place.file).unwrap();
        assert!(read == log);
        // Equality does not tell -0 from 0; bytes do.
        assert!(place.written(&read) == bytes);
    }
}

#[test]
fn no_prefix_of_a_file_is_a_log() {
    let place = Place::new();
    for bytes in [bytes_of(SQUARE_1), square_bytes()] {
        for length in 0..bytes.len() {
            let error = place.read(&bytes[..length]).unwrap_err();
            match error {
                LogFileError::NotALog { .. } if length < 8 => {}
                LogFileError::Length { actual, .. } if length >= 8 && actual == length as u64 => {}
                other => panic!("{length} bytes: {other:?}"),
            }
        }
        let longer = [&bytes[..], &[0]].concat();
        assert!(matches!(place.read(&longer), Err(LogFileError::Length { .. })));
    }
}

/// Reads a file with each bit flipped, and looks whether the error names the part that the bit is in.
fn flip_bits(mut bytes: Vec<u8>, is_named: impl Fn(usize, &LogFileError) -> bool) {
    let place = Place::new();
    for at in 0..bytes.len() {
        for bit in 0..8 {
            bytes[at] ^= 1 << bit;
            let error = place.read(&bytes).unwrap_err();
            assert!(error.to_string().starts_with(&place.file.display().to_string()));
            assert!(is_named(at, &error), "byte {at}: {error:?}");
            bytes[at] ^= 1 << bit;
        }
    }
}

#[test]
fn no_flipped_bit_goes_unnoticed() {
    flip_bits(square_bytes(), |at, error| {
        let named = match error {
            LogFileError::NotALog { .. } => 0..8,
            LogFileError::Version { .. } => 8..12,
            LogFileError::Checksum { offset: 0, section: "header", .. } => 12..44,
            LogFileError::Sections { source: SectionError::Padding { .. }, .. } => 44..TABLE_AT,
            LogFileError::Sections { source: SectionError::Count { .. }, .. } => TABLE_AT..TABLE_AT + 4,
            // More sections than the file has room for.
            LogFileError::Length { .. } => TABLE_AT..TABLE_AT + 1,
            LogFileError::Sections { source: SectionError::TableChecksum { offset: 48 }, .. } => {
                TABLE_AT..POSITIONS_AT
            }
            LogFileError::Checksum { section: "positions", offset: 152, .. } => POSITIONS_AT..TRIANGLES_AT,
            LogFileError::Checksum { section: "triangles", .. } => TRIANGLES_AT..COLLAPSES_AT,
            LogFileError::Checksum { section: "collapses", .. } => COLLAPSES_AT..END,
            _ => return false,
        };
        named.contains(&at)
    });
}

#[test]
fn no_flipped_bit_of_version_1_goes_unnoticed() {
    flip_bits(bytes_of(SQUARE_1), |at, error| {
        let named = match error {
            LogFileError::NotALog { .. } => 0..8,
            LogFileError::Version { .. } => 8..12,
            LogFileError::Checksum { offset: 0, section: "header", .. } => 12..44,
            LogFileError::Checksum { section: "positions", offset: 44, .. } => 44..92,
            LogFileError::Checksum { section: "triangles", .. } => 92..116,
            LogFileError::Checksum { section: "collapses", .. } => 116..172,
            _ => return false,
        };
        // The checksums at the end stand for what they are of.
        named.contains(&if at < 172 { at } else { [44, 92, 116][(at - 172) / 4] })
    });
}

#[test]
fn counts_are_checked_before_anything_is_read() {
    let place = Place::new();
    let with_counts = |counts: [u64; 3], version: usize| {
        let (text, mend) = [(SQUARE_1, mend_1 as fn(&mut [u8])), (SQUARE, mend)][version - 1];
        let mut bytes = bytes_of(text);
        for (at, count) in [16, 24, 32].into_iter().zip(counts) {
            bytes[at..at + 8].copy_from_slice(&count.to_le_bytes());
        }
        mend(&mut bytes);
        bytes
    };
    let most = u64::from(u32::MAX) - 1;
    for (at, offset) in [(0, 16), (1, 24), (2, 32)] {
        for count in [u64::MAX, u64::MAX - 1, u64::MAX / 12, u64::MAX / 28 + 1, 1 << 63, 1 << 32, most + 1] {
            let mut counts = [4, 2, 2];
            counts[at] = count;
            for version in [1, 2] {
                match place.read(&with_counts(counts, version)) {
                    Err(LogFileError::Count { offset: o, count: c, .. }) if (o, c) == (offset, count) => {}
                    other => panic!("{counts:?}: {other:?}"),
                }
            }
        }
    }
    // As large as can be: hundreds of gigabytes, by a file that holds none of them.
    for counts in
        [[most, most, most - 1], [most, 2, 2], [4, most, 2], [most, 0, most - 1], [0, 2, 0], [5, 2, 2]]
    {
        let [v, t, c] = counts;
        match place.read(&with_counts(counts, 1)) {
            Err(LogFileError::Length { expected, .. }) => {
                assert_eq!(expected, 44 + 12 * v + 12 * t + 28 * c + 12);
            }
            other => panic!("{counts:?}: {other:?}"),
        }
        match place.read(&with_counts(counts, 2)) {
            Err(LogFileError::Sections {
                source: SectionError::Entry { kind, field: "the length", value, expected, .. },
                ..
            }) => {
                let all = [
                    (Kind::POSITIONS, 48, 12 * v),
                    (Kind::TRIANGLES, 24, 12 * t),
                    (Kind::COLLAPSES, 56, 28 * c),
                ];
                assert_eq!(
                    all.into_iter().find(|(_, there, asked)| there != asked),
                    Some((kind, value, expected))
                );
            }
            other => panic!("{counts:?}: {other:?}"),
        }
    }
    // Each collapse removes a vertex and one is left.
    for counts in [[4, 2, 4], [0, 0, 1]] {
        for version in [1, 2] {
            let outcome = place.read(&with_counts(counts, version));
            assert!(matches!(outcome, Err(LogFileError::Count { offset: 32, .. })));
        }
    }
    let mut stride = square_bytes();
    stride[12] = 16;
    mend(&mut stride);
    assert!(matches!(place.read(&stride), Err(LogFileError::Attributes { stride: 16, .. })));
}

#[test]
fn intact_nonsense_is_named() {
    let place = Place::new();
    let nan = f32::NAN;
    assert_eq!(
        place.log_error(|log| log.collapses[0].removed = 4),
        LogError::NoSuchVertex { collapse: 0, vertex: 4 }
    );
    assert_eq!(
        place.log_error(|log| log.collapses[1].kept = u32::MAX),
        LogError::NoSuchVertex { collapse: 1, vertex: u32::MAX }
    );
    assert_eq!(
        place.log_error(|log| log.collapses[1].removed = 3),
        LogError::NoSuchVertex { collapse: 1, vertex: 3 },
        "it was removed before"
    );
    assert_eq!(
        place.log_error(|log| log.collapses[1].kept = 3),
        LogError::NoSuchVertex { collapse: 1, vertex: 3 }
    );
    assert_eq!(
        place.log_error(|log| log.collapses[0].kept = 3),
        LogError::IntoItself { collapse: 0, vertex: 3 }
    );
    assert_eq!(
        place.log_error(|log| log.mesh.triangles[1][2] = 4),
        LogError::CornerOutOfRange { triangle: 1, vertex: 4, vertices: 4 }
    );
    for bad in [nan, f32::INFINITY, f32::NEG_INFINITY] {
        let error = place.log_error(|log| log.mesh.positions[2][1] = bad);
        assert!(matches!(error, LogError::BadPosition { vertex: 2, .. }), "{error}");
        let error = place.log_error(|log| log.collapses[1].bounds.center[0] = bad);
        assert!(matches!(error, LogError::BadBounds { collapse: 1, .. }), "{error}");
    }
    for bad in [nan, f32::INFINITY, -1.0] {
        let error = place.log_error(|log| log.collapses[0].bounds.radius = bad);
        assert!(matches!(error, LogError::BadBounds { collapse: 0, .. }), "{error}");
        let error = place.log_error(|log| log.collapses[1].bounds.eps = bad);
        assert!(matches!(error, LogError::BadBounds { collapse: 1, .. }), "{error}");
    }
}

#[test]
fn any_word_can_be_anything_without_a_panic() {
    let place = Place::new();
    let words = [0, 1, 3, 4, u32::MAX, u32::MAX - 1, 1 << 31, 0x7f80_0000, 0x7fc0_0000, 0x7f7f_ffff];
    let mut logs = 0;
    for at in (0..END).step_by(4) {
        for word in words {
            let mut bytes = square_bytes();
            bytes[at..at + 4].copy_from_slice(&u32::to_le_bytes(word));
            mend(&mut bytes);
            if let Ok(log) = place.read(&bytes) {
                assert!(log.forest().is_ok());
                assert_eq!(place.written(&log), bytes);
                logs += 1;
            }
        }
    }
    assert!(logs > 100, "most coordinates can be anything finite: {logs}");
}

#[test]
fn what_can_not_be_written_is_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let inside = folder.path().join("folder");
    std::fs::create_dir(&inside).unwrap();
    for file in [inside.clone(), inside.join("nowhere/x.log")] {
        let error = write_log(&file, &square()).unwrap_err();
        assert!(matches!(&error, LogFileError::Io { file: f, .. } if *f == file), "{error}");
    }
    let names = |folder: &Path| {
        let entries = std::fs::read_dir(folder).unwrap();
        entries.map(|entry| entry.unwrap().file_name()).collect::<Vec<_>>()
    };
    assert_eq!(names(folder.path()), ["folder"]);
    assert_eq!(names(&inside), [""; 0]);
    let error = read_log(&inside.join("x.log")).unwrap_err();
    assert!(matches!(error, LogFileError::Io { .. }), "{error}");
}

/// Written piece by piece, the bytes are the same; where a piece is missing, is too many or can not be had, there is no
/// file.
#[test]
fn pieces_make_the_same_file_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pieces");
    let mut log = square();
    log.mesh.georeference = germany();
    let whole = Place::new().written(&log);
    let right = LogCounts { vertices: 4, triangles: 2, collapses: 2 };
    let write = |counts: LogCounts, fail: bool| {
        let triangles =
            log.mesh.triangles.iter().map(|&t| if fail { Err(std::io::Error::other("gone")) } else { Ok(t) });
        let positions = log.mesh.positions.iter().map(|&p| Ok(p));
        let georeference = &log.mesh.georeference;
        write_log_from(
            &path,
            counts,
            georeference,
            positions,
            triangles,
            log.collapses.iter().map(|&c| Ok(c)),
        )
    };
    write(right, false).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), whole);
    std::fs::remove_file(&path).unwrap();
    for (counts, fail, said) in [
        (LogCounts { vertices: 5, ..right }, false, "end of file"),
        (LogCounts { triangles: 1, ..right }, false, "more records than the 1 announced"),
        (LogCounts { collapses: 0, ..right }, false, "more records than the 0 announced"),
        (right, true, "gone"),
    ] {
        let error = write(counts, fail).unwrap_err();
        assert!(matches!(error, LogFileError::Io { .. }) && error.to_string().contains(said), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
