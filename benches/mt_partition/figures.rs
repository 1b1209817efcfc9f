//! Figures 4 and 5: read operations and memory.

use foldfront::CollapseLog;
use foldfront::experiment::plot::{Plot, Series, curves, stack};
use foldfront::selection::engine::Engine;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::NullSink;
use mt_partition::{BuildOptions, CacheMode, Memory, MtTree, QueueOrder};

use crate::{build, folder, near, replay, settings, tree, turning, views};

/// One mode along one path.
#[derive(Default)]
struct Run {
    name: &'static str,
    /// Sum of reads up to each frame, and bytes of the nodes in memory after it.
    reads: Vec<f64>,
    bytes: Vec<f64>,
}

pub fn figures(model: &str, log: &CollapseLog) {
    for order in [QueueOrder::Increasing, QueueOrder::Decreasing] {
        for partition in [20, 50] {
            let (file, built) = build(log, &BuildOptions { order, partition, ..BuildOptions::default() });
            println!(
                "queue {order:?}, at most {partition} nodes: {} partitions of {:.1} nodes",
                built.partitions,
                built.nodes as f64 / built.partitions as f64
            );
            for path in [near(&log.mesh), turning(&log.mesh)] {
                let views = views(&path);
                let mut hashes: Vec<u64> = Vec::new();
                let mut runs = CacheMode::ALL.map(|mode| {
                    let engine = Engine::new(tree(&file, mode), NullSink, settings(&path, Strategy::Event));
                    run(mode.name(), engine.expect("a whole file"), &views, &mut hashes)
                });
                if order == QueueOrder::default() && partition == 20 {
                    draw(model, &path.name, &runs);
                }
                let half = (mean(&runs[2].bytes) * 0.5e6) as u64;
                let mut all: Vec<Run> = runs.iter_mut().map(std::mem::take).collect();
                for (share, name) in [(1.5, "p-cc in 3/4"), (1.0, "p-cc in 1/2"), (0.5, "p-cc in 1/4")] {
                    let limit = ((half as f64 * share) as u64).max(file.least_memory());
                    let limited = mt_partition::Settings {
                        cache: CacheMode::PCc,
                        memory: Memory::new(limit),
                        ..Default::default()
                    };
                    let tree = MtTree::new(file.clone(), limited).expect("enough memory");
                    let engine = Engine::new(tree, NullSink, settings(&path, Strategy::Event));
                    all.push(run(name, engine.expect("a whole file"), &views, &mut hashes));
                }
                table(&path.name, &all);
            }
        }
    }
}

/// Replays a path, and compares its cuts with those of other modes.
fn run(
    name: &'static str,
    mut engine: Engine<MtTree, NullSink>,
    views: &[View],
    hashes: &mut Vec<u64>,
) -> Run {
    let mut run = Run { name, ..Run::default() };
    let (mut reads, mut frame) = (0, 0);
    replay(&mut engine, views, |report, engine| {
        reads += report.pages.reads;
        run.reads.push(reads as f64);
        run.bytes.push(engine.tree().node_bytes() as f64 / 1e6);
        if frame == hashes.len() {
            hashes.push(report.cut_hash);
        }
        assert_eq!(hashes[frame], report.cut_hash, "modes differ in what they show");
        frame += 1;
    });
    run
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn table(path: &str, runs: &[Run]) {
    let figures = |run: &Run| (run.reads.last().copied().unwrap_or(0.0), mean(&run.bytes));
    let (least, conservative) = (figures(&runs[0]), figures(&runs[2]));
    for run in runs {
        let (reads, bytes) = figures(run);
        println!(
            "  {path}, {:11}: {reads:7} reads, {bytes:7.3} MB on average; of NP,NC {:.3} and {:.2}, of P,CC {:.2} and {:.2}",
            run.name,
            reads / least.0,
            bytes / least.1,
            reads / conservative.0,
            bytes / conservative.1
        );
    }
}

fn draw(model: &str, path: &str, runs: &[Run]) {
    let plot = |title: String, y_label, values: fn(&Run) -> &Vec<f64>| {
        let names = ["NP,NC", "P,NC", "P,CC", "P,C", "P, by status"];
        let series: Vec<Series> =
            (0..5).map(|i| Series { name: names[i], values: values(&runs[i]), colour: i }).collect();
        let plot = Plot { title: &title, x_label: "frame", y_label, ..Plot::default() };
        curves(&plot, &series).expect("curves can be drawn")
    };
    let pictures = [
        plot(format!("{model}, {path}: read operations since the start"), "reads", |run| &run.reads),
        plot(format!("{model}, {path}: nodes in memory"), "MB", |run| &run.bytes),
    ];
    let file = folder().join(format!("mt-{model}-{}.svg", path.replace(' ', "-")));
    std::fs::write(&file, stack(&pictures)).expect("target is writable");
}
