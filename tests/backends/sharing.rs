//! Many trees over one store, some of which go while they wait for it.

use std::sync::Arc;

use foldfront::experiment::path::around;
use foldfront::page_store::source::{Faults, Faulty, MemorySource};
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::settled::Settled;
use foldfront::vertex_tree::{NullSink, Prefetch};
use mt_partition::{BuildOptions, Memory, MtFile, MtTree, Reader};

use crate::common::{data, meshes, seeded};
use crate::walks::pixels;

const TREES: usize = 64;
const THREADS: usize = 4;

/// 64 trees, 16 a thread, over one reader and one memory, from a store that is late at times. Every third goes at a frame of its own with
/// requests under way; all others reach, in every frame that waits, the cut that a tree by itself has.
#[test]
fn sixty_four_trees_over_one_store() {
    let log = data::log(meshes::scan(5, &mut seeded(9)));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.mt");
    mt_partition::write(&path, &log, &BuildOptions::default()).unwrap();
    let faults = Faults { delays: 100, delay: std::time::Duration::from_micros(200), ..Faults::default() };
    let source = Faulty::new(MemorySource::new("scan.mt", std::fs::read(&path).unwrap()), 3, faults);
    let file = Arc::new(MtFile::open(Arc::new(source)).unwrap());
    let walk = around(&log.mesh).unwrap();
    let views: Vec<_> = (0..60).map(|at| walk.view(12 * at, pixels(2.0)).unwrap()).collect();
    let settings = |reader: &Reader, memory: &Memory, prefetch| mt_partition::Settings {
        reader: Some(reader.clone()),
        memory: memory.clone(),
        prefetch,
        ..mt_partition::Settings::default()
    };
    let alone = settings(&Reader::new().unwrap(), &Memory::new(u64::MAX), Prefetch::None);
    let alone = Settled::new(MtTree::new(file.clone(), alone).unwrap());
    let mut alone = Engine::new(alone, NullSink, Settings::default()).unwrap();
    let expected: Vec<u64> = views.iter().map(|view| alone.advance(&[*view]).unwrap().cut_hash).collect();
    let (reader, memory) = (Reader::new().unwrap(), Memory::new(u64::MAX));
    std::thread::scope(|scope| {
        for thread in 0..THREADS {
            let (file, views, expected) = (&file, &views, &expected);
            let (reader, memory) = (&reader, &memory);
            scope.spawn(move || {
                let mut trees: Vec<_> = (0..TREES / THREADS)
                    .map(|number| {
                        let number = thread * TREES / THREADS + number;
                        let prefetch =
                            if number.is_multiple_of(2) { Prefetch::Schedule } else { Prefetch::None };
                        let tree = MtTree::new(file.clone(), settings(reader, memory, prefetch)).unwrap();
                        // Those that go do not wait, so that something is under way when they do.
                        let tree = Settled::waiting(tree, !number.is_multiple_of(3));
                        Some((number, Engine::new(tree, NullSink, Settings::default()).unwrap()))
                    })
                    .collect();
                for step in 0..views.len() {
                    for tree in &mut trees {
                        let Some((number, engine)) = tree else { continue };
                        let at = (step + *number) % views.len();
                        let report = engine.advance(&[views[at]]).unwrap();
                        if !number.is_multiple_of(3) {
                            assert_eq!(report.misses, 0, "tree {number}, step {step}");
                            assert_eq!(report.cut_hash, expected[at], "tree {number}, step {step}");
                        } else if step == *number % 50 {
                            *tree = None;
                        }
                    }
                }
                assert!(trees.iter().flatten().all(|(number, _)| !number.is_multiple_of(3)), "they are gone");
            });
        }
    });
    assert_eq!(memory.used(), 0, "what trees had is given back");
}
