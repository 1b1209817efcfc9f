//! Figures 4 and 5: read operations and memory.

use foldfront::CollapseLog;
use foldfront::engine::Engine;
use foldfront::plot::{Plot, Series, curves, stack};
use foldfront::refine::Strategy;
use foldfront::vertex_tree::NullSink;
use mt_partition::{BuildOptions, CacheMode, QueueOrder};

use crate::{build, folder, near, replay, settings, tree, turning, views};

/// One mode along one path.
struct Run {
    /// Sum of reads up to each frame, and bytes of the nodes in memory after it.
    reads: Vec<f64>,
    bytes: Vec<f64>,
}

pub fn figures(model: &str, log: &CollapseLog) {
    for order in [QueueOrder::Decreasing, QueueOrder::Increasing] {
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
                let runs = CacheMode::ALL.map(|mode| {
                    let settings = settings(&path, Strategy::Event);
                    let mut engine = Engine::new(tree(&file, mode), NullSink, settings).expect("a whole file");
                    let mut run = Run { reads: Vec::new(), bytes: Vec::new() };
                    let (mut reads, mut frame) = (0, 0);
                    replay(&mut engine, &views, |report, engine| {
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
                });
                table(&path.name, &runs);
                if order == QueueOrder::default() && partition == 20 {
                    draw(model, &path.name, &runs);
                }
            }
        }
    }
}

fn table(path: &str, runs: &[Run; 4]) {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let reads = runs.each_ref().map(|run| run.reads.last().copied().unwrap_or(0.0));
    let bytes = runs.each_ref().map(|run| mean(&run.bytes));
    for (mode, (reads, bytes)) in CacheMode::ALL.iter().zip(reads.iter().zip(bytes)) {
        println!("  {path}, {:5}: {reads:7} reads, {bytes:7.3} MB on average", mode.name());
    }
    println!(
        "  {path}: P,C : P,CC reads {:.2}, memory {:.2}; P,C : NP,NC memory {:.2}, reads {:.3}",
        reads[3] / reads[2],
        bytes[3] / bytes[2],
        bytes[3] / bytes[0],
        reads[3] / reads[0]
    );
}

fn draw(model: &str, path: &str, runs: &[Run; 4]) {
    let plot = |title: String, y_label, values: fn(&Run) -> &Vec<f64>| {
        let names = ["NP,NC", "P,NC", "P,CC", "P,C"];
        let series: Vec<Series> = (0..4)
            .map(|i| Series { name: names[i], values: values(&runs[i]), colour: i })
            .collect();
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
