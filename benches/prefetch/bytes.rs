//! What foresight reads beside what loading on demand does, over stretches of every trajectory at hand: the paths of the
//! other tables are the middle of three of them, and a path can be found on which any scheme looks well.

use std::path::Path as FilePath;

use foldfront::CollapseLog;
use foldfront::experiment::compare::{Loading, Pace, Run, Subject};
use foldfront::experiment::path::Path;
use foldfront::page_store::Simulated;

use crate::{FRAME, FRAMES, LATENCY, TRAJECTORIES, imported, memory, open, options};

/// Stretches of each, evenly spread from its first frame to its last.
const STRETCHES: usize = 5;

/// The stretches of all trajectories, brought to a mesh or a terrain.
pub fn stretches(mesh: &str, log: &CollapseLog) -> Vec<Path> {
    let mut all = Vec::new();
    for path in TRAJECTORIES.iter().filter_map(|trajectory| imported(trajectory, mesh, log)) {
        let length = path.frames.len().min(FRAMES);
        for stretch in 0..STRETCHES {
            let start = (path.frames.len() - length) * stretch / (STRETCHES - 1);
            let frames = path.frames[start..start + length].to_vec();
            all.push(Path { name: format!("{} {start}", path.name), frames, ..path.clone() });
        }
    }
    all
}

pub fn heading() {
    println!("{:18} {:>8} {:>8} {:>8} {:>8} {:>6}", "path", "misses", "of none", "KiB", "of none", "ratio");
}

/// Prints a row a stretch; returns the largest ratio.
pub fn table(file: &FilePath, mesh: &str, stretches: &[Path]) -> f64 {
    let mut subject = Subject::of_store(mesh, open(file));
    let mut most = 0.0_f64;
    for walk in stretches {
        let page_memory = memory(&subject, walk);
        let pace = Pace::Simulated(FRAME, Simulated::with_latency(LATENCY));
        let options = options(pace, page_memory, vec![Loading::Schedule, Loading::None]);
        let runs =
            subject.replay(walk, 0..walk.frames.len(), &options, &mut |_, _| ()).expect("a valid file");
        // The first frame waits for its pages, whatever fetches them.
        let sum = |run: &Run, f: fn(&foldfront::selection::engine::FrameReport) -> u64| -> u64 {
            run.rows.iter().skip(1).map(|row| f(&row.report)).sum()
        };
        let [misses, without] = [0, 1].map(|i| sum(&runs[i], |report| report.misses));
        let [bytes, on_demand] = [0, 1].map(|i| sum(&runs[i], |report| report.pages.read_bytes) / 1024);
        let ratio = bytes as f64 / on_demand.max(1) as f64;
        println!("{:18} {misses:8} {without:8} {bytes:8} {on_demand:8} {ratio:6.3}", walk.name);
        most = most.max(ratio);
    }
    most
}
