//! The engine in a viewer: once a model a hierarchy, once a viewer an engine, and every frame one call.
//!
//! `cargo run --release --example embed`

use std::sync::Arc;

use foldfront::construction::simplify;
use foldfront::experiment::scene::Scene;
use foldfront::glam::DVec3;
use foldfront::in_memory::{InMemoryHierarchy, InMemoryTree};
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::view::{Camera, View, theta_of_pixels};

/// Flies over a city of 160,000 triangles and says what is drawn.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    // `foldfront::construction::mesh_io::read` reads files.
    let mesh = Scene::parse("scene:city")?.mesh(&mut |_, _| ());
    let (log, _) = simplify::build(mesh, &simplify::Options::default(), &mut |_, _| ())?;
    let tree = InMemoryTree::new(Arc::new(InMemoryHierarchy::new(&log)?));
    let mut engine = Engine::new(tree, ActiveMesh::new(), Settings::default())?;
    for frame in 0..240 {
        let eye = DVec3::new(-1200.0 + 5.0 * f64::from(frame), -800.0, 250.0);
        let camera = Camera::look_at(eye, DVec3::new(0.0, 0.0, 20.0), DVec3::Z, 1.0, 16.0 / 9.0)?;
        let report = engine.advance(&[View::new(&camera, theta_of_pixels(1.0, 1080))?])?;
        if frame % 60 == 0 {
            println!("frame {frame}: {} triangles, {:?}", report.displayed, report.select);
        }
        engine.sink_mut().clear_changes(); // after drawing: see the example `buffers`
    }
    Ok(())
}
