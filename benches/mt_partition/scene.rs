//! A scene of many objects: "if there are many objects in the scene the partition size should be enlarged to 50-100, to reduce
//! file operations" (Holst & Schumann 2007, section 4.2).
//!
//! A hundred objects of four models stand in a square, turned and scaled, and a camera walks between them. The models are made here,
//! closed and bumpy, of 20 to 60 thousand triangles; where the shared data are, four scans stand there a second time.
//! One memory and one store for all of them. For each size of partitions:
//!
//! * settled, with memory for everything: reads and bytes by frame, the most in memory, and the time of selection, the least of
//!   three replays for each frame;
//! * on virtual time at 60 frames a second, with a store of 5 ms and as much memory as the settled replay with partitions
//!   of 20 took: misses, reads and bytes.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use foldfront::CollapseLog;
use foldfront::Mesh;
use foldfront::construction::simplify;
use foldfront::experiment::store::Store;
use foldfront::experiment::stored_scene::{ScenePaging, StoredScene};
use foldfront::page_store::Simulated;
use foldfront::selection::engine::{FrameReport, Settings};
use foldfront::selection::view::{Camera, View, theta_of_pixels};
use foldfront::vertex_tree::Prefetch;
use glam::{DQuat, DVec3};
use mt_partition::{BuildOptions, CacheMode, Memory, Reader};

use crate::model_log;

/// Most nodes in a partition: today's default first.
const SIZES: [u32; 4] = [20, 50, 75, 100];
/// Objects a side of the square, two units apart.
const SIDE: usize = 10;
const FRAMES: usize = 600;
const FRAME: Duration = Duration::from_nanos(16_666_667);
const LATENCY: Duration = Duration::from_millis(5);
const ROUNDS: usize = 3;

/// A closed surface of about `triangles`, of extent 2, with bumps of several sizes.
fn bumpy(triangles: usize, seed: f64) -> Mesh {
    let rows = ((triangles / 4) as f64).sqrt() as usize;
    let columns = 2 * rows;
    let place = |row: usize, column: usize| {
        let (theta, phi) = (
            std::f64::consts::PI * row as f64 / rows as f64,
            std::f64::consts::TAU * column as f64 / columns as f64,
        );
        let at = DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        let bump =
            |k: f64| (k * at.x + seed).sin() * (k * at.y - 2.0 * seed).sin() * (k * at.z + 0.5 * seed).cos();
        (at * (0.8 + 0.15 * bump(3.0) + 0.04 * bump(17.0) + 0.01 * bump(71.0))).as_vec3().to_array()
    };
    let mut mesh = Mesh::default();
    mesh.positions.push(place(0, 0));
    for row in 1..rows {
        mesh.positions.extend((0..columns).map(|column| place(row, column)));
    }
    mesh.positions.push(place(rows, 0));
    let last = mesh.positions.len() as u32 - 1;
    let number = |row: usize, column: usize| match row {
        0 => 0,
        _ if row == rows => last,
        _ => (1 + (row - 1) * columns + column % columns) as u32,
    };
    for row in 0..rows {
        for column in 0..columns {
            let [a, b] = [number(row, column), number(row, column + 1)];
            let [c, d] = [number(row + 1, column), number(row + 1, column + 1)];
            if row > 0 {
                mesh.triangles.push([a, c, b]);
            }
            if row + 1 < rows {
                mesh.triangles.push([b, c, d]);
            }
        }
    }
    mesh
}

fn made() -> Vec<CollapseLog> {
    let build = |(triangles, seed)| {
        let built = simplify::build(bumpy(triangles, seed), &simplify::Options::default(), &mut |_, _| ());
        built.expect("a closed surface").0
    };
    [(20_000, 1.0), (30_000, 2.0), (45_000, 3.0), (60_000, 4.0)].map(build).into()
}

/// Four scans, if all of them are there.
fn scans() -> Option<Vec<CollapseLog>> {
    ["armadillo_100k", "lucy_100k", "horse", "bunny"].into_iter().map(model_log).collect()
}

/// From one corner of the square to the other and back along its side, between the objects.
fn walk() -> Vec<View> {
    let end = 2.0 * (SIDE - 1) as f64;
    let corners = [
        DVec3::new(-4.0, -4.0, 1.5),
        DVec3::new(end + 1.0, end + 1.0, 1.2),
        DVec3::new(-1.0, end + 1.0, 1.2),
    ];
    let view = |frame: usize| {
        let share = frame as f64 / FRAMES as f64 * 2.0;
        let leg = share as usize;
        let eye = corners[leg].lerp(corners[leg + 1], share.fract());
        // The look goes from side to side, as one does in a collection.
        let aside = DQuat::from_rotation_z(0.7 * (share * 9.0).sin());
        let target = eye + aside * (corners[leg + 1] - corners[leg]).with_z(-1.0);
        let camera = Camera::look_at(eye, target, DVec3::Z, std::f64::consts::FRAC_PI_3, 16.0 / 9.0);
        View::new(&camera.expect("a camera"), theta_of_pixels(1.0, 1080)).expect("a tolerance")
    };
    (0..FRAMES).map(view).collect()
}

/// Writes the models with partitions of a size, and the scene.
fn write(folder: &Path, models: &[CollapseLog], partition: u32) -> StoredScene {
    for (number, log) in models.iter().enumerate() {
        let options = BuildOptions { partition, ..BuildOptions::default() };
        mt_partition::write(&folder.join(format!("{number}.mt")), log, &options).expect("target is writable");
    }
    let mut text = String::new();
    for at in 0..SIDE * SIDE {
        let model = (at * 7 + at / SIDE) % models.len();
        let (lo, hi) = models[model].mesh.bounding_box().unwrap_or_default();
        let [lo, hi] = [lo, hi].map(|corner| DVec3::from(corner.map(f64::from)));
        let scale = (1.6 + 0.1 * (at % 5) as f64) / (hi - lo).max_element();
        let turn = DQuat::from_rotation_z(at as f64);
        let place = DVec3::new(2.0 * (at % SIDE) as f64, 2.0 * (at / SIDE) as f64, 0.8);
        let moved = place - turn * (scale * (lo + hi) / 2.0);
        let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn * (scale * axis));
        let rows = [x.x, y.x, z.x, moved.x, x.y, y.y, z.y, moved.y, x.z, y.z, z.z, moved.z];
        text += &format!("{model}.mt {}\n", rows.map(|x| x.to_string()).join(" "));
    }
    let file = folder.join("objects.scene");
    std::fs::write(&file, text).expect("target is writable");
    StoredScene::open(&file).expect("it was just written")
}

fn replay(
    scene: &StoredScene,
    views: &[View],
    cache: CacheMode,
    memory: Memory,
    store: Option<Simulated>,
) -> Vec<FrameReport> {
    let reader = store.map(Reader::simulated);
    let mt_partition = mt_partition::Settings { cache, memory, reader, prefetch: Prefetch::None };
    let paging = ScenePaging { mt_partition, ..ScenePaging::default() };
    let settings = Settings { rho: 0.05, omega: 0.02, ..Settings::default() };
    let mut reports = Vec::new();
    let frame = store.map(|_| FRAME);
    let replayed = scene.replay(views, settings, &paging, frame, |_, _, report| {
        reports.push(report);
        ControlFlow::Continue(())
    });
    replayed.expect("files that are whole");
    reports
}

fn sum(reports: &[FrameReport], of: impl Fn(&FrameReport) -> u64) -> u64 {
    reports.iter().map(of).sum()
}

pub fn scenes(folder: &Path) {
    let folder = folder.join("scene");
    std::fs::create_dir_all(&folder).expect("target is writable");
    let views = walk();
    for (name, models) in [("made", Some(made())), ("scans", scans())] {
        let Some(models) = models else {
            println!("scene of {name}: the data are not there");
            continue;
        };
        println!(
            "scene of {} objects, {name}, {} frames\n{:9} {:5} {:>10} {:>9} {:>9} {:>8} {:>9} {:>8} | {:>8} {:>8} {:>9} {:>8}",
            SIDE * SIDE,
            views.len(),
            "partition",
            "cache",
            "partitions",
            "median us",
            "99 % us",
            "reads",
            "MiB",
            "peak MiB",
            "misses",
            "miss %",
            "reads",
            "MiB"
        );
        let mut budget = 0;
        for size in SIZES {
            let scene = write(&folder, &models, size);
            for cache in [CacheMode::PCc, CacheMode::PC] {
                row(&scene, &views, size, cache, &mut budget);
            }
        }
    }
}

fn row(scene: &StoredScene, views: &[View], size: u32, cache: CacheMode, budget: &mut u64) {
    const MIB: f64 = (1_u64 << 20) as f64;
    let rounds: Vec<_> =
        (0..ROUNDS).map(|_| replay(scene, views, cache, Memory::new(u64::MAX), None)).collect();
    let settled = &rounds[0];
    // The first frame reads what all later ones begin with.
    let mut times: Vec<Duration> = (1..views.len())
        .map(|frame| rounds.iter().map(|round| round[frame].select).min().unwrap_or_default())
        .collect();
    times.sort_unstable();
    let time = |share: usize| times[times.len() * share / 100].as_secs_f64() * 1e6;
    let peak = settled.iter().map(|report| report.pages.resident_bytes).max().unwrap_or(0);
    if *budget == 0 {
        *budget = peak.max(scene.least_memory());
    }
    let late = replay(scene, views, cache, Memory::new(*budget), Some(Simulated::with_latency(LATENCY)));
    let (misses, changes) = (sum(&late[1..], |r| r.misses), sum(&late[1..], |r| r.unfolds + r.folds));
    let partitions: u64 = scene
        .files()
        .iter()
        .flat_map(Store::facts)
        .filter(|(fact, _)| *fact == "partitions")
        .filter_map(|(_, count)| count.split(' ').next()?.parse::<u64>().ok())
        .sum();
    println!(
        "{size:9} {:5} {partitions:10} {:9.1} {:9.1} {:8} {:9.1} {:8.1} | {misses:8} {:8.3} {:9} {:8.1}",
        cache.name(),
        time(50),
        time(99),
        sum(settled, |r| r.pages.reads),
        sum(settled, |r| r.pages.read_bytes) as f64 / MIB,
        peak as f64 / MIB,
        100.0 * misses as f64 / (misses + changes).max(1) as f64,
        sum(&late, |r| r.pages.reads),
        sum(&late, |r| r.pages.read_bytes) as f64 / MIB,
    );
}
