//! What a backend has to do, in one call: with every exact strategy, in every frame of a random walk, show the brute-force cut.

use selection::engine::{Engine, Settings};
use selection::refine::Strategy;
use selection::settled::Settled;
use selection::view::View;
use vertex_tree::{NullSink, Refine, VertexTree};

use crate::brute_force::BruteForce;
use crate::strict_mesh::StrictMesh;
use crate::walk::Walk;

/// What a walk amounted to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// Frames of the walk.
    pub frames: u64,
    /// Nodes of the hierarchy.
    pub nodes: u64,
    /// Unfolds and folds of one strategy: all make the same.
    pub changes: u64,
    /// Tests of the criterion that the event queue made, and the brute-force cut.
    pub tests: [u64; 2],
}

/// The state of the engines is checked in so many frames, and then once in so many.
const EVERY_FRAME: u64 = 100;
const CHECK_EVERY: u64 = 25;

/// Follows a random walk around a hierarchy with every exact strategy. `open` gives a tree that nothing has been done with, each
/// time; pages that it misses are waited for.
///
/// # Panics
/// If bounds are not nested, or a front is not the brute-force cut, a report does not say what is displayed, or the engine's
/// or the backend's own state is wrong; and if the hierarchy has no nodes, or the walk changes nothing, which would prove nothing.
#[track_caller]
pub fn conforms<T: Refine<NullSink>>(mut open: impl FnMut() -> T) -> Totals {
    follow(&mut open).0
}

/// [`conforms`], with the brute-force cut that it was compared with.
#[track_caller]
fn follow<T: Refine<NullSink>>(open: &mut impl FnMut() -> T) -> (Totals, BruteForce) {
    let mut whole = Settled::new(open());
    whole.start(&mut NullSink).expect("a hierarchy that starts");
    let mut brute_force = BruteForce::new(&mut whole).expect("a hierarchy that unfolds");
    drop(whole);
    assert!(brute_force.node_count() > 0, "a hierarchy without nodes proves nothing");
    brute_force.assert_nested();
    let (center, radius) = brute_force.sphere();
    let mut walk = Walk::new(center, radius, 1);
    let [rho, omega] = walk.speed();
    let exact = Strategy::ALL.into_iter().filter(|strategy| strategy.is_exact());
    let mut engines: Vec<_> = exact
        .map(|strategy| {
            let settings = Settings { strategy, rho, omega, ..Settings::default() };
            Engine::new(Settled::new(open()), NullSink, settings).expect("a hierarchy that starts")
        })
        .collect();
    let mut totals = Totals { nodes: brute_force.node_count() as u64, ..Totals::default() };
    for frame in 0..u64::from(Walk::FRAMES) {
        let views: Vec<View> = walk.next_views().to_vec();
        // What is compared does not depend on the strategy.
        let cut = brute_force.cut(engines[0].settings(), &views);
        for (at, engine) in engines.iter_mut().enumerate() {
            let report = engine.advance_relative(&views).expect("a frame");
            if frame < EVERY_FRAME || frame.is_multiple_of(CHECK_EVERY) {
                engine.assert_well_formed();
            }
            let strategy = engine.settings().strategy;
            let name = strategy.name();
            assert_eq!(report.misses, 0, "{name}, frame {frame}: what has been waited for is there");
            if (report.cut_hash, report.active_nodes) != (cut.hash, cut.nodes) {
                let wrong = brute_force.wrong(engine);
                let forced = report.forced;
                panic!(
                    "{name}, frame {frame}: {wrong} nodes are wrong, {forced} were forced; views {views:?}"
                );
            }
            assert_eq!(report.displayed, cut.displayed, "{name}, frame {frame}: what is displayed");
            if at == 0 {
                totals.changes += report.unfolds + report.folds;
                totals.tests[1] += totals.nodes;
            }
            if strategy == Strategy::Event {
                totals.tests[0] += report.tests;
            }
        }
        totals.frames += 1;
    }
    assert!(totals.changes > 0, "a walk that changes nothing proves nothing");
    (totals, brute_force)
}

/// [`conforms`], and what a mesh backend tells a sink: in every frame of the walk the mesh is one that can be, with as many triangles as
/// the report says, and at the end, without a view, the base mesh.
///
/// # Panics
/// As [`conforms`], and at the first call that a sink could not have followed.
#[track_caller]
pub fn conforms_with_mesh<T: VertexTree>(mut open: impl FnMut() -> T) -> Totals {
    let (totals, brute_force) = follow(&mut open);
    let (center, radius) = brute_force.sphere();
    let mut walk = Walk::new(center, radius, 2);
    let [rho, omega] = walk.speed();
    let settings = Settings { rho, omega, ..Settings::default() };
    let mut engine =
        Engine::new(Settled::new(open()), StrictMesh::default(), settings).expect("a hierarchy that starts");
    let base = engine.sink().clone();
    for frame in 0..Walk::FRAMES {
        let report = engine.advance_relative(walk.next_views()).expect("a frame");
        let shown = engine.sink().triangles.len() as u64;
        assert_eq!(shown, report.displayed, "frame {frame}: triangles");
    }
    engine.advance_relative(&[]).expect("a frame");
    assert_eq!(engine.sink().shape(), base.shape(), "wholly folded it is not the base mesh");
    totals
}

#[cfg(test)]
mod tests;
