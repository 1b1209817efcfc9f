//! What each room may use, and what must never be in it; `ARCHITECTURE.md` says why.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use proc_macro2::TokenStream;

use crate::circles::flatten;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Who may depend on whom: the packages of the workspace, those below before those above, each with all that it may depend on.
const FLOORS: [(&str, &[&str]); 12] = [
    ("backends/vertex-tree", &[]),
    ("backends/page-store", &["vertex-tree"]),
    ("backends/container", &["page-store", "vertex-tree"]),
    ("backends/collapse-log", &["container", "page-store", "vertex-tree"]),
    ("backends/star-mesh", &["vertex-tree"]),
    ("backends/in-memory", &["collapse-log", "star-mesh", "vertex-tree"]),
    ("backends/meta-node", &["collapse-log", "container", "page-store", "star-mesh", "vertex-tree"]),
    ("backends/detail-block", &["collapse-log", "container", "page-store", "vertex-tree"]),
    ("backends/mt-partition", &["collapse-log", "container", "page-store", "vertex-tree"]),
    ("src/selection", &["vertex-tree"]),
    ("src/construction", &["collapse-log", "container", "vertex-tree"]),
    ("src/testing", &["collapse-log", "selection", "vertex-tree"]),
];

/// What an embedder has who asks for nothing but a hierarchy in memory, with what is switched off then left out.
const SMALLEST: [&str; 5] = [
    "src/selection",
    "backends/vertex-tree",
    "backends/star-mesh",
    "backends/in-memory",
    "backends/collapse-log",
];

/// Packages in that build, those that only run in the compiler apart.
const MOST_PACKAGES: usize = 20;

/// Methods that the platform's mathematical library answers; `sqrt` and rounding are exact everywhere.
const PLATFORM: [&str; 24] = [
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sin_cos", "sinh", "cosh", "tanh", "asinh",
    "acosh", "atanh", "exp", "exp2", "exp_m1", "ln", "ln_1p", "log2", "log10", "powf", "cbrt", "hypot",
];

/// The source files below a folder, in order: names from the root, and texts.
fn texts(folder: &str) -> Vec<(String, String)> {
    let mut files = Vec::new();
    let mut folders = vec![PathBuf::from(ROOT).join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let name = path.strip_prefix(ROOT).unwrap().to_str().unwrap().replace('\\', "/");
                files.push((name, fs::read_to_string(&path).unwrap()));
            }
        }
    }
    files.sort();
    files
}

/// The same as tokens.
fn sources(folder: &str) -> Vec<(String, Vec<String>)> {
    texts(folder).into_iter().map(|(name, text)| (name, tokens(&text))).collect()
}

/// Those that are compiled without features and tests: whole files may be switched off where they are declared.
fn without_features(mut files: Vec<(String, Vec<String>)>) -> Vec<(String, Vec<String>)> {
    let mut off = BTreeSet::new();
    for (name, tokens) in &files {
        let folder = name.trim_end_matches("/lib.rs").trim_end_matches(".rs");
        for module in switched_off_modules(tokens) {
            off.insert(format!("{folder}/{module}"));
        }
    }
    files.retain(|(name, _)| {
        !off.iter().any(|module| name == &format!("{module}.rs") || name.starts_with(&format!("{module}/")))
    });
    files
}

fn tokens(text: &str) -> Vec<String> {
    let mut tokens = Vec::new();
    flatten(text.parse::<TokenStream>().unwrap(), &mut tokens);
    tokens
}

/// Whether an attribute that begins here keeps out what follows from the build without features and tests.
fn is_switch(tokens: &[String]) -> bool {
    let start = ["#", "[", "cfg", "("];
    tokens.len() > 5
        && tokens.iter().zip(start).all(|(token, expected)| token == expected)
        && (tokens[4] == "test" || tokens[4] == "feature")
}

fn switched_off_modules(tokens: &[String]) -> Vec<String> {
    let mut modules = Vec::new();
    for at in (0..tokens.len()).filter(|&at| is_switch(&tokens[at..])) {
        let Some(end) = tokens[at..].iter().position(|token| token == "]").map(|end| at + end) else {
            continue;
        };
        let item: Vec<&str> = tokens[end + 1..].iter().take(3).map(String::as_str).collect();
        match item[..] {
            ["mod", name, ";"] | ["pub", "mod", name] => modules.push(name.to_owned()),
            _ => {}
        }
    }
    modules
}

/// The tokens without items that are switched off in the file itself: up to the end of their braces, or a semicolon.
fn switched_on(tokens: &[String]) -> Vec<String> {
    let (mut kept, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        if !is_switch(&tokens[at..]) {
            kept.push(tokens[at].clone());
            at += 1;
            continue;
        }
        let mut depth = 0_i32;
        at += tokens[at..].iter().position(|token| token == "]").unwrap_or(0) + 1;
        while at < tokens.len() {
            let token = tokens[at].as_str();
            at += 1;
            depth +=
                i32::from(matches!(token, "{" | "(" | "[")) - i32::from(matches!(token, "}" | ")" | "]"));
            if depth == 0 && matches!(token, "}" | ";") {
                break;
            }
        }
    }
    kept
}

/// What a file has that needs a file system, a thread, a clock or the platform's mathematical library.
fn forbidden(tokens: &[String]) -> Vec<String> {
    let tokens = switched_on(tokens);
    let token = |at: usize| tokens.get(at).map_or("", String::as_str);
    let mut found = Vec::new();
    for at in 0..tokens.len() {
        let path = || format!("{}::{}::{}", token(at), token(at + 2), token(at + 4));
        match token(at) {
            "std" if token(at + 1) == "::" => match token(at + 2) {
                "fs" | "net" | "process" | "thread" | "env" => found.push(path()),
                "io" if token(at + 4) != "Error" => found.push(path()),
                _ => {}
            },
            name @ ("Instant" | "SystemTime" | "File") => found.push(name.to_owned()),
            "." if PLATFORM.contains(&token(at + 1)) && token(at + 2) == "(" => {
                found.push(format!(".{}()", token(at + 1)));
            }
            name @ ("f64" | "f32") if token(at + 1) == "::" && PLATFORM.contains(&token(at + 2)) => {
                found.push(format!("{name}::{}", token(at + 2)));
            }
            _ => {}
        }
    }
    found
}

#[test]
fn the_smallest_build_has_no_file_no_thread_no_clock() {
    let mut faults = Vec::new();
    let mut files = 0;
    for folder in SMALLEST {
        for (name, tokens) in without_features(sources(folder)) {
            files += 1;
            faults.extend(forbidden(&tokens).into_iter().map(|what| format!("{name}: {what}")));
        }
    }
    assert!(files > 70, "{files} files: where are the others?");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn what_is_forbidden_is_found() {
    let found = |text: &str| forbidden(&tokens(text));
    assert_eq!(found("use std::fs::File;"), ["std::fs::File", "File"]);
    assert_eq!(found("fn f() { std::thread::spawn(g); }"), ["std::thread::spawn"]);
    assert_eq!(
        found("fn f() { let now = Instant::now(); x.sin() + f64::powf(a, b) }"),
        ["Instant", ".sin()", "f64::powf"]
    );
    assert_eq!(found("use std::io::{self, Read};"), ["std::io::{"]);
    let none: [String; 0] = [];
    assert_eq!(found("struct E(std::io::Error); fn f() { libm::sin(x.sqrt()) } // std::fs\n"), none);
    assert_eq!(
        found(
            "#[cfg(test)] mod tests { use std::fs; } #[cfg(feature = \"clock\")] fn f() { Instant::now() }"
        ),
        none
    );
    assert_eq!(
        found("#[cfg(feature = \"files\")] use std::fs; fn f() { std::fs::read(x) }"),
        ["std::fs::read"]
    );
    let modules =
        switched_off_modules(&tokens("#[cfg(feature = \"files\")] pub mod a; #[cfg(test)] mod b; mod c;"));
    assert_eq!(modules, ["a", "b"]);
}

/// The packages of the workspace in the section `[dependencies]` of a manifest.
fn dependencies(manifest: &str) -> BTreeSet<String> {
    let ours: BTreeSet<&str> = FLOORS.iter().filter_map(|(folder, _)| folder.rsplit('/').next()).collect();
    let section = manifest.split("\n[").find_map(|section| section.strip_prefix("dependencies]"));
    let names = section.unwrap_or("").lines().filter_map(|line| line.split([' ', '.', '=']).next());
    names.filter(|name| ours.contains(name)).map(str::to_owned).collect()
}

#[test]
fn arrows_go_down_only() {
    let mut above = BTreeSet::new();
    for (folder, allowed) in FLOORS {
        let manifest = fs::read_to_string(Path::new(ROOT).join(folder).join("Cargo.toml")).unwrap();
        let allowed: BTreeSet<String> = allowed.iter().map(ToString::to_string).collect();
        assert_eq!(dependencies(&manifest), allowed, "{folder}");
        let name = folder.rsplit('/').next().unwrap();
        assert!(allowed.iter().all(|below| above.contains(below)), "{name} stands below what it depends on");
        above.insert(name.to_owned());
    }
    // No package is missing from the table.
    let mut packages = BTreeSet::new();
    for folder in ["backends", "src"] {
        for entry in fs::read_dir(Path::new(ROOT).join(folder)).unwrap() {
            let entry = entry.unwrap();
            if entry.path().join("Cargo.toml").exists() {
                packages.insert(entry.file_name().to_str().unwrap().to_owned());
            }
        }
    }
    assert_eq!(packages, above);
}

/// A backend answers for nodes; which of them a camera wants is not for it to know.
#[test]
fn a_backend_never_sees_a_camera() {
    let mut files = 0;
    for (folder, allowed) in FLOORS.iter().filter(|(folder, _)| folder.starts_with("backends/")) {
        assert!(!allowed.contains(&"selection"), "{folder}");
        for (name, tokens) in sources(&format!("{folder}/src")) {
            files += 1;
            let seen = switched_on(&tokens)
                .into_iter()
                .find(|token| matches!(token.as_str(), "Camera" | "View" | "selection"));
            assert_eq!(seen, None, "{name}");
        }
    }
    assert!(files > 100, "{files} files: where are the others?");
}

/// Rooms that are modules of the root: the command line may use experiments, and nothing may use the command line.
#[test]
fn the_top_floor_has_few_names_and_nothing_uses_the_command_line() {
    let names: BTreeSet<String> = fs::read_dir(Path::new(ROOT).join("src"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_str().unwrap().to_owned())
        .collect();
    assert!(names.len() <= 7, "{names:?}");
    let mut files = 0;
    for (name, tokens) in sources("src/experiment") {
        files += 1;
        let uses = tokens.windows(3).any(|path| path == ["crate", "::", "cli"]);
        assert!(!uses, "{name} uses the command line");
    }
    assert!(files > 50, "{files} files: where are the others?");
    // Every room says what it is before anything else.
    for room in
        ["selection/lib.rs", "construction/lib.rs", "testing/lib.rs", "experiment/mod.rs", "cli/mod.rs"]
    {
        let text = fs::read_to_string(Path::new(ROOT).join("src").join(room)).unwrap();
        let says = |word: &str| {
            text.lines().take_while(|line| line.starts_with("//!")).any(|line| line.contains(word))
        };
        assert!(text.starts_with("//! ") && says("may use") && says("never be in it"), "{room}");
    }
}

#[test]
fn an_embedder_gets_few_packages() {
    let arguments = [
        "tree",
        "--offline",
        "--locked",
        "-p",
        "foldfront",
        "--no-default-features",
        "--features",
        "in-memory",
    ];
    let output = Command::new(env!("CARGO"))
        .current_dir(ROOT)
        .args(arguments)
        .args(["-e", "normal,no-proc-macro", "--prefix", "none", "--format", "{p}"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let packages: BTreeSet<&str> =
        text.lines().filter_map(|line| line.split(' ').next()).filter(|name| !name.is_empty()).collect();
    assert!(packages.contains("foldfront-in-memory"), "{packages:?}");
    assert!(packages.len() <= MOST_PACKAGES, "{}: {packages:?}", packages.len());
}

/// Every format that is read, by the file that reads it, and the test that gives it what is hostile.
const FORMATS: [(&str, &str, &str); 10] = [
    (
        "backends/container/src/table.rs",
        "backends/container/src/tests/sections.rs",
        "sections_that_overlap_or_lie_outside_are_named",
    ),
    (
        "backends/collapse-log/src/log_file/layout.rs",
        "backends/collapse-log/src/tests/log_file.rs",
        "any_word_can_be_anything_without_a_panic",
    ),
    (
        "backends/meta-node/src/format.rs",
        "backends/meta-node/src/tests/file.rs",
        "every_flipped_bit_is_found",
    ),
    (
        "backends/detail-block/src/format.rs",
        "backends/detail-block/src/tests/damage.rs",
        "hostile_files_end_in_errors",
    ),
    (
        "backends/mt-partition/src/format.rs",
        "tests/backends/mt_partition/damage.rs",
        "any_flipped_bit_is_found",
    ),
    ("src/experiment/path/format.rs", "tests/experiment/path.rs", "no_text_panics"),
    ("src/experiment/path/import.rs", "tests/experiment/path.rs", "no_trajectory_panics"),
    (
        "src/experiment/stored_scene/scene_file.rs",
        "tests/experiment/stored_scene.rs",
        "a_scene_says_which_line_is_wrong",
    ),
    ("src/construction/mesh_io.rs", "tests/construction/mesh_io/wrong.rs", "no_prefix_of_a_file_panics"),
    ("src/experiment/store.rs", "tests/cli/failures.rs", "a_damaged_hierarchy_is_named_with_the_offset"),
];

#[test]
fn every_format_has_its_hostile_file_test() {
    for (format, file, test) in FORMATS {
        assert!(Path::new(ROOT).join(format).exists(), "{format}");
        let text =
            fs::read_to_string(Path::new(ROOT).join(file)).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert!(text.contains(&format!("fn {test}(")), "{file} has no {test}");
    }
    // Whoever has a magic number is a format.
    for (folder, _) in FLOORS {
        for (name, tokens) in sources(folder) {
            let has_magic = tokens.windows(2).any(|two| two == ["const", "MAGIC"]);
            assert!(
                !has_magic || FORMATS.iter().any(|(format, ..)| *format == name),
                "{name} is a format without a test"
            );
        }
    }
}

/// Errors that there is nothing to name of.
const SAY_ALL: [&str; 2] = [
    // Whoever interrupts knows what.
    "interrupted",
    "no input file",
];

#[test]
fn every_error_names_a_file_or_a_value() {
    let (mut faults, mut count) = (Vec::new(), 0);
    let folders = FLOORS.iter().map(|(folder, _)| *folder).chain(["src/experiment", "src/cli"]);
    for folder in folders {
        for (name, text) in texts(folder) {
            for message in text.split("#[error(").skip(1) {
                let message = message.trim_start();
                count += 1;
                let Some(literal) = message.strip_prefix('"').and_then(|rest| rest.split('"').next()) else {
                    continue;
                };
                if !literal.contains('{') && !SAY_ALL.contains(&literal) {
                    faults.push(format!("{name}: {literal}"));
                }
            }
        }
    }
    assert!(count > 150, "{count} errors: where are the others?");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
