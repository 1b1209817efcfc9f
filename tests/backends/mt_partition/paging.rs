//! Little memory, slow stores, failing stores, several trees.

use std::sync::Arc;
use std::time::{Duration, Instant};

use foldfront::Hierarchy;
use foldfront::page_store::source::{Counted, Faults, Faulty, MemorySource, PageSource};
use foldfront::selection::engine::Engine;
use foldfront::selection::engine::Settings;
use foldfront::vertex_tree::{MeshSink, NullSink};
use mt_partition::{BuildOptions, CacheMode, FileError, Memory, MtError, MtFile, MtTree, Reader};

use super::{CRITERION, Walk, advance_settled, all_around, ball_log, engine};
use crate::common::graph_cut::GraphCut;
use foldfront::testing::strict_mesh::StrictMesh;

fn bytes(levels: u32) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.mt");
    mt_partition::write(&path, &ball_log(levels), &BuildOptions { patch: 4.0, ..BuildOptions::default() })
        .unwrap();
    std::fs::read(&path).unwrap()
}

fn open<S: PageSource + 'static>(source: S) -> Arc<MtFile> {
    Arc::new(MtFile::open(Arc::new(source)).unwrap())
}

/// As long as the views rest, advances, and checks that the front is what brute force says at the end.
fn assert_converges<M: MeshSink>(
    engine: &mut Engine<MtTree, M>,
    cut: &mut GraphCut,
    views: &[foldfront::selection::view::View],
    what: &str,
) {
    let arrives = (0..4000).any(|_| {
        let report = engine.advance(views).unwrap();
        engine.assert_well_formed();
        let memory = engine.tree().memory();
        assert!(memory.used() <= memory.limit(), "{what}: {} of {} bytes", memory.used(), memory.limit());
        engine.tree_mut().settle().unwrap();
        report.misses == 0
    });
    assert!(arrives, "{what}: the front never arrives");
    cut.find(CRITERION, views);
    assert_eq!(cut.difference(engine), None, "{what}");
}

/// With memory for one change at a time, a front that rests still comes to where it should be: nothing that is displayed
/// has to stay in memory. The limit holds in every frame.
#[test]
fn the_least_memory_is_enough() {
    let file = open(MemorySource::new("ball.mt", bytes(4)));
    let mut cut = GraphCut::new(&file);
    for (seed, mode) in CacheMode::ALL.into_iter().enumerate() {
        for times in [1, 3] {
            let memory = Memory::new(times * file.least_memory());
            let mut engine = engine(&file, mode, memory.clone(), StrictMesh::default());
            let mut walk = Walk::new(seed as u64, 300.0);
            for round in 0..25 {
                let mut views = walk.step();
                for _ in 0..8 {
                    views = walk.step();
                    engine.advance(&views).unwrap();
                    engine.assert_well_formed();
                    assert!(memory.used() <= memory.limit());
                }
                let what = format!("{}, {times} times the least memory, round {round}", mode.name());
                assert_converges(&mut engine, &mut cut, &views, &what);
                let triangles = engine.tree().displayed();
                assert_eq!(triangles, engine.sink().triangles.len() as u64);
            }
            drop(engine);
            assert_eq!(memory.used(), 0, "{}: all is given back", mode.name());
        }
    }
}

#[test]
fn less_than_that_is_refused() {
    let file = open(MemorySource::new("ball.mt", bytes(3)));
    let memory = Memory::new(file.least_memory() - 1);
    let settings = mt_partition::Settings { memory, ..mt_partition::Settings::default() };
    let error = MtTree::new(file.clone(), settings).unwrap_err();
    assert!(
        matches!(error, MtError::File(FileError::Memory { needed, .. }) if needed == file.least_memory()),
        "{error}"
    );
}

/// The limit goes down and up between frames; the tree follows at the end of the next one.
#[test]
fn the_limit_can_be_changed() {
    let file = open(MemorySource::new("ball.mt", bytes(5)));
    let mut cut = GraphCut::new(&file);
    let memory = Memory::default();
    let mut engine = engine(&file, CacheMode::PCc, memory.clone(), NullSink);
    let mut walk = Walk::new(3, 300.0);
    for limit in
        [u64::MAX, 4 * file.least_memory(), 40 * file.least_memory(), 2 * file.least_memory(), u64::MAX]
    {
        memory.set_limit(limit);
        for _ in 0..40 {
            let views = walk.step();
            engine.advance(&views).unwrap();
            engine.assert_well_formed();
            assert!(memory.used() <= limit, "{} of {limit} bytes", memory.used());
        }
        let views = walk.step();
        assert_converges(&mut engine, &mut cut, &views, "another limit");
    }
}

/// Modes keep what they say: no more than the cut, no more than partitions with a node in the cut, and all of them show
/// the same.
#[test]
fn modes_differ_in_what_they_keep_only() {
    let file = open(MemorySource::new("ball.mt", bytes(5)));
    let mut engines = CacheMode::ALL.map(|mode| engine(&file, mode, Memory::default(), NullSink));
    let mut walk = Walk::new(8, 300.0);
    let (mut sums, mut reads) = ([0; 5], [0; 5]);
    for _ in 0..300 {
        let views = walk.step();
        for (at, engine) in engines.iter_mut().enumerate() {
            for frame in 0.. {
                let report = engine.advance(&views).unwrap();
                engine.assert_well_formed();
                reads[at] += report.pages.reads;
                if report.misses == 0 {
                    break;
                }
                assert!(frame < 1000);
                engine.tree_mut().settle().unwrap();
            }
            sums[at] += engine.tree().node_bytes();
        }
        let hashes = engines.each_ref().map(|engine| engine.front().cut_hash());
        assert_eq!(hashes, [hashes[0]; 5]);
    }
    let [np_nc, p_nc, p_cc, p_c, p_status] = sums;
    assert_eq!(np_nc, p_nc, "neither keeps more than the cut");
    assert!(p_nc < p_c && p_c < p_cc && p_nc < p_status && p_status < p_cc, "{sums:?}");
    let [np_nc, p_nc, p_cc, p_c, p_status] = reads;
    assert!(p_cc <= p_status && p_status < p_c && p_c < p_nc && p_c < np_nc, "{reads:?}");
}

/// Reads that fail, end early, bring flipped bits or take long: frames go on, faults are counted, and when the store has
/// recovered, so does the front.
#[test]
fn a_store_that_fails_now_and_then() {
    let faulty = Arc::new(Faulty::new(MemorySource::new("ball.mt", bytes(4)), 7, Faults::default()));
    let file = open(faulty.clone());
    let mut cut = GraphCut::new(&file);
    let all = Faults { errors: 150, short: 150, flips: 150, delays: 20, delay: Duration::from_millis(50) };
    let kinds = [
        Faults { errors: 300, ..Faults::default() },
        Faults { short: 300, ..Faults::default() },
        Faults { flips: 1000, ..Faults::default() },
        Faults { delays: 100, ..all },
        all,
    ];
    for (seed, faults) in kinds.into_iter().enumerate() {
        for mode in [CacheMode::NpNc, CacheMode::PC] {
            let mut engine = engine(&file, mode, Memory::new(8 * file.least_memory()), StrictMesh::default());
            let before = faulty.befallen();
            faulty.set(faults);
            let mut walk = Walk::new(seed as u64, 300.0);
            let mut counted = 0;
            // Reads that take long are few: the walk goes on until one of them has been befallen.
            let mut frames = 0;
            while frames < 150 || (faulty.befallen() == before && frames < 20_000) {
                counted += engine.advance(&walk.step()).unwrap().pages.faults;
                std::thread::sleep(Duration::from_micros(200));
                frames += 1;
            }
            faulty.set(Faults::default());
            let views = walk.step();
            for _ in 0..3000 {
                engine.tree_mut().settle().unwrap();
                let report = engine.advance(&views).unwrap();
                engine.assert_well_formed();
                counted += report.pages.faults;
                if report.misses == 0 {
                    break;
                }
            }
            cut.find(CRITERION, &views);
            assert_eq!(cut.difference(&engine), None, "{faults:?}");
            let befallen = faulty.befallen() - before;
            // A flipped bit in a partition befalls one record of it; one in what nobody needed is a fault all the same.
            assert!(counted > 0 && counted <= befallen, "{faults:?}: {counted} of {befallen}");
            if faults.flips == 0 {
                assert_eq!(counted, befallen, "{faults:?}");
            }
        }
    }
}

/// Frames do not wait for a store whose reads hang: many of them end before the first page has come.
#[test]
fn frames_do_not_wait() {
    let gate = Arc::new(Gate { source: MemorySource::new("ball.mt", bytes(4)), open: false.into() });
    let closed = {
        gate.open.store(true, std::sync::atomic::Ordering::SeqCst);
        let file = open(gate.clone());
        gate.open.store(false, std::sync::atomic::Ordering::SeqCst);
        file
    };
    let mut engine = engine(&closed, CacheMode::PC, Memory::default(), StrictMesh::default());
    let mut walk = Walk::new(4, 300.0);
    let mut misses = 0;
    for _ in 0..100 {
        // The store answers nothing at all, and this returns.
        misses += engine.advance(&walk.step()).unwrap().misses;
    }
    assert!(misses >= 100, "{misses}");
    gate.open.store(true, std::sync::atomic::Ordering::SeqCst);
    let views = all_around(glam::DVec3::ZERO);
    advance_settled(&mut engine, &views);
    let mut cut = GraphCut::new(&closed);
    cut.find(CRITERION, &views);
    assert_eq!(cut.difference(&engine), None);
}

/// A store whose reads hang until it is opened.
struct Gate {
    source: MemorySource,
    open: std::sync::atomic::AtomicBool,
}

impl PageSource for Gate {
    fn name(&self) -> &str {
        self.source.name()
    }
    fn len(&self) -> u64 {
        self.source.len()
    }
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> std::io::Result<()> {
        while !self.open.load(std::sync::atomic::Ordering::SeqCst) {
            std::thread::sleep(Duration::from_millis(1));
        }
        self.source.read_at(offset, buffer)
    }
}

/// A tree that goes away takes its requests back, and waits for nothing, even where a read never ends.
#[test]
fn dropping_a_tree_never_hangs() {
    let gate = Arc::new(Gate { source: MemorySource::new("ball.mt", bytes(4)), open: true.into() });
    let file = open(gate.clone());
    let reader = Reader::new().unwrap();
    let memory = Memory::default();
    gate.open.store(false, std::sync::atomic::Ordering::SeqCst);
    let start = Instant::now();
    for seed in 0..20 {
        let settings = mt_partition::Settings {
            memory: memory.clone(),
            reader: (seed % 2 == 0).then(|| reader.clone()),
            ..mt_partition::Settings::default()
        };
        let tree = MtTree::new(file.clone(), settings).unwrap();
        let mut engine = Engine::new(tree, NullSink, Settings::default()).unwrap();
        let mut walk = Walk::new(seed, 300.0);
        for _ in 0..3 {
            engine.advance(&walk.step()).unwrap();
            engine.assert_well_formed();
        }
        assert!(memory.used() > 0);
        drop(engine);
        assert_eq!(memory.used(), 0);
    }
    // Not a claim of speed: a hang would be for ever.
    assert!(start.elapsed() < Duration::from_secs(60));
    gate.open.store(true, std::sync::atomic::Ordering::SeqCst);
}

/// Several trees over one file share one thread and one budget that is too small for all of them at once.
#[test]
fn trees_share_a_budget() {
    let counted = Arc::new(Counted::new(MemorySource::new("ball.mt", bytes(4))));
    let file = open(counted.clone());
    let mut cut = GraphCut::new(&file);
    let memory = Memory::new(6 * file.least_memory());
    let reader = Reader::new().unwrap();
    let mut walkers: Vec<_> = (0..5)
        .map(|seed| {
            let settings = mt_partition::Settings {
                cache: CacheMode::PCc,
                memory: memory.clone(),
                reader: Some(reader.clone()),
                ..Default::default()
            };
            let tree = MtTree::new(file.clone(), settings).unwrap();
            (Engine::new(tree, NullSink, Settings::default()).unwrap(), Walk::new(seed, 300.0))
        })
        .collect();
    for round in 0..10 {
        let mut views = Vec::new();
        for _ in 0..6 {
            views.clear();
            for (engine, walk) in &mut walkers {
                let view = walk.step();
                engine.advance(&view).unwrap();
                views.push(view);
                assert!(memory.used() <= memory.limit());
            }
        }
        // All rest: each of them arrives.
        let mut left = 4000;
        loop {
            let mut misses = 0;
            for ((engine, _), view) in walkers.iter_mut().zip(&views) {
                misses += engine.advance(view).unwrap().misses;
                engine.tree_mut().settle().unwrap();
                assert!(memory.used() <= memory.limit());
            }
            left -= 1;
            assert!(left > 0, "round {round}: some front never arrives");
            if misses == 0 {
                break;
            }
        }
        for ((engine, _), view) in walkers.iter().zip(&views) {
            cut.find(CRITERION, view);
            assert_eq!(cut.difference(engine), None, "round {round}");
        }
    }
    assert!(counted.totals().0 > 100);
    drop(walkers);
    assert_eq!(memory.used(), 0);
}
