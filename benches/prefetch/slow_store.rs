//! What a slow store does to the time of selection: the percentiles of the whole step over an instant store and over one
//! that takes 50 ms for each read, one after the other, so that along a fast path it is hopelessly behind.
//!
//! On virtual time a replay can be repeated, and each frame is then taken at its fastest: what is left is what the frame
//! has to do. By the wall clock, with real threads, nothing is repeated, and whatever else the machine does is in it.

use std::path::Path as FilePath;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use foldfront::experiment::compare::{Loading, Pace, Row, Subject};
use foldfront::experiment::path::Path;
use foldfront::experiment::store::Store;
use foldfront::page_store::Simulated;
use foldfront::page_store::source::{FileSource, PageSource};

use crate::{FRAME, open, options};

/// Frames of each path that are replayed.
const FRAMES: usize = 600;

/// Replays on virtual time of which the fastest counts.
const TIMES: usize = 5;

const SCHEMES: [Loading; 2] = [Loading::Paper, Loading::Schedule];

const LATENCIES: [Duration; 2] = [Duration::ZERO, Duration::from_millis(50)];

pub fn heading() {
    println!(
        "{:8} {:9} {:>5} {:>8} {:>8} {:>8} {:>8}  times those of the instant store",
        "path", "prefetch", "ms", "median", "99 %", "99.9 %", "misses"
    );
}

/// The least time of each frame over several replays that are the same.
pub fn virtual_time(file: &FilePath, mesh: &str, walk: &Path, page_memory: u64) {
    let mut subject = Subject::of_store(mesh, open(file));
    for prefetch in SCHEMES {
        let [instant, slow] = LATENCIES.map(|latency| {
            let store = Simulated { depth: 1, ..Simulated::with_latency(latency) };
            let options = options(Pace::Simulated(FRAME, store), page_memory, vec![prefetch]);
            let mut replay = || {
                let frames = 0..walk.frames.len().min(FRAMES);
                let mut runs = subject.replay(walk, frames, &options, &mut |_, _| ()).expect("a valid file");
                runs.swap_remove(0).rows
            };
            let mut rows = replay();
            for _ in 1..TIMES {
                for (row, again) in rows.iter_mut().zip(replay()) {
                    assert_eq!(
                        row.report.cut_hash, again.report.cut_hash,
                        "a replay on virtual time repeats itself"
                    );
                    row.report.select = row.report.select.min(again.report.select);
                }
            }
            Times::new(&rows)
        });
        print(walk, prefetch, &instant, &slow);
    }
}

/// A store that is slow once it is told to: a first frame is waited for, and shall not take minutes.
#[derive(Debug)]
struct SlowLater {
    source: FileSource,
    latency_ms: AtomicU64,
}

impl PageSource for SlowLater {
    fn name(&self) -> &str {
        self.source.name()
    }
    fn len(&self) -> u64 {
        self.source.len()
    }
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> std::io::Result<()> {
        std::thread::sleep(Duration::from_millis(self.latency_ms.load(Ordering::Relaxed)));
        self.source.read_at(offset, buffer)
    }
}

/// Real threads and a frame every sixtieth of a second.
pub fn wall_clock(file: &FilePath, mesh: &str, walk: &Path, page_memory: u64) {
    for prefetch in SCHEMES {
        let [instant, slow] = LATENCIES.map(|latency| {
            let source = FileSource::open(file).expect("a valid file");
            let source = Arc::new(SlowLater { source, latency_ms: AtomicU64::new(0) });
            let store = Store::from_source(source.clone()).expect("a valid file");
            let options = options(Pace::WallClock(FRAME), page_memory, vec![prefetch]);
            let mut slow_down = |_, _| source.latency_ms.store(latency.as_millis() as u64, Ordering::Relaxed);
            let runs = Subject::of_store(mesh, store)
                .replay(walk, 0..walk.frames.len().min(FRAMES), &options, &mut slow_down)
                .expect("a valid file");
            Times::new(&runs[0].rows)
        });
        print(walk, prefetch, &instant, &slow);
    }
}

/// What the frames of a replay took.
struct Times {
    /// Median, 99th and 99.9th percentile, in microseconds.
    percentiles: [f64; 3],
    misses: u64,
}

impl Times {
    /// The first frame, which waits for its pages, is left out.
    fn new(rows: &[Row]) -> Self {
        let rows = &rows[1..];
        let mut times: Vec<Duration> = rows.iter().map(|row| row.report.select).collect();
        times.sort_unstable();
        let at = |share: f64| times[((share * times.len() as f64).ceil() as usize).max(1) - 1];
        Self {
            percentiles: [0.5, 0.99, 0.999].map(|share| at(share).as_secs_f64() * 1e6),
            misses: rows.iter().map(|row| row.report.misses).sum(),
        }
    }
}

fn print(walk: &Path, prefetch: Loading, instant: &Times, slow: &Times) {
    for (times, latency) in [instant, slow].into_iter().zip(LATENCIES) {
        let [median, most, all] = times.percentiles;
        print!(
            "{:8} {:9} {:5} {median:8.0} {most:8.0} {all:8.0} {:8}",
            walk.name,
            prefetch.name(),
            latency.as_millis(),
            times.misses
        );
        if latency.is_zero() {
            println!();
        } else {
            let ratio = |i: usize| slow.percentiles[i] / instant.percentiles[i];
            println!("  {:.2}, {:.2}, {:.2}", ratio(0), ratio(1), ratio(2));
        }
    }
}
