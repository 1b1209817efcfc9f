//! Pages that contradict themselves, each other, or the list of roots.

use std::sync::Arc;
use std::time::Duration;

use foldfront::page_store::Simulated;
use foldfront::page_store::source::MemorySource;
use meta_node::{BuildOptions, Dependencies, InUse, Io, MetaNodeFile, MetaNodeTree, Settings};

use super::grid;
use crate::common::backends::meta_node_bytes;
use crate::common::seeded;
use crate::corpora::targets::walk::follow;
use crate::lies::{put, section, tell_lies, word};

fn open(bytes: Vec<u8>) -> Option<Arc<MetaNodeFile>> {
    MetaNodeFile::open(Arc::new(MemorySource::new("lies", bytes))).ok().map(Arc::new)
}

/// An intact file of some dozen pages, and where they are.
fn intact() -> (Vec<u8>, Vec<(usize, usize)>) {
    let bytes = meta_node_bytes(&grid(13), &BuildOptions { levels: Some(2), page_bytes: 600 });
    let ((mut start, _), (table, length)) = (section(&bytes, 80, b"PAGE"), section(&bytes, 80, b"PAGT"));
    let place = |length| {
        start += length;
        (start - length, length)
    };
    let pages: Vec<_> =
        (0..length / 4).map(|page| 4 * word(&bytes, table + 4 * page) as usize).map(place).collect();
    assert!(pages.len() > 20);
    (bytes, pages)
}

fn settings(seed: u64, file: &MetaNodeFile) -> Settings {
    let in_use = [InUse::Yields, InUse::Stays, InUse::Printed][seed as usize % 3];
    let dependencies = [Dependencies::Off, Dependencies::Force, Dependencies::Block][seed as usize / 3 % 3];
    let page_memory = if seed.is_multiple_of(2) { u64::MAX } else { 2 * file.least_memory() };
    let io = Io::Simulated(Simulated::with_latency(Duration::from_millis(5)));
    Settings { page_memory, dependencies, in_use, io, ..Settings::default() }
}

#[test]
fn pages_that_lie_are_faults() {
    let (bytes, pages) = intact();
    let (mut found, mut faults, mut errors) = (0, 0, 0);
    for seed in 0..900 {
        let mut lying = bytes.clone();
        tell_lies(&mut lying, &pages, &mut seeded(seed));
        let Some(file) = open(lying) else { continue };
        let verified = file.verify().is_ok();
        found += u32::from(!verified);
        let tree = MetaNodeTree::new(file.clone(), settings(seed, &file)).unwrap();
        let outcome = follow(tree, seed, 2000, verified);
        faults += u32::from(outcome.faults > 0);
        errors += u32::from(outcome.errors > 0);
        assert!(
            !verified || outcome.is_clean(),
            "seed {seed}: verify passes what a walk comes upon: {outcome:?}"
        );
    }
    assert!(found > 500 && faults > 300, "{found} found, {faults} with faults, {errors} with errors");
}

/// Leaves that are nested on each page, and not where they should be: the head of each page says where its parts are, and the leaves
/// of all of its nodes are moved along.
#[test]
fn leaves_that_lie_are_told() {
    let (bytes, pages) = intact();
    let (mut told, mut count) = (0, 0);
    for (at, &(start, length)) in pages.iter().enumerate() {
        for by in [1_u32, 7, u32::MAX] {
            let mut lying = bytes.clone();
            for node in 0..word(&bytes, start + 12) as usize {
                for leaf in [8, 9] {
                    let place = start + 4 * (9 + 14 * node + leaf);
                    put(&mut lying, place, word(&bytes, place).wrapping_add(by));
                }
            }
            let sum = crc32fast::hash(&lying[start + 4..start + length]);
            put(&mut lying, start, sum);
            let Some(file) = open(lying) else { continue };
            assert!(file.verify().is_err(), "page {at}, by {by}");
            let seed = at as u64;
            let settings = settings(seed, &file);
            let mut tree = MetaNodeTree::new(file, settings).unwrap();
            tree.load_all();
            let outcome = follow(tree, seed, 2000, false);
            // With little memory, the page may never come, and the pages around it not with it.
            if settings.page_memory == u64::MAX {
                told += u32::from(outcome.faults + outcome.errors > 0);
                count += 1;
            }
        }
    }
    assert!(told == count && count > 30, "{told} of {count}");
}
