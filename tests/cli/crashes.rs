//! Processes that are killed or interrupted at any moment: what was there is whole, old or new, and what they leave the next one
//! removes.
#![cfg(unix)]

use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::workplace::Workplace;

/// Moments at which a command is killed.
const MOMENTS: u32 = 50;

/// A wavy square with so many vertices a side.
fn waves(side: u32) -> foldfront::Mesh {
    let at = |i: u32| i as f32 / side as f32;
    let height = |x: u32, y: u32| 0.01 * ((x * x + 3 * y * y + x * y) % 7) as f32;
    let positions = (0..side * side).map(|v| (v % side, v / side)).map(|(x, y)| [at(x), at(y), height(x, y)]);
    let squares = (0..(side - 1) * (side - 1)).map(|s| s / (side - 1) * side + s % (side - 1));
    let triangles = squares.flat_map(|v| [[v, v + 1, v + side + 1], [v, v + side + 1, v + side]]);
    foldfront::Mesh { positions: positions.collect(), triangles: triangles.collect(), ..Default::default() }
}

fn place() -> Workplace {
    let place = Workplace::new();
    foldfront::construction::mesh_io::write_ply(&place.file("waves.ply"), &waves(64), None).unwrap();
    std::fs::create_dir(place.file("temporary")).unwrap();
    place
}

/// Runs a command to its end, then kills it at as many moments of that time, and calls `check` after each. Returns how many were
/// killed before they had ended.
fn kill(place: &Workplace, command: &str, mut check: impl FnMut(&str)) -> u32 {
    let start = || {
        let mut command = place.command(command);
        command.env("TMPDIR", place.file("temporary")).stdout(Stdio::null()).stderr(Stdio::null());
        (Instant::now(), command.spawn().unwrap())
    };
    let (begun, mut child) = start();
    assert!(child.wait().unwrap().success(), "{command}");
    let whole = begun.elapsed();
    check(command);
    let mut killed = 0;
    for moment in 0..MOMENTS {
        let (begun, mut child) = start();
        std::thread::sleep((whole * moment / MOMENTS).saturating_sub(begun.elapsed()));
        killed += u32::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
        check(&format!("{command}, killed at {moment} of {MOMENTS}"));
    }
    let (_, mut child) = start();
    assert!(child.wait().unwrap().success(), "{command}");
    for folder in ["", "temporary", "results"] {
        if place.file(folder).is_dir() {
            let left: Vec<_> = place.names(folder).into_iter().filter(|name| name.starts_with('.')).collect();
            assert!(left.is_empty(), "{command}: the next run leaves {left:?}");
        }
    }
    killed
}

#[test]
fn a_killed_build_leaves_the_file_whole() {
    for (backend, memory) in [
        ("in-memory", ""),
        ("in-memory", "--memory 1M"),
        ("meta-node", ""),
        ("meta-node", "--memory 1M"),
        ("detail-block", ""),
        ("detail-block", "--memory 1M"),
        ("mt-partition", ""),
        ("mt-partition", "--memory 1M"),
    ] {
        let place = place();
        let mut written = Vec::new();
        let killed =
            kill(&place, &format!("build waves.ply --backend {backend} {memory} -o out.fold"), |moment| {
                if written.is_empty() {
                    written = place.read("out.fold");
                    // What is there before: something else, and as whole.
                    place.write("out.fold", "written earlier");
                }
                let found = place.read("out.fold");
                assert!(found == written || found == b"written earlier", "{moment}: half of a file");
                if found == written {
                    place.write("out.fold", "written earlier");
                }
            });
        assert!(killed > MOMENTS / 4, "{backend} {memory}: only {killed} were killed");
    }
}

#[test]
fn a_killed_comparison_leaves_its_results_whole() {
    let place = place();
    let command = "compare waves.ply --backend meta-node --path descent.path --strategy front --out results";
    let killed = kill(&place, command, |moment| {
        if let Ok(report) = std::fs::read(place.file("results/report.html")) {
            assert!(report.ends_with(b"</html>\n"), "{moment}");
            for name in ["frames.csv", "summary.csv"] {
                let text = place.text(&format!("results/{name}"));
                let mut rows = csv::Reader::from_reader(text.as_bytes());
                assert_eq!(
                    rows.records().filter(Result::is_ok).count(),
                    if name == "frames.csv" { 3 } else { 1 },
                    "{moment}"
                );
            }
        }
    });
    assert!(killed > MOMENTS / 4, "only {killed} were killed");
}

/// An interrupted comparison writes the runs that were finished, all files of them, and leaves nothing else.
#[test]
fn an_interrupted_comparison_writes_what_was_finished() {
    let place = place();
    place.write("long.path", long_path(20_000));
    let mut command = place.command(
        "compare waves.ply --backend mt-partition --path descent.path --path long.path --fps 100 --wall-clock --out results",
    );
    command.env("TMPDIR", place.file("temporary")).stderr(Stdio::piped()).stdout(Stdio::null());
    let (begun, child) = (Instant::now(), command.spawn().unwrap());
    // By the clock, the short path takes a few hundredths of a second and the long one minutes, on whatever machine.
    while place.names("temporary").is_empty() {
        assert!(begun.elapsed() < Duration::from_secs(120), "nothing is built");
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(Duration::from_millis(3000));
    let pid = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    println!("ended {:?} after it began", begun.elapsed());
    let complaint = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{complaint}");
    assert_eq!(complaint, "foldfront: interrupted: results has what had been replayed to the end\n");
    assert_eq!(place.names("results"), ["frames.csv", "report.html", "selection-waves.svg", "summary.csv"]);
    assert_eq!(place.names("temporary"), [""; 0]);
    let text = place.text("results/summary.csv");
    let runs = csv::Reader::from_reader(text.as_bytes()).records().count();
    assert_eq!(runs, 4, "{text}");
}

/// A path that takes a while.
fn long_path(frames: u32) -> String {
    let at = |i: u32| f64::from(i % 200) / 200.0;
    let frames = (0..frames).map(|i| format!("{i} {} 0.5 {} 0 0 0 1\n", at(i), 0.3 + at(7 * i)));
    let header = "# foldfront path\n# name long\n# units m\n# fov 60\n# aspect 1.5\n";
    frames.fold(header.to_owned(), |text, frame| text + &frame)
}

/// A file that is cut short, written over or removed while it is replayed: an error or faults, or nothing if it was not needed any
/// more, and never the end of the process.
#[test]
fn files_may_change_under_a_replay() {
    type Change = fn(&Workplace, &str);
    let changes: [(&str, Change); 4] = [
        ("cut to nothing", |place, file| place.write(file, "")),
        ("cut in half", |place, file| {
            let half = place.read(file).len() as u64 / 2;
            std::fs::OpenOptions::new().write(true).open(place.file(file)).unwrap().set_len(half).unwrap();
        }),
        ("written over", |place, file| {
            let length = place.read(file).len();
            place.write(file, vec![0x5a; length]);
        }),
        ("removed", |place, file| std::fs::remove_file(place.file(file)).unwrap()),
    ];
    let place = place();
    place.write("long.path", long_path(200));
    let mut running = 0;
    for (backend, file) in [("meta-node", "x.meta"), ("detail-block", "x.xfm"), ("mt-partition", "x.mt")] {
        place.succeed(&format!("build waves.ply --backend {backend} -o {file}"));
        let intact = place.read(file);
        for (name, change) in changes {
            place.write(file, &intact);
            let command = format!(
                "compare {file} --path long.path --pixels 0.5 --page-memory 200K --strategy event --out results"
            );
            let mut child =
                place.command(&command).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
            std::thread::sleep(Duration::from_millis(30));
            running += u32::from(child.try_wait().unwrap().is_none());
            change(&place, file);
            let output = child.wait_with_output().unwrap();
            let complaint = String::from_utf8_lossy(&output.stderr);
            match output.status.code() {
                Some(0) => assert_eq!(complaint, "", "{file}, {name}"),
                Some(1) => assert!(
                    complaint.lines().count() == 1 && complaint.contains(file),
                    "{file}, {name}: {complaint}"
                ),
                code => panic!("{file}, {name}: exit {code:?}: {complaint}"),
            }
        }
    }
    assert!(running > 6, "only {running} of 12 were still running");
}

/// Two processes over one file see the same.
#[test]
fn two_processes_over_one_file() {
    let place = place();
    place.write("long.path", long_path(300));
    for (backend, file) in [("meta-node", "x.meta"), ("detail-block", "x.xfm"), ("mt-partition", "x.mt")] {
        place.succeed(&format!("build waves.ply --backend {backend} -o {file}"));
        let start = |out: &str| {
            let command = format!("compare {file} --path long.path --strategy front --out {out}");
            place.command(&command).stdout(Stdio::null()).spawn().unwrap()
        };
        for mut child in [start("one"), start("other")] {
            assert!(child.wait().unwrap().success(), "{file}");
        }
        let cuts = ["one", "other"].map(|out| place.column(&format!("{out}/frames.csv"), "cut_hash"));
        assert_eq!(cuts[0].len(), 300);
        assert_eq!(cuts[0], cuts[1], "{file}");
    }
}
