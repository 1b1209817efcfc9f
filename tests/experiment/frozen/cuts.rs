//! Cuts, files and what paging does, as they were on 30 November 2026: whatever moves in the code, none of these may.
//!
//! `cuts.txt` has a line for each file that is written of a built-in scene, for each recorded path through it, backend and
//! strategy (every frame's cut, its size and its triangles), and for each way to fetch ahead on virtual time (every frame's cut,
//! misses, reads and bytes). Where something is meant to change, the new table is printed, to be looked at.
//!
//! Changed since: `laserscan-wild meta-node schedule`, where seven pages are read two frames earlier. How long reads take is noted
//! after what was known of it has faded for the frame, in all backends. And `mt-partition schedule`, all six: what a read brings
//! beside what was foreseen stays until what else is under way has come, so that it is not read again: fewer reads and bytes on every
//! path, and no more misses on any (`benches/record/2026-11-30-trajectories.md`). What is timed is found by the queue alone, which `event` was
//! when the table was made: in what order changes are found decides which of two pages is read first.

use std::fmt::Write;
use std::path::Path as FilePath;
use std::time::Duration;

use detail_block::XfmTree;
use foldfront::construction::simplify;
use foldfront::experiment::compare::{Loading, Options, Pace, Subject};
use foldfront::experiment::path::{Path, recorded};
use foldfront::experiment::scene::SceneKind;
use foldfront::experiment::store::{self, Backend, BuildOptions, Store};
use foldfront::page_store::Simulated;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::settled::Settled;
use foldfront::selection::view::theta_of_pixels;
use foldfront::vertex_tree::{Hierarchy, NullSink, Prefetch, Refine};
use in_memory::InMemoryTree;
use meta_node::MetaNodeTree;
use mt_partition::MtTree;

use crate::common::scenes;

const LATENCY: Duration = Duration::from_millis(5);

/// A number for a sequence of numbers.
fn digest(numbers: impl IntoIterator<Item = u64>) -> u64 {
    // FNV-1a, a word at a time, and mixed.
    let mix = |digest: u64, x: u64| (digest ^ x).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(29);
    numbers.into_iter().fold(0xcbf2_9ce4_8422_2325, mix)
}

/// All cuts along a path, each with as many pages as it needs.
fn settled<T: Hierarchy + Refine<NullSink>>(tree: T, path: &Path, strategy: Strategy) -> u64 {
    let usual = path.motion_percentile(99.0);
    let settings = Settings { strategy, rho: usual.rho, omega: usual.omega, ..Settings::default() };
    let mut engine = Engine::new(Settled::new(tree), NullSink, settings).unwrap();
    let frames = (0..path.frames.len()).flat_map(|frame| {
        let report = engine.advance(&[path.view(frame, theta_of_pixels(1.0, 1080)).unwrap()]).unwrap();
        [report.cut_hash, report.active_nodes, report.displayed]
    });
    digest(frames)
}

/// The lines of a scene.
fn table(kind: SceneKind, folder: &FilePath) -> String {
    let mut lines = String::new();
    let mesh = scenes::mesh(kind).clone();
    // As on the command line, where the blocks of the city are joined.
    let mut options = simplify::Options::default();
    options.merge_components = kind == SceneKind::City;
    let log = simplify::build(mesh, &options, &mut |_, _| ()).unwrap().0;
    for backend in Backend::ALL {
        let file = folder.join(backend.name());
        store::write(backend, &file, &log, &BuildOptions::default()).unwrap();
        let bytes = std::fs::read(&file).unwrap();
        let (name, words) = (backend.name(), bytes.iter().map(|&byte| u64::from(byte)));
        writeln!(lines, "{} file {name} {:016x}", kind.name(), digest(words)).unwrap();
        let mut subject = Subject::of_store(kind.name(), Store::open(&file).unwrap());
        for path in recorded(kind).unwrap() {
            for strategy in Strategy::COMPARED {
                let digest = match Store::open(&file).unwrap() {
                    Store::InMemory(hierarchy, _) => settled(InMemoryTree::new(hierarchy), &path, strategy),
                    Store::MetaNode(file) => {
                        let settings = meta_node::Settings { prefetch: Prefetch::None, ..Default::default() };
                        settled(MetaNodeTree::new(file, settings).unwrap(), &path, strategy)
                    }
                    Store::DetailBlock(file) => {
                        let settings =
                            detail_block::Settings { prefetch: Prefetch::None, ..Default::default() };
                        settled(XfmTree::new(file, settings).unwrap(), &path, strategy)
                    }
                    Store::MtPartition(file) => {
                        let settings =
                            mt_partition::Settings { prefetch: Prefetch::None, ..Default::default() };
                        settled(MtTree::new(file, settings).unwrap(), &path, strategy)
                    }
                };
                writeln!(lines, "{} {name} {} {digest:016x}", path.name, strategy.name()).unwrap();
            }
            let all = 0..path.frames.len();
            if backend == Backend::InMemory {
                continue;
            }
            let timed = Options {
                strategies: vec![Strategy::EventQueue],
                prefetch: vec![Loading::Paper, Loading::Schedule, Loading::None],
                pace: Pace::Simulated(Duration::from_secs_f64(1.0 / 60.0), Simulated::with_latency(LATENCY)),
                ..Options::default()
            };
            for run in subject.replay(&path, all.clone(), &timed, &mut |_, _| ()).unwrap() {
                let digest = digest(run.rows.iter().flat_map(|row| {
                    let pages = row.report.pages;
                    [row.report.cut_hash, row.report.misses, pages.reads, pages.read_bytes]
                }));
                writeln!(lines, "{} {name} {} {digest:016x}", run.path, run.prefetch.name()).unwrap();
            }
        }
    }
    lines
}

fn check(kind: SceneKind) {
    let folder = tempfile::tempdir().unwrap();
    let found = table(kind, folder.path());
    let all = include_str!("cuts.txt");
    let expected: Vec<&str> = all.lines().filter(|line| line.starts_with(kind.name())).collect();
    let differ: Vec<(&str, &str)> =
        found.lines().zip(expected.iter().copied()).filter(|(found, expected)| found != expected).collect();
    assert!(
        differ.is_empty() && found.lines().count() == expected.len(),
        "{differ:?} differ (found, expected); all that was found:\n{found}"
    );
}

#[test]
fn of_the_city() {
    check(SceneKind::City);
}

#[test]
fn of_the_alps() {
    check(SceneKind::Alps);
}

#[test]
fn of_the_laser_scan() {
    check(SceneKind::Laserscan);
}
