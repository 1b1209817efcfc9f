//! A store on virtual time that can not keep up: what the engine and every backend spare themselves then.

use std::time::Duration;

use crate::common::backends::meta_node_file;
use crate::common::detail_block as detail;
use crate::common::{bumpy_grid, graph_cut, seeded};
use detail_block::{Arrangement, XfmTree};
use foldfront::CollapseLog;
use foldfront::construction::simplify;
use foldfront::page_store::Simulated;
use foldfront::selection::engine::{Engine, FrameReport, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::settled::Settled;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{NullSink, Prefetch, VertexTree};
use glam::DVec3;
use meta_node::MetaNodeTree;
use mt_partition::{MtTree, Reader};

const FRAME: Duration = Duration::from_micros(16_667);

/// Three frames for each read, one after the other.
const STORE: Simulated = Simulated { latency: Duration::from_millis(50), bandwidth: None, depth: 1 };

/// Frames in which the camera comes near.
const FLIGHT: u32 = 60;

fn log() -> CollapseLog {
    let mesh = bumpy_grid(120, &mut seeded(1));
    simplify::build(mesh, &simplify::Options::default(), &mut |_, _| ()).unwrap().0
}

/// Down on the grid, nearer and nearer.
fn view(frame: u32) -> View {
    let eye = DVec3::new(0.1, 0.2, 40.0 - 34.0 * f64::from(frame) / f64::from(FLIGHT));
    View::from_parts(eye, -DVec3::Z, 0.8, 0.6, 400.0).unwrap()
}

fn settings(strategy: Strategy) -> Settings {
    Settings { strategy, rho: 1.0, ..Settings::default() }
}

fn play<T: VertexTree>(engine: &mut Engine<T, NullSink>, views: &[View]) -> FrameReport {
    engine.tree_mut().pass(FRAME).unwrap();
    let report = engine.advance(views).unwrap();
    engine.assert_well_formed();
    report
}

/// Waits for all that is missing.
fn settle<T: VertexTree>(engine: &mut Engine<T, NullSink>, view: View) -> FrameReport {
    for _ in 0..500 {
        let report = engine.advance(&[view]).unwrap();
        if report.misses == 0 {
            return report;
        }
        engine.tree_mut().settle().unwrap();
    }
    panic!("the cut is not reached");
}

/// A flight that the store can not follow, a camera that looks away, and one that comes back.
fn overload<T: VertexTree>(name: &str, open: impl Fn(Prefetch) -> T) {
    for strategy in Strategy::ALL {
        for prefetch in [Prefetch::Schedule, Prefetch::None] {
            let what = format!("{name}, {}, {}", strategy.name(), prefetch.name());
            let mut engine = Engine::new(open(prefetch), NullSink, settings(strategy)).unwrap();
            settle(&mut engine, view(0));
            let (mut foreseen, mut reports) = (0, Vec::new());
            for frame in 1..=FLIGHT {
                let report = play(&mut engine, &[view(frame)]);
                foreseen += report.foreseen;
                reports.push(report);
            }
            assert_eq!(foreseen > 0, prefetch == Prefetch::Schedule, "{what}: at first it is looked ahead");
            let misses = reports[FLIGHT as usize - 1].misses;
            assert!(misses >= 5, "{what}: {misses} misses");
            for report in reports[FLIGHT as usize / 2..].iter().filter(|report| report.misses > 100) {
                assert_eq!(report.foreseen, 0, "{what}: foresight for a store that can not keep up");
            }

            // What is not wanted any more is not read, but for what was under way and what was started when that ended.
            let mut reads = 0;
            for frame in 0..60 {
                let report = play(&mut engine, &[]);
                assert_eq!(report.misses, 0, "{what}, {frame} frames after the camera has looked away");
                reads += report.pages.reads;
            }
            assert!(reads <= 2, "{what}: {reads} reads for what nobody wants, of {misses}");

            let report = settle(&mut engine, view(FLIGHT));
            if strategy.is_exact() {
                let mut waits =
                    Engine::new(Settled::new(open(Prefetch::None)), NullSink, settings(strategy)).unwrap();
                let expected = waits.advance(&[view(FLIGHT)]).unwrap();
                assert_eq!(report.cut_hash, expected.cut_hash, "{what}");
            }
        }
    }
}

#[test]
fn meta_nodes() {
    let file = meta_node_file(&log(), &meta_node::BuildOptions { levels: Some(3), page_bytes: 700 });
    overload("meta-node", |prefetch| {
        let io = meta_node::Io::Simulated(STORE);
        MetaNodeTree::new(file.clone(), meta_node::Settings { prefetch, io, ..Default::default() }).unwrap()
    });
}

#[test]
fn detail_blocks() {
    let file = detail::file(&Arrangement::new(&log(), &detail::options(false, true)).unwrap());
    overload("detail-block", |prefetch| {
        let io = detail_block::Io::Simulated(STORE);
        XfmTree::new(file.clone(), detail_block::Settings { prefetch, ..detail::reading(io) }).unwrap()
    });
}

#[test]
fn multi_triangulations() {
    let options = mt_partition::BuildOptions { patch: 4.0, partition: 6, ..Default::default() };
    let file = graph_cut::file(&log(), &options);
    overload("mt-partition", |prefetch| {
        let reader = Some(Reader::simulated(STORE));
        MtTree::new(file.clone(), mt_partition::Settings { prefetch, reader, ..Default::default() }).unwrap()
    });
}
