//! The tables of a report: each a header and rows, with what its columns mean.

use std::fmt::Write;
use std::time::Duration;

use super::section::Section;
use crate::experiment::compare::Run;
use crate::experiment::compare::csv::Summary;
use crate::experiment::store::Backend;
use selection::refine::Strategy;

/// A table, and what its columns mean.
pub(super) struct Table {
    pub columns: &'static [(&'static str, &'static str)],
    pub rows: Vec<Vec<String>>,
}

/// Columns of the table of strategies.
pub(super) const STRATEGIES: &[(&str, &str)] = &[
    ("strategy", "how the nodes that must change are found"),
    ("median µs", "the whole refinement step, median over the frames"),
    ("99 % µs", "the same, 99th percentile"),
    ("find µs", "the part that finds what must change, median"),
    ("apply µs", "the part that folds, unfolds and patches the mesh, median"),
    ("tests", "tests of the criterion a frame"),
    ("changes", "folds and unfolds a frame"),
    ("tests / change", "the ideal is 1"),
    ("active nodes", "mean over the frames"),
    ("triangles", "displayed, mean over the frames"),
    (
        "wrong nodes",
        "nodes whose status is not the oracle's, mean and most in a frame, where that was checked; what a late page keeps \
         back is wrong here too",
    ),
    ("vs top-down", "median of top-down over this median"),
];

/// Columns of the table of paging.
pub(super) const PAGING: &[(&str, &str)] = &[
    ("backend", "where the hierarchy is kept"),
    (
        "prefetch",
        "how pages are loaded: paper is the backend's published scheme made asynchronous, printed El-Sana & Chiang's to the \
         letter, blocking lets frames wait, schedule is the engine's foresight, none is on demand",
    ),
    ("misses", "nodes whose change was refused for want of a page, each counted once a frame"),
    ("% of flips", "misses as a share of the changes that were wanted"),
    ("reads", "read operations, those of the first frame included"),
    ("MiB read", "bytes that these brought"),
    ("precision %", "of the pages fetched ahead, those that a change has used"),
    (
        "recall %",
        "of the pages that were fetched after the first frame and that a change needed, those fetched ahead of it",
    ),
    ("I/O limited %", "frames whose detail was kept down by pages that had not come"),
    ("memory limited %", "frames whose detail was kept down by pages that there was no room for"),
    ("peak MiB", "most bytes of the hierarchy in memory"),
    (
        "stalled ms",
        "what changes have waited for the store: virtual time with --fps, where only blocking waits",
    ),
    ("faults", "reads that failed, or brought what is damaged; what they keep back is not displayed"),
];

/// Columns of the table of files and construction.
pub(super) const STORAGE: &[(&str, &str)] = &[
    ("scene", "what was built from"),
    ("backend", "what for"),
    ("triangles", "of the input"),
    ("file MiB", "size of the file; for in-memory, of the collapse log"),
    ("bytes a triangle", "the same for each triangle of the input"),
    ("simplification s", "making the collapse log, the same for every backend"),
    ("µs a triangle", "the same for each triangle of the input"),
    ("writing s", "arranging the log as the backend's file"),
    ("µs a triangle", "the same for each triangle of the input"),
];

/// The strategies along one path, with one backend and one way to prefetch.
pub(super) fn strategies(runs: &[Run]) -> Table {
    let summaries: Vec<Summary> = runs.iter().map(Summary::new).collect();
    let top_down = runs.iter().position(|run| run.strategy == Strategy::TopDown).map(|at| summaries[at]);
    let row = |(run, s): (&Run, &Summary)| {
        let ratio = top_down.map(|t| t.select_median.as_secs_f64() / s.select_median.as_secs_f64().max(1e-9));
        vec![
            run.strategy.name().to_owned(),
            microseconds(s.select_median),
            microseconds(s.select_p99),
            microseconds(s.find_median),
            microseconds(s.apply_median),
            format!("{:.0}", s.tests_mean),
            format!("{:.1}", s.changes_mean),
            // Where nothing changes there is no ratio.
            if s.changes_mean > 0.0 {
                format!("{:.1}", s.tests_mean / s.changes_mean)
            } else {
                "–".to_owned()
            },
            format!("{:.0}", s.active_nodes_mean),
            format!("{:.0}", s.triangles_mean),
            s.wrong.map_or_else(String::new, |w| format!("{:.1}, {}", w.mean, w.largest)),
            ratio.map_or_else(String::new, |r| format!("{r:.1} ×")),
        ]
    };
    Table { columns: STRATEGIES, rows: runs.iter().zip(&summaries).map(row).collect() }
}

/// Backends and ways to prefetch along one path, with one strategy.
pub(super) fn paging(runs: &[&Run]) -> Table {
    let row = |run: &&Run| {
        let s = Summary::new(run);
        let misses: u64 = run.rows.iter().map(|row| row.report.misses).sum();
        let percent = |share: Option<f64>| share.map_or_else(String::new, |share| format!("{share:.1}"));
        vec![
            run.backend.to_owned(),
            run.prefetch.name().to_owned(),
            misses.to_string(),
            format!("{:.3}", s.miss_percent),
            s.reads.to_string(),
            mebibytes(s.read_bytes),
            percent(s.precision),
            percent(s.recall),
            format!("{:.1}", s.io_limited),
            format!("{:.1}", s.memory_limited),
            mebibytes(s.peak_resident_bytes),
            format!("{:.1}", 1e3 * s.stalled.as_secs_f64()),
            s.faults.to_string(),
        ]
    };
    Table { columns: PAGING, rows: runs.iter().map(row).collect() }
}

/// What was built, and what that took.
pub(super) fn storage(sections: &[Section]) -> Table {
    let row = |section: &Section| {
        let per = |time: Option<Duration>| {
            let each = |time: Duration| time.as_secs_f64() * 1e6 / section.triangles.max(1) as f64;
            [
                time.map_or_else(String::new, |time| format!("{:.2}", time.as_secs_f64())),
                time.map_or_else(String::new, |time| format!("{:.2}", each(time))),
            ]
        };
        let [simplifying, simplifying_each] = per(section.simplification);
        let [writing, writing_each] = per(section.writing);
        vec![
            section.scene.clone(),
            section.backend.to_owned(),
            section.triangles.to_string(),
            section.file_bytes.map_or_else(String::new, mebibytes),
            section.file_bytes.map_or_else(String::new, |bytes| {
                format!("{:.1}", bytes as f64 / section.triangles.max(1) as f64)
            }),
            simplifying,
            simplifying_each,
            writing,
            writing_each,
        ]
    };
    Table { columns: STORAGE, rows: sections.iter().map(row).collect() }
}

/// The runs of a scene along one path that tell of paging: those of the strategy that is best at it, and of backends that
/// page.
pub(super) fn paged<'a>(runs: &[&'a Run]) -> Vec<&'a Run> {
    let strategies =
        [Strategy::Event, Strategy::EventQueue, Strategy::Front, Strategy::TopDown, Strategy::EventPublished];
    let is_there = |strategy: &Strategy| runs.iter().any(|run| run.strategy == *strategy);
    let strategy = strategies.into_iter().find(is_there);
    let pages = |run: &Run| run.backend != Backend::InMemory.name();
    runs.iter().copied().filter(|run| Some(run.strategy) == strategy && pages(run)).collect()
}

impl Table {
    /// As lines of text.
    pub fn to_text(&self, text: &mut String) {
        let header: Vec<String> = self.columns.iter().map(|(name, _)| (*name).to_owned()).collect();
        let rows: Vec<&Vec<String>> = std::iter::once(&header).chain(&self.rows).collect();
        let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..header.len()).map(width).collect();
        for row in &rows {
            for (at, (cell, &width)) in row.iter().zip(&widths).enumerate() {
                let _ =
                    if at == 0 { write!(text, "{cell:width$}") } else { write!(text, "  {cell:>width$}") };
            }
            text.truncate(text.trim_end().len());
            text.push('\n');
        }
    }

    pub fn to_html(&self, html: &mut String) {
        html.push_str("<table>\n<tr>");
        for (name, meaning) in self.columns {
            let _ = write!(html, "<th title=\"{}\">{}", escape(meaning), escape(name));
        }
        html.push('\n');
        for row in &self.rows {
            html.push_str("<tr>");
            for cell in row {
                let _ = write!(html, "<td>{}", escape(cell));
            }
            html.push('\n');
        }
        html.push_str("</table>\n");
    }
}

pub(super) fn microseconds(time: Duration) -> String {
    let value = time.as_secs_f64() * 1e6;
    if value < 100.0 { format!("{value:.1}") } else { format!("{value:.0}") }
}

fn mebibytes(bytes: u64) -> String {
    let value = bytes as f64 / f64::from(1 << 20);
    if value < 100.0 { format!("{value:.2}") } else { format!("{value:.0}") }
}

/// Text as it stands in a page.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
