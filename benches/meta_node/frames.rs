//! Table 2: frames with little memory, external memory against virtual memory.
//!
//! Each replay runs in a process of its own, alone in a control group whose memory is limited to what the process needs
//! without any page, and so much more. Files are dropped from the page cache before, and the program is read into it from
//! outside of the group, so that the group does not pay for it. Frames come at 60 a second, and what a frame takes is the
//! whole refinement step with the displayed mesh. A replay that takes too long is ended, and the frames so far count.
//!
//! * `mapped`: the in-memory tree's arrays, mapped, as the operating system pages them by itself;
//! * `advised`: the same, and it has been told that accesses are in no order, so that it reads no more than what is touched;
//! * `paper`, `schedule`, `none`: meta-nodes, by what prefetches.

use std::fs;
use std::path::{Path as FilePath, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use foldfront::experiment::path::Path;
use foldfront::experiment::path::import::Mode;
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::engine::Engine;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::vertex_tree::{Prefetch, VertexTree};
use meta_node::{BuildOptions, MetaNodeTree, Settings};

use crate::misses::{CAR, DRONE};
use crate::selection::settings;
use crate::subject::{imported, is_chosen, kept, log, meta_nodes, open, spread, views};
use crate::virtual_memory::{self, MappedTree};

/// Each replay is made this often. Of each frame the least times count: what else the machine does can only add.
const ROUNDS: usize = 2;
const FRAMES: usize = 600;
/// A replay ends with the frame in which it has taken so long, the first view included, and is killed after twice that.
const PATIENCE: Duration = Duration::from_secs(60);
/// What a process needs that is in no table: stacks, the kernel's own.
const SLACK: u64 = 4 << 20;

/// The shares of the file, as a numerator and a denominator, and whether virtual memory is tried as well: with less than a
/// quarter it gets nowhere.
const SHARES: [(u64, u64, bool); 4] = [(1, 8, false), (1, 4, true), (1, 2, true), (3, 4, true)];

/// Three meshes, each with a path.
const MESHES: [(&str, (&str, Mode, f64)); 3] = [("dragon", DRONE), ("happy", DRONE), ("boston", CAR)];

pub fn table(words: &[String]) {
    let Some(group) = Group::new() else {
        println!("frames: no control group with a memory limit can be made here; nothing is measured");
        return;
    };
    println!(
        "mesh     of the file  tree      frames   us a frame: mean  median      p99      max   misses %  changes/frame  \
         triangles  major faults   of the first view"
    );
    for (name, (trajectory, mode, rate)) in MESHES {
        if !is_chosen(name, words, MESHES.map(|(name, _)| name)) {
            continue;
        }
        let Some((log, _)) = log(name) else { continue };
        let Some(mut walk) = imported(trajectory, &log, mode, rate) else { continue };
        walk.frames.truncate(FRAMES);
        let meta = meta_nodes(name, &log, &BuildOptions::default());
        let mapped = kept(&format!("{name}.mapped"));
        virtual_memory::write(&mapped, &log);
        drop(log);
        let path = kept(&format!("{name}.path"));
        walk.write(&path).expect("target is writable");
        let bytes = fs::metadata(&meta).map_or(0, |m| m.len());
        // What it takes without any page of either file: anonymous memory of the mapped tree, which has no other.
        let Some(base) = run(&group, "mapped", &mapped, &path, u64::MAX, u64::MAX) else { continue };
        let base = base.anonymous;
        for (parts, of, also_virtual) in SHARES {
            let memory = bytes * parts / of;
            let limit = base + memory + SLACK;
            let mut best_virtual: Option<[f64; 2]> = None;
            for kind in ["mapped", "advised", "none", "paper", "schedule"] {
                let is_virtual = ["mapped", "advised"].contains(&kind);
                if is_virtual && !also_virtual {
                    continue;
                }
                let file = if is_virtual { &mapped } else { &meta };
                // A tenth is left to what is being read.
                let page_memory = memory / 10 * 9;
                let runs: Vec<Run> =
                    (0..ROUNDS).filter_map(|_| run(&group, kind, file, &path, limit, page_memory)).collect();
                let label = format!("{name:8} {parts}/{of}          {kind:9}");
                let Some(first) = runs.first() else {
                    println!("{label} the first view took more than {:?}", 2 * PATIENCE);
                    continue;
                };
                let frames = runs.iter().map(|run| run.frames.len()).min().unwrap_or(0);
                let least = |frame: usize| runs.iter().map(|run| run.frames[frame]).fold(f64::MAX, f64::min);
                let times: Vec<f64> = (0..frames).map(least).collect();
                if times.is_empty() {
                    println!("{label} no frame but the first view in {PATIENCE:?}");
                    continue;
                }
                let most = times.iter().copied().fold(0.0, f64::max);
                let [mean, median, p99] = spread(times);
                let misses: Vec<f64> = runs.iter().map(|run| run.misses).collect();
                println!(
                    "{label} {frames:6} {mean:18.1} {median:7.1} {p99:8.1} {most:8.1} {:8.2} {:12.0} {:12.0} {:12} {:12}",
                    spread(misses)[0],
                    first.changes,
                    first.triangles,
                    first.major_faults[1],
                    first.major_faults[0],
                );
                if frames < walk.frames.len() {
                    println!("{:22} ended after {PATIENCE:?}: no ratio is taken of it", "");
                } else if is_virtual {
                    let best = best_virtual.get_or_insert([f64::MAX; 2]);
                    (best[0], best[1]) = (best[0].min(mean), best[1].min(p99));
                } else if let Some(best) = best_virtual {
                    let ratios = [best[0] / mean, best[1] / p99];
                    println!(
                        "{:22} better of the mapped : {kind}   mean {:.2}   p99 {:.2}",
                        "", ratios[0], ratios[1]
                    );
                }
            }
        }
    }
}

/// What a replay amounted to.
struct Run {
    frames: Vec<f64>,
    misses: f64,
    changes: f64,
    triangles: f64,
    anonymous: u64,
    /// Of the first view, and of the frames.
    major_faults: [u64; 2],
}

/// Runs one replay in a process of its own.
fn run(group: &Group, kind: &str, file: &FilePath, path: &FilePath, limit: u64, memory: u64) -> Option<Run> {
    let program = std::env::current_exe().expect("it is running");
    // The program comes into the page cache at nobody's cost; the file leaves it, where it would be charged to nobody here.
    fs::read(&program).expect("it can be read");
    let input = format!("if={}", file.display());
    Command::new("dd").args([&input, "of=/dev/null", "iflag=nocache", "count=0"]).output().ok()?;
    group.limit(limit);
    let mut child = Command::new(program)
        .args(["child", kind])
        .args([file, path])
        .arg(memory.to_string())
        .arg(group.members())
        .stdout(Stdio::piped())
        .spawn()
        .expect("it can be started again");
    let start = Instant::now();
    while child.try_wait().ok()?.is_none() {
        if start.elapsed() > 2 * PATIENCE {
            child.kill().ok()?;
            child.wait().ok()?;
            return None;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let output = child.wait_with_output().ok()?;
    if !output.status.success() {
        eprintln!("{kind}: {}", output.status);
        return None;
    }
    let numbers: Vec<f64> =
        String::from_utf8_lossy(&output.stdout).split_whitespace().filter_map(|w| w.parse().ok()).collect();
    let [misses, changes, triangles, anonymous, before, after, ref frames @ ..] = numbers[..] else {
        return None;
    };
    let major_faults = [before as u64, after as u64];
    Some(Run {
        frames: frames.to_vec(),
        misses,
        changes,
        triangles,
        anonymous: anonymous as u64,
        major_faults,
    })
}

/// The other side of [`run`].
pub fn child(arguments: &[String]) {
    let [kind, file, path, memory, members, ..] = arguments else { panic!("{arguments:?}") };
    fs::write(members, std::process::id().to_string()).expect("the control group takes it");
    let file = PathBuf::from(file);
    let walk = Path::read(FilePath::new(path)).expect("just written");
    let views = views(&walk, 1.0);
    match Prefetch::ALL.into_iter().find(|prefetch| prefetch.name() == kind) {
        None => replay(MappedTree::open(&file, kind == "advised"), &walk, &views),
        Some(prefetch) => {
            let page_memory = memory.parse().expect("a number");
            let settings = Settings { page_memory, prefetch, ..Settings::default() };
            replay(MetaNodeTree::new(open(&file), settings).expect("enough memory"), &walk, &views);
        }
    }
}

fn replay<T: VertexTree>(tree: T, walk: &Path, views: &[View]) {
    let start = Instant::now();
    let mut engine =
        Engine::new(tree, ActiveMesh::new(), settings(walk, Strategy::Event)).expect("the store is fine");
    loop {
        let report = engine.advance(&views[..1]).expect("the store is fine");
        engine.tree_mut().settle().expect("the store is fine");
        engine.sink_mut().clear_changes();
        if report.misses == 0 {
            break;
        }
    }
    let before = major_faults();
    let (mut times, mut misses, mut changes, mut triangles) = (Vec::new(), 0, 0, 0);
    let mut next = Instant::now();
    for view in views {
        next = (next + Duration::from_micros(16_667)).max(Instant::now());
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        let report = engine.advance(std::slice::from_ref(view)).expect("the store is fine");
        engine.sink_mut().clear_changes();
        times.push(report.select.as_nanos() as f64 / 1e3);
        misses += report.misses;
        changes += report.unfolds + report.folds;
        triangles += report.displayed;
        if start.elapsed() > PATIENCE {
            break;
        }
    }
    let count = times.len().max(1) as f64;
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let anonymous = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap_or("0 kB");
    let anonymous: u64 = anonymous.trim().trim_end_matches(" kB").trim().parse().unwrap_or(0);
    println!(
        "{} {} {} {} {} {}",
        100.0 * misses as f64 / (misses + changes).max(1) as f64,
        changes as f64 / count,
        triangles as f64 / count,
        anonymous * 1024,
        before,
        major_faults() - before
    );
    times.iter().for_each(|time| println!("{time}"));
}

/// Page faults of this process so far for which something had to be read.
fn major_faults() -> u64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    after_name.split_whitespace().nth(9).and_then(|field| field.parse().ok()).unwrap_or(0)
}

/// A control group of this benchmark's own.
struct Group {
    folder: PathBuf,
    limit: &'static str,
}

impl Group {
    /// In the memory hierarchy of version 1, or in that of version 2.
    fn new() -> Option<Self> {
        let name = format!("foldfront-bench-{}", std::process::id());
        [("/sys/fs/cgroup/memory", "memory.limit_in_bytes"), ("/sys/fs/cgroup", "memory.max")]
            .into_iter()
            .find_map(|(root, limit)| {
                let folder = FilePath::new(root).join(&name);
                fs::create_dir(&folder).ok()?;
                let group = Self { folder, limit };
                fs::write(group.folder.join(limit), (1_u64 << 34).to_string()).ok().map(|()| group)
            })
    }

    fn limit(&self, bytes: u64) {
        let bytes = bytes.min(1 << 40);
        // What earlier processes have left is given back first, or the limit can not be set.
        let _ = fs::write(self.folder.join("memory.force_empty"), "0");
        fs::write(self.folder.join(self.limit), bytes.to_string()).expect("the limit can be set");
    }

    fn members(&self) -> PathBuf {
        self.folder.join("cgroup.procs")
    }
}

impl Drop for Group {
    fn drop(&mut self) {
        let _ = fs::remove_dir(&self.folder);
    }
}
