//! Mesh files: read whole and piece by piece, which must come to the same, and simplified now and then.

use foldfront::Mesh;
use foldfront::construction::mesh_io::{self, Collector, ReadOptions};
use foldfront::construction::simplify;

use super::{Desk, check_error, choice};

/// One in so many meshes is simplified, if it is not larger than this.
const SIMPLIFY_EVERY: u64 = 16;
const MOST_TRIANGLES: usize = 300;

pub fn run(bytes: &[u8], name: &str, desk: &Desk) -> bool {
    let file = desk.lay(name, bytes);
    let whole = mesh_io::read(&[&file], &mut |_, _| ());
    let mut collector = Collector::default();
    let sent = mesh_io::send(&[&file], &ReadOptions::default(), &desk.folder, &mut collector, &mut |_, _| ());
    let pieces = sent.map(|()| collector.into_mesh());
    let (mesh, pieces) = match (whole, pieces) {
        (Ok(mesh), Ok(pieces)) => (mesh, pieces),
        // Where several things are wrong, the one that is met first is said.
        (Err(whole), Err(pieces)) => {
            check_error(&whole);
            check_error(&pieces);
            return false;
        }
        (whole, pieces) => panic!("read whole: {:?}, piece by piece: {:?}", whole.err(), pieces.err()),
    };
    assert!(
        bits(&mesh) == bits(&pieces) && mesh.georeference == pieces.georeference,
        "other pieces than the whole"
    );
    check(&mesh);
    if choice(bytes).is_multiple_of(SIMPLIFY_EVERY) && mesh.triangles.len() <= MOST_TRIANGLES {
        match simplify::build(mesh, &simplify::Options::default(), &mut |_, _| ()) {
            Err(error) => check_error(&error),
            Ok((log, _)) => {
                log.forest().expect("a log that has been built");
            }
        }
    }
    true
}

/// Positions and triangles, to the bit.
fn bits(mesh: &Mesh) -> (Vec<[u32; 3]>, &[[u32; 3]]) {
    (mesh.positions.iter().map(|p| p.map(f32::to_bits)).collect(), &mesh.triangles)
}

/// A mesh as `Mesh` demands.
pub fn check(mesh: &Mesh) {
    assert!(!mesh.triangles.is_empty(), "a mesh without a triangle");
    assert!(mesh.positions.iter().flatten().all(|x| x.is_finite()), "a coordinate that is no number");
    for corners in &mesh.triangles {
        assert!(corners.iter().all(|&v| (v as usize) < mesh.positions.len()), "a triangle {corners:?}");
        let [a, b, c] = *corners;
        assert!(a != b && b != c && c != a, "a triangle {corners:?}");
    }
    let georeference = &mesh.georeference;
    assert!(georeference.origin.iter().all(|x| x.is_finite()), "an origin that is no number");
}
