//! Trees of detail blocks of scans and cities.

use foldfront::CollapseLog;
use foldfront::construction::simplify;
use libtest_mimic::Trial;

use crate::facing::what_is_seen_from_behind_stays_coarse;
use crate::flights::{a_bad_store_delays_and_no_more, flies, forced_cuts_are_the_closure};
use crate::kit::{self, needs};
use crate::quotas::{
    at_rest_the_cut_is_reached_or_loading_ends, the_hard_quota_holds, the_schedule_spares_misses,
};

/// Files, whether they are manifold, and whether they are closed.
const FLYING: [(&str, bool, bool); 11] = [
    ("meshes/horse.ply", true, true),
    ("meshes/armadillo_100k.ply", true, true),
    ("meshes/lucy_100k.ply", true, true),
    ("meshes/turbineblade_200k.ply", true, true),
    ("meshes/happy.ply", true, true),
    ("meshes/bunny.ply", true, false),
    ("meshes/dragon.ply", true, false),
    ("meshes/ogre.ply", false, false),
    ("meshes/beast.ply", false, false),
    ("city/denhaag01_lod2_terrain.obj", true, false),
    ("city/boston_blocks.obj", true, false),
];

fn over(name: &str, mesh: &str, check: fn(&CollapseLog)) -> Trial {
    needs(&format!("detail_block::{name}"), [mesh], move |[file]| check(&kit::log(file)))
}

pub fn trials() -> Vec<Trial> {
    let flying = FLYING.map(|(file, is_manifold, is_closed)| {
        needs(&format!("detail_block::flies::{}", kit::stem(file)), [file], move |[path]| {
            flies(file, &kit::log(path), is_manifold, is_closed);
        })
    });
    // Virtual merges of components are none of a manifold mesh.
    let joined = needs("detail_block::flies::joined", ["city/denhaag01_lod2_terrain.obj"], |[file]| {
        let mut options = simplify::Options::default();
        options.merge_components = true;
        let (log, _) = simplify::build(kit::mesh(file), &options, &mut |_, _| ()).unwrap();
        flies("joined", &log, false, false);
    });
    let [horse, bunny] = ["meshes/horse.ply", "meshes/bunny.ply"];
    let others = [
        joined,
        over("forced_cuts_are_the_closure", horse, |log| forced_cuts_are_the_closure(log, 1500)),
        over("a_bad_store_delays_and_no_more", bunny, a_bad_store_delays_and_no_more),
        over("what_is_seen_from_behind_stays_coarse", horse, |log| {
            what_is_seen_from_behind_stays_coarse(log, 40_000.0, 10);
        }),
        over("the_hard_quota_holds_over_100_000_frames", bunny, |log| the_hard_quota_holds(log, 100_000)),
        over("at_rest_the_cut_is_reached_or_loading_ends", horse, at_rest_the_cut_is_reached_or_loading_ends),
        over("the_schedule_spares_misses", horse, |log| the_schedule_spares_misses(log, 1.0)),
    ];
    flying.into_iter().chain(others).collect()
}
