//! Misses along recorded paths, with place holders for a share of the file.
//!
//! A miss is a change that was refused in a frame for want of a page; the percentage is of all changes that were asked
//! for, made or refused. Counting starts when the first view is settled.

use std::time::{Duration, Instant};

use foldfront::engine::Engine;
use foldfront::path::import::Mode;
use foldfront::refine::Strategy;
use foldfront::vertex_tree::{NullSink, VertexTree};
use meta_node::{BuildOptions, InUse, MetaNodeTree, Settings};

use crate::selection::settings;
use crate::subject::{imported, log, meta_nodes, open, views};

const DRONE: (&str, Mode, f64) = ("euroc_mh04_drone.txt", Mode::Fly, 60.0);
const CAR: (&str, Mode, f64) = ("kitti_00_car_10hz.txt", Mode::Walk, 30.0);

#[derive(Clone, Copy, PartialEq)]
enum Pace {
    /// After every frame, everything that has been asked for arrives.
    Settled,
    /// A frame every 1/60 s, whatever has arrived.
    RealTime,
}

pub fn table() {
    println!(
        "path   mesh     in use  pace       memory  frames  misses %  frames with a miss %  changes  reads/frame  active"
    );
    for (name, (trajectory, mode, rate), pixels) in [
        ("horse", DRONE, 0.5),
        ("dragon", DRONE, 1.0),
        ("denhaag", CAR, 1.0),
        ("boston", CAR, 1.0),
        ("sierra", DRONE, 1.0),
        ("sierra", CAR, 1.0),
    ] {
        let Some((log, _)) = log(name) else { continue };
        let Some(walk) = imported(trajectory, &log, mode, rate) else { continue };
        let path = meta_nodes(name, &log, &BuildOptions::default());
        let bytes = std::fs::metadata(&path).map_or(0, |m| m.len());
        drop(log);
        let views = views(&walk, pixels);
        for (share, in_use, pace) in [
            (4, InUse::Yields, Pace::Settled),
            (4, InUse::Yields, Pace::RealTime),
            (4, InUse::Stays, Pace::Settled),
            (16, InUse::Yields, Pace::Settled),
        ] {
            let views = if pace == Pace::RealTime { &views[..views.len().min(1200)] } else { &views[..] };
            let paging = Settings { page_memory: bytes / share, in_use, ..Settings::default() };
            let Ok(tree) = MetaNodeTree::new(open(&path), paging) else { continue };
            let mut engine = Engine::new(tree, NullSink, settings(&walk, Strategy::Event)).expect("fine");
            for _ in 0..2000 {
                let report = engine.advance(&views[..1]).expect("the store is fine");
                engine.tree_mut().settle().expect("the store is fine");
                if report.misses == 0 {
                    break;
                }
            }
            let (mut misses, mut changes, mut reads, mut missing, mut active) = (0, 0, 0, 0_u32, 0);
            let mut next = Instant::now();
            for view in views {
                if pace == Pace::RealTime {
                    next += Duration::from_micros(16_667);
                    std::thread::sleep(next.saturating_duration_since(Instant::now()));
                }
                let report = engine.advance(std::slice::from_ref(view)).expect("the store is fine");
                if pace == Pace::Settled {
                    engine.tree_mut().settle().expect("the store is fine");
                }
                misses += report.misses;
                changes += report.unfolds + report.folds;
                reads += report.pages.reads;
                missing += u32::from(report.misses > 0);
                active += report.active_nodes;
            }
            let frames = views.len() as f64;
            println!(
                "{:5}  {name:8} {:6}  {:9}  1/{share:<4}  {:6}  {:8.2}  {:20.1}  {changes:7}  {:11.2}  {:6.0}",
                if mode == Mode::Walk { "car" } else { "drone" },
                format!("{in_use:?}"),
                if pace == Pace::Settled { "settled" } else { "real time" },
                views.len(),
                100.0 * misses as f64 / (misses + changes).max(1) as f64,
                100.0 * f64::from(missing) / frames,
                reads as f64 / frames,
                active as f64 / frames,
            );
        }
    }
}
