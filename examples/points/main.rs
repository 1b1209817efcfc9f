//! Points instead of triangles: an event queue over a quadtree of a survey, exact in every frame, and how little it tests.
//!
//! The tree is in `quadtree.rs`. It knows nothing of meshes, and the engine nothing of points.

mod quadtree;

use std::collections::BTreeMap;
use std::ops::Range;

use foldfront::experiment::path::recorded;
use foldfront::experiment::scene::{Scene, SceneKind};
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::view::theta_of_pixels;
use foldfront::testing::brute_force::BruteForce;
use foldfront::vertex_tree::{NullSink, Refine};
use quadtree::{PointSink, PointTree};

/// What a renderer would draw: a buffer for each node's points.
#[derive(Default)]
struct Buffers(BTreeMap<u32, Vec<[f32; 3]>>);

impl PointSink for Buffers {
    fn points_added(&mut self, numbers: Range<u32>, positions: &[[f32; 3]]) {
        self.0.insert(numbers.start, positions.to_vec());
    }

    fn points_removed(&mut self, numbers: Range<u32>) {
        self.0.remove(&numbers.start);
    }
}

/// Flies over a survey of a quarter of a million points, and compares every frame with brute force.
pub fn main() -> Result<(), Box<dyn std::error::Error>> {
    let survey = Scene::new(SceneKind::Laserscan).mesh(&mut |_, _| ()).positions;
    let [path, _] = recorded(SceneKind::Laserscan)?;
    let mut whole = PointTree::new(&survey);
    whole.start(&mut NullSink)?;
    let mut brute_force = BruteForce::new(&mut whole)?;
    let mut engine = Engine::new(PointTree::new(&survey), Buffers::default(), Settings::default())?;
    let (mut tests, mut changes) = (0, 0);
    for frame in 0..path.frames.len() {
        // A point a pixel and a half.
        let report = engine.advance(&[path.view(frame, theta_of_pixels(1.5, 1080))?])?;
        let drawn: usize = engine.sink().0.values().map(Vec::len).sum();
        assert_eq!(drawn as u64, report.displayed);
        assert_eq!(brute_force.wrong(&engine), 0, "frame {frame}");
        if frame > 0 {
            (tests, changes) = (tests + report.tests, changes + report.unfolds + report.folds);
        }
        if frame % 200 == 0 {
            println!("frame {frame}: {drawn} of {} points in {} nodes", survey.len(), report.active_nodes);
        }
    }
    let frames = path.frames.len() as u64 - 1;
    println!("{} tests and {} changes a frame, exact in every frame", tests / frames, changes / frames);
    Ok(())
}
