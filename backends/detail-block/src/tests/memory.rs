//! Files built from logs that may be larger than memory.

use std::io;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::{
    Arrangement, BuildOptions, FileError, Workspace, WorkspaceError, XfmError, needed_bytes, write_within,
};
use collapse_log::{Collapse, CollapseLog, LogCounts, LogSource, Mesh, Records};
use container::Georeference;

use super::driver::bytes_of;
use super::meshes::{grid, random_log, rubble, torus};
use super::options;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;

/// A mesh of several components, of all kinds, some of them far from manifold.
fn several(random: &mut Pcg64) -> Mesh {
    let mut mesh = Mesh::default();
    for part in [rubble(25, random), torus(15, random), grid(15, random), rubble(8, random)] {
        let first = mesh.positions.len() as u32;
        mesh.positions.extend(part.positions);
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    mesh
}

/// The same mesh with vertices and triangles in any order.
fn shuffled(mesh: &Mesh, random: &mut Pcg64) -> Mesh {
    let mut order: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let mut triangles = mesh.triangles.clone();
    order.shuffle(random);
    triangles.shuffle(random);
    let mut positions = mesh.positions.clone();
    for (&to, &position) in order.iter().zip(&mesh.positions) {
        positions[to as usize] = position;
    }
    Mesh {
        positions,
        triangles: triangles.iter().map(|t| t.map(|v| order[v as usize])).collect(),
        ..Mesh::default()
    }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect()
}

/// Whatever the memory, the file is the one that is built in memory.
#[test]
fn the_file_is_the_same_whatever_the_memory() {
    let folder = tempfile::tempdir().unwrap();
    let (path, temporary) = (folder.path().join("file"), folder.path().join("temporary"));
    std::fs::create_dir(&temporary).unwrap();
    let stop = &AtomicBool::new(false);
    let mut random = Pcg64::seed_from_u64(5);
    // Spheres nested along random collapses soon grow too large to be quantised: that is for the smallest mesh.
    let meshes = [
        rubble(13, &mut random),
        grid(32, &mut random),
        torus(20, &mut random),
        rubble(24, &mut random),
        several(&mut random),
    ];
    for (i, mesh) in (0..).zip(&meshes) {
        for mesh in [mesh, &shuffled(mesh, &mut random)] {
            let log = random_log(mesh.clone(), &mut random);
            let options = options(1 + (i + 3) % 5, i == 0, i != 2);
            let arrangement = Arrangement::new(&log, &options).unwrap();
            let whole = bytes_of(&arrangement);
            let counts = log.counts();
            let needed = needed_bytes(counts.vertices, counts.triangles);
            for memory in [0, needed / 3] {
                let workspace = Workspace { folder: temporary.clone(), memory, stop };
                let report = write_within(&path, &log, &options, &workspace).unwrap();
                assert_eq!(report, arrangement.report());
                assert!(std::fs::read(&path).unwrap() == whole, "mesh {i} with {memory} bytes");
            }
        }
    }
    assert!(names(&temporary).is_empty());
}

/// Which of the sequences of a log breaks off, and after how many records.
struct Broken<'a>(&'a CollapseLog, usize, usize);

impl Broken<'_> {
    fn cut<'r, T: 'r>(&self, which: usize, records: Records<'r, T>) -> Records<'r, T> {
        let after = if which == self.1 { self.2 } else { usize::MAX };
        Box::new(records.enumerate().map(move |(i, record)| {
            if i < after { record } else { Err(io::Error::other("the tape has torn")) }
        }))
    }
}

impl LogSource for Broken<'_> {
    fn counts(&self) -> LogCounts {
        self.0.counts()
    }
    fn georeference(&self) -> &Georeference {
        self.0.georeference()
    }
    fn positions(&self) -> Records<'_, [f32; 3]> {
        self.cut(0, self.0.positions())
    }
    fn triangles(&self) -> Records<'_, [u32; 3]> {
        self.cut(1, self.0.triangles())
    }
    fn collapses(&self) -> Records<'_, Collapse> {
        self.cut(2, self.0.collapses())
    }
    fn collapses_back(&self) -> Records<'_, Collapse> {
        self.cut(2, self.0.collapses_back())
    }
}

/// What goes wrong is named: the log, the temporary files, what is written; and nothing is left.
#[test]
fn what_fails_is_named_and_leaves_nothing() {
    let mut random = Pcg64::seed_from_u64(6);
    let log = random_log(grid(50, &mut random), &mut random);
    let folder = tempfile::tempdir().unwrap();
    let (stop, stopped) = (&AtomicBool::new(false), &AtomicBool::new(true));
    let workspace = Workspace { folder: folder.path().to_owned(), memory: 0, stop };
    let path = folder.path().join("file");
    let options = BuildOptions::default();
    for which in 0..3 {
        let outcome = write_within(&path, &Broken(&log, which, 1000), &options, &workspace);
        assert!(matches!(outcome, Err(XfmError::Source { .. })), "{outcome:?}");
    }
    let nowhere = Workspace { folder: folder.path().join("nowhere"), ..workspace.clone() };
    let error = write_within(&path, &log, &options, &nowhere).unwrap_err();
    assert!(
        matches!(&error, XfmError::Workspace(WorkspaceError::Temporary { folder, .. }) if *folder == nowhere.folder),
        "{error}"
    );
    assert!(error.to_string().contains("nowhere"));
    let interrupted = Workspace { stop: stopped, ..workspace.clone() };
    let outcome = write_within(&path, &log, &options, &interrupted);
    assert!(matches!(outcome, Err(XfmError::Workspace(WorkspaceError::Interrupted))), "{outcome:?}");
    let outcome = write_within(&nowhere.folder.join("file"), &log, &options, &workspace);
    assert!(matches!(outcome, Err(XfmError::File(FileError::Write { .. }))), "{outcome:?}");
    let mut wrong = log.clone();
    wrong.collapses[700].kept = wrong.collapses[600].removed;
    let outcome = write_within(&path, &wrong, &options, &workspace);
    assert!(matches!(outcome, Err(XfmError::Log(_))), "{outcome:?}");
    assert!(names(folder.path()).is_empty());
}
