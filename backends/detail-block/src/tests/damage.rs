//! Damaged, truncated, foreign and hostile files: errors, never a panic, a hang or a huge allocation.

use std::path::Path;
use std::sync::Arc;

use crate::{Arrangement, FileError, MAGIC, XfmError, XfmFile, XfmTree};
use collapse_log::read_log;
use page_store::source::MemorySource;
use vertex_tree::{Hierarchy, MeshSink, NodeId, Step, TriangleId, VertexId, VertexTree};

use super::driver::bytes_of;
use super::meshes::{random_log, torus};
use super::{blocking, options};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn small_file(levels: u32, quantize: bool) -> Vec<u8> {
    let mut random = Pcg64::seed_from_u64(3);
    let log = random_log(torus(7, &mut random), &mut random);
    bytes_of(&Arrangement::new(&log, &options(levels, quantize, false)).unwrap())
}

fn open(bytes: &[u8]) -> Result<Arc<XfmFile>, XfmError> {
    XfmFile::open(Arc::new(MemorySource::new("bytes", bytes.to_vec()))).map(Arc::new)
}

#[test]
fn every_truncated_file_is_an_error() {
    let bytes = small_file(2, false);
    for length in 0..bytes.len() {
        let error = open(&bytes[..length]).err().unwrap_or_else(|| panic!("{length} bytes are enough"));
        assert!(error.to_string().starts_with("bytes: "), "{error}");
    }
    let longer = [&bytes[..], &[0]].concat();
    assert!(matches!(open(&longer), Err(XfmError::File(FileError::Length { .. }))));
}

#[test]
fn every_flipped_bit_is_found() {
    for quantize in [false, true] {
        let mut bytes = small_file(3, quantize);
        open(&bytes).unwrap().verify().unwrap();
        for at in 0..bytes.len() {
            let bit = 1 << (at % 8);
            bytes[at] ^= bit;
            let found = open(&bytes).and_then(|file| file.verify());
            assert!(found.is_err(), "byte {at} changed and nobody minds");
            bytes[at] ^= bit;
        }
    }
}

#[test]
fn foreign_files_are_named() {
    for bytes in [&b""[..], b"FFXFMES", b"FFCOLLOG and so on", &[0; 4096]] {
        assert!(matches!(open(bytes), Err(XfmError::File(FileError::Foreign { .. }))));
    }
    let mut later = small_file(4, false);
    later[8] = 3;
    assert_eq!(open(&later).err().unwrap().to_string(), "bytes: offset 8: the version is 3, expected 1 or 2");
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
}

fn put(bytes: &mut [u8], at: usize, value: u32) {
    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

/// Where things are in an intact file.
struct Places {
    /// The entries in the table of sections that have a checksum: where they are, and start and length of the sections.
    sections: Vec<(usize, usize, usize)>,
    table_end: usize,
    /// Start and length of each block.
    blocks: Vec<(usize, usize)>,
}

const TABLE: usize = 152;

impl Places {
    fn new(bytes: &[u8]) -> Self {
        let table_end = TABLE + 8 + 32 * word(bytes, TABLE) as usize;
        let all = (TABLE + 8..table_end).step_by(32);
        let place = |at: usize| (at, long(bytes, at + 8) as usize, long(bytes, at + 16) as usize);
        let index = place(all.clone().find(|&at| bytes[at..at + 4] == *b"PAGT").unwrap()).1;
        let entry = |b: usize| long(bytes, index + 8 * b);
        let count = long(bytes, 48) as usize;
        Self {
            sections: all.filter(|&at| word(bytes, at + 4) & 2 == 0).map(place).collect(),
            table_end,
            blocks: (0..count)
                .map(|b| ((entry(b) & ((1 << 48) - 1)) as usize, (entry(b) >> 48) as usize))
                .collect(),
        }
    }

    /// Makes all checksums right again.
    fn reseal(&self, bytes: &mut [u8]) {
        for (number, &(start, length)) in (0_u32..).zip(&self.blocks) {
            let body = [&number.to_le_bytes()[..], &bytes[start..start + length - 4]].concat();
            put(bytes, start + length - 4, crc32fast::hash(&body));
        }
        for &(at, start, length) in &self.sections {
            let sum = crc32fast::hash(&bytes[start..start + length]);
            put(bytes, at + 24, sum);
        }
        let table = [&bytes[TABLE..TABLE + 4], &bytes[TABLE + 8..self.table_end]].concat();
        put(bytes, TABLE + 4, crc32fast::hash(&table));
        let sum = crc32fast::hash(&bytes[..144]);
        put(bytes, 144, sum);
    }
}

/// Takes everything.
struct Lenient;

impl MeshSink for Lenient {
    fn vertex_added(&mut self, _: VertexId, _: [f32; 3]) {}
    fn vertex_removed(&mut self, _: VertexId) {}
    fn triangle_added(&mut self, _: TriangleId, _: [VertexId; 3]) {}
    fn triangle_removed(&mut self, _: TriangleId) {}
    fn corner_moved(&mut self, _: TriangleId, _: usize, _: VertexId) {}
}

/// Goes down as far as the file lets, then up; says how many errors there were.
fn walk(file: Arc<XfmFile>) -> usize {
    let mut tree = XfmTree::new(file, blocking()).unwrap();
    let limit = tree.node_limit() as usize;
    tree.base_mesh(&mut Lenient).unwrap();
    let mut active: Vec<NodeId> = Vec::new();
    let mut is_active = vec![false; limit];
    let mut errors = 0;
    // Whatever is needed is tried once the rest has been; a few rounds reach what there is.
    let mut waiting: Vec<NodeId> = tree.roots().to_vec();
    for _ in 0..30 {
        for node in std::mem::take(&mut waiting) {
            match tree.unfold(node, &mut Lenient) {
                Ok(Step::Done) => {
                    active.push(node);
                    is_active[node.index()] = true;
                    waiting.extend(tree.children(node));
                }
                Ok(Step::Needs(needed)) => {
                    // The engine goes up from here.
                    let mut at = needed;
                    for _ in 0..limit {
                        let _ = tree.bounds(at);
                        let Some(parent) = tree.parents(at).next() else { break };
                        assert!(parent < at, "going up goes down in numbers");
                        at = parent;
                    }
                    waiting.push(node);
                }
                Ok(_) => waiting.push(node),
                Err(_) => errors += 1,
            }
        }
        tree.begin_frame(&mut Vec::new()).unwrap_or_else(|_| errors += 1);
        let _ = tree.end_frame();
    }
    for _ in 0..30 {
        for i in (0..active.len()).rev() {
            let node = active[i];
            let is_collapsible = tree.children(node).all(|child| !is_active[child.index()]);
            if is_collapsible && matches!(tree.fold(node, &mut Lenient), Ok(Step::Done)) {
                is_active[node.index()] = false;
                active.remove(i);
            }
        }
    }
    errors
}

/// Words are changed at random and all checksums are right. What opens can be walked through.
#[test]
fn hostile_files_end_in_errors() {
    let (mut opened, mut refused, mut errors, mut found) = (0, 0, 0, 0);
    for seed in 0..3000 {
        let mut random = Pcg64::seed_from_u64(seed);
        let levels = 1 + seed as u32 % 5;
        let quantize = seed % 3 == 0;
        let mut bytes = small_file(levels, quantize);
        let places = Places::new(&bytes);
        let blocks = &places.blocks;
        for _ in 0..random.random_range(1..5) {
            // Mostly in the blocks.
            let low = if random.random_ratio(1, 4) { 12 } else { blocks[0].0 };
            let at = low + random.random_range(0..bytes.len() - 4 - low);
            let value = match random.random_range(0..6) {
                0 => 0,
                1 => u32::MAX,
                2 => random.random(),
                3 => word(&bytes, at) ^ 1 << random.random_range(0..32),
                4 => word(&bytes, blocks[0].0 + random.random_range(0..bytes.len() - 4 - blocks[0].0)),
                _ => word(&bytes, at).wrapping_add(8),
            };
            put(&mut bytes, at, value);
        }
        places.reseal(&mut bytes);
        match open(&bytes) {
            Err(_) => refused += 1,
            Ok(file) => {
                opened += 1;
                let verified = file.verify();
                found += usize::from(verified.is_err());
                let on_the_way = walk(file);
                errors += on_the_way;
                assert!(
                    verified.is_err() || on_the_way == 0,
                    "{on_the_way} errors in what verify has passed"
                );
            }
        }
    }
    eprintln!("{opened} opened, {refused} refused, {found} found by verify, {errors} errors on the way");
    assert!(opened > 300 && refused > 100 && errors > 300 && found > 300);
}

/// Two nodes that need each other: `verify` finds it, and a tree names them without end in sight but never hangs.
#[test]
fn needs_in_a_circle_are_found() {
    let mut bytes = small_file(1, false);
    let places = Places::new(&bytes);
    let blocks = &places.blocks;
    open(&bytes).unwrap().verify().unwrap();
    // With one level, a block is a node; w x y z are the four words before eps and the checksum.
    let adjacent = |block: usize| blocks[block].0 + blocks[block].1 - 4 - 4 - 16;
    let needs = |bytes: &[u8], block: usize| {
        (0..4)
            .map(|i| word(bytes, adjacent(block) + 4 * i))
            .find(|&h| h >> 31 == 0)
            .map(|h| (h >> 4) as usize)
    };
    let first = (0..blocks.len()).rev().find(|&b| needs(&bytes, b).is_some()).unwrap();
    let second = needs(&bytes, first).unwrap();
    // A half-edge of a triangle that the first node does have.
    let side =
        u32::from(word(&bytes, adjacent(first)) == u32::MAX && word(&bytes, adjacent(first) + 4) == u32::MAX);
    for i in 0..4 {
        if word(&bytes, adjacent(second) + 4 * i) != u32::MAX {
            put(&mut bytes, adjacent(second) + 4 * i, (first as u32) << 4 | side << 2);
            break;
        }
    }
    places.reseal(&mut bytes);
    let file = open(&bytes).unwrap();
    let error = file.verify().err().unwrap().to_string();
    assert!(error.contains("it needs itself, by way of others"), "{error}");
    walk(file);
}

/// The first bytes of the format are fixed.
#[test]
fn the_magic_is_what_it_is() {
    assert_eq!(&MAGIC, b"FFXFMESH");
    // The checksum is of the file that this log makes, so the log is a file too: no generator can change it.
    let log = read_log(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src/tests/frozen.fold"))).unwrap();
    let bytes = bytes_of(&Arrangement::new(&log, &options(4, false, false)).unwrap());
    assert_eq!((bytes[..8].to_vec(), word(&bytes, 8)), (MAGIC.to_vec(), 2));
    assert_eq!(crc32fast::hash(&bytes), FROZEN, "version 2 is written differently from what it was");
}

/// Checksum of the file that a fixed log makes.
const FROZEN: u32 = 1_901_165_696;
