//! The curves of a report.

use super::section::Section;
use crate::experiment::compare::csv::Summary;
use crate::experiment::compare::{Row, Run};
use crate::experiment::plot::{self, Line, Plot, PlotError, Series};
use selection::engine::FrameReport;
use selection::refine::Strategy;

/// Something that is drawn frame by frame.
pub(super) struct Quantity {
    pub name: &'static str,
    /// With its unit.
    label: &'static str,
    logarithmic: bool,
    median_window: usize,
    /// Whether the first frame, which reads the whole cut, would flatten all others.
    leaves_out_first: bool,
    value: fn(&FrameReport) -> f64,
}

pub(super) const SELECTION: Quantity = Quantity {
    name: "selection time",
    label: "selection time, ms",
    logarithmic: true,
    median_window: 15,
    leaves_out_first: false,
    value: |report| report.select.as_secs_f64() * 1e3,
};

pub(super) const TESTS: Quantity = Quantity {
    name: "tests of the criterion",
    label: "tests a frame",
    logarithmic: true,
    median_window: 15,
    leaves_out_first: false,
    value: |report| report.tests as f64,
};

pub(super) const CHANGES: Quantity = Quantity {
    name: "folds and unfolds",
    label: "changes a frame",
    logarithmic: true,
    median_window: 15,
    leaves_out_first: false,
    value: |report| (report.unfolds + report.folds) as f64,
};

/// What paging does in a frame.
pub(super) const PAGING: [Quantity; 4] = [
    Quantity {
        name: "misses",
        label: "misses a frame (without the first)",
        logarithmic: false,
        median_window: 0,
        leaves_out_first: true,
        value: |report| report.misses as f64,
    },
    Quantity {
        name: "reads",
        label: "reads a frame (without the first)",
        logarithmic: false,
        median_window: 15,
        leaves_out_first: true,
        value: |report| report.pages.reads as f64,
    },
    Quantity {
        name: "bytes read",
        label: "KiB read a frame (without the first)",
        logarithmic: false,
        median_window: 15,
        leaves_out_first: true,
        value: |report| report.pages.read_bytes as f64 / 1024.0,
    },
    Quantity {
        name: "resident memory",
        label: "MiB of the hierarchy in memory",
        logarithmic: false,
        median_window: 0,
        leaves_out_first: false,
        value: |report| report.pages.resident_bytes as f64 / f64::from(1 << 20),
    },
];

/// A quantity along a path, one curve for each run.
pub(super) fn panel(
    title: &str,
    quantity: &Quantity,
    runs: &[&Run],
    name: impl Fn(&Run) -> (String, usize),
) -> Result<String, PlotError> {
    let value = |(at, row): (usize, &Row)| match at {
        0 if quantity.leaves_out_first => f64::NAN,
        _ => (quantity.value)(&row.report),
    };
    let values: Vec<Vec<f64>> =
        runs.iter().map(|run| run.rows.iter().enumerate().map(value).collect()).collect();
    let names: Vec<(String, usize)> = runs.iter().map(|run| name(run)).collect();
    let series: Vec<Series> = names
        .iter()
        .zip(&values)
        .map(|((name, colour), values)| Series { name, values, colour: *colour })
        .collect();
    let plot = Plot {
        title,
        x_label: "frame",
        y_label: quantity.label,
        first_frame: runs.first().and_then(|run| run.rows.first()).map_or(0, |row| row.frame),
        logarithmic: quantity.logarithmic,
        median_window: quantity.median_window,
    };
    plot::curves(&plot, &series)
}

/// Name and colour of a strategy's curve.
pub(super) fn by_strategy(run: &Run) -> (String, usize) {
    let colour = Strategy::ALL.iter().position(|&s| s == run.strategy).unwrap_or(0);
    (run.strategy.name().to_owned(), colour)
}

/// Name and colour of the curve of a way to prefetch.
pub(super) fn by_prefetch(run: &Run) -> (String, usize) {
    let colour =
        crate::experiment::compare::Loading::ALL.iter().position(|&p| p == run.prefetch).unwrap_or(0);
    (format!("{}, prefetch {}", run.backend, run.prefetch.name()), colour)
}

/// Median selection time over the size of the mesh, one line a strategy, a panel a backend; for scenes that are there in
/// several sizes, as in `scene:alps@1` and `scene:alps@2`.
pub(super) fn scaling(sections: &[Section]) -> Result<Vec<String>, PlotError> {
    let base = |section: &Section| section.scene.split('@').next().unwrap_or_default().to_owned();
    let mut groups: Vec<(String, Vec<&Section>)> = Vec::new();
    for section in sections {
        let name = format!("{}, {}", base(section), section.backend);
        match groups.iter_mut().find(|(group, _)| *group == name) {
            Some((_, members)) => members.push(section),
            None => groups.push((name, vec![section])),
        }
    }
    let mut panels = Vec::new();
    for (name, mut members) in groups {
        members.sort_by_key(|section| section.triangles);
        members.dedup_by_key(|section| section.triangles);
        if members.len() < 2 {
            continue;
        }
        let line = |strategy: Strategy| {
            let point = |section: &&Section| {
                let medians: Vec<f64> = section
                    .runs
                    .iter()
                    .filter(|run| run.strategy == strategy)
                    .map(|run| Summary::new(run).select_median.as_secs_f64() * 1e3)
                    .collect();
                let mean = medians.iter().sum::<f64>() / medians.len().max(1) as f64;
                (section.triangles as f64, mean)
            };
            let colour = Strategy::ALL.iter().position(|&s| s == strategy).unwrap_or(0);
            Line { name: strategy.name(), points: members.iter().map(point).collect(), colour }
        };
        let is_there = |strategy: &Strategy| members[0].runs.iter().any(|run| run.strategy == *strategy);
        let lines: Vec<Line> = Strategy::ALL.into_iter().filter(is_there).map(line).collect();
        let plot = Plot {
            title: &format!("{name}: selection and the size of the mesh"),
            x_label: "triangles of the input",
            y_label: "median selection time, ms",
            ..Plot::default()
        };
        panels.push(plot::lines(&plot, &lines)?);
    }
    Ok(panels)
}
