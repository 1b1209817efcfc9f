//! Construction within little memory: the same result as in memory, whatever the memory, or else nothing at all.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use foldfront::mesh_io::{MeshIoError, Receiver};
use foldfront::simplify::{LEAST_MEMORY, Limits, OutOfCoreError, Report, build_within};
use foldfront::vertex_tree::{Georeference, LogError, read_log};
use foldfront::{CollapseLog, Mesh};

use crate::common::data;
use crate::{check, difficult, flat_grid, options, simplify};

/// Bytes a vertex that the construction in memory takes at its most, measured on the 2.9 million triangles of N36W119.
const BYTES_A_VERTEX: u64 = 300;

fn send(mesh: &Mesh, receiver: &mut dyn Receiver) -> Result<(), MeshIoError> {
    mesh.positions
        .iter()
        .try_for_each(|&p| receiver.position(p.map(f64::from)))
        .map_err(MeshIoError::Receiver)?;
    mesh.triangles.iter().try_for_each(|&t| receiver.triangle(t)).map_err(MeshIoError::Receiver)
}

fn limits<'a>(memory: u64, folder: &Path, stop: &'a AtomicBool) -> Limits<'a> {
    Limits { memory, temporary: folder.to_owned(), threads: 2, expected_triangles: 0, stop }
}

fn build(mesh: &Mesh, merge: bool, memory: u64) -> (CollapseLog, Report) {
    build_with(mesh, merge, memory, 2)
}

fn build_with(mesh: &Mesh, merge: bool, memory: u64, threads: usize) -> (CollapseLog, Report) {
    let folder = tempfile::tempdir().unwrap();
    let (file, stop) = (folder.path().join("log"), AtomicBool::new(false));
    let limits = Limits { threads, ..limits(memory, folder.path(), &stop) };
    let mut last = 0;
    let progress = &mut |done, all| {
        assert!(last <= done && done <= all);
        last = done;
    };
    let report = build_within(|r, _| send(mesh, r), &file, &options(merge), &limits, progress).unwrap();
    assert_eq!(names(folder.path()), ["log"]);
    (read_log(&file).unwrap(), report)
}

/// A town, about its own middle: where that is in the world is not sent.
fn town() -> Option<Mesh> {
    let mesh = data::mesh("city/denhaag01_lod2_terrain.obj")?;
    Some(Mesh { georeference: Georeference::default(), ..mesh })
}

fn names(folder: &Path) -> Vec<String> {
    std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

/// The log, and all of the report but times, are those of the construction in memory.
fn assert_same(mesh: &Mesh, merge: bool, memory: u64) -> Report {
    let in_memory = simplify(mesh, merge);
    assert_same_as(&in_memory, mesh, merge, memory, 2)
}

fn assert_same_as(
    (expected, in_memory): &(CollapseLog, Report),
    mesh: &Mesh,
    merge: bool,
    memory: u64,
    threads: usize,
) -> Report {
    let (log, report) = build_with(mesh, merge, memory, threads);
    assert!(log == *expected, "another log within {memory} bytes, with {threads} threads");
    let facts = |r: &Report| {
        (
            (r.triangles, r.collapses, r.rounds.clone(), r.roots, r.tree_depth),
            (r.dependency_depth, r.base_triangles, r.largest_eps, r.inversions),
        )
    };
    assert_eq!(facts(&report), facts(in_memory));
    report
}

#[test]
fn difficult_meshes_are_the_same_within_little_memory() {
    for (name, mesh) in difficult() {
        println!("{name}");
        assert_same(&mesh, false, LEAST_MEMORY);
        for merge in [false, true] {
            assert_same(&mesh, merge, 1 << 30);
        }
    }
}

#[test]
fn the_result_does_not_depend_on_the_memory() {
    let Some(mesh) = data::mesh("meshes/bunny.ply") else { return };
    let windows = [LEAST_MEMORY, 1 << 20, 4 << 20, 1 << 30].map(|m| assert_same(&mesh, false, m).windows);
    assert!(windows.is_sorted_by(|a, b| a > b), "{windows:?}");
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    let Some(mesh) = data::mesh("meshes/lucy_100k.ply") else { return };
    let in_memory = simplify(&mesh, false);
    for threads in [1, 2, 3, 4] {
        let report = assert_same_as(&in_memory, &mesh, false, 1 << 20, threads);
        assert!(report.windows > 100, "{report:?}");
    }
}

/// Stars that vanish as a whole, and edges that are long for blocks as small as these.
#[test]
fn a_town_does_not_depend_on_the_number_of_threads() {
    let Some(mesh) = town() else { return };
    let in_memory = simplify(&mesh, false);
    for threads in [1, 4] {
        let report = assert_same_as(&in_memory, &mesh, false, 4 << 20, threads);
        assert!(report.windows > 10, "{report:?}");
    }
}

#[test]
fn components_are_merged_as_in_memory_where_there_is_enough() {
    let Some(mesh) = town() else { return };
    let report = assert_same(&mesh, true, 1 << 30);
    assert!(report.roots < 10, "{report:?}");
}

/// With less, they are merged once what is left fits.
#[test]
fn components_are_merged_within_little_memory() {
    let Some(mesh) = town() else { return };
    let (log, report) = build(&mesh, true, 4 << 20);
    assert!(report.windows > 10 && report.roots < 10, "{report:?}");
    check(&mesh, &log, &report);
    assert!(build_with(&mesh, true, 4 << 20, 1).0 == log, "another log with one thread");
}

/// The invariant of a pass: nothing is collapsed beyond its longest spanning edge, and in ascending order.
fn with_memory_for_a_twentieth(mesh: &Mesh) {
    let report = assert_same(mesh, false, mesh.positions.len() as u64 * BYTES_A_VERTEX / 20);
    assert!(report.windows > 100, "{report:?}");
    for round in &report.rounds {
        let [first, last] = round.keys;
        assert!(first <= last && last <= round.limit, "{round:?}");
    }
    assert_eq!(report.rounds.iter().map(|r| r.collapses).sum::<usize>(), report.collapses);
}

#[test]
fn dragon_with_memory_for_a_twentieth() {
    data::mesh("meshes/dragon.ply").iter().for_each(with_memory_for_a_twentieth);
}

#[test]
fn happy_with_memory_for_a_twentieth() {
    data::mesh("meshes/happy.ply").iter().for_each(with_memory_for_a_twentieth);
}

/// Wherever it is stopped, it ends with an error; what was there before is still there, and nothing else.
#[test]
fn nothing_is_left_of_an_interrupted_construction() {
    let mesh = flat_grid(150, 1.0);
    let steps = |stop_at: u32| {
        let folder = tempfile::tempdir().unwrap();
        let (file, stop) = (folder.path().join("log"), AtomicBool::new(false));
        std::fs::write(&file, "written earlier").unwrap();
        let limits = limits(LEAST_MEMORY, folder.path(), &stop);
        let mut steps = 0;
        let progress = &mut |_, _| {
            steps += 1;
            stop.store(steps >= stop_at, Ordering::Relaxed);
        };
        let outcome = build_within(|r, _| send(&mesh, r), &file, &options(false), &limits, progress);
        assert_eq!(names(folder.path()), ["log"]);
        if outcome.is_err() {
            assert!(matches!(outcome, Err(OutOfCoreError::Interrupted)), "{outcome:?}");
            assert_eq!(std::fs::read(&file).unwrap(), b"written earlier");
        }
        (steps, outcome.is_ok())
    };
    let (all, finished) = steps(u32::MAX);
    assert!(finished && all > 30, "{all}");
    for stop_at in (1..all).step_by(all as usize / 20) {
        assert!(!steps(stop_at).1, "stopped at step {stop_at} of {all}");
    }
}

#[test]
fn failures_are_named() {
    let (folder, stop) = (tempfile::tempdir().unwrap(), AtomicBool::new(false));
    let mesh = flat_grid(10, 1.0);
    let run = |temporary: &Path, file: &str, wrong: bool| {
        let limits = limits(1 << 20, temporary, &stop);
        let read = |receiver: &mut dyn Receiver, _: &mut dyn FnMut(u64, u64)| {
            send(&mesh, receiver)?;
            if wrong { Err(MeshIoError::NoInput) } else { Ok(()) }
        };
        let file = folder.path().join(file);
        build_within(read, &file, &options(false), &limits, &mut |_, _| ()).unwrap_err()
    };
    let missing = folder.path().join("missing");
    let error = run(&missing, "log", false);
    assert!(matches!(error, OutOfCoreError::Temporary { .. }), "{error:?}");
    assert!(error.to_string().contains("missing"), "{error}");
    let full = Limits { expected_triangles: 1 << 50, ..limits(1 << 20, folder.path(), &stop) };
    let read = |_: &mut dyn Receiver, _: &mut dyn FnMut(u64, u64)| panic!("read, though there is no room");
    let error = build_within(read, &missing, &options(false), &full, &mut |_, _| ()).unwrap_err();
    assert!(matches!(error, OutOfCoreError::Room { triangles: 0x4_0000_0000_0000, .. }), "{error:?}");
    let error = run(folder.path(), "nowhere/log", false);
    assert!(matches!(error, OutOfCoreError::Log(_)), "{error:?}");
    let error = run(folder.path(), "log", true);
    assert!(matches!(error, OutOfCoreError::Input(MeshIoError::NoInput)), "{error:?}");
    let limits = limits(1 << 20, folder.path(), &stop);
    for (position, triangle) in [([0.0; 3], [0, 1, 101]), ([0.0, f32::NAN, 0.0], [0, 1, 2])] {
        let read = |receiver: &mut dyn Receiver, _: &mut dyn FnMut(u64, u64)| {
            send(&mesh, receiver)?;
            receiver
                .position(position.map(f64::from))
                .and_then(|()| receiver.triangle(triangle))
                .map_err(MeshIoError::Receiver)
        };
        let outcome = build_within(read, &missing, &options(false), &limits, &mut |_, _| ());
        match outcome {
            Err(OutOfCoreError::Mesh(LogError::BadPosition { vertex: 100, .. })) => {
                assert!(position[1].is_nan());
            }
            Err(OutOfCoreError::Mesh(LogError::CornerOutOfRange { vertex, vertices, .. })) => {
                assert_eq!((vertex, vertices), (101, 101));
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(names(folder.path()), <[&str; 0]>::default());
}
