//! Mesh files, read in both ways.

use std::path::Path;

use foldfront::Mesh;
use foldfront::construction::mesh_io::{self, Collector, MeshIoError, ReadOptions};

/// Reads at once, and piece by piece, which has to come to the same.
pub fn read(inputs: &[impl AsRef<Path>]) -> Result<Mesh, MeshIoError> {
    let whole = mesh_io::read(inputs, &mut |_, _| ());
    let mut pieces = Collector::default();
    let folder = std::env::temp_dir();
    let sent = mesh_io::send(inputs, &ReadOptions::default(), &folder, &mut pieces, &mut |_, _| ());
    let sent = sent.map(|()| pieces.into_mesh());
    match (&whole, &sent) {
        (Ok(whole), Ok(pieces)) => {
            assert_eq!(whole, pieces);
            let bits = |mesh: &Mesh| mesh.positions.iter().map(|p| p.map(f32::to_bits)).collect::<Vec<_>>();
            assert!(bits(whole) == bits(pieces));
        }
        // Of several errors, another may be met first.
        (Err(_), Err(_)) => {}
        _ => panic!("at once {whole:?}, piece by piece {sent:?}"),
    }
    whole
}

pub fn counts(mesh: &Mesh) -> (usize, usize) {
    (mesh.positions.len(), mesh.triangles.len())
}

pub fn assert_well_formed(mesh: &Mesh) {
    assert!(mesh.positions.as_flattened().iter().all(|x| x.is_finite()));
    assert!(mesh.triangles.as_flattened().iter().all(|&v| (v as usize) < mesh.positions.len()));
    assert!(!mesh.triangles.is_empty());
}
