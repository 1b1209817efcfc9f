//! Files of every version of every format: they open, and give what they were made of; and the last version is written, byte
//! for byte, whatever the memory.

mod cuts;
mod unknown;

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use foldfront::Mesh;
use foldfront::collapse_log::{LogFile, read_log};
use foldfront::container::{DegreeMap, Georeference, Rounding};
use foldfront::experiment::compare::Subject;
use foldfront::experiment::store::{self, Backend, BuildOptions, Store, WriteLimits};

fn frozen(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/experiment/frozen").join(name)
}

/// A file of version 1 that was found to be read badly, or that such a file was made of.
fn case(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases/reliability").join(name)
}

/// The mesh of the files: a hilly grid of 6 by 6 vertices.
fn hills() -> Mesh {
    let mut mesh = Mesh::default();
    for (x, y) in (0..36_u32).map(|i| (i % 6, i / 6)) {
        mesh.positions.push([x as f32, y as f32, ((7 * x + 11 * y) % 5) as f32 * 0.25]);
        if x < 5 && y < 5 {
            let v = 6 * y + x;
            mesh.triangles.extend([[v, v + 1, v + 7], [v, v + 7, v + 6]]);
        }
    }
    mesh
}

/// Where the files of version 2 have it.
fn germany() -> Georeference {
    Georeference {
        origin: [691_000.125, 5_334_000.0, -0.5],
        coordinate_system: "EPSG:25832".to_owned(),
        degrees: Some(DegreeMap {
            longitude: 11.5,
            latitude: 48.25,
            metres_per_degree: [74_000.5, 111_000.25],
        }),
        rounding: Rounding { largest_move: 0.015, median_edge: 0.75 },
    }
}

/// Triangles by the bits of their corners, each in the least of its rotations.
fn triangles(mesh: &Mesh) -> Vec<[[u32; 3]; 3]> {
    let corner = |v: u32| mesh.positions[v as usize].map(f32::to_bits);
    let least = |[a, b, c]: [[u32; 3]; 3]| [a, b, c].min([b, c, a]).min([c, a, b]);
    let mut all: Vec<_> = mesh.triangles.iter().map(|t| least(t.map(corner))).collect();
    all.sort_unstable();
    all
}

fn check(name: &str, georeference: &Georeference) {
    let store = Store::open(&frozen(name)).unwrap();
    store.verify().unwrap();
    assert_eq!(store.georeference(), *georeference, "{name}");
    let finest = Subject::of_store(name, store).finest().unwrap();
    assert_eq!(triangles(&finest), triangles(&hills()), "{name}");
    assert_eq!(finest.georeference, *georeference, "{name}");
}

const EXTENSIONS: [(Backend, &str); 4] = [
    (Backend::InMemory, "fold"),
    (Backend::MetaNode, "meta"),
    (Backend::DetailBlock, "xfm"),
    (Backend::MtPartition, "mt"),
];

#[test]
fn files_of_each_version_give_what_they_were_made_of() {
    for (_, extension) in EXTENSIONS {
        check(&format!("v1.{extension}"), &Georeference::default());
        check(&format!("v2.{extension}"), &germany());
    }
}

/// The collapses of the first version's log, in the world: as version 2 they have these bytes, from memory and from a file.
#[test]
fn version_2_is_written_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let (path, log_path) = (folder.path().join("file"), folder.path().join("log"));
    let mut log = read_log(&frozen("v1.fold")).unwrap();
    log.mesh.georeference = germany();
    store::write(Backend::InMemory, &log_path, &log, &BuildOptions::default()).unwrap();
    let from = LogFile::open(&log_path).unwrap();
    let options = BuildOptions { levels: Some(2), patch: Some(2.0), partition: Some(3), quantize: false };
    for (backend, extension) in EXTENSIONS {
        let name = format!("v2.{extension}");
        store::write(backend, &path, &log, &options).unwrap();
        let written = std::fs::read(&path).unwrap();
        assert!(written == std::fs::read(frozen(&name)).unwrap(), "{name} is written differently");
        let stop = &AtomicBool::new(false);
        let limits = WriteLimits { memory: 1 << 16, temporary: folder.path().to_owned(), stop };
        store::write_within(backend, &path, &from, &options, &limits).unwrap();
        assert!(std::fs::read(&path).unwrap() == written, "{name} from a file");
    }
}

/// A hilly grid of 722 triangles, with pages in plenty.
#[test]
fn larger_files_of_version_1_are_in_order() {
    for name in ["intact.meta", "intact.mt"] {
        let store = Store::open(&case(name)).unwrap();
        store.verify().unwrap();
        assert_eq!(store.georeference(), Georeference::default());
        let finest = Subject::of_store(name, store).finest().unwrap();
        assert_eq!(finest.triangles.len(), 722, "{name}");
    }
}

/// A header of 14 vertices that claims 4294967294, and one whose only page of 56 words is to be the largest of 2^30 - 1: they
/// asked for gigabytes.
#[test]
fn headers_that_lie_about_sizes_are_refused() {
    for (name, said) in [
        ("lying-leaves.meta", "offset 16: the number of leaves is 4294967294"),
        ("lying-largest.meta", "offset 60: the size of the largest page is 1073741823"),
    ] {
        let error = Store::open(&case(name)).err().unwrap().to_string();
        assert!(error.ends_with(said), "{error}");
    }
}
