//! What is foreseen is loaded in time; and on a camera at rest loading comes to an end, whatever memory there is. All on a
//! store on virtual time.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use crate::{BuildOptions, Io, Settings, XfmFile};
use page_store::Simulated;
use page_store::source::{Faults, Faulty, MemorySource};
use vertex_tree::{Hierarchy, NodeId, PageStats, Prefetch, Step, VertexTree};

use super::driver::{Driver, open};
use super::options;
use super::paging::built;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

const FRAME: Duration = Duration::from_millis(10);

/// A store whose reads take so many frames.
fn frames_away(frames: u32) -> Io {
    Io::Simulated(Simulated::with_latency(FRAME * frames))
}

fn settings(prefetch: Prefetch, frames: u32) -> Settings {
    Settings { io: frames_away(frames), prefetch, ..Settings::default() }
}

/// Sums of what the frames report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Sums {
    reads: u64,
    ahead: u64,
    ahead_used: u64,
    no_room: u64,
    faults: u64,
    misses: u64,
}

impl Sums {
    fn add(&mut self, pages: &PageStats) {
        self.reads += pages.reads;
        self.ahead += pages.ahead;
        self.ahead_used += pages.ahead_used;
        self.no_room += pages.no_room;
        self.faults += pages.faults;
    }
}

/// One frame of an engine that wants these nodes: what is not wanted folds, what is unfolds, as far as it can. Then what
/// is foreseen is said, and time passes.
fn frame(
    driver: &mut Driver,
    wanted: &BTreeSet<NodeId>,
    foreseen: &[(NodeId, u32)],
    sums: &mut Sums,
) -> usize {
    let mut arrived = Vec::new();
    driver.tree.begin_frame(&mut arrived).unwrap();
    let mut changes = 0;
    loop {
        let unwanted =
            driver.active.iter().rev().find(|&&n| !wanted.contains(&n) && driver.is_collapsible(n));
        let Some(&node) = unwanted else { break };
        assert!(driver.fold(node).unwrap());
        changes += 1;
    }
    let mut refused = BTreeSet::new();
    loop {
        let boundary = driver.boundary();
        let next = boundary.into_iter().find(|n| wanted.contains(n) && !refused.contains(n));
        let Some(node) = next else { break };
        if driver.unfold(node).unwrap() {
            changes += 1;
        } else {
            refused.insert(node);
        }
    }
    sums.misses += refused.len() as u64;
    for &(node, frames) in foreseen {
        driver.tree.will_need(node, frames);
    }
    sums.add(&driver.tree.end_frame().unwrap());
    driver.tree.pass(FRAME).unwrap();
    changes
}

/// All nodes, in an order in which they can be unfolded one by one.
fn order(file: &Arc<XfmFile>, random: &mut Pcg64) -> Vec<NodeId> {
    let mut driver = Driver::new(file, super::blocking());
    let mut order = Vec::new();
    loop {
        let boundary = driver.boundary();
        if boundary.is_empty() {
            return order;
        }
        let node = boundary[random.random_range(0..boundary.len())];
        // Not where others would have to be forced.
        if driver.tree.unfold(node, &mut driver.mesh).unwrap() == Step::Done {
            driver.active.insert(node);
            order.push(node);
        }
    }
}

/// The front sinks by one node a frame, and some frames before each it is said that it will: nothing is missed. Without
/// that each block costs misses for as long as a read takes.
#[test]
fn what_is_foreseen_is_there_in_time() {
    let (bytes, _) = built(20, &options(2, false, true));
    let file = open(bytes);
    let order = order(&file, &mut Pcg64::seed_from_u64(3));
    let run = |prefetch, away: u32, room: u64| {
        let mut driver = Driver::new(&file, Settings { hard_quota: room, ..settings(prefetch, away) });
        let (mut wanted, mut sums) = (BTreeSet::new(), Sums::default());
        let mut least = u32::MAX;
        // It takes as long for a block to come as there are blocks above it that are not there yet.
        let before = 6 * away as usize;
        for at in 0..order.len() + before {
            let ahead = (at.max(before) - before..at.min(order.len())).map(|next| order[next]);
            let foreseen: Vec<(NodeId, u32)> = ahead.zip(1..).collect();
            if let Some(now) = at.checked_sub(before) {
                wanted.insert(order[now]);
            }
            frame(&mut driver, &wanted, &foreseen, &mut sums);
            if at > before {
                least = least.min(driver.tree.look_ahead());
            }
        }
        assert_eq!(driver.active.len(), order.len(), "{prefetch:?}");
        (sums, least)
    };
    for away in [1, 4] {
        let (schedule, least) = run(Prefetch::Schedule, away, u64::MAX);
        let (none, silent) = run(Prefetch::None, away, u64::MAX);
        let paper = run(Prefetch::Paper, away, u64::MAX);
        eprintln!("{away} frames away: {schedule:?}, without {none:?}");
        assert_eq!(schedule.misses, 0);
        assert_eq!((schedule.ahead, schedule.ahead_used), (schedule.reads, schedule.reads));
        assert!(least > away, "{least} frames of foresight");
        assert_eq!(silent, 0);
        assert_eq!(paper, (none, silent), "the paper loads when a change first needs it");
        assert!(none.ahead == 0 && none.misses > u64::from(away) * none.reads / 2);
        assert_eq!(run(Prefetch::Schedule, away, u64::MAX), (schedule, least), "a replay differs");
    }
}

/// What is not named any more is not read any more, and what is missed goes before what is foreseen, for one read only.
#[test]
fn requests_are_withdrawn_and_hurried() {
    let (bytes, _) = built(20, &options(2, false, true));
    let file = open(bytes);
    // One read at a time, a frame each.
    let line = Simulated { latency: FRAME, bandwidth: None, depth: 1 };
    let settings = Settings { io: Io::Simulated(line), ..settings(Prefetch::Schedule, 1) };
    let mut driver = Driver::new(&file, settings);
    let (mut wanted, mut sums) = (BTreeSet::new(), Sums::default());
    let roots: Vec<NodeId> = driver.tree.roots().to_vec();
    assert!(roots.len() > 3, "{} roots", roots.len());
    // All roots are foreseen; the first read has been started when the frame ends, and the second after it.
    let foreseen: Vec<(NodeId, u32)> = roots.iter().copied().zip(5..).collect();
    frame(&mut driver, &wanted, &foreseen, &mut sums);
    frame(&mut driver, &wanted, &[], &mut sums);
    for _ in 0..5 {
        frame(&mut driver, &wanted, &[], &mut sums);
    }
    assert_eq!((sums.reads, sums.ahead), (2, 2), "the others have been withdrawn");
    // All are foreseen again, and the last one is missed.
    wanted.insert(roots[roots.len() - 1]);
    let mut driver = Driver::new(&file, settings);
    let mut sums = Sums::default();
    frame(&mut driver, &BTreeSet::new(), &foreseen, &mut sums);
    frame(&mut driver, &wanted, &foreseen, &mut sums);
    frame(&mut driver, &wanted, &[], &mut sums);
    frame(&mut driver, &wanted, &[], &mut sums);
    frame(&mut driver, &wanted, &[], &mut sums);
    assert!(driver.active.contains(&roots[roots.len() - 1]), "it waited for what was only foreseen");
    assert!(sums.reads <= 4 && sums.ahead < sums.reads, "{sums:?}");
}

/// With memory for a part only, what is needed first is kept, what is needed last makes room for it, and there is no
/// end of reading only if there is an end of naming.
#[test]
fn the_nearest_in_time_keep_their_place() {
    let (bytes, _) = built(20, &options(2, false, true));
    let file = open(bytes);
    let all = file.resident_bytes_of_all();
    let mut driver = Driver::new(&file, Settings { hard_quota: all / 8, ..settings(Prefetch::Schedule, 1) });
    let (wanted, mut sums) = (BTreeSet::new(), Sums::default());
    let levels = 2;
    let blocks: Vec<NodeId> =
        (0..driver.tree.node_limit() >> levels).map(|block| NodeId(block << levels)).collect();
    let foreseen: Vec<(NodeId, u32)> = blocks.iter().rev().copied().zip(1..).collect();
    let mut reads = 0;
    for round in 0..20 {
        frame(&mut driver, &wanted, &foreseen, &mut sums);
        let (_, with_under_way) = driver.tree.block_bytes();
        assert!(with_under_way <= all / 8);
        if round == 5 {
            reads = sums.reads;
        }
    }
    assert!(reads > 10 && sums.reads == reads, "{reads} reads, then {}", sums.reads);
    // The other way round: now those at the other end are the nearest.
    let foreseen: Vec<(NodeId, u32)> = blocks.iter().copied().zip(1..).collect();
    for round in 0..20 {
        frame(&mut driver, &wanted, &foreseen, &mut sums);
        if round == 5 {
            assert!(sums.reads > reads + 10);
            reads = sums.reads;
        }
    }
    assert_eq!(sums.reads, reads);
    assert_eq!((sums.misses, sums.no_room), (0, 0));
}

/// Of a boundary node and of what is below it the children are shown as they come into play, as far as they are there.
#[test]
fn peeking_shows_what_unfolding_brings() {
    let (bytes, _) = built(16, &options(2, false, true));
    let file = open(bytes);
    let order = order(&file, &mut Pcg64::seed_from_u64(3));
    let mut driver = Driver::new(&file, super::blocking());
    let (mut shown, mut hidden) = (0, 0);
    for &node in &order {
        let mut children = vec![(node, driver.tree.bounds(node))];
        let is_there = driver.tree.peek(node, &mut children);
        assert!(driver.unfold(node).unwrap());
        let brought: Vec<_> = driver.tree.children_and_bounds(node).collect();
        assert_eq!(&children[1..], if is_there { &brought[..] } else { &[] });
        (shown, hidden) = (shown + usize::from(is_there), hidden + usize::from(!is_there));
    }
    assert!(shown > 100 && hidden > 20, "{shown} shown, {hidden} not");
}

/// All is wanted, and memory is for a part: after a while nothing is read and nothing changes, and it is said why.
/// With memory for all, it is all there within the time that the reads take one below the other.
#[test]
fn at_rest_loading_ends() {
    let (bytes, _) = built(24, &options(2, false, true));
    let file = open(bytes);
    let all = file.resident_bytes_of_all();
    let order = order(&file, &mut Pcg64::seed_from_u64(3));
    let wanted: BTreeSet<NodeId> = order.iter().copied().collect();
    for prefetch in Prefetch::ALL {
        let mut actives = Vec::new();
        for share in [64, 16, 6, 3, 2, 1] {
            let hard_quota = if share == 1 { u64::MAX } else { all / share };
            let mut driver = Driver::new(&file, Settings { hard_quota, ..settings(prefetch, 2) });
            let mut sums = Sums::default();
            for _ in 0..60 {
                frame(&mut driver, &wanted, &[], &mut sums);
            }
            let (reads, active) = (sums.reads, driver.active.clone());
            let mut sums = Sums::default();
            for _ in 0..20 {
                assert_eq!(frame(&mut driver, &wanted, &[], &mut sums), 0);
            }
            assert_eq!((sums.reads, &driver.active), (0, &active), "{prefetch:?}, a {share}th of the blocks");
            assert_eq!(sums.no_room > 0, share > 1);
            assert_eq!(active.len() == order.len(), share == 1);
            assert!(reads < 2 * u64::from(driver.tree.node_limit() >> 2), "{reads} reads");
            actives.push(active.len());
        }
        eprintln!("{prefetch:?}: active nodes {actives:?}");
        assert!(actives.is_sorted() && actives[2] > 0);
    }
}

/// Reads ahead of time that fail are counted and are no error of the tree, however many: nobody has missed anything.
#[test]
fn failed_foresight_is_no_error() {
    let (bytes, _) = built(10, &BuildOptions::default());
    let source = Arc::new(Faulty::new(MemorySource::new("bytes", bytes), 1, Faults::default()));
    let file = Arc::new(XfmFile::open(source.clone()).unwrap());
    source.set(Faults { errors: 1000, ..Faults::default() });
    let mut driver = Driver::new(&file, settings(Prefetch::Schedule, 1));
    let roots: Vec<(NodeId, u32)> = driver.tree.roots().iter().map(|&root| (root, 3)).collect();
    let mut sums = Sums::default();
    for _ in 0..100 {
        frame(&mut driver, &BTreeSet::new(), &roots, &mut sums);
    }
    assert!(sums.faults > 0 && sums.faults <= roots.len() as u64, "{sums:?}");
    source.set(Faults::default());
    let wanted = order(&file, &mut Pcg64::seed_from_u64(1))[..20].iter().copied().collect();
    for _ in 0..20 {
        frame(&mut driver, &wanted, &roots, &mut sums);
    }
    assert_eq!(driver.active, wanted);
}
