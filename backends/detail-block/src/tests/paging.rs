//! Quotas, loading in the background, and stores that fail.

use std::sync::Arc;
use std::time::Duration;

use crate::{ATTEMPTS, Arrangement, BuildOptions, Io, Settings, XfmFile};
use collapse_log::CollapseLog;
use page_store::Simulated;
use page_store::source::{Faults, Faulty, MemorySource};
use vertex_tree::{Hierarchy, NodeId};

use super::driver::{Driver, bytes_of, open};
use super::meshes::{random_log, torus};
use super::{blocking, options};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

pub fn built(side: usize, options: &BuildOptions) -> (Vec<u8>, CollapseLog) {
    let mut random = Pcg64::seed_from_u64(11);
    let log = random_log(torus(side, &mut random), &mut random);
    let arrangement = Arrangement::new(&log, options).unwrap();
    (bytes_of(&arrangement), arrangement.effective_log())
}

fn reading(io: Io) -> Settings {
    Settings { io, grace: 0, ..Settings::default() }
}

/// What reads: the frame, a thread, and a line on which a read takes one frame of 10 ms in any case.
fn kinds() -> [Io; 3] {
    let line = Simulated { bandwidth: Some(10_000_000), ..Simulated::with_latency(Duration::from_millis(8)) };
    [Io::Blocking, Io::Background, Io::Simulated(line)]
}

/// One frame of random changes, more down than up or the reverse; `check` sees the driver after every step.
fn frame(driver: &mut Driver, random: &mut Pcg64, down: usize, check: &dyn Fn(&Driver)) {
    let mut arrived = Vec::new();
    driver.tree.begin_frame(&mut arrived).unwrap();
    for _ in 0..12 {
        let boundary = driver.boundary();
        let collapsible: Vec<NodeId> =
            driver.active.iter().copied().filter(|&n| driver.is_collapsible(n)).collect();
        if random.random_range(0..10) < down && !boundary.is_empty() {
            driver.unfold(boundary[random.random_range(0..boundary.len())]).unwrap();
        } else if !collapsible.is_empty() {
            driver.fold(collapsible[random.random_range(0..collapsible.len())]).unwrap();
        }
        check(driver);
    }
    driver.tree.end_frame().unwrap();
    check(driver);
}

/// Whatever is asked for, blocks never take more than the hard quota, while quotas change now and then; and what is
/// displayed is right all the time.
#[test]
fn the_hard_quota_is_never_exceeded() {
    let (bytes, log) = built(30, &options(2, false, false));
    let file = open(bytes);
    let all = file.resident_bytes_of_all();
    for io in kinds() {
        let mut driver = Driver::new(&file, reading(io));
        let mut random = Pcg64::seed_from_u64(17);
        let mut hard = all / 4;
        driver.tree.set_quotas(all / 6, hard);
        for round in 0..400 {
            let down = [8, 8, 3, 5][round / 20 % 4];
            frame(&mut driver, &mut random, down, &|driver| {
                let (loaded, with_under_way) = driver.tree.block_bytes();
                assert!(
                    loaded <= hard && with_under_way <= hard,
                    "{with_under_way} of {hard}, frame {round}"
                );
                driver.tree.assert_well_formed();
            });
            driver.tree.pass(Duration::from_millis(10)).unwrap();
            if round % 3 == 0 {
                driver.tree.settle().unwrap();
            }
            if round % 100 == 99 {
                driver.assert_shows(&log);
                // More from now on: less could not be kept at once.
                hard += all / 8;
                driver.tree.set_quotas(all / 6, hard);
            }
        }
        let counts = driver.tree.counts();
        eprintln!("{io:?}: {counts:?}, {} not resident", driver.not_resident);
        assert!((counts.refused > 20 || io != Io::Blocking) && counts.removals > 100, "{io:?}: {counts:?}");
    }
}

/// A hard quota below what the front occupies keeps everything where it is, and is kept to once the front has folded.
#[test]
fn a_hard_quota_lowered_below_the_front_takes_effect_as_it_folds() {
    let (bytes, _) = built(16, &options(3, false, true));
    let mut driver = Driver::new(&open(bytes), blocking());
    let mut random = Pcg64::seed_from_u64(2);
    super::unfold_all(&mut driver, &mut random);
    let hard = driver.tree.block_bytes().0 / 3;
    driver.tree.set_quotas(hard, hard);
    for _ in 0..400 {
        frame(&mut driver, &mut random, 2, &|driver| driver.tree.assert_well_formed());
    }
    assert!(driver.tree.block_bytes().0 <= hard);
}

/// Everything goes when the front is back at the roots and nothing may stay.
#[test]
fn without_a_quota_to_keep_anything_nothing_is_kept() {
    let (bytes, _) = built(12, &BuildOptions::default());
    let mut driver = Driver::new(&open(bytes), blocking());
    super::unfold_all(&mut driver, &mut Pcg64::seed_from_u64(2));
    driver.tree.set_quotas(0, u64::MAX);
    super::fold_all(&mut driver);
    for _ in 0..3 {
        driver.tree.begin_frame(&mut Vec::new()).unwrap();
        driver.tree.end_frame().unwrap();
    }
    assert_eq!(driver.tree.block_bytes(), (0, 0));
    driver.tree.assert_well_formed();
}

/// Reads fail, end early, bring flipped bits or come late. Each is counted, nothing wrong is ever shown, and in the end
/// everything is there.
#[test]
fn faults_cost_nothing_but_time() {
    // So many blocks that more than 30 reads are befallen, also where a grace keeps what has just been used.
    let (bytes, log) = built(20, &options(2, false, false));
    for (seed, io) in (1..).zip(kinds()) {
        let faults =
            Faults { errors: 60, short: 60, flips: 60, delays: 30, delay: Duration::from_micros(200) };
        let source =
            Arc::new(Faulty::new(MemorySource::new("bytes", bytes.clone()), seed, Faults::default()));
        let file = Arc::new(XfmFile::open(source.clone()).unwrap());
        source.set(faults);
        let mut driver = Driver::new(&file, reading(io));
        driver.tree.set_quotas(file.resident_bytes_of_all() / 10, u64::MAX);
        let mut random = Pcg64::seed_from_u64(seed);
        let mut counted = 0;
        for round in 0..900 {
            driver.tree.begin_frame(&mut Vec::new()).unwrap();
            for _ in 0..8 {
                let boundary = driver.boundary();
                if random.random_range(0..10) < [9, 4][round / 40 % 2] && !boundary.is_empty() {
                    driver.unfold(boundary[random.random_range(0..boundary.len())]).unwrap();
                } else if let Some(&node) = driver.active.iter().rev().find(|&&n| driver.is_collapsible(n)) {
                    driver.fold(node).unwrap();
                }
            }
            driver.tree.assert_well_formed();
            counted += driver.tree.end_frame().unwrap().faults;
            // However slow the machine, something is loaded.
            if round % 2 == 0 {
                driver.tree.settle().unwrap();
            }
        }
        driver.assert_shows(&log);
        driver.tree.settle().unwrap();
        driver.tree.begin_frame(&mut Vec::new()).unwrap();
        counted += driver.tree.end_frame().unwrap().faults;
        assert!(source.befallen() > 30, "{io:?}: only {} faults", source.befallen());
        assert_eq!(counted, source.befallen(), "{io:?}: every fault is counted");
        source.set(Faults::default());
        for _ in 0..1000 {
            driver.tree.begin_frame(&mut Vec::new()).unwrap();
            for node in driver.boundary() {
                driver.unfold(node).unwrap();
            }
            driver.tree.end_frame().unwrap();
            driver.tree.settle().unwrap();
        }
        assert_eq!(driver.tree.displayed(), log.mesh.triangles.len() as u64, "{io:?}");
        driver.assert_shows(&log);
    }
}

/// A store that never answers is an error after so many attempts, and not the end: when it is back, so is the mesh.
#[test]
fn a_store_that_stays_away_is_an_error() {
    let (bytes, _) = built(10, &BuildOptions::default());
    let source = Arc::new(Faulty::new(MemorySource::new("bytes", bytes), 1, Faults::default()));
    let file = Arc::new(XfmFile::open(source.clone()).unwrap());
    source.set(Faults { errors: 1000, ..Faults::default() });
    let mut driver = Driver::new(&file, reading(Io::Background));
    let root = driver.tree.roots()[0];
    let mut failed_after = 0;
    for attempt in 0..=ATTEMPTS {
        if let Err(error) = driver.tree.begin_frame(&mut Vec::new()) {
            failed_after = attempt;
            assert!(error.to_string().starts_with("bytes: reading"), "{error}");
            break;
        }
        assert!(!driver.unfold(root).unwrap());
        driver.tree.settle().unwrap();
    }
    assert_eq!(failed_after, ATTEMPTS);
    source.set(Faults::default());
    for _ in 0..3 {
        driver.tree.begin_frame(&mut Vec::new()).unwrap();
        driver.unfold(root).unwrap();
        driver.tree.settle().unwrap();
    }
    assert!(driver.active.contains(&root));
}

/// What has just become a candidate stays for a while, whatever the soft quota; not so where the hard one is in need.
#[test]
fn a_grace_keeps_what_has_just_been_used() {
    let (bytes, _) = built(12, &BuildOptions::default());
    let file = open(bytes);
    let mut driver = Driver::new(&file, Settings { grace: 20, ..blocking() });
    super::unfold_all(&mut driver, &mut Pcg64::seed_from_u64(2));
    super::fold_all(&mut driver);
    driver.tree.set_quotas(0, u64::MAX);
    for frame in 1..=30 {
        driver.tree.begin_frame(&mut Vec::new()).unwrap();
        driver.tree.end_frame().unwrap();
        assert_eq!(driver.tree.block_bytes().0 == 0, frame > 20, "frame {frame}");
    }
    let mut driver = Driver::new(&file, Settings { grace: 20, ..blocking() });
    super::unfold_all(&mut driver, &mut Pcg64::seed_from_u64(2));
    super::fold_all(&mut driver);
    driver.tree.set_quotas(0, 0);
    driver.tree.begin_frame(&mut Vec::new()).unwrap();
    driver.tree.end_frame().unwrap();
    assert_eq!(driver.tree.block_bytes().0, 0);
}
