//! The comparison as one self-contained HTML page: tables, curves and pictures.
//!
//! The page is written by hand for now, as the axes of the curves are drawn: both will be made anew together.

mod figures;
mod section;
mod tables;

use std::fmt::Write;
use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

pub use self::section::{Picture, Section};
use self::tables::{escape, microseconds};
use crate::experiment::compare::csv::Summary;
use crate::experiment::compare::{Pace, Run};
use crate::experiment::plot::{self, PlotError};
use selection::refine::Strategy;

impl Section {
    /// A quantity along every path, one curve a strategy, a panel a path.
    fn panels(&self, quantity: &figures::Quantity) -> Result<Vec<String>, PlotError> {
        let panel = |runs: &[Run]| {
            let all: Vec<&Run> = runs.iter().collect();
            figures::panel(
                &format!("{}: {}", self.title(runs), quantity.name),
                quantity,
                &all,
                figures::by_strategy,
            )
        };
        self.replays().map(panel).collect()
    }

    /// Selection time along every path, one curve a strategy, a panel a path; below them the command that made them.
    ///
    /// # Errors
    /// What [`plot::curves`] says.
    pub fn curves(&self, command: &str) -> Result<String, PlotError> {
        let mut panels = self.panels(&figures::SELECTION)?;
        panels.push(plot::small_print(command));
        Ok(plot::stack(&panels))
    }
}

/// Everything that was compared.
#[derive(Clone, Debug)]
pub struct Report {
    /// The command that made it.
    pub command: String,
    /// How time passed.
    pub pace: Pace,
    /// The scenes, all backends of one together.
    pub sections: Vec<Section>,
}

impl Report {
    /// All backends of each scene.
    fn scenes(&self) -> impl Iterator<Item = &[Section]> {
        self.sections.chunk_by(|a, b| a.scene == b.scene)
    }

    /// The tables, in plain text.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        for section in &self.sections {
            for runs in section.replays() {
                let _ = writeln!(text, "\n{}", section.title(runs));
                tables::strategies(runs).to_text(&mut text);
            }
        }
        for scene in self.scenes() {
            for (path, runs) in paths(scene) {
                let paged = tables::paged(&runs);
                if let Some(first) = paged.first() {
                    let _ = writeln!(
                        text,
                        "\n{}, path {path}: paging with {}",
                        scene[0].scene,
                        first.strategy.name()
                    );
                    tables::paging(&paged).to_text(&mut text);
                }
            }
        }
        if self.sections.iter().any(|section| section.file_bytes.is_some()) {
            text.push_str("\nfiles and construction\n");
            tables::storage(&self.sections).to_text(&mut text);
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
             <style>{STYLE}</style>\n<h1>foldfront: comparison of refinement strategies and backends</h1>\n\
             <p>Made by <code>{}</code>. Every strategy replays the same path from the base mesh on, in one process, \
             one after the other, with the displayed mesh kept. Times are of the refinement step on one core. {}</p>\n",
            escape(&self.command),
            escape(&describe(self.pace)),
        );
        self.overview(&mut html);
        if self.sections.iter().any(|section| section.file_bytes.is_some()) {
            html.push_str("<h2>Files and construction</h2>\n");
            tables::storage(&self.sections).to_html(&mut html);
        }
        let scaling = figures::scaling(&self.sections)?;
        if !scaling.is_empty() {
            html.push_str("<h2>Scaling</h2>\n<p>Mean over the paths of each scene.</p>\n");
            self.figure(&mut html, &scaling);
        }
        for scene in self.scenes() {
            self.scene(&mut html, scene)?;
        }
        html.push_str("<h2>Columns</h2>\n<dl>\n");
        for (name, meaning) in
            tables::STRATEGIES.iter().chain(&tables::PAGING[1..]).chain(&tables::STORAGE[2..])
        {
            let _ = writeln!(html, "<dt>{}<dd>{}", escape(name), escape(meaning));
        }
        html.push_str("</dl>\n</html>\n");
        Ok(html)
    }

    fn figure(&self, html: &mut String, panels: &[String]) {
        let _ = writeln!(
            html,
            "<figure>{}<figcaption>Made by <code>{}</code></figcaption></figure>",
            plot::stack(panels),
            escape(&self.command)
        );
    }

    /// One line a replay: who is fastest, and by how much.
    fn overview(&self, html: &mut String) {
        html.push_str("<table>\n<tr><th>scene<th>backend<th>prefetch<th>path<th>frames");
        let is_there = |strategy: &Strategy| {
            let mut runs = self.sections.iter().flat_map(|section| &section.runs);
            runs.any(|run| run.strategy == *strategy)
        };
        let strategies: Vec<Strategy> = Strategy::ALL
            .into_iter()
            .filter(|strategy| Strategy::COMPARED.contains(strategy) || is_there(strategy))
            .collect();
        for strategy in &strategies {
            let _ = write!(html, "<th>{}, median µs", strategy.name());
        }
        html.push_str("<th>event vs top-down<th>misses, % of flips\n");
        for runs in self.sections.iter().flat_map(Section::replays) {
            let summary = |strategy| Some(Summary::new(runs.iter().find(|run| run.strategy == strategy)?));
            let median = |strategy| summary(strategy).map(|s| s.select_median);
            let _ = write!(
                html,
                "<tr><td>{}<td>{}<td>{}<td>{}<td>{}",
                escape(&runs[0].scene),
                runs[0].backend,
                runs[0].prefetch.name(),
                escape(&runs[0].path),
                runs[0].rows.len()
            );
            for &strategy in &strategies {
                let _ = write!(html, "<td>{}", median(strategy).map_or_else(String::new, microseconds));
            }
            let ratio =
                median(Strategy::TopDown).zip(median(Strategy::Event)).map_or_else(String::new, |(t, e)| {
                    format!("{:.1} ×", t.as_secs_f64() / e.as_secs_f64().max(1e-9))
                });
            let misses =
                runs.iter().find(|run| run.strategy.is_exact()).map(|run| Summary::new(run).miss_percent);
            let _ =
                writeln!(html, "<td>{ratio}<td>{}", misses.map_or_else(String::new, |m| format!("{m:.3}")));
        }
        html.push_str("</table>\n");
    }

    /// All backends of one scene.
    fn scene(&self, html: &mut String, sections: &[Section]) -> Result<(), PlotError> {
        let _ = writeln!(html, "<h2>{}</h2>", escape(&sections[0].scene));
        for section in sections {
            let _ = writeln!(html, "<h3>{}</h3>\n<table class=\"facts\">", section.backend);
            for (name, value) in &section.facts {
                let _ = writeln!(html, "<tr><th>{}<td>{}", escape(name), escape(value));
            }
            html.push_str("</table>\n");
            self.figure(html, &section.panels(&figures::SELECTION)?);
            for runs in section.replays() {
                let speed = runs[0].speed;
                let _ = writeln!(
                    html,
                    "<h4>{}</h4>\n<p>Declared full speed: rho = {:.4} object units, omega = {:.5} rad a frame.</p>",
                    escape(&section.title(runs)),
                    speed.rho,
                    speed.omega,
                );
                tables::strategies(runs).to_html(html);
                inexact(html, runs);
            }
            html.push_str("<details><summary>Tests and changes in every frame</summary>\n");
            self.figure(html, &section.panels(&figures::TESTS)?);
            self.figure(html, &section.panels(&figures::CHANGES)?);
            html.push_str("</details>\n<div class=\"pictures\">\n");
            for picture in &section.pictures {
                let _ = writeln!(
                    html,
                    "<figure><img alt=\"\" src=\"data:image/png;base64,{}\"><figcaption>{}</figcaption></figure>",
                    STANDARD.encode(&picture.png),
                    escape(&picture.caption),
                );
            }
            html.push_str("</div>\n");
        }
        for (path, runs) in paths(sections) {
            let paged = tables::paged(&runs);
            if paged.is_empty() {
                continue;
            }
            let _ =
                writeln!(html, "<h3>Paging along {}, with {}</h3>", escape(path), paged[0].strategy.name());
            tables::paging(&paged).to_html(html);
            for quantity in &figures::PAGING {
                let panel = |runs: &[&Run]| {
                    let title =
                        format!("{}, {}, path {path}: {}", runs[0].scene, runs[0].backend, quantity.name);
                    figures::panel(&title, quantity, runs, figures::by_prefetch)
                };
                let panels: Vec<String> =
                    paged.chunk_by(|a, b| a.backend == b.backend).map(panel).collect::<Result<_, _>>()?;
                let _ = writeln!(html, "<details><summary>{} in every frame</summary>", quantity.name);
                self.figure(html, &panels);
                html.push_str("</details>\n");
            }
        }
        Ok(())
    }
}

/// The runs of a scene by path, those of all backends together.
fn paths(sections: &[Section]) -> Vec<(&str, Vec<&Run>)> {
    let mut paths: Vec<(&str, Vec<&Run>)> = Vec::new();
    for run in sections.iter().flat_map(|section| &section.runs) {
        match paths.iter_mut().find(|(path, _)| *path == run.path) {
            Some((_, runs)) => runs.push(run),
            None => paths.push((&run.path, vec![run])),
        }
    }
    paths
}

/// How a strategy that is not exact did.
fn inexact(html: &mut String, runs: &[Run]) {
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

fn describe(pace: Pace) -> String {
    let rate = |frame: Duration| 1.0 / frame.as_secs_f64();
    match pace {
        Pace::Settled => "Each frame waits for its pages, so that cuts can be compared.".to_owned(),
        Pace::Simulated(frame, store) => {
            let bandwidth = store.bandwidth.map_or_else(
                || "no limit on bandwidth".to_owned(),
                |bandwidth| format!("{:.1} MiB a second", bandwidth as f64 / f64::from(1 << 20)),
            );
            format!(
                "Real time of {:.0} frames a second, on virtual time: a simulated store with a latency of {:?}, {bandwidth} \
                 and {} reads under way at most. The first frame waits for its pages.",
                rate(frame),
                store.latency,
                store.depth
            )
        }
        Pace::WallClock(frame) => format!(
            "Real time of {:.0} frames a second by the wall clock, from files as they are. The first frame waits for its \
             pages.",
            rate(frame)
        ),
    }
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
summary { cursor: pointer; color: #0072b2; }
dt { font-weight: 600; }
";
