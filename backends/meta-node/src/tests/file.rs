//! The file: what is written is what is read, and damage anywhere is found.

use std::sync::Arc;

use crate::tests::common::{bytes, log_of, open, random_log};
use crate::{BuildOptions, FileError, MAGIC, MetaNodeError, MetaNodeFile};
use collapse_log::{Collapse, CollapseLog};
use page_store::source::MemorySource;
use vertex_tree::Bounds;

fn options(levels: u32, page_bytes: u32) -> BuildOptions {
    BuildOptions { levels: Some(levels), page_bytes }
}

#[test]
fn whatever_the_pages_the_whole_hierarchy_is_there() {
    for (side, left) in [(2, 1), (3, 1), (9, 4), (20, 1), (40, 30)] {
        let log = random_log(side, left, 7 + side as u64);
        for levels in [1, 2, 3, 5, 8, 12] {
            for page_bytes in [0, 600, 4096, 1 << 20] {
                let file = open(bytes(&log, &options(levels, page_bytes))).unwrap();
                file.verify().unwrap_or_else(|e| panic!("{side}, {left}, {levels}, {page_bytes}: {e}"));
                let facts: Vec<_> = file.facts();
                let fact = |name| facts.iter().find(|(fact, _)| *fact == name).unwrap().1.as_str();
                assert_eq!(fact("nodes"), log.collapses.len().to_string());
                assert_eq!(fact("roots"), log.forest().unwrap().roots().count().to_string());
                assert_eq!(fact("levels of a block"), levels.to_string());
            }
        }
    }
}

#[test]
fn by_default_every_block_fits_a_page_of_a_disk() {
    let log = random_log(60, 3, 1);
    let written = bytes(&log, &BuildOptions::default());
    let facts = open(written).unwrap().facts();
    let fact = |name| facts.iter().find(|(fact, _)| *fact == name).unwrap().1.parse::<f64>().unwrap();
    assert!(fact("largest page, bytes") <= 4096.0, "{facts:?}");
    assert!(fact("mean page, bytes") > 2048.0, "{facts:?}");
    let deeper =
        BuildOptions { levels: Some(fact("levels of a block") as u32 + 1), ..BuildOptions::default() };
    let facts = open(bytes(&log, &deeper)).unwrap().facts();
    let largest = facts.iter().find(|(fact, _)| *fact == "largest page, bytes").unwrap();
    assert!(largest.1.parse::<f64>().unwrap() > 4096.0, "one more level would not fit: {facts:?}");
}

#[test]
fn the_same_log_gives_the_same_bytes() {
    let log = random_log(20, 2, 3);
    assert_eq!(bytes(&log, &BuildOptions::default()), bytes(&log, &BuildOptions::default()));
}

#[test]
fn logs_with_nothing_in_them() {
    let empty = CollapseLog::default();
    open(bytes(&empty, &BuildOptions::default())).unwrap().verify().unwrap();
    let mut no_collapse = random_log(3, 9, 1);
    open(bytes(&no_collapse, &BuildOptions::default())).unwrap().verify().unwrap();
    // Doubled corners are never shown.
    no_collapse.mesh.triangles.extend([[0, 0, 1], [2, 2, 2]]);
    let file = open(bytes(&no_collapse, &BuildOptions::default())).unwrap();
    file.verify().unwrap();
    assert!(file.facts().contains(&("base triangles", "8".to_owned())), "{:?}", file.facts());
}

#[test]
fn what_can_not_be_built_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree");
    let log = random_log(4, 1, 1);
    for levels in [0, 13] {
        let error = crate::write(&path, &log, &options(levels, 4096)).unwrap_err();
        assert!(matches!(error, MetaNodeError::Levels { levels: l, .. } if l == levels), "{error}");
    }
    let bounds = Bounds { center: [0.0; 3], radius: -1.0, eps: 0.0 };
    let wrong = CollapseLog { collapses: vec![Collapse { removed: 1, kept: 0, bounds }], ..log };
    let error = crate::write(&path, &wrong, &BuildOptions::default()).unwrap_err();
    assert!(matches!(error, MetaNodeError::Log(_)), "{error}");
    assert!(!path.exists(), "nothing is left behind");
}

/// Where a section starts and ends, as the table says.
fn section(bytes: &[u8], kind: &[u8; 4]) -> (usize, usize) {
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    let entries = (0..word(80)).map(|i| 88 + 32 * i);
    let entry = entries.into_iter().find(|&at| bytes[at..at + 4] == *kind).unwrap();
    (word(entry + 8), word(entry + 8) + word(entry + 16))
}

/// Whether a file is refused, with words.
fn is_found(damaged: Vec<u8>) -> bool {
    open(damaged).is_err_and(|error| !error.to_string().is_empty())
}

/// Every bit and every length of a small file: opening refuses it, or verifying names the page.
#[test]
fn every_flipped_bit_is_found() {
    let log = random_log(5, 2, 5);
    let intact = bytes(&log, &options(2, 400));
    open(intact.clone()).unwrap().verify().unwrap();
    let (mut refused, mut reported) = (0, 0);
    for bit in 0..8 * intact.len() {
        let mut damaged = intact.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        match open(damaged) {
            Err(_) => refused += 1,
            Ok(file) => match file.verify() {
                Err(MetaNodeError::Page { page, offset, file, .. }) => {
                    assert!(offset as usize <= bit / 8, "page {page} at {offset}, bit {bit}");
                    assert_eq!(file, "tree");
                    reported += 1;
                }
                other => panic!("bit {bit}: {other:?}"),
            },
        }
    }
    assert!(refused > 1000 && reported > 1000, "{refused} refused, {reported} reported");
}

#[test]
fn every_truncated_file_is_refused() {
    let log = random_log(5, 2, 5);
    let intact = bytes(&log, &options(2, 400));
    for length in 0..intact.len() {
        assert!(is_found(intact[..length].to_vec()), "cut to {length} bytes");
    }
    let mut longer = intact;
    longer.push(0);
    assert!(matches!(open(longer), Err(MetaNodeError::File(FileError::Length { .. }))));
}

/// Words that lie, with checksums that agree with them: nothing panics, hangs or takes memory without end.
#[test]
fn lies_with_valid_checksums_are_found() {
    let log = random_log(5, 2, 5);
    let intact = bytes(&log, &options(2, 400));
    let word = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
    let put = |bytes: &mut [u8], at: usize, w: u32| bytes[at..at + 4].copy_from_slice(&w.to_le_bytes());
    let seal_header = |bytes: &mut Vec<u8>| {
        let checksum = crc32fast::hash(&bytes[..76]);
        put(bytes, 76, checksum);
    };
    let mut found = 0;
    for at in (8..76).step_by(4) {
        for lie in [0, 1, 2, 0x7FFF, 0xFFFF, 1 << 20, 1 << 31, u32::MAX - 1, u32::MAX, word(&intact, at) + 1]
        {
            let mut damaged = intact.clone();
            put(&mut damaged, at, lie);
            seal_header(&mut damaged);
            // Levels of a block are for information alone.
            let harmless = damaged == intact || at == 52;
            let ends = open(damaged).and_then(|file| file.verify());
            assert!(harmless || ends.is_err(), "word at {at}: {lie}");
            found += u32::from(ends.is_err());
        }
    }
    assert!(found > 100);
    // Every word of the first page, and of its neighbour.
    let pages = word(&intact, 44) as usize;
    let lengths_at = section(&intact, b"PAGT").0;
    let mut start = section(&intact, b"PAGE").0;
    let mut found = 0;
    for page in 0..pages.min(3) {
        let length = 4 * word(&intact, lengths_at + 4 * page) as usize;
        for at in (start + 4..start + length).step_by(4) {
            for lie in [0, 1, 0x8000, 0xFFFF, 0xFFFF_0000, 1 << 31, u32::MAX, f32::NAN.to_bits()] {
                let mut damaged = intact.clone();
                put(&mut damaged, at, lie);
                let checksum = crc32fast::hash(&damaged[start + 4..start + length]);
                put(&mut damaged, start, checksum);
                // A place may be anywhere.
                found += u32::from(open(damaged).and_then(|file| file.verify()).is_err());
            }
        }
        start += length;
    }
    assert!(found > 500, "{found}");
}

#[test]
fn foreign_files_are_named() {
    let foreign = |bytes: &[u8]| open(bytes.to_vec()).unwrap_err().to_string();
    assert_eq!(foreign(b""), "tree: no file of meta-nodes: it does not start with \"FFMETAND\"");
    assert!(
        foreign(b"FFCOLLOG and so on and so forth, longer than a header of eighty bytes, to be sure of it.")
            .contains("no file")
    );
    assert!(foreign(&MAGIC).contains("8 bytes"), "{}", foreign(&MAGIC));
    let log = random_log(4, 1, 5);
    let mut newer = bytes(&log, &BuildOptions::default());
    newer[8] = 3;
    assert_eq!(foreign(&newer), "tree: offset 8: version 3, expected 1 to 2");
    let mut damaged = bytes(&log, &BuildOptions::default());
    let last = section(&damaged, b"PAGE").1 - 1;
    damaged[last] ^= 1;
    let error = open(damaged).unwrap().verify().unwrap_err().to_string();
    assert!(error.contains("tree: page 0 at offset") && error.contains("checksum"), "{error}");
}

/// Version 2, byte for byte: files that are about must stay readable.
#[test]
fn the_bytes_of_version_2() {
    // The checksum is of the file that these numbers make, and stays as it is: so do they.
    let mut state = 5_u64;
    let log = log_of(4, 1, |limit| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) % limit as u64) as usize
    });
    let written = bytes(&log, &BuildOptions::default());
    assert_eq!((written.len(), crc32fast::hash(&written)), (1404, 2_448_529_876));
    MetaNodeFile::open(Arc::new(MemorySource::new("tree", written))).unwrap();
}
