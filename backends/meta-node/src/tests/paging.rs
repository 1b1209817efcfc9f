//! The tree and its thread, without an engine: memory, faults, and dropping it at any moment.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::tests::common::{Front, bytes, frame, holder_bytes, random_log};
use crate::{BuildOptions, FileError, InUse, MetaNodeError, MetaNodeFile, MetaNodeTree, Settings};
use page_store::source::{Faults, Faulty, MemorySource, PageSource, Throttled};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use vertex_tree::{Hierarchy, NullSink, VertexTree};

const PAGES: BuildOptions = BuildOptions { levels: Some(3), page_bytes: 700 };

fn source(side: usize, left: usize) -> MemorySource {
    MemorySource::new("tree", bytes(&random_log(side, left, 11), &PAGES))
}

fn file(source: impl PageSource + 'static) -> Arc<MetaNodeFile> {
    Arc::new(MetaNodeFile::open(Arc::new(source)).unwrap())
}

/// With four place holders, a front through all pages is reached all the same, and the way back too.
#[test]
fn everything_unfolds_and_folds_with_four_place_holders() {
    let file = file(source(60, 3));
    let page_memory = 4 * holder_bytes(&file);
    let mut tree = MetaNodeTree::new(file, Settings { page_memory, ..Settings::default() }).unwrap();
    tree.base_mesh(&mut NullSink).unwrap();
    let base = tree.displayed();
    let mut front = Front::new(&tree);
    let (mut frames, mut refusals) = (0, 0);
    while front.active.len() < 60 * 60 - 3 {
        let ((_, refused), stats) = frame(&mut tree, |tree| front.unfold(tree));
        assert!(stats.resident_bytes <= page_memory, "{stats:?}");
        refusals += refused;
        frames += 1;
        assert!(frames < 20_000, "{} of {} nodes after {frames} frames", front.active.len(), 60 * 60 - 3);
        tree.settle().unwrap();
    }
    assert!(refusals > 1000, "{refusals}");
    assert_eq!(tree.displayed(), 2 * 59 * 59);
    // Children were unfolded after their parents: from the last to the first, each is collapsible in its turn.
    while !front.active.is_empty() {
        let (_, stats) = frame(&mut tree, |tree| front.fold(tree));
        assert!(stats.resident_bytes <= page_memory, "{stats:?}");
        frames += 1;
        assert!(frames < 60_000, "{} nodes left after {frames} frames", front.active.len());
        tree.settle().unwrap();
    }
    assert_eq!(tree.displayed(), base);
}

/// As printed: three place holders not in use are left for switching up, so that a front that needs more than there are
/// stays coarser, and comes back all the same.
#[test]
fn pages_in_use_stay_and_three_are_left_to_switch_up() {
    let file = file(source(60, 3));
    let page_memory = 12 * holder_bytes(&file);
    let settings = Settings { page_memory, in_use: InUse::Stays, ..Settings::default() };
    let mut tree = MetaNodeTree::new(file, settings).unwrap();
    tree.base_mesh(&mut NullSink).unwrap();
    let mut front = Front::new(&tree);
    let mut last = 0;
    for _ in 0..300 {
        frame(&mut tree, |tree| front.unfold(tree));
        tree.settle().unwrap();
        last = front.active.len();
    }
    assert!(last > 50 && last < 2000, "{last} nodes are active with 12 place holders");
    for _ in 0..20 {
        assert_eq!(frame(&mut tree, |tree| front.unfold(tree)).0.0, 0, "what could be unfolded has been");
        tree.settle().unwrap();
    }
    let mut frames = 0;
    while !front.active.is_empty() {
        frame(&mut tree, |tree| front.fold(tree));
        tree.settle().unwrap();
        frames += 1;
        assert!(frames < 5000, "{} nodes left", front.active.len());
    }
    // More memory, more detail.
    tree.set_page_memory(u64::MAX).unwrap();
    for _ in 0..400 {
        frame(&mut tree, |tree| front.unfold(tree));
        tree.settle().unwrap();
    }
    assert_eq!(front.active.len(), 60 * 60 - 3);
}

#[test]
fn memory_may_change_between_frames() {
    let file = file(source(60, 3));
    let each = holder_bytes(&file);
    let mut tree = MetaNodeTree::new(file, Settings::default()).unwrap();
    tree.load_all();
    let mut front = Front::new(&tree);
    let mut random = Pcg64::seed_from_u64(5);
    for round in 0..60 {
        let holders = if round % 7 == 0 { 10_000 } else { random.random_range(4..44) };
        tree.set_page_memory(holders * each).unwrap();
        for _ in 0..random.random_range(0..30) {
            let (_, stats) = frame(&mut tree, |tree| match round % 3 {
                0 => drop(front.fold(tree)),
                _ => drop(front.unfold(tree)),
            });
            assert!(stats.resident_bytes <= holders * each, "{stats:?}, {holders} place holders allowed");
            if random.random() {
                tree.settle().unwrap();
            }
        }
    }
    let error = tree.set_page_memory(4 * each - 1).unwrap_err();
    let is_named = |allowed: u64, needed| allowed + 1 == needed && needed == tree.file().least_memory();
    assert!(
        matches!(error, MetaNodeError::File(FileError::Memory { allowed, needed, .. }) if is_named(allowed, needed)),
        "{error}"
    );
}

/// The root page is there at all times after it has come: folding the last node is never refused.
#[test]
fn roots_are_never_evicted() {
    let file = file(source(60, 1));
    let each = holder_bytes(&file);
    let mut tree =
        MetaNodeTree::new(file, Settings { page_memory: 4 * each, ..Settings::default() }).unwrap();
    let mut front = Front::new(&tree);
    tree.settle().unwrap();
    let root = tree.roots()[0];
    for _ in 0..400 {
        frame(&mut tree, |tree| {
            assert!(tree.is_resident(root));
            front.unfold(tree)
        });
        tree.settle().unwrap();
    }
    assert!(front.active.len() > 1000);
}

/// Dropped while commands wait and a slow read is under way: nobody waits for it.
#[test]
fn dropping_a_tree_never_hangs() {
    let slow: Arc<dyn PageSource> = Arc::new(Throttled::new(source(30, 1), Duration::from_millis(20), None));
    let file = Arc::new(MetaNodeFile::open(slow).unwrap());
    let start = Instant::now();
    for walk in 0..200 {
        let mut tree = MetaNodeTree::new(file.clone(), Settings::default()).unwrap();
        let mut front = Front::new(&tree);
        if walk % 2 == 0 {
            tree.load_all();
        }
        for _ in 0..walk % 4 {
            frame(&mut tree, |tree| front.unfold(tree));
        }
    }
    // One after the other, the reads that were asked for would have taken ten times as long at least.
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
}

/// A store that panics is a store that fails.
#[test]
fn a_panic_in_the_store_is_a_fault() {
    /// Panics once it is told to.
    struct Panics(MemorySource, AtomicBool);
    impl PageSource for Panics {
        fn name(&self) -> &str {
            self.0.name()
        }
        fn len(&self) -> u64 {
            self.0.len()
        }
        fn read_at(&self, offset: u64, buffer: &mut [u8]) -> std::io::Result<()> {
            assert!(!self.1.load(Ordering::Relaxed), "on purpose");
            self.0.read_at(offset, buffer)
        }
    }
    let panics = Arc::new(Panics(source(30, 1), AtomicBool::new(false)));
    let file = file(panics.clone());
    panics.1.store(true, Ordering::Relaxed);
    let mut tree = MetaNodeTree::new(file, Settings::default()).unwrap();
    tree.load_all();
    tree.settle().unwrap();
    let (_, stats) = frame(&mut tree, |_| ());
    assert!(stats.faults > 10, "{stats:?}");
    let fault = tree.take_fault().unwrap().to_string();
    assert!(fault.contains("panicked"), "{fault}");
}

/// Errors, short reads, flipped bits and delays: frames go on, every fault is counted once, and the whole hierarchy is
/// reached when the store has recovered.
#[test]
fn faults_are_counted_and_later_reads_recover() {
    let faulty = Arc::new(Faulty::new(source(60, 3), 17, Faults::default()));
    let file = file(faulty.clone());
    let page_memory = 20 * holder_bytes(&file);
    let mut tree = MetaNodeTree::new(file, Settings { page_memory, ..Settings::default() }).unwrap();
    let mut front = Front::new(&tree);
    faulty.set(Faults { errors: 150, short: 150, flips: 150, delays: 2, delay: Duration::from_millis(50) });
    let mut faults = 0;
    for at in 0..400 {
        let (_, stats) = frame(&mut tree, |tree| front.unfold(tree));
        faults += stats.faults;
        if at % 2 == 0 {
            tree.settle().unwrap();
        }
    }
    faulty.set(Faults::default());
    let mut frames = 0;
    while front.active.len() < 60 * 60 - 3 {
        let (_, stats) = frame(&mut tree, |tree| front.unfold(tree));
        faults += stats.faults;
        tree.settle().unwrap();
        frames += 1;
        assert!(frames < 20_000, "{} nodes", front.active.len());
    }
    assert!(faults > 50, "{faults}");
    assert_eq!(faults, faulty.befallen(), "every fault is counted once");
    assert!(tree.take_fault().is_some());
}
