//! What paging is up against: how many pages a path needs, and what the best that can be done misses.
//!
//! The cut is followed with everything in memory, and the page of each change is noted. Then caches are played over that:
//! the least recently used page makes room, or the one that is needed farthest in the future (Belady 1966: no policy that
//! fetches on demand reads less). A change misses if its page is not there when the frame starts; what was missing is
//! there in the next frame. So these are bounds for pages that are fetched on demand; prefetching can miss less, but not
//! read less than Belady's.

use std::collections::BTreeSet;

use foldfront::selection::engine::Engine;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{Hierarchy, NodeId, NullSink};
use meta_node::{BuildOptions, MetaNodeFile, MetaNodeTree};

use crate::misses::PATHS;
use crate::selection::settings;
use crate::subject::{fact, imported, log, meta_nodes, open, views};

/// The pages of all changes, frame by frame. The first frame unfolds the first view, and is only there to start from.
struct Trace {
    frames: Vec<Vec<u32>>,
    /// Bytes of each page.
    bytes: Vec<u64>,
    pages: usize,
    /// Of the pages, in each tenth frame: those with a node or leaf of the front on them, and those with a node that can
    /// change its status next.
    in_front: Vec<usize>,
    can_change: Vec<usize>,
}

pub fn table() {
    println!(
        "path   mesh      pages  in front %: mean  most   can change %: mean  most   changed on in 60, 600 frames %   \
         memory   misses %: LRU  Belady   reads/frame: LRU  Belady"
    );
    for (name, (trajectory, mode, rate), pixels) in PATHS {
        let Some((log, _)) = log(name) else { continue };
        let Some(walk) = imported(trajectory, &log, mode, rate) else { continue };
        let path = meta_nodes(name, &log, &BuildOptions::default());
        drop(log);
        let file = open(&path);
        let bytes = std::fs::metadata(&path).map_or(0, |m| m.len());
        let trace = trace(&file, &views(&walk, pixels), settings(&walk, Strategy::Event));
        let share = |of: f64| 100.0 * of / trace.pages as f64;
        let spread = |counts: &[usize]| {
            let mean = counts.iter().sum::<usize>() as f64 / counts.len().max(1) as f64;
            format!("{:5.1}  {:5.1}", share(mean), share(counts.iter().copied().max().unwrap_or(0) as f64))
        };
        let recent = [60, 600].map(|frames| share(trace.changed_on_within(frames)));
        let changes: usize = trace.frames[1..].iter().map(Vec::len).sum();
        for parts in [4, 16] {
            let [lru, belady] = [false, true].map(|belady| trace.play(bytes / parts, belady));
            let percent = |misses: usize| 100.0 * misses as f64 / changes.max(1) as f64;
            let frames = trace.frames.len() as f64;
            println!(
                "{trajectory:.5}  {name:8} {:6}           {}               {}                     {:6.1}  {:6.1}           \
                 1/{parts:<4}            {:6.2}  {:6.2}             {:6.2}  {:6.2}",
                trace.pages,
                spread(&trace.in_front),
                spread(&trace.can_change),
                recent[0],
                recent[1],
                percent(lru.0),
                percent(belady.0),
                lru.1 as f64 / frames,
                belady.1 as f64 / frames,
            );
        }
    }
}

fn trace(
    file: &std::sync::Arc<MetaNodeFile>,
    views: &[View],
    settings: foldfront::selection::engine::Settings,
) -> Trace {
    let mut tree = MetaNodeTree::new(file.clone(), meta_node::Settings::default()).expect("memory is there");
    tree.load_all();
    tree.settle().expect("the store is fine");
    let pages = fact(file, "pages") as usize;
    let slots = tree.node_limit() / pages as u32;
    let mut engine = Engine::new(tree, NullSink, settings).expect("the store is fine");
    // The last frame but one in which each node was active, and a mark for pages.
    let mut active = vec![0_u32; engine.tree().node_limit() as usize];
    let mut now: Vec<NodeId> = Vec::new();
    let mut seen = vec![u32::MAX; pages];
    let bytes = (0..pages as u32).filter_map(|page| file.page_bytes(page)).collect();
    let mut trace = Trace { frames: Vec::new(), bytes, pages, in_front: Vec::new(), can_change: Vec::new() };
    for (frame, view) in (1..).zip(views) {
        engine.advance(std::slice::from_ref(view)).expect("the store is fine");
        let before = std::mem::take(&mut now);
        engine.for_each_active(|node| now.push(node));
        now.iter().for_each(|node| {
            let last = std::mem::replace(&mut active[node.index()], frame);
            if last + 1 != frame || frame == 1 {
                trace.changed(frame, node.0 / slots);
            }
        });
        before.iter().filter(|node| active[node.index()] != frame).for_each(|node| {
            trace.changed(frame, node.0 / slots);
        });
        trace.frames.resize(frame as usize, Vec::new());
        if frame % 10 == 0 {
            let is_active = |node: NodeId| active[node.index()] == frame;
            let tree = engine.tree();
            let mut count = |mark: u32, pages: &mut dyn Iterator<Item = u32>| {
                pages.filter(|&page| std::mem::replace(&mut seen[page as usize], mark) != mark).count()
            };
            let folded_below = |node: NodeId| tree.children(node).filter(|&child| !is_active(child));
            let is_collapsible = |node: NodeId| !tree.children(node).any(is_active);
            // Leaves count on the page of their parent: a node with one child that is a node has a leaf below it.
            let has_leaf = |node: NodeId| tree.children(node).count() < 2;
            let in_front = count(
                2 * frame,
                &mut now.iter().flat_map(|&node| {
                    let own = has_leaf(node).then_some(node);
                    folded_below(node).chain(own).map(|node| node.0 / slots)
                }),
            );
            let can_change = count(
                2 * frame + 1,
                &mut now.iter().flat_map(|&node| {
                    let own = is_collapsible(node).then_some(node);
                    folded_below(node).chain(own).map(|node| node.0 / slots)
                }),
            );
            trace.in_front.push(in_front);
            trace.can_change.push(can_change);
        }
    }
    trace
}

impl Trace {
    fn changed(&mut self, frame: u32, page: u32) {
        self.frames.resize(frame as usize, Vec::new());
        if let Some(pages) = self.frames.last_mut() {
            pages.push(page);
        }
    }

    /// How many pages, on average over all frames, have been changed on within so many frames.
    fn changed_on_within(&self, frames: usize) -> f64 {
        let (mut last, mut sum) = (vec![usize::MAX; self.pages], 0_usize);
        for (at, changes) in self.frames.iter().enumerate().skip(1) {
            for &page in changes {
                // From its last change on, a page counts for so many frames.
                let since = at.saturating_sub(last[page as usize].min(at));
                sum += if last[page as usize] == usize::MAX { frames } else { since.min(frames) };
                last[page as usize] = at;
            }
        }
        sum as f64 / self.frames.len().max(1) as f64
    }

    /// Changes that miss, and reads, with room for so many bytes.
    fn play(&self, room: u64, belady: bool) -> (usize, usize) {
        // When each page is used next, for each of its uses: from the last frame backwards.
        let mut next_use = vec![usize::MAX; self.pages];
        let mut next: Vec<Vec<usize>> = vec![Vec::new(); self.frames.len()];
        for (at, changes) in self.frames.iter().enumerate().rev() {
            next[at] = changes.iter().map(|&page| next_use[page as usize]).collect();
            changes.iter().for_each(|&page| next_use[page as usize] = at);
        }
        // Pages that are there, by what decides: the least goes first.
        let mut rank: Vec<Option<usize>> = vec![None; self.pages];
        let mut there: BTreeSet<(usize, u32)> = BTreeSet::new();
        let (mut misses, mut reads, mut used) = (0, 0, 0);
        for (at, changes) in self.frames.iter().enumerate() {
            let missing = changes.iter().filter(|&&page| rank[page as usize].is_none()).count();
            misses += if at == 0 { 0 } else { missing };
            for (&page, &next) in changes.iter().zip(&next[at]) {
                let new = if belady { usize::MAX - next } else { at };
                match rank[page as usize].replace(new) {
                    Some(old) => drop(there.remove(&(old, page))),
                    None => {
                        reads += usize::from(at > 0);
                        used += self.bytes[page as usize];
                        while used > room
                            && let Some((_, gone)) = there.pop_first()
                        {
                            rank[gone as usize] = None;
                            used -= self.bytes[gone as usize];
                        }
                    }
                }
                there.insert((new, page));
            }
        }
        (misses, reads)
    }
}
