//! `frames.csv` and `summary.csv`: the columns are a contract that other programs rely on.

use std::time::Duration;

use vertex_tree::PageStats;

use super::run::Run;
use selection::engine::Limit;

/// Columns of `frames.csv`: one row per scene, path, backend, strategy and frame. What is added comes last.
const FRAMES: [&str; 25] = [
    "scene",
    "path",
    "backend",
    "strategy",
    "prefetch",
    "frame",
    "select_ns",
    "apply_ns",
    "tests",
    "unfolds",
    "folds",
    "forced",
    "blocked",
    "carried",
    "misses",
    "wrong",
    "limit",
    "active_nodes",
    "triangles",
    "reads",
    "read_bytes",
    "resident_bytes",
    "cut_hash",
    "stall_ns",
    "faults",
];

/// Columns of `summary.csv`: one row per scene, path, backend, strategy and way to load. What is added comes last.
const SUMMARY: [&str; 22] = [
    "scene",
    "path",
    "backend",
    "strategy",
    "prefetch",
    "frames",
    "select_ns_median",
    "select_ns_mean",
    "select_ns_p99",
    "apply_ns_median",
    "tests_mean",
    "changes_mean",
    "active_nodes_mean",
    "triangles_mean",
    "miss_percent",
    "reads",
    "read_bytes",
    "peak_resident_bytes",
    "stall_ns",
    "faults",
    "wrong_mean",
    "wrong_max",
];

/// Figures of a run that its tables show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Frames replayed.
    pub frames: usize,
    /// Median, mean and 99th percentile of the refinement step.
    pub select_median: Duration,
    /// See [`Self::select_median`].
    pub select_mean: Duration,
    /// See [`Self::select_median`].
    pub select_p99: Duration,
    /// Median of the part spent on status changes.
    pub apply_median: Duration,
    /// Median of the rest: finding what changes.
    pub find_median: Duration,
    /// Tests of the criterion a frame.
    pub tests_mean: f64,
    /// Folds and unfolds a frame.
    pub changes_mean: f64,
    /// Active nodes.
    pub active_nodes_mean: f64,
    /// Displayed triangles.
    pub triangles_mean: f64,
    /// Refused flips as a share of wanted ones.
    pub miss_percent: f64,
    /// Read operations.
    pub reads: u64,
    /// Bytes read.
    pub read_bytes: u64,
    /// Share of the pages fetched ahead that a change has used, in percent; `None` where none was fetched ahead.
    pub precision: Option<f64>,
    /// Share of the pages that a change has used and that were fetched ahead, among these and those that were fetched when
    /// a change had been refused, in percent.
    pub recall: Option<f64>,
    /// Frames in which pages that were not there kept the detail down, and those in which that was for want of memory, in
    /// percent.
    pub io_limited: f64,
    /// See [`Self::io_limited`].
    pub memory_limited: f64,
    /// Most bytes of the hierarchy in memory at once.
    pub peak_resident_bytes: u64,
    /// How long changes have waited for the store, see [`PageStats::stalled`].
    pub stalled: Duration,
    /// Reads that failed or brought a damaged page.
    pub faults: u64,
    /// Where it was looked at: the largest and the mean number of nodes that differ from the oracle, and the share of
    /// frames in which any does.
    pub wrong: Option<Wrong>,
}

/// How far a strategy that is not exact was from the oracle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrong {
    /// Most wrong nodes in a frame.
    pub largest: u64,
    /// Wrong nodes a frame.
    pub mean: f64,
    /// Frames with a wrong node, in percent.
    pub frames_percent: f64,
}

/// The value that a share `q` of the sorted values do not exceed, by the nearest rank; 0 if there is none.
fn percentile(sorted: &[Duration], q: f64) -> Duration {
    let rank = (q * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied().unwrap_or_default()
}

impl Summary {
    /// Sums up a run.
    #[must_use]
    pub fn new(run: &Run) -> Self {
        let frames = run.rows.len();
        let sorted = |f: &dyn Fn(&super::Row) -> Duration| {
            let mut all: Vec<_> = run.rows.iter().map(f).collect();
            all.sort_unstable();
            all
        };
        let mean = |f: &dyn Fn(&super::Row) -> u64| {
            run.rows.iter().map(f).sum::<u64>() as f64 / frames.max(1) as f64
        };
        let select = sorted(&|r| r.report.select);
        let changes = mean(&|r| r.report.unfolds + r.report.folds);
        let misses = mean(&|r| r.report.misses);
        // What the first frame reads, nothing could have foreseen.
        let paged =
            |f: &dyn Fn(&PageStats) -> u64| run.rows.iter().skip(1).map(|r| f(&r.report.pages)).sum::<u64>();
        let (ahead, used) = (paged(&|p| p.ahead), paged(&|p| p.ahead_used));
        let demanded = paged(&|p| p.reads.saturating_sub(p.ahead));
        let percent = |part: u64, whole: u64| (whole > 0).then(|| 100.0 * part as f64 / whole as f64);
        let limited = |limit| {
            let count = run.rows.iter().filter(|r| r.report.limit == limit).count();
            100.0 * count as f64 / frames.max(1) as f64
        };
        let wrong: Vec<u64> = run.rows.iter().filter_map(|r| r.wrong).collect();
        Self {
            frames,
            select_median: percentile(&select, 0.5),
            select_mean: select.iter().sum::<Duration>() / frames.max(1) as u32,
            select_p99: percentile(&select, 0.99),
            apply_median: percentile(&sorted(&|r| r.report.apply), 0.5),
            find_median: percentile(&sorted(&|r| r.report.select - r.report.apply), 0.5),
            tests_mean: mean(&|r| r.report.tests),
            changes_mean: changes,
            active_nodes_mean: mean(&|r| r.report.active_nodes),
            triangles_mean: mean(&|r| r.report.displayed),
            miss_percent: if misses > 0.0 { 100.0 * misses / (misses + changes) } else { 0.0 },
            reads: run.rows.iter().map(|r| r.report.pages.reads).sum(),
            read_bytes: run.rows.iter().map(|r| r.report.pages.read_bytes).sum(),
            precision: percent(used.min(ahead), ahead),
            recall: percent(used, used + demanded).filter(|_| ahead > 0),
            io_limited: limited(Limit::Io),
            memory_limited: limited(Limit::Memory),
            peak_resident_bytes: run.rows.iter().map(|r| r.report.pages.resident_bytes).max().unwrap_or(0),
            stalled: run.rows.iter().map(|r| r.report.pages.stalled).sum(),
            faults: run.rows.iter().map(|r| r.report.pages.faults).sum(),
            wrong: (!wrong.is_empty()).then(|| Wrong {
                largest: wrong.iter().copied().max().unwrap_or(0),
                mean: wrong.iter().sum::<u64>() as f64 / wrong.len() as f64,
                frames_percent: 100.0 * wrong.iter().filter(|&&w| w > 0).count() as f64 / wrong.len() as f64,
            }),
        }
    }
}

/// The text of `frames.csv`.
#[must_use]
pub fn frames(runs: &[&Run]) -> Vec<u8> {
    text(&FRAMES, |out| {
        for run in runs {
            for row in &run.rows {
                let r = &row.report;
                out.write_record([
                    run.scene.clone(),
                    run.path.clone(),
                    run.backend.to_owned(),
                    run.strategy.name().to_owned(),
                    run.prefetch.name().to_owned(),
                    row.frame.to_string(),
                    r.select.as_nanos().to_string(),
                    r.apply.as_nanos().to_string(),
                    r.tests.to_string(),
                    r.unfolds.to_string(),
                    r.folds.to_string(),
                    r.forced.to_string(),
                    r.blocked.to_string(),
                    r.carried.to_string(),
                    r.misses.to_string(),
                    row.wrong.map_or_else(String::new, |w| w.to_string()),
                    r.limit.name().to_owned(),
                    r.active_nodes.to_string(),
                    r.displayed.to_string(),
                    r.pages.reads.to_string(),
                    r.pages.read_bytes.to_string(),
                    r.pages.resident_bytes.to_string(),
                    format!("{:016x}", r.cut_hash),
                    r.pages.stalled.as_nanos().to_string(),
                    r.pages.faults.to_string(),
                ])?;
            }
        }
        Ok(())
    })
}

/// The text of `summary.csv`.
#[must_use]
pub fn summary(runs: &[&Run]) -> Vec<u8> {
    text(&SUMMARY, |out| {
        for run in runs {
            let s = Summary::new(run);
            out.write_record([
                run.scene.clone(),
                run.path.clone(),
                run.backend.to_owned(),
                run.strategy.name().to_owned(),
                run.prefetch.name().to_owned(),
                s.frames.to_string(),
                s.select_median.as_nanos().to_string(),
                s.select_mean.as_nanos().to_string(),
                s.select_p99.as_nanos().to_string(),
                s.apply_median.as_nanos().to_string(),
                format!("{:.1}", s.tests_mean),
                format!("{:.1}", s.changes_mean),
                format!("{:.1}", s.active_nodes_mean),
                format!("{:.1}", s.triangles_mean),
                format!("{:.3}", s.miss_percent),
                s.reads.to_string(),
                s.read_bytes.to_string(),
                s.peak_resident_bytes.to_string(),
                s.stalled.as_nanos().to_string(),
                s.faults.to_string(),
                s.wrong.map_or_else(String::new, |w| format!("{:.3}", w.mean)),
                s.wrong.map_or_else(String::new, |w| w.largest.to_string()),
            ])?;
        }
        Ok(())
    })
}

fn text(header: &[&str], rows: impl FnOnce(&mut csv::Writer<Vec<u8>>) -> Result<(), csv::Error>) -> Vec<u8> {
    let mut out = csv::Writer::from_writer(Vec::new());
    let written = out.write_record(header).and_then(|()| rows(&mut out));
    debug_assert!(written.is_ok(), "every row has as many fields as the header: {written:?}");
    // Memory does not fail.
    out.into_inner().unwrap_or_default()
}
