//! Prefetching by the schedule, on virtual time and without an engine: the test says what is needed, and when.

use std::sync::Arc;
use std::time::Duration;

use crate::tests::common::{Front, bytes, frame, holder_bytes, random_log};
use crate::{BuildOptions, Io, MetaNodeFile, MetaNodeTree, Settings};
use page_store::Simulated;
use page_store::source::MemorySource;
use vertex_tree::{Hierarchy, NodeId, NullSink, PageStats, Prefetch, Step, VertexTree};

const MS: Duration = Duration::from_millis(1);

fn file() -> Arc<MetaNodeFile> {
    let options = BuildOptions { levels: Some(3), page_bytes: 700 };
    let bytes = bytes(&random_log(60, 3, 12), &options);
    Arc::new(MetaNodeFile::open(Arc::new(MemorySource::new("tree", bytes))).unwrap())
}

/// A tree with so many place holders over a store of so much latency, in milliseconds.
fn tree(
    file: &Arc<MetaNodeFile>,
    prefetch: Prefetch,
    holders: u64,
    latency: u32,
    depth: usize,
) -> MetaNodeTree {
    let store = Simulated { depth, ..Simulated::with_latency(latency * MS) };
    let page_memory = holders * holder_bytes(file);
    let settings = Settings { page_memory, prefetch, io: Io::Simulated(store), ..Settings::default() };
    MetaNodeTree::new(file.clone(), settings).unwrap()
}

/// All nodes, each level after the one above.
fn level_by_level(file: &Arc<MetaNodeFile>) -> Vec<NodeId> {
    let mut tree = tree(file, Prefetch::Paper, 1_000_000, 0, 32);
    tree.load_all();
    tree.settle().unwrap();
    tree.begin_frame(&mut Vec::new()).unwrap();
    let mut front = Front::new(&tree);
    while !front.boundary.is_empty() {
        front.unfold(&mut tree);
    }
    front.active
}

/// The first node of each page.
fn page_by_page(file: &Arc<MetaNodeFile>) -> Vec<NodeId> {
    let pages: u32 = file.facts().iter().find(|(fact, _)| *fact == "pages").unwrap().1.parse().unwrap();
    let slots = tree(file, Prefetch::None, 4, 0, 1).node_limit() / pages;
    (0..pages).map(|page| NodeId(page * slots)).collect()
}

fn add(sum: &mut PageStats, stats: PageStats) {
    sum.reads += stats.reads;
    sum.ahead += stats.ahead;
    sum.ahead_used += stats.ahead_used;
    sum.no_room += stats.no_room;
}

/// The whole hierarchy in order, ten changes a frame, and each named as far ahead as the tree asks for: nothing is ever
/// refused once the first request has shown how slow the store is. Without prefetching every page is.
#[test]
fn what_is_named_in_time_is_there_in_time() {
    let file = file();
    let order = level_by_level(&file);
    let walk = |prefetch: Prefetch| {
        let mut tree = tree(&file, prefetch, 1_000, 45, 1_000);
        let (mut sum, mut refusals, mut late, mut frames, mut at) = (PageStats::default(), 0, 0, 0, 0);
        let mut farthest = 0;
        while at < order.len() {
            tree.begin_frame(&mut Vec::new()).unwrap();
            let end = order.len().min(at + 10);
            while at < end && tree.unfold(order[at], &mut NullSink).unwrap() == Step::Done {
                at += 1;
            }
            refusals += usize::from(at < end);
            late += usize::from(at < end && frames > 20);
            let ahead = tree.look_ahead();
            farthest = farthest.max(ahead);
            for (next, &node) in order[at..].iter().take(10 * ahead as usize).enumerate() {
                tree.will_need(node, next as u32 / 10 + 1);
            }
            add(&mut sum, tree.end_frame().unwrap());
            tree.pass(10 * MS).unwrap();
            frames += 1;
            assert!(frames < 20_000, "{at} nodes");
        }
        assert_eq!(
            farthest,
            if prefetch == Prefetch::Schedule { 10 } else { 0 },
            "twice the frames that a page takes"
        );
        (sum, refusals, late)
    };
    let pages = page_by_page(&file).len() as u64;
    let (none, refusals, _) = walk(Prefetch::None);
    assert_eq!((none.reads, none.ahead, none.ahead_used), (pages, 0, 0));
    assert!(refusals as u64 > 4 * pages, "{refusals} refusals, and each page takes five frames");
    let scheduled = walk(Prefetch::Schedule);
    let (sum, refusals, late) = scheduled;
    assert!(refusals < 20 && late == 0, "{refusals} refusals, {late} of them late");
    assert_eq!(sum.reads, pages);
    assert!(sum.ahead > pages - 10 && sum.ahead == sum.ahead_used, "{sum:?}");
    assert_eq!(walk(Prefetch::Schedule), scheduled, "the same replay, the same misses");
}

/// One read at a time: what a change is refused for comes first, then what is needed first.
#[test]
fn requests_are_in_order_of_need() {
    let file = file();
    let nodes = page_by_page(&file);
    let mut tree = tree(&file, Prefetch::Schedule, 40, 10, 1);
    let named = [(20, 9), (21, 3), (22, 5), (23, 4), (24, 7)];
    let say = |tree: &mut MetaNodeTree| named.iter().for_each(|&(page, at)| tree.will_need(nodes[page], at));
    frame(&mut tree, say);
    tree.pass(MS).unwrap();
    // The first is being read; now one is refused, and another is needed sooner than was said.
    frame(&mut tree, |tree| {
        assert_eq!(tree.unfold(nodes[30], &mut NullSink).unwrap(), Step::NotResident);
        say(tree);
        tree.will_need(nodes[20], 4);
    });
    let mut order = Vec::new();
    for _ in 0..7 {
        tree.pass(10 * MS).unwrap();
        frame(&mut tree, say);
        order.extend(
            (0..nodes.len())
                .filter(|&page| tree.is_resident(nodes[page]) && !order.contains(&page))
                .collect::<Vec<_>>(),
        );
    }
    assert_eq!(order, [21, 30, 23, 22, 24, 20], "and the last is as far as it was again");
}

/// What nobody names any more is not read.
#[test]
fn requests_are_withdrawn() {
    let file = file();
    let nodes = page_by_page(&file);
    let mut tree = tree(&file, Prefetch::Schedule, 1_000, 10, 4);
    frame(&mut tree, |tree| nodes[..50].iter().for_each(|&node| tree.will_need(node, 1)));
    tree.pass(MS).unwrap();
    frame(&mut tree, |_| ());
    tree.settle().unwrap();
    let ((), stats) = frame(&mut tree, |_| ());
    assert_eq!((stats.reads, stats.ahead), (4, 4), "those that had been started");
}

/// More pages are named than there is room for, frame after frame: the nearest come and stay, and then nothing moves.
#[test]
fn of_two_pages_the_nearer_one_wins() {
    let file = file();
    let nodes = page_by_page(&file);
    let mut tree = tree(&file, Prefetch::Schedule, 12, 0, 32);
    let mut last = 0;
    for at in 0..100 {
        let ((), stats) = frame(&mut tree, |tree| {
            // The farther ones are named first.
            (0..60).rev().for_each(|page| tree.will_need(nodes[100 + page], 10 + page as u32));
        });
        tree.pass(MS).unwrap();
        if stats.reads > 0 {
            last = at;
        }
    }
    assert!(last < 10, "pages still come after {last} frames");
    let there: Vec<usize> = (0..60).filter(|&page| tree.is_resident(nodes[100 + page])).collect();
    assert_eq!(there, (0..there.len()).collect::<Vec<_>>(), "the nearest");
    assert!(there.len() > 8, "{there:?}");
    // What is needed at once gets its place from what is farthest away.
    for first in [true, false] {
        frame(&mut tree, |tree| {
            if first {
                assert_eq!(tree.unfold(nodes[30], &mut NullSink).unwrap(), Step::NotResident);
            }
            (0..60).for_each(|page| tree.will_need(nodes[100 + page], 10 + page as u32));
        });
        tree.pass(MS).unwrap();
    }
    assert!(tree.is_resident(nodes[30]) && tree.is_resident(nodes[100]));
    assert!(!tree.is_resident(nodes[99 + there.len()]));
}

/// However near is what is foreseen: it may be what the refused change leads to, and would wait for it forever.
#[test]
fn what_is_refused_comes_before_all_that_is_foreseen() {
    let file = file();
    let nodes = page_by_page(&file);
    let mut tree = tree(&file, Prefetch::Schedule, 4, 1, 32);
    let say = |tree: &mut MetaNodeTree| (100..140).for_each(|page| tree.will_need(nodes[page], 1));
    // Memory is full of what is foreseen.
    for _ in 0..10 {
        frame(&mut tree, say);
        tree.pass(2 * MS).unwrap();
    }
    let came = (0..10).any(|_| {
        let (step, _) = frame(&mut tree, |tree| {
            let step = tree.unfold(nodes[30], &mut NullSink).unwrap();
            say(tree);
            step
        });
        tree.pass(2 * MS).unwrap();
        step == Step::Done
    });
    assert!(came, "the page never came");
}

/// A page that is asked for while it is on its way ahead of time is read once, and was asked for.
#[test]
fn a_page_under_way_is_read_once() {
    let file = file();
    let nodes = page_by_page(&file);
    let mut tree = tree(&file, Prefetch::Schedule, 40, 10, 1);
    frame(&mut tree, |tree| (10..13).for_each(|page| tree.will_need(nodes[page], 1)));
    tree.pass(5 * MS).unwrap();
    // The first is being read, the last two wait.
    frame(&mut tree, |tree| {
        for page in [10, 12] {
            assert_eq!(tree.unfold(nodes[page], &mut NullSink).unwrap(), Step::NotResident);
        }
        (10..13).for_each(|page| tree.will_need(nodes[page], 1));
    });
    let mut sum = PageStats::default();
    for _ in 0..10 {
        tree.pass(10 * MS).unwrap();
        add(&mut sum, frame(&mut tree, |_| ()).1);
    }
    // The third was withdrawn, as nobody named it any more, and had not been started.
    assert_eq!((sum.reads, sum.ahead, sum.ahead_used), (2, 0, 0));
}

/// Four place holders for everything: every way of prefetching gets there in the end, and then nothing moves any more. What
/// is wanted and has been refused is named in every frame, with what is known below it, as an engine at rest does.
#[test]
fn with_little_memory_a_front_at_rest_comes_to_rest() {
    let file = file();
    for prefetch in Prefetch::ALL {
        let mut tree = tree(&file, prefetch, 4, 3, 32);
        let mut front = Front::new(&tree);
        let mut sum = PageStats::default();
        for _ in 0..20_000 {
            let ((done, refused), stats) = frame(&mut tree, |tree| {
                let moved = front.unfold(tree);
                if tree.look_ahead() > 0 {
                    let mut below = Vec::new();
                    for &node in &front.boundary {
                        tree.will_need(node, 1);
                        tree.peek(node, &mut below);
                    }
                    below.iter().for_each(|&(node, _)| tree.will_need(node, 1));
                }
                moved
            });
            tree.pass(2 * MS).unwrap();
            add(&mut sum, stats);
            if done + refused == 0 {
                break;
            }
        }
        assert_eq!(front.active.len(), 60 * 60 - 3, "{}", prefetch.name());
        assert!(sum.no_room > 0, "{}: {sum:?}", prefetch.name());
        frame(&mut tree, |_| ());
        tree.settle().unwrap();
        frame(&mut tree, |_| ());
        for _ in 0..20 {
            tree.pass(2 * MS).unwrap();
            assert_eq!(frame(&mut tree, |_| ()).1.reads, 0, "{}", prefetch.name());
        }
    }
}
