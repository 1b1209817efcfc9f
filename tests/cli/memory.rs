//! Building within a given memory.

use std::time::{Duration, Instant};

use foldfront::Mesh;

use crate::workplace::Workplace;

/// A wavy grid of `side * side` vertices.
fn large(side: u32) -> Mesh {
    let height = |x: u32, y: u32| ((x * x + 3 * y * y + x * y) % 97) as f32 * 0.05;
    let vertices = (0..side * side).map(|v| (v % side, v / side));
    let positions = vertices.map(|(x, y)| [x as f32, y as f32, height(x, y)]).collect();
    let squares = (0..side - 1).flat_map(|y| (0..side - 1).map(move |x| y * side + x));
    let triangles = squares.flat_map(|v| [[v, v + 1, v + side + 1], [v, v + side + 1, v + side]]).collect();
    Mesh { positions, triangles, ..Mesh::default() }
}

fn with_large(side: u32) -> Workplace {
    let place = Workplace::new();
    foldfront::construction::mesh_io::write_ply(&place.file("large.ply"), &large(side), None).unwrap();
    place
}

#[test]
fn the_file_is_the_same_whatever_the_memory() {
    let place = with_large(120);
    std::fs::create_dir(place.file("temp")).unwrap();
    let whole = place.succeed("build large.ply -o whole.log");
    assert!(whole.contains("triangles            28322\n"), "{whole}");
    for options in ["--memory 64K", "--memory 1M --temp temp", "--memory 1G"] {
        let pieces = place.succeed(&format!("build large.ply -o pieces.log {options}"));
        assert!(place.read("whole.log") == place.read("pieces.log"), "{options}");
        let without_time = |text: &str| text.lines().take(9).collect::<Vec<_>>().join("\n");
        assert_eq!(without_time(&whole), without_time(&pieces), "{options}");
    }
    assert!(place.names("temp").is_empty());
}

/// Files of backends are written within the memory too. What a multi-triangulation is like with less than its graph takes,
/// `mt_partition` says.
#[test]
fn files_of_backends_are_the_same_whatever_the_memory() {
    let place = with_large(60);
    std::fs::create_dir(place.file("temp")).unwrap();
    place.succeed("build large.ply -o large.log");
    for (backend, memory) in
        [("in-memory", "64K"), ("meta-node", "64K"), ("detail-block", "64K"), ("mt-partition", "16M")]
    {
        place.succeed(&format!("build large.ply -o whole.fold --backend {backend}"));
        let whole = place.read("whole.fold");
        for input in ["large.ply --threads 1", "large.ply --threads 3", "large.log"] {
            let options = format!("--backend {backend} --memory {memory} --temp temp");
            place.succeed(&format!("build {input} -o pieces.fold {options}"));
            assert!(place.read("pieces.fold") == whole, "{input} for {backend}");
        }
    }
    assert!(place.names("temp").is_empty());
    place.fail("build scene:city -o out.log --memory 1G", 1, &["scene:city is made in memory"]);
}

#[test]
fn what_is_wrong_with_the_input_or_the_options_is_said() {
    let place = Workplace::new();
    let whole = place.read("grid.ply");
    place.write("truncated.ply", &whole[..whole.len() - 100]);
    place.write("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 4\n");
    place.fail("build truncated.ply -o out.log --memory 1M", 1, &["truncated.ply: face 2", "ends too early"]);
    place.fail("build range.obj -o out.log --memory 1M", 1, &["range.obj: line 5: no vertex 4, there are 3"]);
    place.fail("build grid.ply -o out.log --memory 1M --temp nowhere", 1, &["nowhere"]);
    for size in ["0", "1.5", "many", "-1"] {
        place.fail(&format!("build grid.ply -o out.log --memory={size}"), 2, &["--memory", size]);
    }
    place.fail("build grid.ply -o out.log --temp .", 2, &["--memory"]);
    place.fail("build grid.ply -o out.log --memory 1M --threads 5", 2, &["--threads", "5"]);
}

/// A limit on the length of files stands in for a full disk: writing fails in the same way.
#[cfg(unix)]
#[test]
fn a_full_disk_is_an_error_and_leaves_nothing() {
    let place = with_large(200);
    place.succeed("build large.ply -o large.log");
    let before = place.everything();
    for build in [
        "build large.ply -o out.log --memory 1M",
        "build large.log -o out.xfm --backend detail-block --memory 1M",
        "build large.log -o out.mt --backend mt-partition --memory 1M",
    ] {
        place.fail_as(&mut within(&place, 400, build), build, 1, &["temporary files in .: ", "too large"]);
        assert_eq!(place.everything(), before);
    }
    // The report has pictures; the tables by themselves would fit, and are not written either.
    let compare = "compare large.log --path descent.path --strategy front --out new/results";
    place.fail_as(&mut within(&place, 100, compare), compare, 1, &["new/results/report.html: ", "too large"]);
    std::fs::create_dir_all(place.file("new/results")).unwrap();
    place.write("new/results/frames.csv", "written earlier");
    place.fail_as(&mut within(&place, 100, compare), compare, 1, &["new/results/report.html: ", "too large"]);
}

/// The program, where no file may be longer than so many blocks of 512 bytes.
#[cfg(unix)]
fn within(place: &Workplace, blocks: u32, arguments: &str) -> std::process::Command {
    let program = env!("CARGO_BIN_EXE_foldfront");
    // The signal that comes with the error is not for the program.
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec {program} {arguments}");
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", &script]).current_dir(place.file(""));
    shell
}

/// An interrupted build says so, and leaves neither its output nor anything temporary.
#[cfg(unix)]
#[test]
fn an_interrupt_leaves_nothing() {
    let place = with_large(400);
    let before = place.everything();
    let mut child = place
        .command("build large.ply -o out.log --memory 64K")
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(300));
    assert!(child.try_wait().unwrap().is_none(), "already finished");
    let pid = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let sent = Instant::now();
    let output = child.wait_with_output().unwrap();
    println!("ended {:?} later", sent.elapsed());
    assert_eq!(output.status.code(), Some(130));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "foldfront: interrupted\n");
    assert_eq!(place.everything(), before);
}

/// A limit on page memory that is too small is refused by every backend in the same words, before anything is written; and no more
/// is loaded than it allows, whatever is looked at.
#[test]
fn page_memory_is_a_limit() {
    let place = with_large(100);
    for (backend, file) in [("meta-node", "x.meta"), ("detail-block", "x.xfm"), ("mt-partition", "x.mt")] {
        place.succeed(&format!("build large.ply --backend {backend} -o {file}"));
        place.fail(
            &format!("compare {file} --page-memory 1K --out results"),
            1,
            &[file, "1024 bytes of page memory are too few: a single change needs "],
        );
        let peak = |how: &str| -> u64 {
            let all = format!("compare {file} --frames 0..5 --strategy front --out results {how}");
            place.succeed(&all);
            place.column("results/summary.csv", "peak_resident_bytes")[0].parse().unwrap()
        };
        // What is there beside pages, or with the first of them.
        let least = peak("--pixels 1000000");
        // Without a path, there is a flight around what is seen of it as a whole.
        let limited = peak("--page-memory 100K");
        assert!(limited <= least + (100 << 10), "{backend}: {limited} bytes at most, {least} at least");
        assert!(peak("") > limited, "{backend}: the limit keeps nothing out");
    }
    place.fail("build large.ply -o out.fold --memory 1", 2, &["--memory", "at least 64K"]);
}

/// Over a file that is 30 times the limit, the process takes no more than what it takes over a tiny one, the limit, 16 bytes a
/// page, 4 bytes a node, 256 bytes a displayed triangle for front, mesh and queue, and a megabyte for what is being read.
#[cfg(target_os = "linux")]
#[test]
fn resident_memory_keeps_to_the_limit() {
    let place = with_large(400);
    place.succeed("build large.ply -o large.log");
    for backend in ["meta-node", "detail-block", "mt-partition"] {
        place.succeed(&format!("build large.log --backend {backend} -o large.{backend}"));
        place.succeed(&format!("build grid.ply --backend {backend} -o tiny.{backend}"));
        let length = place.file(&format!("large.{backend}")).metadata().unwrap().len();
        let facts = place.succeed(&format!("info large.{backend}"));
        let fact = |name: &str| -> u64 {
            let line = facts.lines().find(|line| line.starts_with(&format!("{name}  ")));
            line.map_or(0, |line| line[name.len()..].split_whitespace().next().unwrap().parse().unwrap())
        };
        let pages = ["pages", "detail blocks", "partitions"].map(fact).iter().sum::<u64>();
        let nodes = fact("nodes").max(fact("collapses"));
        assert!(pages > 1000, "{facts}");
        let run = |size: &str, memory: &str| {
            let options = "--strategy event --frames 0..240 --pixels 8 --out results";
            peak(place.command(&format!("compare {size}.{backend} {options} {memory}")))
        };
        let limit = length / 30;
        let (tiny, limited) = (run("tiny", ""), run("large", &format!("--page-memory {limit}")));
        let triangles = place.column("results/frames.csv", "triangles");
        let displayed = triangles.iter().map(|count| count.parse::<u64>().unwrap()).max().unwrap();
        let most = tiny + limit + 16 * pages + 4 * nodes + 256 * displayed + (1 << 20);
        println!(
            "{backend}: {length} bytes, {tiny} over a tiny file, {limited} within {limit}, at most {most}"
        );
        assert!(limited <= most, "{backend}: {limited} bytes within {limit}, {tiny} over a tiny file");
        let whole = run("large", "");
        assert!(whole > most, "{backend}: {whole} bytes without a limit: nothing is kept out");
    }
}

/// The most memory that is resident at a time while a program runs, in bytes.
#[cfg(target_os = "linux")]
fn peak(mut command: std::process::Command) -> u64 {
    let mut child = command.stdout(std::process::Stdio::null()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0;
    loop {
        let ended = child.try_wait().unwrap();
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line.and_then(|line| line.split_whitespace().next()?.parse::<u64>().ok());
        peak = peak.max(1024 * kilobytes.unwrap_or(0));
        if let Some(ended) = ended {
            assert!(ended.success() && peak > 0);
            break peak;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}
