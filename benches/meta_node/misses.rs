//! Misses along recorded paths, with place holders for a share of the file.
//!
//! A miss is a change that was refused in a frame for want of a page; the percentage is of all changes that were asked
//! for, made or refused. Counting starts when the first view is settled. Frames come at 60 a second, on virtual time with a
//! store of a given latency, or in real time from the file on disk.

use std::time::{Duration, Instant};

use foldfront::experiment::path::import::Mode;
use foldfront::page_store::Simulated;
use foldfront::selection::engine::Engine;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{Hierarchy, NullSink, Prefetch};
use meta_node::{BuildOptions, InUse, Io, MetaNodeTree, Settings};

use crate::selection::settings;
use crate::subject::{imported, is_chosen, log, meta_nodes, open, views};

pub const DRONE: (&str, Mode, f64) = ("euroc_mh04_drone.txt", Mode::Fly, 60.0);
pub const CAR: (&str, Mode, f64) = ("kitti_00_car_10hz.txt", Mode::Walk, 30.0);

/// Mesh, path, and the tolerance in pixels.
pub const PATHS: [(&str, (&str, Mode, f64), f64); 7] = [
    ("horse", DRONE, 0.5),
    ("dragon", DRONE, 1.0),
    ("happy", DRONE, 1.0),
    ("denhaag", CAR, 1.0),
    ("boston", CAR, 1.0),
    ("sierra", DRONE, 1.0),
    ("sierra", CAR, 1.0),
];

const FRAME: Duration = Duration::from_micros(16_667);
/// In real time, so many frames: 20 seconds.
const REAL_FRAMES: usize = 1200;

/// Of the meshes that are named, or of all.
pub fn table(words: &[String]) {
    println!(
        "path   mesh     memory  in use  prefetch  latency    frames  misses %  frames with a miss %  changes  reads/frame  \
         of these ahead %, used %  no room  active"
    );
    for (name, (trajectory, mode, rate), pixels) in PATHS {
        if !is_chosen(name, words, PATHS.map(|(name, ..)| name)) {
            continue;
        }
        let Some((log, _)) = log(name) else { continue };
        let Some(walk) = imported(trajectory, &log, mode, rate) else { continue };
        let path = meta_nodes(name, &log, &BuildOptions::default());
        let bytes = std::fs::metadata(&path).map_or(0, |m| m.len());
        drop(log);
        let views = views(&walk, pixels);
        let ways = Prefetch::ALL.map(|prefetch| (InUse::Yields, prefetch));
        for (parts, latency) in [(4, Some(5)), (4, Some(50)), (4, None), (16, Some(5))] {
            let stays = [InUse::Stays, InUse::Printed].map(|in_use| (in_use, Prefetch::Paper));
            let stays = stays.into_iter().filter(|_| latency == Some(5));
            for (in_use, prefetch) in ways.into_iter().chain(stays) {
                let io = latency.map_or(Io::Thread, |latency| {
                    Io::Simulated(Simulated::with_latency(Duration::from_millis(latency)))
                });
                let page_memory = bytes / parts;
                let paging = Settings { page_memory, in_use, prefetch, io, ..Settings::default() };
                let Ok(tree) = MetaNodeTree::new(open(&path), paging) else { continue };
                let engine = Engine::new(tree, NullSink, settings(&walk, Strategy::Event)).expect("fine");
                let views =
                    if latency.is_none() { &views[..views.len().min(REAL_FRAMES)] } else { &views[..] };
                println!(
                    "{:5}  {name:8} 1/{parts:<4}  {:6}  {:8}  {:9}  {}",
                    if mode == Mode::Walk { "car" } else { "drone" },
                    format!("{in_use:?}"),
                    prefetch.name(),
                    latency.map_or("real time".to_owned(), |latency| format!("{latency} ms")),
                    replay(engine, views, latency.is_none())
                );
            }
        }
    }
}

/// Follows a path, and says what was missing.
fn replay(mut engine: Engine<MetaNodeTree, NullSink>, views: &[View], in_real_time: bool) -> String {
    for _ in 0..2000 {
        let report = engine.advance(&views[..1]).expect("the store is fine");
        engine.tree_mut().settle().expect("the store is fine");
        if report.misses == 0 {
            break;
        }
    }
    let (mut misses, mut changes, mut missing, mut active) = (0, 0, 0_u32, 0);
    let (mut reads, mut ahead, mut used, mut no_room) = (0, 0, 0, 0);
    let mut next = Instant::now();
    for view in views {
        if in_real_time {
            next += FRAME;
            std::thread::sleep(next.saturating_duration_since(Instant::now()));
        }
        let report = engine.advance(std::slice::from_ref(view)).expect("the store is fine");
        engine.tree_mut().pass(FRAME).expect("the store is fine");
        misses += report.misses;
        changes += report.unfolds + report.folds;
        missing += u32::from(report.misses > 0);
        active += report.active_nodes;
        reads += report.pages.reads;
        ahead += report.pages.ahead;
        used += report.pages.ahead_used;
        no_room += report.pages.no_room;
    }
    let (frames, percent) = (views.len() as f64, |part: u64, of: u64| 100.0 * part as f64 / of.max(1) as f64);
    format!(
        "{:6}  {:8.2}  {:20.1}  {changes:7}  {:11.2}  {:14.0} {:7.0}  {no_room:7}  {:6.0}",
        views.len(),
        percent(misses, misses + changes),
        100.0 * f64::from(missing) / frames,
        reads as f64 / frames,
        percent(ahead, reads),
        percent(used, ahead),
        active as f64 / frames,
    )
}
