//! Files that are written with less memory than the graph takes.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use foldfront::page_store::source::MemorySource;
use foldfront::{CollapseLog, Hierarchy};
use mt_partition::{
    BuildOptions, CacheMode, FileError, Memory, MtError, MtFile, Workspace, WorkspaceError, WriteReport,
    write_within,
};

use super::surface::assert_closed;
use super::{Walk, ball_log, engine};
use crate::common::data;
use crate::patches::assert_finest_is_input;
use foldfront::testing::strict_mesh::StrictMesh;

fn write(
    path: &Path,
    log: &CollapseLog,
    options: &BuildOptions,
    memory: u64,
) -> Result<WriteReport, MtError> {
    let (folder, stop) = (path.parent().unwrap().to_owned(), &AtomicBool::new(false));
    write_within(path, log, options, &Workspace { folder, memory, stop })
}

fn open(path: &Path) -> Arc<MtFile> {
    let source = MemorySource::new("within.mt", std::fs::read(path).unwrap());
    Arc::new(MtFile::open(Arc::new(source)).unwrap())
}

/// With dozens of regions, merging must not close a cycle that leaves a region and comes back: the file verifies (layers
/// grow along every arc), every cut is a closed surface, and the finest is the input.
#[test]
fn every_cut_is_a_surface_whatever_the_memory() {
    let log = ball_log(5);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("within.mt");
    for (seed, (patch, memory)) in [(10.0, 0), (10.0, 200_000), (1e9, 0), (0.0, 0)].into_iter().enumerate() {
        let options = BuildOptions { patch, ..BuildOptions::default() };
        let report = write(&path, &log, &options, memory).unwrap();
        assert_eq!(report.bytes, std::fs::metadata(&path).unwrap().len());
        let file = open(&path);
        file.verify().unwrap();
        let mut engine = engine(&file, CacheMode::PC, Memory::default(), StrictMesh::default());
        let mut walk = Walk::new(seed as u64, 300.0);
        for frame in 0..60 {
            engine.advance(&walk.step()).unwrap();
            engine.tree_mut().settle().unwrap();
            assert_closed(&engine, &format!("patch {patch}, memory {memory}, frame {frame}"));
        }
        assert_finest_is_input(&file, &log.mesh);
    }
}

/// With memory enough the file is that of `write`, bit for bit; with less it is another, the same each time, and about
/// as good.
#[test]
fn less_memory_makes_files_about_as_good() {
    let log = ball_log(6);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("within.mt");
    let options = BuildOptions::default();
    let whole = mt_partition::write(&path, &log, &options).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(write(&path, &log, &options, 64 << 20).unwrap(), whole);
    assert!(bytes == std::fs::read(&path).unwrap());

    // 24 bytes for each triangle.
    let report = write(&path, &log, &options, 24 * whole.triangles).unwrap();
    let other = std::fs::read(&path).unwrap();
    assert!(bytes != other, "it was one region all the time");
    write(&path, &log, &options, 24 * whole.triangles).unwrap();
    assert!(other == std::fs::read(&path).unwrap());
    assert_eq!((report.unreduced, report.triangles), (whole.unreduced, whole.triangles));
    assert!(report.stored_triangles as f64 >= 10.0 * report.arcs as f64, "{report:?}");
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 0.05;
    for (a, b) in [
        (report.stored_triangles as f64, whole.stored_triangles as f64),
        (report.bytes as f64, whole.bytes as f64),
        (report.inflation[0], whole.inflation[0]),
        (report.nodes as f64, whole.nodes as f64),
    ] {
        assert!(near(a, b), "{report:?}\n{whole:?}");
    }
}

#[test]
fn what_goes_wrong_is_said_and_leaves_nothing() {
    let log = data::log(super::bumpy_ball(3));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("within.mt");
    let options = BuildOptions::default();
    let workspace = |folder: &str, stop| Workspace { folder: folder.into(), memory: 0, stop };
    let stop = AtomicBool::new(true);
    let outcome = write_within(&path, &log, &options, &workspace(".", &stop));
    assert!(matches!(outcome, Err(MtError::Workspace(WorkspaceError::Interrupted))), "{outcome:?}");
    let stop = AtomicBool::new(false);
    let outcome = write_within(&path, &log, &options, &workspace("/nowhere/at/all", &stop));
    assert!(
        matches!(&outcome, Err(MtError::Workspace(WorkspaceError::Temporary { folder, .. })) if folder == Path::new("/nowhere/at/all")),
        "{outcome:?}"
    );
    let outcome = write_within(Path::new("/nowhere/within.mt"), &log, &options, &workspace(".", &stop));
    assert!(
        matches!(&outcome, Err(MtError::File(FileError::Write { file, .. })) if file == "/nowhere/within.mt"),
        "{outcome:?}"
    );
    let refused = |change: &dyn Fn(&mut CollapseLog)| {
        let mut log = log.clone();
        change(&mut log);
        match write(&path, &log, &options, 0) {
            Err(MtError::Log(error)) => error == log.forest().unwrap_err(),
            outcome => panic!("{outcome:?}"),
        }
    };
    let removed = log.collapses[3].removed;
    assert!(refused(&|log| log.collapses[7].kept = removed));
    assert!(refused(&|log| log.collapses[7].removed = removed));
    assert!(refused(&|log| log.collapses[5].kept = log.collapses[5].removed));
    assert!(refused(&|log| log.collapses[5].bounds.radius = -1.0));
    assert!(refused(&|log| log.mesh.positions[9][1] = f32::INFINITY));
    assert!(refused(&|log| log.mesh.triangles[9][1] = 1 << 20));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
