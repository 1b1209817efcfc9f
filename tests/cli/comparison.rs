//! `compare`: its files are a contract that other programs rely on.

use std::collections::HashMap;

use crate::workplace::Workplace;

const FRAMES: &str = "scene,path,backend,strategy,prefetch,frame,select_ns,apply_ns,tests,unfolds,folds,forced,blocked,\
                      carried,misses,wrong,limit,active_nodes,triangles,reads,read_bytes,resident_bytes,cut_hash,stall_ns,faults";
const SUMMARY: &str = "scene,path,backend,strategy,prefetch,frames,select_ns_median,select_ns_mean,select_ns_p99,\
                       apply_ns_median,tests_mean,changes_mean,active_nodes_mean,triangles_mean,miss_percent,reads,\
                       read_bytes,peak_resident_bytes,stall_ns,faults,wrong_mean,wrong_max";
const STRATEGIES: [&str; 4] = ["top-down", "front", "event", "event-published"];

/// The rows of a table with exactly these columns, by column.
fn table(text: &str, header: &str) -> Vec<HashMap<String, String>> {
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some(header));
    let columns: Vec<&str> = header.split(',').collect();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells.len(), columns.len(), "{line}");
        columns.iter().zip(cells).map(|(&column, cell)| (column.to_owned(), cell.to_owned())).collect()
    };
    lines.map(row).collect()
}

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {row:?}"))
}

/// What a browser would have to fetch.
fn references(page: &str) -> Vec<&str> {
    let names = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!names.contains("http:") && !names.contains("https:"), "an address in the page");
    assert!(!names.contains("file:") && !names.contains("@import") && !names.contains("<script src"));
    let quoted = ["src=\"", "href=\"", "url("].into_iter().flat_map(|attribute| {
        page.match_indices(attribute).map(move |(at, _)| &page[at + attribute.len()..])
    });
    quoted
        .map(|rest| &rest[..rest.len().min(60)])
        .filter(|r| !r.starts_with("data:") && !r.starts_with('#'))
        .collect()
}

#[test]
fn a_comparison_writes_its_tables_curves_and_report() {
    let place = Workplace::new();
    let said = place.succeed("compare scene:laserscan --frames 0..20 --check --out results");
    assert_eq!(
        place.names("results"),
        ["frames.csv", "report.html", "selection-laserscan.svg", "summary.csv"]
    );
    for strategy in STRATEGIES {
        let lines = said.lines().filter(|line| line.split_whitespace().next() == Some(strategy));
        assert_eq!(lines.count(), 2, "a line a path for {strategy} in {said}");
    }

    let frames = table(&place.text("results/frames.csv"), FRAMES);
    assert_eq!(frames.len(), 2 * 4 * 20);
    let mut rows = frames.iter();
    let mut cuts = HashMap::new();
    for path in ["laserscan-calm", "laserscan-wild"] {
        for strategy in STRATEGIES {
            let (mut active, mut changes) = (0.0, 0.0);
            for frame in 0..20 {
                let row = rows.next().unwrap();
                for (column, value) in [
                    ("scene", "laserscan"),
                    ("path", path),
                    ("backend", "in-memory"),
                    ("strategy", strategy),
                    ("prefetch", "none"),
                    ("limit", "error"),
                    ("frame", &frame.to_string()),
                ] {
                    assert_eq!(row[column], value, "{column}");
                }
                active += number(row, "unfolds") - number(row, "folds");
                changes += number(row, "unfolds") + number(row, "folds");
                assert_eq!(number(row, "active_nodes"), active);
                assert!(number(row, "triangles") > active);
                assert!(number(row, "apply_ns") <= number(row, "select_ns"));
                assert!(number(row, "resident_bytes") > 1e6);
                for column in ["forced", "blocked", "carried", "misses", "reads", "read_bytes"] {
                    assert_eq!(row[column], "0", "{column}");
                }
                assert!(row["cut_hash"].len() == 16 && u64::from_str_radix(&row["cut_hash"], 16).is_ok());
                if strategy != "event-published" {
                    assert_eq!(row["wrong"], "0");
                    let cut = (&row["cut_hash"], &row["active_nodes"], &row["triangles"]);
                    assert_eq!(*cuts.entry((path, frame)).or_insert(cut), cut, "{strategy}, frame {frame}");
                } else {
                    number(row, "wrong");
                }
            }
            // The wild path starts with a rest.
            assert!(active > 1000.0 && changes >= active, "{path}, {strategy}: nothing happens");
        }
    }

    let summary = table(&place.text("results/summary.csv"), SUMMARY);
    assert_eq!(summary.len(), 2 * 4);
    for (row, frames) in summary.iter().zip(frames.chunks(20)) {
        for column in ["scene", "path", "backend", "strategy", "prefetch"] {
            assert_eq!(row[column], frames[0][column]);
        }
        assert_eq!(row["frames"], "20");
        let mean = |column: &str| frames.iter().map(|frame| number(frame, column)).sum::<f64>() / 20.0;
        for (column, expected) in [
            ("tests_mean", mean("tests")),
            ("changes_mean", mean("unfolds") + mean("folds")),
            ("active_nodes_mean", mean("active_nodes")),
            ("triangles_mean", mean("triangles")),
            ("miss_percent", 0.0),
            ("reads", 0.0),
            ("peak_resident_bytes", mean("resident_bytes")),
        ] {
            assert!((number(row, column) - expected).abs() < 0.06, "{column}: {row:?}");
        }
        assert!((number(row, "select_ns_mean") - mean("select_ns")).abs() < 2.0);
        let mut times: Vec<f64> = frames.iter().map(|frame| number(frame, "select_ns")).collect();
        times.sort_by(f64::total_cmp);
        assert_eq!(number(row, "select_ns_p99"), times[19]);
        assert!((times[9]..=times[10]).contains(&number(row, "select_ns_median")));
    }

    let curves = place.text("results/selection-laserscan.svg");
    assert!(curves.starts_with("<svg") && curves.trim_end().ends_with("</svg>"));
    let report = place.text("results/report.html");
    for page in [&curves, &report] {
        assert_eq!(references(page), [""; 0]);
        for strategy in STRATEGIES {
            assert!(page.contains(strategy));
        }
    }
    assert_eq!(report.matches("<img").count(), 4, "two pictures a path");
    assert_eq!(report.matches("src=\"data:image/png;base64,").count(), 4);
    assert!(report.contains("<svg"), "the curves are in the page itself");
}

#[test]
fn inputs_of_one_name_do_not_overwrite_each_other() {
    let place = Workplace::new();
    place.succeed("build grid.ply -o grid.log");
    std::fs::create_dir(place.file("a&b <c>")).unwrap();
    std::fs::copy(place.file("grid.ply"), place.file("a&b <c>/grid.ply")).unwrap();
    let mut command =
        place.command("compare grid.ply grid.log --frames 0..3 --strategy event,front --out results");
    let output = command.arg("a&b <c>/grid.ply").output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert_eq!(
        place.names("results"),
        [
            "frames.csv",
            "report.html",
            "selection-grid-2.svg",
            "selection-grid-3.svg",
            "selection-grid.svg",
            "summary.csv"
        ]
    );
    let frames = table(&place.text("results/frames.csv"), FRAMES);
    let runs = ["grid", "grid-2", "grid-3"].into_iter().flat_map(|s| [(s, "event"), (s, "front")]);
    assert!(frames.chunks(3).map(|rows| (&*rows[0]["scene"], &*rows[0]["strategy"])).eq(runs));
    assert!(frames.iter().all(|row| row["wrong"].is_empty()), "nothing was checked");
    let report = place.text("results/report.html");
    assert!(report.contains("a&amp;b &lt;c&gt;/grid.ply") && !report.contains("a&b <c>"));
    assert_eq!(references(&report), [""; 0]);
}

#[test]
fn a_triangle_budget_is_named_as_the_limit() {
    let place = Workplace::new();
    // From outside of every sphere: what the eye is inside of is shown at any tolerance.
    let mut path = "# fov 60\n# aspect 1.5\n".to_owned();
    for frame in 0..200 {
        path += &format!("{frame} 0 0 {} 0 0 0 1\n", 12.0 - 0.001 * f64::from(frame));
    }
    place.write("far.path", path);
    // The published queue knows nothing of a tolerance that changes.
    place.succeed(
        "compare grid.ply --path far.path --frames 50.. --triangles 100 --strategy top-down,front,event --check \
         --out results",
    );
    let frames = table(&place.text("results/frames.csv"), FRAMES);
    for rows in frames.chunks(150) {
        let last = rows.last().unwrap();
        assert_eq!((&*last["frame"], &*last["limit"]), ("199", "triangles"));
        let settled: f64 = rows[100..].iter().map(|row| number(row, "triangles")).sum::<f64>() / 50.0;
        assert!((85.0..105.0).contains(&settled), "{settled} triangles of 100");
    }
}
