//! Files written within little memory, and from logs that are not in memory.

use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::tests::common::{bytes, open, random_log};
use crate::{BuildOptions, MetaNodeError, Workspace, WorkspaceError, write_within};
use collapse_log::{CollapseLog, LogError, LogFile, LogSource, write_log};

static RUNNING: AtomicBool = AtomicBool::new(false);

fn write(folder: &Path, log: &dyn LogSource, memory: u64) -> Result<Vec<u8>, MetaNodeError> {
    let temporary = folder.join("temporary");
    std::fs::create_dir_all(&temporary).unwrap();
    let path = folder.join("tree");
    let workspace = Workspace { folder: temporary.clone(), memory, stop: &RUNNING };
    let outcome = write_within(&path, log, &BuildOptions::default(), &workspace);
    assert_eq!(std::fs::read_dir(temporary).unwrap().count(), 0, "a temporary file is left");
    outcome.map(|_| std::fs::read(path).unwrap())
}

/// One tree, several, and so many that most leaves have none; with vertices and triangles that nothing touches. Memory for
/// subtrees of two leaves, of some dozen, and of all.
#[test]
fn the_file_is_the_same_whatever_the_memory() {
    for (side, left) in [(30, 1), (30, 7), (40, 800), (5, 25)] {
        let mut log = random_log(side, left, 5);
        log.mesh.positions.extend([[-1.0; 3], [-2.0; 3]]);
        let stray = log.mesh.positions.len() as u32 - 1;
        log.mesh.triangles.extend([[0, stray, stray - 1], [3, 3, 4]]);
        let expected = bytes(&log, &BuildOptions::default());
        open(expected.clone()).unwrap().verify().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("log");
        write_log(&file, &log).unwrap();
        let file = LogFile::open(&file).unwrap();
        for memory in [0, 1 << 13, 1 << 15, 1 << 30] {
            assert!(write(folder.path(), &log, memory).unwrap() == expected, "{left} left, {memory} bytes");
            assert!(write(folder.path(), &file, memory).unwrap() == expected, "{left} left, {memory} bytes");
        }
    }
}

#[test]
fn wrong_logs_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let right = random_log(10, 1, 1);
    let fails = |change: &dyn Fn(&mut CollapseLog)| {
        let mut log = right.clone();
        change(&mut log);
        let expected = log.forest().unwrap_err();
        match write(folder.path(), &log, 1 << 12) {
            Err(MetaNodeError::Log(error)) => assert_eq!(error, expected),
            other => panic!("{other:?}, not {expected}"),
        }
        assert!(!folder.path().join("tree").exists());
        expected
    };
    let removed = right.collapses[3].removed;
    fails(&|log| log.collapses[50].kept = removed);
    fails(&|log| log.collapses[50].removed = 100);
    fails(&|log| log.collapses[50].kept = log.collapses[50].removed);
    fails(&|log| log.collapses[98].bounds.eps = -1.0);
    fails(&|log| log.mesh.positions[99][2] = f32::INFINITY);
    let error = fails(&|log| log.mesh.triangles[7][1] = 100);
    assert_eq!(error, LogError::CornerOutOfRange { triangle: 7, vertex: 100, vertices: 100 });
    let nowhere = Workspace { folder: folder.path().join("nowhere"), memory: 0, stop: &RUNNING };
    let error = write_within(&folder.path().join("tree"), &right, &BuildOptions::default(), &nowhere);
    assert!(matches!(error, Err(MetaNodeError::Workspace(WorkspaceError::Temporary { .. }))), "{error:?}");
}

#[test]
fn it_stops_when_it_is_told_to() {
    let folder = tempfile::tempdir().unwrap();
    let workspace = Workspace { folder: folder.path().to_owned(), memory: 0, stop: &AtomicBool::new(true) };
    let file = folder.path().join("tree");
    let outcome = write_within(&file, &random_log(10, 1, 1), &BuildOptions::default(), &workspace);
    assert!(matches!(outcome, Err(MetaNodeError::Workspace(WorkspaceError::Interrupted))), "{outcome:?}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
