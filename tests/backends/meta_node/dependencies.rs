//! Implicit dependencies: what is forced, what is blocked, and what little memory does to that.

use foldfront::selection::engine::Engine;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::{Hierarchy, NullSink};
use meta_node::{Dependencies, MetaNodeTree};

use super::{EXACT, PAGES, grid, holder_bytes, settings, settle};
use crate::common::backends::meta_node_file;
use crate::common::{data, meshes, random_step, random_view, seeded};
use crate::needs::{Needs, force_block_and_off};
use rand::RngExt;

#[test]
fn dependencies_force_block_and_off() {
    force_block_and_off(&grid(50));
    force_block_and_off(&data::log(meshes::scan(10, &mut seeded(1))));
}

/// Memory for a few pages, frames that do not wait, and every now and then a rest: chains of needed nodes that are longer
/// than what fits are completed all the same, and the cut is the closure.
#[test]
fn forcing_gets_there_with_little_memory() {
    let log = grid(40);
    let file = meta_node_file(&log, &PAGES);
    let needs = Needs::new(&log);
    for holders in [4, 5, 7, 20] {
        let paging = meta_node::Settings {
            page_memory: holders * holder_bytes(&file),
            dependencies: Dependencies::Force,
            ..meta_node::Settings::default()
        };
        for strategy in EXACT {
            let tree = MetaNodeTree::new(file.clone(), paging).unwrap();
            let mut engine = Engine::new(tree, NullSink, settings(strategy)).unwrap();
            let mut oracle = Oracle::new(&log).unwrap();
            let mut random = seeded(21);
            let mut view = random_view(&mut random);
            let mut beyond = 0;
            for round in 0..25 {
                for _ in 0..random.random_range(0..20) {
                    random_step(&mut view, &mut random);
                    engine.advance(&[view]).unwrap();
                    engine.assert_well_formed();
                }
                settle(&mut engine, &[view]);
                oracle.cut(engine.settings().criterion, &[view]);
                let expected = needs.close(oracle.active());
                beyond += expected.iter().filter(|&&is| is).count() - oracle.active_nodes();
                let mut active = vec![false; log.collapses.len()];
                engine.for_each_active(|node| active[engine.tree().log_number(node) as usize] = true);
                let wrong = active.iter().zip(&expected).filter(|(a, b)| a != b).count();
                assert_eq!(wrong, 0, "{} place holders, {}, round {round}", holders, strategy.name());
                // And nothing moves any more.
                let report = engine.advance(&[view]).unwrap();
                engine.assert_well_formed();
                assert_eq!((report.misses, report.unfolds, report.folds), (0, 0, 0), "round {round}");
            }
            assert!(beyond > 20, "{beyond} nodes were forced in all settled cuts");
        }
    }
}
