//! The comparison as one self-contained HTML page: tables, curves and pictures.

use std::fmt::Write;
use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

use crate::compare::Run;
use crate::compare::csv::Summary;
use crate::plot::{self, Plot, PlotError, Series};
use crate::refine::Strategy;

/// A picture with what it shows.
#[derive(Clone, Debug)]
pub struct Picture {
    /// One sentence.
    pub caption: String,
    /// The picture, as a PNG file.
    pub png: Vec<u8>,
}

/// All about one scene.
#[derive(Clone, Debug)]
pub struct Section {
    /// What was looked at.
    pub name: String,
    /// Figures of the hierarchy, as name and value.
    pub facts: Vec<(&'static str, String)>,
    /// Every strategy along every path, those of one path together.
    pub runs: Vec<Run>,
    /// What it looks like.
    pub pictures: Vec<Picture>,
}

impl Section {
    fn paths(&self) -> impl Iterator<Item = &[Run]> {
        self.runs.chunk_by(|a, b| a.path == b.path)
    }

    /// Selection time along every path, one curve a strategy, a panel a path.
    ///
    /// # Errors
    /// What [`plot::curves`] says.
    pub fn curves(&self) -> Result<String, PlotError> {
        let panels: Vec<String> =
            self.paths().map(|runs| panel(&self.name, runs)).collect::<Result<_, _>>()?;
        Ok(plot::stack(&panels))
    }
}

fn panel(scene: &str, runs: &[Run]) -> Result<String, PlotError> {
    let values: Vec<Vec<f64>> =
        runs.iter().map(|run| run.rows.iter().map(|row| milliseconds(row.report.select)).collect()).collect();
    let series: Vec<Series> = runs
        .iter()
        .zip(&values)
        .map(|(run, values)| Series {
            name: run.strategy.name(),
            values,
            colour: Strategy::ALL.iter().position(|&s| s == run.strategy).unwrap_or(0),
        })
        .collect();
    let plot = Plot {
        title: &format!("{scene}, path {}", runs[0].path),
        x_label: "frame",
        y_label: "selection time, ms",
        first_frame: runs[0].rows.first().map_or(0, |row| row.frame),
        logarithmic: true,
        median_window: 15,
    };
    plot::curves(&plot, &series)
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

fn microseconds(time: Duration) -> String {
    let value = time.as_secs_f64() * 1e6;
    if value < 100.0 { format!("{value:.1}") } else { format!("{value:.0}") }
}

/// Columns of the table of a path. The report explains each below its first table.
const COLUMNS: [(&str, &str); 12] = [
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
        "nodes whose status is not the oracle's, mean and most in a frame, where that was checked",
    ),
    ("vs top-down", "median of top-down over this median"),
];

fn table_rows(runs: &[Run]) -> Vec<[String; COLUMNS.len()]> {
    let summaries: Vec<Summary> = runs.iter().map(Summary::new).collect();
    let top_down = runs.iter().position(|run| run.strategy == Strategy::TopDown).map(|at| summaries[at]);
    let row = |(run, s): (&Run, &Summary)| {
        let ratio = top_down.map(|t| t.select_median.as_secs_f64() / s.select_median.as_secs_f64().max(1e-9));
        [
            run.strategy.name().to_owned(),
            microseconds(s.select_median),
            microseconds(s.select_p99),
            microseconds(s.find_median),
            microseconds(s.apply_median),
            format!("{:.0}", s.tests_mean),
            format!("{:.1}", s.changes_mean),
            format!("{:.1}", s.tests_mean / s.changes_mean.max(1e-9)),
            format!("{:.0}", s.active_nodes_mean),
            format!("{:.0}", s.triangles_mean),
            s.wrong.map_or_else(String::new, |w| format!("{:.1}, {}", w.mean, w.largest)),
            ratio.map_or_else(String::new, |r| format!("{r:.1} ×")),
        ]
    };
    runs.iter().zip(&summaries).map(row).collect()
}

/// Everything that was compared.
#[derive(Clone, Debug)]
pub struct Report {
    /// The command that made it.
    pub command: String,
    /// The scenes.
    pub sections: Vec<Section>,
}

impl Report {
    /// The tables, in plain text.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        for runs in self.sections.iter().flat_map(Section::paths) {
            let header = COLUMNS.map(|(name, _)| name.to_owned());
            let rows: Vec<_> = std::iter::once(header).chain(table_rows(runs)).collect();
            let width = |column: usize| rows.iter().map(|r| r[column].chars().count()).max().unwrap_or(0);
            let widths: [usize; COLUMNS.len()] = std::array::from_fn(width);
            let _ = writeln!(text, "\n{}, {}, path {}", runs[0].scene, runs[0].backend, runs[0].path);
            for row in &rows {
                for (at, (cell, width)) in row.iter().zip(widths).enumerate() {
                    let _ = if at == 0 {
                        write!(text, "{cell:width$}")
                    } else {
                        write!(text, "  {cell:>width$}")
                    };
                }
                text.truncate(text.trim_end().len());
                text.push('\n');
            }
        }
        text
    }

    /// The page.
    ///
    /// # Errors
    /// What [`plot::curves`] says.
    pub fn to_html(&self) -> Result<String, PlotError> {
        let mut html = String::new();
        let _ = write!(
            html,
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width\">\n<title>foldfront: comparison</title>\n\
             <style>{STYLE}</style>\n<h1>foldfront: comparison of refinement strategies</h1>\n\
             <p>Made by <code>{}</code>. Every strategy replays the same path from the base mesh on, in one process, \
             one after the other, with the displayed mesh kept. Times are of the refinement step on one core.</p>\n",
            escape(&self.command),
        );
        self.overview(&mut html);
        for section in &self.sections {
            section_html(&mut html, section)?;
        }
        html.push_str("<h2>Columns</h2>\n<dl>\n");
        for (name, meaning) in COLUMNS {
            let _ = writeln!(html, "<dt>{}<dd>{}", escape(name), escape(meaning));
        }
        html.push_str("</dl>\n</html>\n");
        Ok(html)
    }

    /// One line a path: who is fastest, and by how much.
    fn overview(&self, html: &mut String) {
        html.push_str("<table>\n<tr><th>scene<th>path<th>frames");
        for strategy in Strategy::ALL {
            let _ = write!(html, "<th>{}, median µs", strategy.name());
        }
        html.push_str("<th>event vs top-down\n");
        for runs in self.sections.iter().flat_map(Section::paths) {
            let median = |strategy| {
                let run = runs.iter().find(|run| run.strategy == strategy)?;
                Some(Summary::new(run).select_median)
            };
            let _ = write!(
                html,
                "<tr><td>{}<td>{}<td>{}",
                escape(&runs[0].scene),
                escape(&runs[0].path),
                runs[0].rows.len()
            );
            for strategy in Strategy::ALL {
                let _ = write!(html, "<td>{}", median(strategy).map_or_else(String::new, microseconds));
            }
            let ratio =
                median(Strategy::TopDown).zip(median(Strategy::Event)).map_or_else(String::new, |(t, e)| {
                    format!("{:.1} ×", t.as_secs_f64() / e.as_secs_f64().max(1e-9))
                });
            let _ = writeln!(html, "<td>{ratio}");
        }
        html.push_str("</table>\n");
    }
}

fn section_html(html: &mut String, section: &Section) -> Result<(), PlotError> {
    let _ = writeln!(html, "<h2>{}</h2>\n<table class=\"facts\">", escape(&section.name));
    for (name, value) in &section.facts {
        let _ = writeln!(html, "<tr><th>{}<td>{}", escape(name), escape(value));
    }
    let _ = writeln!(html, "</table>\n<figure>{}</figure>", section.curves()?);
    for runs in section.paths() {
        let speed = runs[0].speed;
        let _ = writeln!(
            html,
            "<h3>Path {}</h3>\n<p>Declared full speed: rho = {:.4} object units, omega = {:.5} rad a frame.</p>",
            escape(&runs[0].path),
            speed.rho,
            speed.omega,
        );
        html.push_str("<table>\n<tr>");
        for (name, _) in COLUMNS {
            let _ = write!(html, "<th>{}", escape(name));
        }
        html.push('\n');
        for row in table_rows(runs) {
            html.push_str("<tr>");
            for cell in row {
                let _ = write!(html, "<td>{}", escape(&cell));
            }
            html.push('\n');
        }
        html.push_str("</table>\n");
        for run in runs.iter().filter(|run| !run.strategy.is_exact()) {
            if let Some(wrong) = Summary::new(run).wrong {
                let _ = writeln!(
                    html,
                    "<p>{} is not exact: it has wrong nodes in {:.1} % of the frames, {:.1} on average and up to {} \
                     in a frame.</p>",
                    run.strategy.name(),
                    wrong.frames_percent,
                    wrong.mean,
                    wrong.largest,
                );
            }
        }
    }
    html.push_str("<div class=\"pictures\">\n");
    for picture in &section.pictures {
        let _ = writeln!(
            html,
            "<figure><img alt=\"\" src=\"data:image/png;base64,{}\"><figcaption>{}</figcaption></figure>",
            STANDARD.encode(&picture.png),
            escape(&picture.caption),
        );
    }
    html.push_str("</div>\n");
    Ok(())
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

const STYLE: &str = "
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 76rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; font-weight: 600; }
h2 { margin-top: 3rem; border-bottom: 1px solid #ccc; }
code { background: #f3f3f3; padding: 0 .25em; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: 1rem 0; font-size: 14px; }
th, td { padding: .25rem .75rem; text-align: right; border-bottom: 1px solid #e5e5e5; }
th { font-weight: 600; vertical-align: bottom; }
th:first-child, td:first-child, .facts td { text-align: left; }
figure { margin: 1rem 0; }
figure svg, figure img { max-width: 100%; height: auto; }
figcaption { color: #555; font-size: 14px; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(30rem, 1fr)); gap: 1rem; }
dt { font-weight: 600; }
";
