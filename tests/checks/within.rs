//! Construction within little memory: the same result as in memory, whatever the memory.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use foldfront::collapse_log::read_log;
use foldfront::construction::mesh_io::{MeshIoError, Receiver};
use foldfront::construction::simplify::{LEAST_MEMORY, Limits, Report, build_within};
use foldfront::{CollapseLog, Mesh};

use crate::hierarchy::{check, options, simplify};

/// Bytes a vertex that the construction in memory takes at its most, measured on the 2.9 million triangles of N36W119.
const BYTES_A_VERTEX: u64 = 300;

pub fn send(mesh: &Mesh, receiver: &mut dyn Receiver) -> Result<(), MeshIoError> {
    mesh.positions
        .iter()
        .try_for_each(|&p| receiver.position(p.map(f64::from)))
        .map_err(MeshIoError::Receiver)?;
    mesh.triangles.iter().try_for_each(|&t| receiver.triangle(t)).map_err(MeshIoError::Receiver)
}

pub fn limits<'a>(memory: u64, folder: &Path, stop: &'a AtomicBool) -> Limits<'a> {
    Limits { memory, temporary: folder.to_owned(), threads: 2, expected_triangles: 0, stop }
}

pub fn build(mesh: &Mesh, merge: bool, memory: u64) -> (CollapseLog, Report) {
    build_with(mesh, merge, memory, 2)
}

pub fn build_with(mesh: &Mesh, merge: bool, memory: u64, threads: usize) -> (CollapseLog, Report) {
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

pub fn names(folder: &Path) -> Vec<String> {
    std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

/// The log, and all of the report but times, are those of the construction in memory.
pub fn assert_same(mesh: &Mesh, merge: bool, memory: u64) -> Report {
    let in_memory = simplify(mesh, merge);
    assert_same_as(&in_memory, mesh, merge, memory, 2)
}

pub fn assert_same_as(
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

/// The memory changes how often the file is passed over, and nothing else.
pub fn the_memory_does_not_matter(mesh: &Mesh) {
    let windows = [LEAST_MEMORY, 1 << 20, 4 << 20, 1 << 30].map(|m| assert_same(mesh, false, m).windows);
    assert!(windows.is_sorted_by(|a, b| a > b), "{windows:?}");
}

/// Nor does the number of threads, with so much memory, which takes at least so many windows.
pub fn threads_do_not_matter(mesh: &Mesh, memory: u64, windows: u64) {
    let in_memory = simplify(mesh, false);
    for threads in [1, 2, 3, 4] {
        let report = assert_same_as(&in_memory, mesh, false, memory, threads);
        assert!(report.windows > windows, "{report:?}");
    }
}

/// Where there is memory enough, components are merged as in memory.
pub fn components_are_merged_as_in_memory(mesh: &Mesh) {
    let report = assert_same(mesh, true, 1 << 30);
    assert!(report.roots < 10, "{report:?}");
}

/// With less, they are merged once what is left fits.
pub fn components_are_merged_late(mesh: &Mesh, memory: u64) {
    let (log, report) = build(mesh, true, memory);
    assert!(report.windows > 10 && report.roots < 10, "{report:?}");
    check(mesh, &log, &report);
    assert!(build_with(mesh, true, memory, 1).0 == log, "another log with one thread");
}

/// The invariant of a pass: nothing is collapsed beyond its longest spanning edge, and in ascending order.
pub fn a_twentieth_is_enough(mesh: &Mesh) {
    let report = assert_same(mesh, false, mesh.positions.len() as u64 * BYTES_A_VERTEX / 20);
    assert!(report.windows > 100, "{report:?}");
    for round in &report.rounds {
        let [first, last] = round.keys;
        assert!(first <= last && last <= round.limit, "{round:?}");
    }
    assert_eq!(report.rounds.iter().map(|r| r.collapses).sum::<usize>(), report.collapses);
}
