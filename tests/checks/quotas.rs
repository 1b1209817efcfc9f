//! Detail blocks within quotas, and cameras that come to rest.

use std::time::Duration;

use detail_block::{Arrangement, Io, XfmTree};
use foldfront::CollapseLog;
use foldfront::experiment::path::around;
use foldfront::page_store::Simulated;
use foldfront::selection::engine::Engine;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::theta_of_pixels;
use foldfront::vertex_tree::{Hierarchy, NullSink, Prefetch};

use crate::common::backends::combinations;
use crate::common::detail_block::{OwnCut, file, options, reading};
use crate::common::{random_step, random_view, seeded};
use crate::flights::{placed, settings};

/// So many frames, slow and fast, rests and teleports, while an I/O thread brings what it can: the blocks in memory and
/// under way never exceed the hard quota. Quotas change as it goes; before they are lowered the front is folded.
pub fn the_hard_quota_holds(log: &CollapseLog, frames: usize) {
    let file = file(&Arrangement::new(log, &options(false, true)).unwrap());
    let all = file.resident_bytes_of_all();
    let tree = XfmTree::new(file, reading(Io::Background)).unwrap();
    let mut engine = Engine::new(tree, NullSink, settings(&log.mesh, Strategy::Event)).unwrap();
    let mut random = seeded(1);
    let mut view = random_view(&mut random).with_k(300.0).unwrap();
    let (mut misses, mut limited, mut hard) = (0, 0, 0);
    for frame in 0..frames {
        if frame % (frames / 10) == 0 {
            engine.advance(&[]).unwrap();
            engine.advance(&[]).unwrap();
            let percent = [12, 4, 8, 2, 16][frame / (frames / 10) % 5];
            hard = all * percent / 100;
            engine.tree_mut().set_quotas(hard / 2, hard);
            engine.advance(&[]).unwrap();
        }
        random_step(&mut view, &mut random);
        let report = engine.advance(&[placed(&log.mesh, view)]).unwrap();
        let (loaded, with_under_way) = engine.tree().block_bytes();
        assert!(
            loaded <= with_under_way && with_under_way <= hard,
            "{with_under_way} of {hard}, frame {frame}"
        );
        misses += report.misses;
        limited += u64::from(report.misses > 0);
        if frame % 997 == 0 {
            engine.assert_well_formed();
        }
    }
    let counts = engine.tree().counts();
    eprintln!("{counts:?}; {misses} misses in {limited} frames");
    assert!(counts.refused > frames as u64 / 100 && counts.removals > frames as u64 / 10, "{counts:?}");
}

/// A camera flies for a while and stops, over a store on virtual time. With memory for everything the cut is the
/// brute-force one within twice the time that its reads take one below the other and one after the other. With less,
/// loading ends: nothing is read, nothing changes, and it is said that memory is what is missing.
pub fn at_rest_the_cut_is_reached_or_loading_ends(log: &CollapseLog) {
    let arrangement = Arrangement::new(log, &options(false, true)).unwrap();
    let effective = arrangement.effective_log();
    let file = file(&arrangement);
    let forest = effective.forest().unwrap();
    let mut depth = vec![1_u32; forest.parent.len()];
    for n in (0..depth.len()).rev() {
        depth[n] = 1 + depth.get(forest.parent[n] as usize).copied().unwrap_or(0);
    }
    let blocks_deep = depth.iter().max().map_or(0, |d: &u32| d.div_ceil(4));
    let mut cut = OwnCut::new(&effective);
    let path = around(&log.mesh).unwrap();
    let all = file.resident_bytes_of_all();
    let frame_time = Duration::from_millis(10);
    let (latency, bandwidth) = (Duration::from_millis(35), 400_000);
    let store = Simulated { latency, bandwidth: Some(bandwidth), depth: 1 << 20 };
    let view = |frame: usize| path.view(frame, theta_of_pixels(0.5, 1080)).unwrap();
    for (strategy, prefetch) in combinations() {
        let mut reached = Vec::new();
        // Where memory is short, what matters is the loading: one strategy is enough.
        let quotas = [all / 200, all / 20, all / 8, u64::MAX];
        for &quota in if strategy == Strategy::Event { &quotas[..] } else { &quotas[3..] } {
            let paging = detail_block::Settings {
                prefetch,
                soft_quota: quota,
                hard_quota: quota,
                ..reading(Io::Simulated(store))
            };
            let tree = XfmTree::new(file.clone(), paging).unwrap();
            let mut engine = Engine::new(tree, NullSink, settings(&log.mesh, strategy)).unwrap();
            for frame in 0..120 {
                engine.advance(&[view(2 * frame)]).unwrap();
                engine.tree_mut().pass(frame_time).unwrap();
            }
            let (mut bytes, mut waited) = (0, Duration::ZERO);
            let mut report = engine.advance(&[view(240)]).unwrap();
            let mut quiet = 0;
            while quiet < 30 {
                engine.tree_mut().pass(frame_time).unwrap();
                waited += frame_time;
                report = engine.advance(&[view(240)]).unwrap();
                bytes += report.pages.read_bytes;
                let is_quiet = report.pages.reads == 0 && report.unfolds == 0 && report.folds == 0;
                quiet = if is_quiet { quiet + 1 } else { 0 };
                assert!(
                    waited < Duration::from_secs(60),
                    "{strategy:?}, {prefetch:?}, {quota}: no end of reading"
                );
            }
            waited -= frame_time * quiet;
            let found = (report.cut_hash, report.active_nodes, report.displayed);
            let wanted = cut.find(engine.settings(), engine.views());
            if quota == u64::MAX {
                assert_eq!(found, wanted, "{strategy:?}, {prefetch:?}");
                let one_by_one = Duration::from_secs_f64(bytes as f64 / bandwidth as f64);
                let most = 2 * (latency * blocks_deep + one_by_one);
                eprintln!("{strategy:?}, {prefetch:?}: {bytes} bytes in {waited:?}, at most {most:?}");
                assert!(bytes > 0 && waited <= most, "{strategy:?}, {prefetch:?}: {waited:?} of {most:?}");
                assert_eq!((report.misses, report.pages.no_room), (0, 0));
            } else {
                assert!(
                    report.pages.no_room > 0 && found.1 < wanted.1,
                    "{strategy:?}, {prefetch:?}, {quota}"
                );
                assert!(engine.tree().block_bytes().1 <= quota);
            }
            reached.push(found.1);
        }
        eprintln!("{strategy:?}, {prefetch:?}: active nodes {reached:?}");
        assert!(reached.is_sorted() && reached[0] > 0, "{reached:?}");
    }
}

/// On a store that is four frames away, a camera that moves as it did misses less where the engine's foresight is followed
/// than where blocks are loaded on first demand, at hardly more reads, and the same replay has the same misses. The tolerance, in pixels, leaves so few changes a frame that
/// the store keeps up: nothing is foreseen for one that does not.
pub fn the_schedule_spares_misses(log: &CollapseLog, theta: f64) {
    let file = file(&Arrangement::new(log, &options(false, true)).unwrap());
    let path = around(&log.mesh).unwrap();
    let frame_time = Duration::from_millis(10);
    let store = Simulated::with_latency(4 * frame_time);
    let run = |prefetch: Prefetch, quota: u64| {
        let paging = detail_block::Settings { prefetch, hard_quota: quota, ..reading(Io::Simulated(store)) };
        let tree = XfmTree::new(file.clone(), paging).unwrap();
        let mut engine = Engine::new(tree, NullSink, settings(&log.mesh, Strategy::Event)).unwrap();
        let (mut misses, mut reads, mut ahead, mut used) = (0, 0, 0, 0);
        for frame in 0..500 {
            let view = path.view(frame, theta_of_pixels(theta, 1080)).unwrap();
            let report = engine.advance(&[view]).unwrap();
            engine.tree_mut().pass(frame_time).unwrap();
            if frame > 60 {
                misses += report.misses;
                reads += report.pages.reads;
                ahead += report.pages.ahead;
                used += report.pages.ahead_used;
            }
        }
        (misses, reads, ahead, used, engine.tree().counts().peak_bytes)
    };
    // With memory for everything, and for seven tenths of what is ever wanted.
    let all = run(Prefetch::Paper, u64::MAX).4;
    for quota in [u64::MAX, all / 10 * 7] {
        let [paper, schedule, none] = Prefetch::ALL.map(|prefetch| run(prefetch, quota));
        eprintln!("paper {paper:?}, schedule {schedule:?}, none {none:?}");
        assert_eq!(paper, none, "the paper loads on first demand");
        assert_eq!(schedule, run(Prefetch::Schedule, quota), "a replay differs");
        assert!(schedule.0 * 2 < paper.0, "{} misses, {} on demand", schedule.0, paper.0);
        assert!(schedule.3 * 2 > schedule.2, "{} of {} reads ahead used", schedule.3, schedule.2);
    }
}
