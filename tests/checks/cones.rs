//! What the normal-cone test spares, along walks.

use std::sync::Arc;

use detail_block::{Arrangement, Io, XfmFile, XfmTree};
use foldfront::CollapseLog;
use foldfront::selection::active_mesh::ActiveMesh;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::refine::Strategy;
use foldfront::testing::brute_force::BruteForce;
use foldfront::vertex_tree::MeshSink;

use crate::common::detail_block::{OwnCut, file, options, reading};
use crate::common::{random_step, random_view, seeded};
use crate::flights::{assert_closed, placed, settings};

fn engine<M: MeshSink>(
    file: &Arc<XfmFile>,
    mesh: M,
    log: &CollapseLog,
    strategy: Strategy,
) -> Engine<XfmTree, M> {
    let tree = XfmTree::new(file.clone(), reading(Io::Blocking)).unwrap();
    let settings = Settings { normal_cone: true, ..settings(&log.mesh, strategy) };
    Engine::new(tree, mesh, settings).unwrap()
}

/// How far eyes are from the middle of a mesh, whose extent is about 2.
const OUTSIDE: std::ops::Range<f64> = 1.2..2.0;

/// Along random walks, with one view and with two, every strategy has the cut that brute force finds with cones: nothing is
/// forced, as cones are nested over all needs, and the mesh is as well formed as ever. And it is a smaller cut, by
/// this share, in percent: cones of nodes are nested, so that it takes a smooth surface for them to be narrow while nodes
/// are large. A ball seen at `k` = 6000 spares more than 20 %, the horse next to nothing at 300 and more than 10 % at 40,000, where
/// nearly all of it is unfolded.
pub fn what_is_seen_from_behind_stays_coarse(log: &CollapseLog, k: f64, spared: u64) {
    for quantize in [false, true] {
        let arrangement = Arrangement::new(log, &options(quantize, true)).unwrap();
        let effective = arrangement.effective_log();
        let mut plain = OwnCut::new(&effective);
        let mut cut = OwnCut::new(&effective);
        cut.oracle = cut.oracle.with_cones(arrangement.cones());
        let file = file(&arrangement);
        file.verify().unwrap();
        let mut all =
            BruteForce::new(&mut XfmTree::new(file.clone(), reading(Io::Blocking)).unwrap()).unwrap();
        let strategies = [Strategy::TopDown, Strategy::Front, Strategy::Event, Strategy::EventQueue];
        let mut engines = strategies.map(|strategy| engine(&file, ActiveMesh::new(), log, strategy));
        let mut random = seeded(21);
        let mut view = random_view(&mut random).with_k(k).unwrap();
        let (mut with, mut without, mut queue_tests, mut front_tests) = (0, 0, 0, 0);
        for frame in 0..240 {
            random_step(&mut view, &mut random);
            // From within nothing is seen from behind, and from far away nothing is fine.
            let eye = view.eye();
            view = view.with_eye(eye.normalize() * eye.length().clamp(OUTSIDE.start, OUTSIDE.end)).unwrap();
            let mut views = vec![placed(&log.mesh, view)];
            if frame / 60 % 2 == 1 {
                // The other eye.
                let aside = 0.02 * view.direction().any_orthogonal_vector();
                views.push(views[0].with_eye(views[0].eye() + aside).unwrap());
            }
            let expected = cut.find(engines[0].settings(), &views);
            for engine in &mut engines {
                let report = engine.advance(&views).unwrap();
                let name = engine.settings().strategy.name();
                let found = (report.cut_hash, report.active_nodes, report.displayed);
                assert_eq!(found, expected, "{name}, frame {frame}");
                assert_eq!(report.forced + report.misses, 0, "{name}, frame {frame}");
                match engine.settings().strategy {
                    Strategy::EventQueue => queue_tests += report.tests,
                    Strategy::Front => front_tests += report.tests,
                    _ => {}
                }
                if frame % 60 == 0 {
                    assert_eq!(all.wrong(engine), 0, "{name}, frame {frame}");
                    engine.assert_well_formed();
                    assert_closed(engine.sink());
                }
            }
            with += expected.1;
            without += plain.find(engines[0].settings(), &views).1;
        }
        eprintln!(
            "{with} active nodes, {without} without; {queue_tests} tests by events, {front_tests} by scans"
        );
        assert!(with * 100 < without * (100 - spared), "{with} active nodes, {without} without cones");
        assert!(queue_tests * 2 < front_tests, "{queue_tests} tests by events, {front_tests} by scans");
    }
}
