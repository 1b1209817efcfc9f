//! A front that is led over a hierarchy, everything unfolded and folded back, into a sink that trusts nobody.

use foldfront::glam::DVec3;
use foldfront::selection::engine::{Engine, FrameReport, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::strict_mesh::StrictMesh;
use foldfront::testing::walk;
use foldfront::vertex_tree::VertexTree;
use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::check_error;

/// What came of it.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Frames that ended in an error.
    pub errors: u64,
    /// Pages that were read in vain, or contradict others.
    pub faults: u64,
    /// The first of either, in words.
    pub first: Option<String>,
    /// Whether the last camera, which stays, got all that it wants in the end.
    pub at_rest: bool,
    /// Changes of the front.
    pub changes: u64,
    verified: bool,
}

impl Outcome {
    /// Whether nothing was wrong.
    pub fn is_clean(&self) -> bool {
        self.errors + self.faults == 0
    }
}

const FRAMES: u64 = 24;
/// Frames in which a camera that rests gets what it wants, if it ever does.
const REST: u64 = 300;
/// The radius of a ball that holds meshes of extent 2.
const REACH: f64 = 1.4;

/// Follows a walk over so many triangles at most. In a file that is verified, all that is in memory has to be well-formed too.
pub fn follow<T: VertexTree>(tree: T, seed: u64, most: usize, verified: bool) -> Outcome {
    let mut random = Pcg64::seed_from_u64(seed);
    let settings = Settings {
        strategy: Strategy::ALL[seed as usize % Strategy::ALL.len()],
        normal_cone: (seed / 5).is_multiple_of(4),
        rho: 0.02,
        ..Settings::default()
    };
    let mut outcome = Outcome { verified, ..Outcome::default() };
    let mut engine = match Engine::new(tree, StrictMesh::default(), settings) {
        Ok(engine) => engine,
        Err(error) => {
            check_error(&error);
            outcome.first = Some(error.to_string());
            outcome.errors = 1;
            return outcome;
        }
    };
    let at_first = engine.sink().shape();
    let waits = !(seed / 20).is_multiple_of(4);
    let tolerance = [3.0, 30.0, 300.0][seed as usize / 80 % 3];
    let mut view = walk::anywhere(DVec3::ZERO, REACH, &mut random).with_k(tolerance).expect("a tolerance");
    for frame in 0..FRAMES {
        view = walk::step(view, DVec3::ZERO, REACH, &mut random);
        // There and back, so that everything unfolds and folds a few times.
        let near = if frame % 12 < 7 { view.with_k(1e4).expect("a tolerance") } else { view };
        outcome.advance(&mut engine, near, most, waits);
    }
    let everything = view.with_k(1e6).expect("a tolerance");
    outcome.at_rest = outcome.rest(&mut engine, everything, most);
    // From so far away the coarsest mesh will do, whatever is in the file; unless a sphere is larger still.
    let far = view.with_eye(DVec3::splat(1e12)).and_then(|view| view.with_k(1.0)).expect("a view");
    let folded = outcome.rest(&mut engine, far, most);
    if verified && folded && engine.front().active_nodes() == 0 {
        assert!(engine.sink().shape() == at_first, "folded again, the mesh is not what it was at first");
    }
    outcome
}

impl Outcome {
    fn error(&mut self, error: &dyn std::error::Error) {
        check_error(error);
        self.errors += 1;
        self.first.get_or_insert_with(|| error.to_string());
    }

    fn advance<T: VertexTree>(
        &mut self,
        engine: &mut Engine<T, StrictMesh>,
        view: View,
        most: usize,
        waits: bool,
    ) -> Option<FrameReport> {
        let report = match engine.advance(&[view]) {
            Ok(report) => {
                self.faults += report.pages.faults;
                self.changes += report.unfolds + report.folds;
                Some(report)
            }
            Err(error) => {
                self.error(&error);
                None
            }
        };
        if let Some(fault) = engine.take_fault() {
            check_error(&fault);
            self.first.get_or_insert_with(|| fault.to_string());
        }
        let displayed = engine.sink().triangles.len();
        assert!(displayed <= most, "{displayed} triangles are displayed, of {most} that there can be");
        let limit = 100 * (most as u64 + 10) * FRAMES;
        assert!(self.changes <= limit, "{} changes of a front of at most {most} triangles", self.changes);
        if self.verified {
            engine.assert_well_formed();
        }
        let time = if waits {
            engine.tree_mut().settle().map(drop)
        } else {
            engine.tree_mut().pass(std::time::Duration::from_millis(16))
        };
        if let Err(error) = time {
            self.error(&error);
        }
        report
    }

    /// Rests until nothing is missing any more; whether that is so.
    fn rest<T: VertexTree>(&mut self, engine: &mut Engine<T, StrictMesh>, view: View, most: usize) -> bool {
        for _ in 0..REST {
            match self.advance(engine, view, most, true) {
                Some(report) if report.misses == 0 => return true,
                Some(_) if self.is_clean() => {}
                _ => break,
            }
        }
        false
    }
}
