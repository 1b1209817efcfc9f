//! Files that are damaged, cut short or something else.

use std::sync::Arc;
use std::time::Duration;

use foldfront::Hierarchy;
use foldfront::page_store::Simulated;
use foldfront::page_store::source::MemorySource;
use mt_partition::{
    BuildOptions, CacheMode, FileError, MAGIC, Memory, MtError, MtFile, MtTree, Reader, Settings,
};

use super::{all_around, ball_log, finest};
use crate::common::seeded;
use crate::corpora::targets::walk::{Outcome, follow};
use crate::lies::{put, section, tell_lies, word};
use foldfront::testing::strict_mesh::StrictMesh;

/// A small file with several partitions, and where its nodes start.
fn small() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.mt");
    mt_partition::write(
        &path,
        &ball_log(2),
        &BuildOptions { patch: 3.0, partition: 4, ..BuildOptions::default() },
    )
    .unwrap();
    std::fs::read(&path).unwrap()
}

fn open(bytes: Vec<u8>) -> Result<MtFile, MtError> {
    MtFile::open(Arc::new(MemorySource::new("small.mt", bytes)))
}

/// What is damaged is found: when the file is opened, or by `verify`, or at the latest when the page is read. A front over
/// it stays coarse there, counts the fault, and nothing panics.
#[test]
fn any_flipped_bit_is_found() {
    let bytes = small();
    let intact = open(bytes.clone()).unwrap();
    intact.verify().unwrap();
    let (mut refused, mut coarse) = (0, 0);
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        let file = match open(damaged) {
            Err(error) => {
                assert!(error.to_string().starts_with("small.mt"), "{error}");
                refused += 1;
                continue;
            }
            Ok(file) => Arc::new(file),
        };
        let error = file.verify().expect_err("a flipped bit that nobody sees");
        assert!(error.to_string().contains("checksum"), "byte {at}: {error}");
        if at % 7 != 0 {
            continue;
        }
        let mut engine = finest(&file, StrictMesh::default());
        let mut faults = 0;
        for _ in 0..12 {
            faults += engine.advance(&all_around(glam::DVec3::ZERO)).unwrap().pages.faults;
            engine.tree_mut().settle().unwrap();
        }
        assert!(faults > 0, "byte {at}");
        let displayed = engine.sink().triangles.len();
        assert!(displayed < 128, "byte {at}: the damaged node is displayed");
        coarse += 1;
    }
    assert!(refused > 300 && coarse > 100, "{refused}, {coarse}");
}

#[test]
fn every_truncated_file_is_refused() {
    let bytes = small();
    for length in 0..bytes.len() {
        let error = open(bytes[..length].to_vec()).expect_err("cut short");
        let is_expected = match &error {
            MtError::File(FileError::Foreign { .. }) => length < MAGIC.len(),
            MtError::File(FileError::Length { actual, .. }) => *actual == length as u64,
            _ => false,
        };
        assert!(is_expected, "{length} bytes: {error}");
    }
    let mut longer = bytes;
    longer.push(0);
    assert!(matches!(open(longer), Err(MtError::File(FileError::Length { .. }))));
}

/// Counts that ask for the world, with the checksum of the header made right again: refused before anything is allocated.
#[test]
fn huge_counts_are_refused() {
    let bytes = small();
    for at in (16..120).step_by(8) {
        for value in [u64::MAX, u64::from(u32::MAX) - 2, 1 << 40, 0] {
            let mut damaged = bytes.clone();
            damaged[at..at + 8].copy_from_slice(&value.to_le_bytes());
            if damaged == bytes {
                continue;
            }
            let checksum = crc32fast::hash(&damaged[..152]);
            damaged[152..156].copy_from_slice(&checksum.to_le_bytes());
            // The counts that nothing is laid out by are looked at by `verify`, or are for people to read.
            if let Ok(file) = open(damaged) {
                let is_for_people = [16, 24, 32, 80, 88].contains(&at);
                assert!(is_for_people || file.verify().is_err(), "offset {at}, {value}");
            }
        }
    }
}

/// Where the records of the nodes are in an intact file.
fn records(bytes: &[u8]) -> Vec<(usize, usize)> {
    let ((mut start, _), (table, length)) = (section(bytes, 160, b"PAGE"), section(bytes, 160, b"NODE"));
    let lengths = (0..length / 8).map(|node| word(bytes, table + 8 * node) as usize);
    let place = |length| {
        start += length;
        (start - length, length)
    };
    lengths.map(place).collect()
}

#[test]
fn nodes_that_lie_are_faults() {
    let bytes = small();
    let records = records(&bytes);
    let (mut found, mut faults, mut opened) = (0, 0, 0);
    for seed in 0..400 {
        let mut lying = bytes.clone();
        tell_lies(&mut lying, &records, &mut seeded(seed));
        let Ok(file) = open(lying) else { continue };
        opened += 1;
        let verified = file.verify().is_ok();
        found += u32::from(!verified);
        let store = Simulated::with_latency(Duration::from_millis(5));
        let cache = CacheMode::ALL[seed as usize % CacheMode::ALL.len()];
        let memory = Memory::new(if seed.is_multiple_of(2) { u64::MAX } else { 2 * file.least_memory() });
        let reader = Some(Reader::simulated(store));
        let settings = Settings { cache, memory, reader, ..Settings::default() };
        let Ok(tree) = MtTree::new(Arc::new(file), settings) else { continue };
        let outcome = follow(tree, seed, 2000, verified);
        assert_eq!(outcome.errors, 0, "seed {seed}");
        faults += u32::from(outcome.faults > 0);
        assert!(
            !verified || outcome.is_clean(),
            "seed {seed}: verify passes what a walk comes upon: {outcome:?}"
        );
    }
    assert!(opened > 390 && found > 250 && faults > 200, "{opened} opened, {found} found, {faults} faults");
}

/// One end of an arc says nothing of the other, whichever of the two comes first.
#[test]
fn arcs_with_one_end_are_faults() {
    let bytes = small();
    let records = records(&bytes);
    // Ingoing arcs are at 52, outgoing ones behind them.
    let (mut above, mut below) = (0, 0);
    for (node, &(start, length)) in (0_u32..).zip(&records) {
        let ingoing = word(&bytes, start + 32) as usize;
        for (at, is_above) in [(start + 52, true), (start + 52 + 8 * ingoing, false)] {
            let other = word(&bytes, at);
            if other == u32::MAX || (other as usize) >= records.len() {
                continue;
            }
            let mut lying = bytes.clone();
            put(&mut lying, at, (0..).find(|&n| n != node && n != other).unwrap());
            let sum = crc32fast::hash(&lying[start + 4..start + length]);
            put(&mut lying, start, sum);
            let file = open(lying).unwrap();
            assert!(file.verify().is_err());
            let reader = Some(Reader::simulated(Simulated::with_latency(Duration::from_millis(5))));
            let tree = MtTree::new(Arc::new(file), Settings { reader, ..Settings::default() }).unwrap();
            let Outcome { errors, faults, .. } = follow(tree, 1, 2000, false);
            assert_eq!(errors, 0);
            assert!(faults > 0, "node {node}: an arc {}", if is_above { "above" } else { "below" });
            *(if is_above { &mut above } else { &mut below }) += 1;
        }
    }
    assert!(above > 20 && below > 10, "{above}, {below}");
}

#[test]
fn something_else_is_refused() {
    let error = open(b"FFCOLLOG and so on".to_vec()).unwrap_err();
    assert!(matches!(error, MtError::File(FileError::Foreign { .. })), "{error}");
    for (offset, message) in [(8, "version 3"), (12, "attribute stride 1")] {
        let mut other = small();
        other[offset] += 1;
        let error = open(other).unwrap_err();
        assert!(error.to_string().contains(message), "{error}");
    }
    let missing = mt_partition::write("/nowhere/at/all.mt".as_ref(), &ball_log(1), &BuildOptions::default());
    assert!(missing.unwrap_err().to_string().contains("/nowhere/at"));
}
