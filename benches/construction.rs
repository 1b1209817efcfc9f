//! How long it takes to build a hierarchy: triangles a second, preparation and log included.
//!
//! A rough terrain of this file's own making is always there; real meshes are measured where the folder `shared/data`
//! lies beside the repository.

#![expect(clippy::disallowed_methods, reason = "shapes to measure with")]

use std::path::Path;
use std::time::Duration;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use foldfront::Mesh;
use foldfront::construction::mesh_io;
use foldfront::construction::simplify::{Options, build};

/// Squares of rough ground, `side` a side.
fn terrain(side: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for y in 0..side {
        for x in 0..side {
            // Hills at every scale: for each bit of the place, one of that width.
            let wave = |i: u32| {
                let width = (1 << i) as f32;
                width * 0.2 * ((x as f32 / width).sin() * (y as f32 / width + i as f32).cos())
            };
            mesh.positions.push([x as f32, y as f32, (0..9).map(wave).sum()]);
            if x + 1 < side && y + 1 < side {
                let a = y * side + x;
                mesh.triangles.extend([[a, a + 1, a + side + 1], [a, a + side + 1, a + side]]);
            }
        }
    }
    mesh
}

fn construction(c: &mut Criterion) {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    let mut subjects = vec![("terrain-400", terrain(400), false)];
    for (name, file, merge_components) in [
        ("bunny", "meshes/bunny.ply", false),
        ("dragon", "meshes/dragon.ply", false),
        ("happy", "meshes/happy.ply", false),
        ("sierra", "terrain/N36W119.hgt", false),
        ("boston", "city/boston_blocks.obj", true),
    ] {
        if let Ok(mesh) = mesh_io::read(&[data.join(file)], &mut |_, _| ()) {
            subjects.push((name, mesh, merge_components));
        }
    }
    let mut group = c.benchmark_group("construction");
    group.sample_size(10).warm_up_time(Duration::from_millis(1));
    for (name, mesh, merge_components) in subjects {
        group.throughput(Throughput::Elements(mesh.triangles.len() as u64));
        let mut options = Options::default();
        options.merge_components = merge_components;
        group.bench_function(name, |b| {
            b.iter_batched(
                || mesh.clone(),
                |mesh| build(mesh, &options, &mut |_, _| ()).expect("a valid mesh"),
                BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, construction);
criterion_main!(benches);
