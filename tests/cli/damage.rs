//! Damaged hierarchies: every command says so in a line and exits with 1, or does what it does with intact ones.

use std::path::Path;
use std::process::Output;

use crate::workplace::{Workplace, repository};

/// What unfolds everything.
const FINEST: &str = "--path near.path --criterion sphere --pixels 0.000001";

/// One file in a folder, beside a path that sees all of it.
fn with(name: &str) -> Workplace {
    let place = Workplace::new();
    let cases = repository("tests/cases/reliability");
    for file in ["near.path", name] {
        std::fs::copy(cases.join(file), place.file(file)).unwrap();
    }
    place
}

/// What `compare` says of faults: in its table, in both tables of numbers, and in the report.
#[track_caller]
fn assert_faults_are_said(place: &Workplace, output: &Output, file: &str) -> u64 {
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{complaint}");
    assert!(complaint.lines().count() == 1 && complaint.contains(file), "{complaint}");
    assert!(complaint.contains("offset") && complaint.contains("was not displayed"), "{complaint}");
    let table = String::from_utf8_lossy(&output.stdout);
    assert!(table.contains("faults"), "{table}");
    let sum = |table: &str| -> u64 {
        place.column(table, "faults").iter().map(|faults| faults.parse::<u64>().unwrap()).sum()
    };
    let faults = sum("results/summary.csv");
    assert_eq!(sum("results/frames.csv"), faults);
    let report = place.text("results/report.html");
    assert!(report.contains("<th>faults") && report.contains("was not displayed"), "{file}");
    faults
}

/// One bit, in the middle of a file that is otherwise in order.
#[test]
fn one_bit_is_heard_of() {
    for name in ["one-bit.meta", "one-bit.mt"] {
        let place = with(name);
        let said = [name, "offset"];
        place.fail(&format!("verify {name}"), 1, &said);
        place.fail(&format!("export {name} {FINEST} --frame 0 -o x.ply"), 1, &said);
        place.fail(&format!("render {name} {FINEST} --frame 0 -o x.png"), 1, &said);
        place.fail(&format!("deviation {name} {FINEST} --frames 0,1"), 1, &said);
        place.fail(&format!("compare {name} {FINEST} --check --strategy event --out results"), 1, &said);
        let output = place.run(&format!("compare {name} {FINEST} --strategy event --out results"));
        assert!(assert_faults_are_said(&place, &output, name) > 0, "{name}");
    }
}

/// The right checksums, and contents that lie.
#[test]
fn lies_end_in_a_line() {
    for (name, verified) in [
        ("lying-134.meta", 1),
        ("lying-183.meta", 1),
        ("lying-208.meta", 1),
        ("lying-arcs.mt", 1),
        ("lying-leaves.meta", 1),
        ("lying-largest.meta", 1),
        ("endless-needs.xfm", 1),
        ("verified-but-damaged.xfm", 1),
    ] {
        let place = with(name);
        place.fail(&format!("verify {name}"), verified, &[name]);
        for strategy in ["top-down", "front", "event"] {
            let output = place.run(&format!("compare {name} {FINEST} --strategy {strategy} --out results"));
            let complaint = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{name}: {complaint}");
            assert!(complaint.lines().count() == 1 && complaint.contains(name), "{name}: {complaint}");
        }
        place.fail(&format!("export {name} {FINEST} --frame 0 -o x.ply"), 1, &[name]);
    }
}

/// How a file is damaged.
type Harm = fn(&mut Vec<u8>, usize);

/// A bit, a few bytes, and an end that comes too early.
const HARMS: [(&str, Harm); 3] = [
    ("a bit", |bytes, at| bytes[at] ^= 1 << (at % 8)),
    ("zeros", |bytes, at| bytes[at..].iter_mut().take(16).for_each(|byte| *byte = 0)),
    ("cut", |bytes, at| bytes.truncate(at)),
];

/// Places in a file at which it is damaged.
const PLACES: usize = 12;

/// Every backend, kind of damage and command: a line and exit 1, or the same as with the intact file, which is the control.
#[test]
fn damage_is_said_or_does_not_matter() {
    for (backend, file) in [
        ("in-memory", "x.fold"),
        ("meta-node", "x.meta"),
        ("detail-block", "x.xfm"),
        ("mt-partition", "x.mt"),
    ] {
        let place = Workplace::new();
        std::fs::copy(repository("tests/cases/reliability/near.path"), place.file("near.path")).unwrap();
        let small = if backend == "meta-node" { "--levels 2" } else { "" };
        place.succeed(&format!("build grid.ply --backend {backend} {small} -o {file}"));
        let intact = place.read(file);
        let commands = [
            (format!("export {file} {FINEST} --frame 0 -o out.ply"), "out.ply"),
            (format!("render {file} {FINEST} --frame 0 --width 64 -o out.png"), "out.png"),
            (format!("deviation {file} {FINEST} --frames 0"), ""),
            (format!("compare {file} {FINEST} --frames 0..3 --strategy front --out out"), "out/frames.csv"),
        ];
        let outcome = |(command, result): &(String, &str)| {
            let output = place.run(command);
            let written = place.file(result).is_file().then(|| match *result {
                // What does not depend on the time.
                "out/frames.csv" => cuts(&place.file("out/frames.csv")),
                result => place.read(result),
            });
            let _ = std::fs::remove_file(place.file(result));
            let _ = std::fs::remove_dir_all(place.file("out"));
            (output, written)
        };
        let controls = commands.each_ref().map(|command| {
            let (output, written) = outcome(command);
            assert!(output.status.success(), "{}: {}", command.0, String::from_utf8_lossy(&output.stderr));
            (output.stdout, written)
        });
        let mut failed = 0;
        for (kind, harm) in HARMS {
            for place_of_harm in 0..PLACES {
                let mut bytes = intact.clone();
                harm(&mut bytes, intact.len() * (2 * place_of_harm + 1) / (2 * PLACES));
                if bytes == intact {
                    continue;
                }
                place.write(file, &bytes);
                for (command, (said, result)) in commands.iter().zip(&controls) {
                    let (output, written) = outcome(command);
                    let complaint = String::from_utf8_lossy(&output.stderr);
                    let name = format!("{kind} at {place_of_harm} of {PLACES}: {}: {complaint}", command.0);
                    match output.status.code() {
                        Some(0) => {
                            assert!(written == *result, "{name}: something else");
                            let is_timed = command.0.starts_with("compare");
                            assert!(is_timed || output.stdout == *said, "{name}: other words");
                        }
                        Some(1) => {
                            failed += 1;
                            assert!(complaint.lines().count() == 1 && complaint.contains(file), "{name}");
                            // Comparisons go on, and say what they have seen.
                            let goes_on =
                                command.0.starts_with("compare") && complaint.contains("was not displayed");
                            assert_eq!(written.is_some(), goes_on, "{name}");
                        }
                        code => panic!("{name}: exit {code:?}"),
                    }
                }
            }
        }
        assert!(failed > 2 * PLACES, "{backend}: hardly anything has failed: {failed}");
    }
}

/// Of every frame, what was displayed.
fn cuts(file: &Path) -> Vec<u8> {
    let mut rows = csv::Reader::from_path(file).unwrap();
    let header = rows.headers().unwrap().clone();
    let columns = ["active_nodes", "triangles", "cut_hash", "misses"]
        .map(|column| header.iter().position(|name| name == column).unwrap());
    let mut cuts = String::new();
    for row in rows.records() {
        let row = row.unwrap();
        columns.iter().for_each(|&column| cuts.extend([&row[column], " "]));
    }
    cuts.into_bytes()
}
