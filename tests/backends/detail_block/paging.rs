//! The paper's soft quota along recorded walks.

use detail_block::{Arrangement, Io, XfmTree};
use foldfront::experiment::path::recorded;
use foldfront::experiment::scene::SceneKind;
use foldfront::selection::engine::Engine;
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::theta_of_pixels;
use foldfront::vertex_tree::NullSink;

use crate::common::detail_block::{file, options, reading};
use crate::common::scenes;
use crate::flights::settings;

/// The state of the engine is checked once in so many frames: a check takes longer than a frame.
const CHECK_EVERY: usize = 29;

/// With the paper's soft quota, a tenth of all blocks, along the calm paths through the built-in scenes: few blocks are
/// loaded again within 60 frames of their removal.
#[test]
fn what_is_removed_is_not_wanted_again_soon() {
    for kind in SceneKind::ALL {
        let log = scenes::log(kind);
        let file = file(&Arrangement::new(log, &options(false, true)).unwrap());
        let paths = recorded(kind).unwrap();
        for path in paths.iter().filter(|path| path.name.contains("calm")) {
            let mut tree = XfmTree::new(file.clone(), reading(Io::Blocking)).unwrap();
            let soft = file.resident_bytes_of_all() / 10;
            tree.set_quotas(soft, u64::MAX);
            let mut engine = Engine::new(tree, NullSink, settings(&log.mesh, Strategy::Event)).unwrap();
            let mut beyond = 0;
            for frame in 0..path.frames.len() {
                let view = path.view(frame, theta_of_pixels(1.0, 1080)).unwrap();
                engine.advance(&[view]).unwrap();
                if frame.is_multiple_of(CHECK_EVERY) {
                    engine.assert_well_formed();
                }
                beyond += usize::from(engine.tree().block_bytes().0 > soft);
            }
            let counts = engine.tree().counts();
            let percent = 100.0 * counts.soon_again as f64 / counts.removals.max(1) as f64;
            eprintln!(
                "{}: {percent:.2} % again soon, {beyond} frames beyond the quota, {counts:?}",
                path.name
            );
            assert!(percent < 5.0, "{}: {percent} % again soon; {counts:?}", path.name);
            assert!(counts.removals > 5000, "{}: {counts:?}", path.name);
        }
    }
}
