//! Collapse logs as files: what is written is what is read, and nothing else is.

use std::path::{Path, PathBuf};

use vertex_tree::{
    Bounds, Collapse, CollapseLog, LogCounts, LogError, LogFileError, Mesh, read_log, write_log,
    write_log_from,
};

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

/// The file of [`square`]. Files of version 1 are to be read for ever: these bytes do not change.
const SQUARE: &str = "
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

fn square_bytes() -> Vec<u8> {
    SQUARE.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

const TRIANGLES_AT: usize = 44 + 4 * 12;
const COLLAPSES_AT: usize = TRIANGLES_AT + 2 * 12;
const CHECKSUMS_AT: usize = COLLAPSES_AT + 2 * 28;

/// Makes the checksums of a file with the sections of [`square`] right again.
fn mend(bytes: &mut [u8]) {
    for (section, at) in [
        (0..40, 40),
        (44..TRIANGLES_AT, CHECKSUMS_AT),
        (TRIANGLES_AT..COLLAPSES_AT, CHECKSUMS_AT + 4),
        (COLLAPSES_AT..CHECKSUMS_AT, CHECKSUMS_AT + 8),
    ] {
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
fn version_1_has_these_bytes() {
    let place = Place::new();
    assert_eq!(place.written(&square()), square_bytes());
    assert_eq!(place.read(&square_bytes()).unwrap(), square());
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
    let bytes = square_bytes();
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

#[test]
fn no_flipped_bit_goes_unnoticed() {
    let place = Place::new();
    let mut bytes = square_bytes();
    for at in 0..bytes.len() {
        for bit in 0..8 {
            bytes[at] ^= 1 << bit;
            let error = place.read(&bytes).unwrap_err();
            assert!(error.to_string().starts_with(&place.file.display().to_string()));
            let named = match error {
                LogFileError::NotALog { .. } => 0..8,
                LogFileError::Version { .. } => 8..12,
                LogFileError::Checksum { offset: 0, section: "header", .. } => 12..44,
                LogFileError::Checksum { section: "positions", offset: 44, .. } => 44..TRIANGLES_AT,
                LogFileError::Checksum { section: "triangles", .. } => TRIANGLES_AT..COLLAPSES_AT,
                LogFileError::Checksum { section: "collapses", .. } => COLLAPSES_AT..CHECKSUMS_AT,
                other => panic!("byte {at}: {other:?}"),
            };
            let checksum =
                (at >= CHECKSUMS_AT).then(|| [44, TRIANGLES_AT, COLLAPSES_AT][(at - CHECKSUMS_AT) / 4]);
            assert!(named.contains(&checksum.unwrap_or(at)), "byte {at} is not in {named:?}");
            bytes[at] ^= 1 << bit;
        }
    }
}

#[test]
fn counts_are_checked_before_anything_is_read() {
    let place = Place::new();
    let with_counts = |counts: [u64; 3]| {
        let mut bytes = square_bytes();
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
            match place.read(&with_counts(counts)) {
                Err(LogFileError::Count { offset: o, count: c, .. }) if (o, c) == (offset, count) => {}
                other => panic!("{counts:?}: {other:?}"),
            }
        }
    }
    // As large as can be: hundreds of gigabytes, by a file that holds none of them.
    for counts in
        [[most, most, most - 1], [most, 2, 2], [4, most, 2], [most, 0, most - 1], [0, 2, 0], [5, 2, 2]]
    {
        let [v, t, c] = counts;
        match place.read(&with_counts(counts)) {
            Err(LogFileError::Length { expected, .. }) => {
                assert_eq!(expected, 44 + 12 * v + 12 * t + 28 * c + 12);
            }
            other => panic!("{counts:?}: {other:?}"),
        }
    }
    // Each collapse removes a vertex and one is left.
    for counts in [[4, 2, 4], [0, 0, 1]] {
        assert!(matches!(place.read(&with_counts(counts)), Err(LogFileError::Count { offset: 32, .. })));
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
    for at in (0..CHECKSUMS_AT).step_by(4) {
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
    let log = square();
    let right = LogCounts { vertices: 4, triangles: 2, collapses: 2 };
    let write = |counts: LogCounts, fail: bool| {
        let triangles =
            log.mesh.triangles.iter().map(|&t| if fail { Err(std::io::Error::other("gone")) } else { Ok(t) });
        let positions = log.mesh.positions.iter().map(|&p| Ok(p));
        write_log_from(&path, counts, positions, triangles, log.collapses.iter().map(|&c| Ok(c)))
    };
    write(right, false).unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), square_bytes());
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
