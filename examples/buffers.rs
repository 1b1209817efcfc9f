//! Patching the vertex and index buffers of a graphics processor from the changes of the displayed mesh.
//!
//! The buffers on the other side are bytes here, written entry by entry as an upload would; after every frame they are
//! compared with the mesh.
//!
//! `cargo run --release --example buffers`

use std::collections::BTreeSet;
use std::sync::Arc;

use foldfront::construction::simplify;
use foldfront::experiment::scene::Scene;
use foldfront::glam::DVec3;
use foldfront::in_memory::{InMemoryHierarchy, InMemoryTree};
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::view::{Camera, View, theta_of_pixels};

/// A buffer of entries of 12 bytes, as a graphics processor has it: three coordinates, or three indices.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    uploaded: usize,
}

impl Buffer {
    const ENTRY: usize = 12;

    /// Makes room for so many entries. A graphics processor can not grow a buffer, so there is some to spare.
    fn reserve(&mut self, entries: usize) {
        if self.bytes.len() < entries * Self::ENTRY {
            self.bytes.resize((entries * 3 / 2 + 1024) * Self::ENTRY, 0);
        }
    }

    fn upload(&mut self, entry: u32, words: [[u8; 4]; 3]) {
        self.bytes[entry as usize * Self::ENTRY..][..Self::ENTRY].copy_from_slice(words.as_flattened());
        self.uploaded += Self::ENTRY;
    }

    fn words(&self, entry: usize) -> [[u8; 4]; 3] {
        let bytes = &self.bytes[entry * Self::ENTRY..][..Self::ENTRY];
        [
            [bytes[0], bytes[1], bytes[2], bytes[3]],
            [bytes[4], bytes[5], bytes[6], bytes[7]],
            [bytes[8], bytes[9], bytes[10], bytes[11]],
        ]
    }
}

/// The buffers of one mesh.
#[derive(Default)]
struct Drawable {
    vertices: Buffer,
    indices: Buffer,
}

impl Drawable {
    /// Uploads what has changed in the mesh since the last call, and nothing else.
    fn patch(&mut self, mesh: &mut ActiveMesh) {
        self.vertices.reserve(mesh.positions().len());
        self.indices.reserve(mesh.triangles().len());
        for &slot in mesh.changed_vertices() {
            // A slot at the end may have gone again.
            if let Some(position) = mesh.positions().get(slot as usize) {
                self.vertices.upload(slot, position.map(f32::to_le_bytes));
            }
        }
        for &slot in mesh.changed_triangles() {
            if let Some(corners) = mesh.triangles().get(slot as usize) {
                self.indices.upload(slot, corners.map(u32::to_le_bytes));
            }
        }
        mesh.clear_changes();
    }

    /// The triangles that a draw call over the first `slots` would show, as coordinates: those with an area, since the
    /// unused slots have none.
    fn drawn(&self, slots: usize) -> BTreeSet<[[u32; 3]; 3]> {
        let corners = |slot| self.indices.words(slot).map(u32::from_le_bytes);
        let used = (0..slots).map(corners).filter(|[a, b, c]| a != b && b != c && c != a);
        used.map(|corners| corners.map(|v| self.vertices.words(v as usize).map(u32::from_le_bytes))).collect()
    }
}

/// The displayed triangles, as the bits of their coordinates.
fn displayed(mesh: &ActiveMesh) -> BTreeSet<[[u32; 3]; 3]> {
    let at = |v: u32| mesh.positions()[v as usize].map(f32::to_bits);
    mesh.displayed_triangles().map(|(_, corners)| corners.map(at)).collect()
}

/// Flies over a terrain, and says how much had to be uploaded.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mesh = Scene::parse("scene:city")?.mesh(&mut |_, _| ());
    let mut options = simplify::Options::default();
    options.merge_components = true;
    let (log, _) = simplify::build(mesh, &options, &mut |_, _| ())?;
    let tree = InMemoryTree::new(Arc::new(InMemoryHierarchy::new(&log)?));
    let mut engine = Engine::new(tree, ActiveMesh::new(), Settings::default())?;
    let mut drawable = Drawable::default();
    let (mut patched, mut whole) = (0, 0);
    for frame in 0..120 {
        let eye = DVec3::new(-1200.0 + 10.0 * f64::from(frame), -800.0, 250.0);
        let camera = Camera::look_at(eye, DVec3::new(0.0, 0.0, 20.0), DVec3::Z, 1.0, 16.0 / 9.0)?;
        engine.advance(&[View::new(&camera, theta_of_pixels(1.0, 1080))?])?;
        let before = drawable.vertices.uploaded + drawable.indices.uploaded;
        drawable.patch(engine.sink_mut());
        let mesh = engine.sink();
        assert!(drawable.drawn(mesh.triangles().len()) == displayed(mesh), "frame {frame}: another mesh");
        if frame > 0 {
            patched += drawable.vertices.uploaded + drawable.indices.uploaded - before;
            whole += Buffer::ENTRY * (mesh.triangles().len() + mesh.positions().len());
        }
    }
    println!("{} KiB uploaded a frame, {} KiB whole", patched / 119 / 1024, whole / 119 / 1024);
    Ok(())
}
