//! Files that earlier versions wrote: they open, and give what they were made of.

use std::path::{Path, PathBuf};

use foldfront::Mesh;
use foldfront::compare::Subject;
use foldfront::store::Store;

fn frozen(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/frozen").join(name)
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

/// Triangles by the bits of their corners, each in the least of its rotations.
fn triangles(mesh: &Mesh) -> Vec<[[u32; 3]; 3]> {
    let corner = |v: u32| mesh.positions[v as usize].map(f32::to_bits);
    let least = |[a, b, c]: [[u32; 3]; 3]| [a, b, c].min([b, c, a]).min([c, a, b]);
    let mut all: Vec<_> = mesh.triangles.iter().map(|t| least(t.map(corner))).collect();
    all.sort_unstable();
    all
}

#[test]
fn version_1_gives_what_it_was_made_of() {
    for name in ["v1.fold", "v1.meta", "v1.xfm", "v1.mt"] {
        let store = Store::open(&frozen(name)).unwrap();
        store.verify().unwrap();
        let finest = Subject::of_store(name, store).finest().unwrap();
        assert_eq!(triangles(&finest), triangles(&hills()), "{name}");
    }
}

/// A hilly grid of 722 triangles, with pages in plenty.
#[test]
fn larger_files_of_version_1_are_in_order() {
    for name in ["intact.meta", "intact.mt"] {
        let store = Store::open(&frozen(name)).unwrap();
        store.verify().unwrap();
        let finest = Subject::of_store(name, store).finest().unwrap();
        assert_eq!(finest.triangles.len(), 722, "{name}");
    }
}
