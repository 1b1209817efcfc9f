//! Table 2: frames with little memory, external memory against virtual memory.
//!
//! Each replay runs in a process of its own, alone in a control group whose memory is limited to what the process needs
//! without any page, and so much more. Files are dropped from the page cache before. Frames come at 60 a second, and
//! what a frame takes is the whole refinement step with the displayed mesh.

use std::fs;
use std::path::{Path as FilePath, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use foldfront::active_mesh::ActiveMesh;
use foldfront::engine::Engine;
use foldfront::path::Path;
use foldfront::path::import::Mode;
use foldfront::refine::Strategy;
use foldfront::vertex_tree::VertexTree;
use foldfront::view::View;
use meta_node::{BuildOptions, MetaNodeTree, Settings};

use crate::selection::settings;
use crate::subject::{imported, kept, log, meta_nodes, open, spread, views};
use crate::virtual_memory::{self, MappedTree};

/// Each replay is made this often. Of each frame the least times count: what else the machine does can only add.
const ROUNDS: usize = 3;
const FRAMES: usize = 600;
/// What a process needs that is in no table: code, stacks, the kernel's own.
const SLACK: u64 = 4 << 20;

pub fn table() {
    let Some(group) = Group::new() else {
        println!("frames: no control group with a memory limit can be made here; nothing is measured");
        return;
    };
    println!(
        "mesh     memory MB (of file)  tree     us a frame: mean  median     p99     max   misses %  changes/frame  triangles"
    );
    for (name, trajectory, mode, rate) in [
        ("dragon", "euroc_mh04_drone.txt", Mode::Fly, 60.0),
        ("sierra", "euroc_mh04_drone.txt", Mode::Fly, 60.0),
        ("sierra", "kitti_00_car_10hz.txt", Mode::Walk, 30.0),
    ] {
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
        let Some(base) = run(&group, "virt", &mapped, &path, u64::MAX, u64::MAX).map(|run| run.anonymous)
        else {
            continue;
        };
        for share in [16, 8, 4, 2] {
            let memory = bytes / share;
            let mut means = Vec::new();
            for (kind, file) in [("virt", &mapped), ("ext", &meta)] {
                let limit = base + memory + SLACK;
                // A tenth is left to what is being read.
                let runs: Vec<Run> = (0..ROUNDS)
                    .filter_map(|_| run(&group, kind, file, &path, limit, memory / 10 * 9))
                    .collect();
                let Some(first) = runs.first() else {
                    println!("{name:8} {:9.1} (1/{share})  {kind}  did not finish", memory as f64 / 1e6);
                    continue;
                };
                let least = |frame: usize| runs.iter().map(|run| run.frames[frame]).fold(f64::MAX, f64::min);
                let times: Vec<f64> = (0..first.frames.len()).map(least).collect();
                let most = times.iter().copied().fold(0.0, f64::max);
                let [mean, median, p99] = spread(times);
                means.push([mean, p99]);
                let misses: Vec<f64> = runs.iter().map(|run| run.misses).collect();
                println!(
                    "{name:8} {:9.1} (1/{share:<2})       {kind:5}  {mean:17.1} {median:7.1} {p99:9.1} {most:9.1} \
                     {:8.2} {:12.0} {:12.0}",
                    memory as f64 / 1e6,
                    spread(misses)[0],
                    first.changes,
                    first.triangles
                );
            }
            if let [virt, ext] = means[..] {
                println!("{:40} virt : ext   mean {:.2}   p99 {:.2}", "", virt[0] / ext[0], virt[1] / ext[1]);
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
}

/// Runs one replay in a process of its own.
fn run(group: &Group, kind: &str, file: &FilePath, path: &FilePath, limit: u64, memory: u64) -> Option<Run> {
    // The file leaves the page cache, in which it would be charged to nobody here.
    let drop_cache = |file: &FilePath| {
        let input = format!("if={}", file.display());
        Command::new("dd").args([&input, "of=/dev/null", "iflag=nocache", "count=0"]).output().is_ok()
    };
    if !drop_cache(file) {
        return None;
    }
    group.limit(limit);
    let program = std::env::current_exe().expect("it is running");
    let output = Command::new(program)
        .args(["child", kind])
        .args([file, path])
        .arg(memory.to_string())
        .arg(group.members())
        .output()
        .expect("it can be started again");
    if !output.status.success() {
        eprintln!("{kind}: {} {}", output.status, String::from_utf8_lossy(&output.stderr));
        return None;
    }
    let numbers: Vec<f64> =
        String::from_utf8_lossy(&output.stdout).split_whitespace().filter_map(|w| w.parse().ok()).collect();
    let [misses, changes, triangles, anonymous, ref frames @ ..] = numbers[..] else { return None };
    Some(Run { frames: frames.to_vec(), misses, changes, triangles, anonymous: anonymous as u64 })
}

/// The other side of [`run`].
pub fn child(arguments: &[String]) {
    let [kind, file, path, memory, members, ..] = arguments else { panic!("{arguments:?}") };
    fs::write(members, std::process::id().to_string()).expect("the control group takes it");
    let file = PathBuf::from(file);
    let walk = Path::read(FilePath::new(path)).expect("just written");
    let views = views(&walk, 1.0);
    if kind == "virt" {
        replay(MappedTree::open(&file), &walk, &views);
    } else {
        let page_memory = memory.parse().expect("a number");
        let settings = Settings { page_memory, ..Settings::default() };
        replay(MetaNodeTree::new(open(&file), settings).expect("enough memory"), &walk, &views);
    }
}

fn replay<T: VertexTree>(tree: T, walk: &Path, views: &[View]) {
    let mut engine =
        Engine::new(tree, ActiveMesh::new(), settings(walk, Strategy::Event)).expect("the store is fine");
    loop {
        let report = engine.advance(&views[..1]).expect("the store is fine");
        engine.tree_mut().settle().expect("the store is fine");
        engine.mesh_mut().clear_changes();
        if report.misses == 0 {
            break;
        }
    }
    let (mut times, mut misses, mut changes, mut triangles) = (Vec::new(), 0, 0, 0);
    let mut next = Instant::now();
    for view in views {
        next = (next + Duration::from_micros(16_667)).max(Instant::now());
        std::thread::sleep(next.saturating_duration_since(Instant::now()));
        let report = engine.advance(std::slice::from_ref(view)).expect("the store is fine");
        engine.mesh_mut().clear_changes();
        times.push(report.select.as_nanos() as f64 / 1e3);
        misses += report.misses;
        changes += report.unfolds + report.folds;
        triangles += report.triangles;
    }
    let count = views.len() as f64;
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let anonymous = status.lines().find_map(|line| line.strip_prefix("RssAnon:")).unwrap_or("0 kB");
    let anonymous: u64 = anonymous.trim().trim_end_matches(" kB").trim().parse().unwrap_or(0);
    println!(
        "{} {} {} {}",
        100.0 * misses as f64 / (misses + changes).max(1) as f64,
        changes as f64 / count,
        triangles as f64 / count,
        anonymous * 1024
    );
    times.iter().for_each(|time| println!("{time}"));
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
