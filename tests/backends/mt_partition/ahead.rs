//! What fetches nodes ahead, on stores on virtual time: the same replay has the same misses.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::sync::Arc;
use std::time::Duration;

use foldfront::Hierarchy;
use foldfront::page_store::Simulated;
use foldfront::selection::engine::{Engine, FrameReport, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{NodeId, NullSink, Prefetch};
use glam::DVec3;
use mt_partition::{BuildOptions, CacheMode, Memory, MtFile, MtTree, Reader};

use super::{CRITERION, ball_log};
use crate::common::backends::combinations;
use crate::common::graph_cut::{self, GraphCut};

const FRAME: Duration = Duration::from_micros(16_667);

fn file() -> Arc<MtFile> {
    graph_cut::file(&ball_log(5), &BuildOptions { patch: 4.0, partition: 6, ..BuildOptions::default() })
}

fn view(eye: DVec3, direction: DVec3) -> View {
    let cos_beta = 0.8_f64;
    View::from_parts(eye, direction, cos_beta, (1.0 - cos_beta * cos_beta).sqrt(), 150.0).unwrap()
}

/// Around the ball, close to it, looking ahead and down.
fn orbit(frames: usize) -> Vec<View> {
    let at = |angle: f64| DVec3::new(angle.cos(), 0.2 * (2.0 * angle).sin(), angle.sin());
    (0..frames)
        .map(|frame| {
            let angle = frame as f64 * 0.012;
            let eye = 1.3 * at(angle);
            view(eye, (at(angle + 0.4) - eye).normalize())
        })
        .collect()
}

fn engine(
    file: &Arc<MtFile>,
    (strategy, prefetch): (Strategy, Prefetch),
    memory: Memory,
    store: Simulated,
) -> Engine<MtTree, NullSink> {
    let settings = mt_partition::Settings {
        cache: CacheMode::PC,
        memory,
        prefetch,
        reader: Some(Reader::simulated(store)),
    };
    let tree = MtTree::new(file.clone(), settings).unwrap();
    Engine::new(tree, NullSink, Settings { rho: 0.02, strategy, ..Settings::default() }).unwrap()
}

/// Frames as they come, each of the time of a frame.
fn play(engine: &mut Engine<MtTree, NullSink>, view: &View) -> FrameReport {
    engine.tree_mut().pass(FRAME).unwrap();
    engine.advance(std::slice::from_ref(view)).unwrap()
}

/// The cuts of a path by brute force.
struct Future {
    cuts: Vec<Vec<bool>>,
    parents: Vec<Vec<NodeId>>,
}

impl Future {
    fn new(file: &MtFile, views: &[View]) -> Self {
        let mut cut = GraphCut::new(file);
        let find = |view: &View| {
            cut.find(CRITERION, std::slice::from_ref(view));
            cut.active.clone()
        };
        let cuts = views.iter().map(find).collect();
        Self { cuts, parents: cut.parents }
    }

    /// Says what changes after a frame, as an engine would that knows the path: of nodes that can change next, and of what
    /// `peek` shows below those.
    fn tell(&self, frame: usize, engine: &mut Engine<MtTree, NullSink>) {
        let nodes = self.parents.len();
        let mut active = vec![false; nodes];
        engine.for_each_active(|node| active[node.index()] = true);
        let mut has_active_child = vec![false; nodes];
        for n in (0..nodes).filter(|&n| active[n]) {
            self.parents[n].iter().for_each(|p| has_active_child[p.index()] = true);
        }
        // What is said now is heard at the end of the next frame.
        let (now, tree) = (frame + 1, engine.tree_mut());
        let until = self.cuts.len().min(now + 1 + tree.look_ahead() as usize);
        let mut shown = Vec::new();
        let change = |n: usize, to: bool| (now + 1..until).find(|&f| self.cuts[f][n] == to).map(|f| f - now);
        for n in 0..nodes {
            let is_boundary = !active[n] && self.parents[n].iter().all(|p| active[p.index()]);
            if active[n] && !has_active_child[n] {
                change(n, false).inspect(|&frames| tree.will_need(NodeId(n as u32), frames as u32));
            } else if is_boundary {
                shown.push(NodeId(n as u32));
            }
        }
        let mut below = Vec::new();
        while let Some(node) = shown.pop() {
            let Some(frames) = change(node.index(), true) else { continue };
            tree.will_need(node, frames as u32);
            tree.peek(node, &mut below);
            shown.extend(below.drain(..).map(|(child, _)| child));
        }
    }
}

#[derive(Debug, Default, PartialEq)]
struct Totals {
    misses: u64,
    reads: u64,
    ahead: u64,
    ahead_used: u64,
    hashes: Vec<u64>,
}

fn replay(
    file: &Arc<MtFile>,
    views: &[View],
    future: Option<&Future>,
    memory: u64,
    store: Simulated,
) -> Totals {
    let prefetch = if future.is_some() { Prefetch::Schedule } else { Prefetch::None };
    let memory = Memory::new(memory);
    let mut engine = engine(file, (Strategy::Event, prefetch), memory.clone(), store);
    // A viewer starts when everything is there.
    while engine.advance(&views[..1]).unwrap().misses > 0 {
        engine.tree_mut().settle().unwrap();
    }
    let mut totals = Totals::default();
    for (frame, view) in views.iter().enumerate().skip(1) {
        if let Some(future) = future {
            future.tell(frame - 1, &mut engine);
        }
        let report = play(&mut engine, view);
        assert!(memory.used() <= memory.limit());
        totals.misses += report.misses;
        totals.reads += report.pages.reads;
        totals.ahead += report.pages.ahead;
        totals.ahead_used += report.pages.ahead_used;
        totals.hashes.push(report.cut_hash);
    }
    totals
}

/// Who knows what comes can have it there: with as many reads, few changes are refused. And time that is virtual passes in
/// the same way each time.
#[test]
fn what_is_foreseen_is_there_in_time() {
    let file = file();
    let views = orbit(400);
    let future = Future::new(&file, &views);
    let store = Simulated {
        latency: Duration::from_millis(60),
        bandwidth: Some(20_000_000),
        ..Simulated::with_latency(Duration::ZERO)
    };
    for memory in [u64::MAX, 400_000] {
        let blind = replay(&file, &views, None, memory, store);
        let seeing = replay(&file, &views, Some(&future), memory, store);
        assert!(blind.misses > 300, "{}", blind.misses);
        assert_eq!((blind.ahead, blind.ahead_used), (0, 0));
        assert!(4 * seeing.misses < blind.misses, "{} and {}", seeing.misses, blind.misses);
        assert!(5 * seeing.reads < 6 * blind.reads, "{} and {} reads", seeing.reads, blind.reads);
        assert!(seeing.ahead_used <= seeing.ahead && 10 * seeing.ahead_used > 8 * seeing.ahead);
        assert_eq!(seeing, replay(&file, &views, Some(&future), memory, store), "another time");
    }
}

/// A camera that stops: the cut is there within twice the time that the store takes, one read after the other where one
/// leads to the next; then nothing is read any more and nothing changes.
#[test]
fn a_camera_that_stops_gets_its_cut() {
    let file = file();
    let views = orbit(300);
    let (views, last) = (&views[..60], views[299]);
    let (latency, bandwidth) = (Duration::from_millis(40), 2_000_000);
    let store = Simulated { latency, bandwidth: Some(bandwidth), depth: 32 };
    let mut cut = GraphCut::new(&file);
    for (strategy, prefetch) in combinations() {
        // How many reads lead to one another, and what they bring: where nothing takes time.
        let no_time = Simulated::with_latency(Duration::ZERO);
        let mut at_once = engine(&file, (strategy, Prefetch::None), Memory::default(), no_time);
        let mut arrive = |view: &View| {
            let (mut depth, mut bytes) = (0, 0);
            loop {
                let report = at_once.advance(std::slice::from_ref(view)).unwrap();
                bytes += report.pages.read_bytes;
                if report.misses == 0 {
                    return (depth, bytes);
                }
                depth += 1;
                at_once.tree_mut().settle().unwrap();
            }
        };
        for view in views {
            arrive(view);
        }
        let (depth, bytes) = arrive(&last);
        assert!(depth > 2, "{depth}");
        let mut engine = engine(&file, (strategy, prefetch), Memory::default(), store);
        for view in views {
            play(&mut engine, view);
        }
        let mut frames = 0;
        while play(&mut engine, &last).misses > 0 {
            frames += 1;
        }
        cut.find(CRITERION, &[last]);
        assert_eq!(cut.difference(&engine), None);
        let most = 2.0 * (latency.as_secs_f64() * f64::from(depth) + bytes as f64 / bandwidth as f64);
        let took = f64::from(frames) * FRAME.as_secs_f64();
        assert!(frames > 0 && took <= most, "{strategy:?}, {prefetch:?}: {took} s, at most {most}");
        for _ in 0..100 {
            let report = play(&mut engine, &last);
            assert_eq!((report.unfolds + report.folds, report.misses, report.pages.reads), (0, 0, 0));
        }
    }
}

/// With little memory it takes longer, and changes are refused for want of room meanwhile; but a camera at rest still gets
/// its cut, as what is displayed need not be in memory, and then nothing is loaded and let go of without end.
#[test]
fn little_memory_comes_to_rest() {
    let file = file();
    let views = orbit(150);
    let future = Future::new(&file, &views);
    let store = Simulated { latency: Duration::from_millis(40), bandwidth: Some(2_000_000), depth: 8 };
    let mut cut = GraphCut::new(&file);
    for prefetch in Prefetch::ALL {
        for times in [1, 2] {
            let memory = Memory::new(times * file.least_memory());
            let mut engine = engine(&file, (Strategy::Event, prefetch), memory.clone(), store);
            for (frame, view) in views.iter().enumerate() {
                future.tell(frame, &mut engine);
                play(&mut engine, view);
                assert!(memory.used() <= memory.limit());
            }
            let last = views[149];
            let (mut frames, mut no_room) = (0, 0);
            loop {
                let report = play(&mut engine, &last);
                no_room += report.pages.no_room;
                if report.misses == 0 {
                    break;
                }
                frames += 1;
                assert!(frames < 20_000, "{prefetch:?}, {times}: never arrives, {report:?}");
            }
            assert!(no_room > 0, "{prefetch:?}, {times}: memory was the limit");
            cut.find(CRITERION, &[last]);
            assert_eq!(cut.difference(&engine), None, "{prefetch:?}");
            for _ in 0..100 {
                let report = play(&mut engine, &last);
                let pages = report.pages;
                assert_eq!((report.unfolds + report.folds, pages.reads, pages.no_room), (0, 0, 0));
            }
        }
    }
}
