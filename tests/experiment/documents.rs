//! What documents say of this repository is true: `docs/papers.md` names files and tests that are there, and every record of a
//! measurement names a command, and is in the list of records.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// What the short names at the head of the page stand for.
const SHORT: [(&str, &str); 4] = [
    ("dbk/", "backends/detail-block/src/"),
    ("meta/", "backends/meta-node/src/"),
    ("mt/", "backends/mt-partition/src/"),
    ("tree/", "backends/vertex-tree/src/"),
];

/// The names of all functions in Rust files below a folder.
fn functions(folder: &Path, names: &mut HashSet<String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            if path.file_name().is_some_and(|name| name != "target") {
                functions(&path, names);
            }
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            let is_part = |c: char| c.is_alphanumeric() || c == '_';
            let after = text.split("fn ").skip(1);
            names.extend(after.map(|rest| rest.chars().take_while(|&c| is_part(c)).collect::<String>()));
            // Of macros that make tests of many cases, the names of the cases.
            let lines = text.lines().map(str::trim);
            names.extend(
                lines.filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(" {").map(String::from)),
            );
        }
    }
}

/// The words of a table's cell that stand in backquotes.
fn quoted(cell: &str) -> impl Iterator<Item = &str> {
    cell.split('`').skip(1).step_by(2)
}

/// What the rows of the page's tables name that is not there, and how many rows there are.
fn missing(page: &str, functions: &HashSet<String>) -> (Vec<String>, usize) {
    let (mut missing, mut rows) = (Vec::new(), 0);
    for line in page.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| ---")) {
        let cells: Vec<&str> = line.trim_matches('|').split(" | ").map(str::trim).collect();
        if cells[0] == "mechanism" {
            continue;
        }
        rows += 1;
        let [mechanism, place, how, test] = cells[..] else {
            missing.push(format!("a cell: {line}"));
            continue;
        };
        for file in quoted(place) {
            let short =
                SHORT.iter().find_map(|(short, long)| Some(format!("{long}{}", file.strip_prefix(short)?)));
            if !PathBuf::from(ROOT).join(short.as_deref().unwrap_or(file)).exists() {
                missing.push(format!("{mechanism}: {file}"));
            }
        }
        if place == "-" && !how.contains("missing") {
            missing.push(format!("{mechanism}: a place, or a reason why it is missing"));
        }
        let tests: Vec<&str> = quoted(test).collect();
        if tests.is_empty() && test != "-" {
            missing.push(format!("{mechanism}: a test, or a dash"));
        }
        missing.extend(
            tests
                .iter()
                .filter(|&&name| !functions.contains(name))
                .map(|name| format!("{mechanism}: {name}")),
        );
    }
    (missing, rows)
}

#[test]
fn every_mechanism_names_files_and_tests_that_are_there() {
    let mut names = HashSet::new();
    for folder in ["src", "tests", "backends", "examples"] {
        functions(&Path::new(ROOT).join(folder), &mut names);
    }
    let page = fs::read_to_string(Path::new(ROOT).join("docs/papers.md")).unwrap();
    let (missing, rows) = missing(&page, &names);
    assert_eq!(missing, Vec::<String>::new());
    assert!(rows > 150, "{rows}");
}

#[test]
fn what_is_not_there_is_found() {
    let names = HashSet::from(["it_works".to_owned()]);
    let page = "| mechanism | where | how | test |\n| --- | --- | --- | --- |\n\
        | a | `src/lib.rs` | as printed | `it_works` |\n\
        | b | `mt/lib.rs`, `src/nowhere.rs` | as printed | - |\n\
        | c | - | as printed | - |\n\
        | d | - | missing: too long | `it_does_not` |\n\
        | e | `src/lib.rs` | as printed | by sight |\n\
        | f | `src/lib.rs` | as printed |\n";
    let (missing, rows) = missing(page, &names);
    assert_eq!(rows, 6);
    let words: Vec<&str> = missing.iter().map(|line| line.split(':').next().unwrap()).collect();
    assert_eq!(words, ["b", "c", "d", "e", "a cell"], "{missing:?}");
}

/// What is wrong with the records of measurements, given their names and texts, and with the list of them.
fn wrong_records(list: &str, records: &[(String, String)]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (name, text) in records {
        if !list.contains(&format!("({name})")) {
            wrong.push(format!("{name} is not in the list"));
        }
        let commands = ["cargo bench", "cargo test", "cargo run", "foldfront "];
        if !commands.iter().any(|command| text.contains(command)) {
            wrong.push(format!("{name} names no command"));
        }
    }
    for link in list.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
        if !records.iter().any(|(name, _)| name == link) {
            wrong.push(format!("{link} is not there"));
        }
    }
    wrong
}

#[test]
fn every_record_is_in_the_list_and_names_a_command() {
    let folder = Path::new(ROOT).join("benches/record");
    let mut records = Vec::new();
    for entry in fs::read_dir(&folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if name.ends_with(".md") && name != "README.md" {
            records.push((name, fs::read_to_string(&path).unwrap()));
        }
    }
    let list = fs::read_to_string(folder.join("README.md")).unwrap();
    assert_eq!(wrong_records(&list, &records), Vec::<String>::new());
    assert!(records.len() > 5);
}

#[test]
fn a_record_without_a_command_is_found() {
    let record = |name: &str, text: &str| (name.to_owned(), text.to_owned());
    let records =
        [record("a.md", "`cargo bench`: 3 s"), record("b.md", "3 s"), record("c.md", "`foldfront build`")];
    let wrong = wrong_records("[a](a.md) [b](b.md) [d](d.md)", &records);
    assert_eq!(wrong, ["b.md names no command", "c.md is not in the list", "d.md is not there"]);
}

#[test]
fn links_of_documents_lead_somewhere() {
    let mut broken = Vec::new();
    let documents = [
        "README.md",
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "DESIGN.md",
        "CHANGELOG.md",
        "docs/papers.md",
        "benches/record/README.md",
    ];
    for document in documents {
        let path = Path::new(ROOT).join(document);
        let text = fs::read_to_string(&path).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next()) {
            if !link.is_empty() && !link.contains("://") && !path.parent().unwrap().join(link).exists() {
                broken.push(format!("{document}: {link}"));
            }
        }
    }
    assert_eq!(broken, Vec::<String>::new());
}
