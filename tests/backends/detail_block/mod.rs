//! Trees of detail blocks under the engine: all kinds of meshes build and fly, quotas hold, forced cuts are what they
//! should be. Real meshes are in `tests/real`.

mod cones;
mod paging;

use crate::common::{data, meshes, scenes, seeded};
use crate::flights::flies;
use foldfront::CollapseLog;
use foldfront::construction::simplify;
use foldfront::experiment::scene::SceneKind;

fn closed() -> CollapseLog {
    data::log(meshes::with_handles(2, 14))
}

fn scan() -> CollapseLog {
    data::log(meshes::scan(16, &mut seeded(1)))
}

#[test]
fn closed_surfaces_fly() {
    for (genus, side) in [(0, 40), (3, 20), (20, 8)] {
        flies(&format!("genus {genus}"), &data::log(meshes::with_handles(genus, side)), true, true);
    }
}

#[test]
fn open_scans_fly() {
    flies("scan", &scan(), true, false);
}

#[test]
fn meshes_that_are_not_manifold_fly() {
    flies("patchwork", &data::log(meshes::patchwork(16, &mut seeded(2))), false, false);
}

#[test]
fn towns_fly() {
    flies("town", &data::log(meshes::part_of(SceneKind::City, 0.5)), true, false);
}

/// Virtual merges of components are none of a manifold mesh: they are left out, and there are more roots.
#[test]
fn joined_components_fly_apart() {
    let mut options = simplify::Options::default();
    options.merge_components = true;
    let town = meshes::part_of(SceneKind::City, 0.5);
    let (log, _) = simplify::build(town, &options, &mut |_, _| ()).unwrap();
    flies("joined", &log, false, false);
}

#[test]
fn built_in_scenes_fly() {
    for kind in SceneKind::ALL {
        flies(kind.name(), scenes::log(kind), false, false);
    }
}

#[test]
fn forced_cuts_are_the_closure() {
    crate::flights::forced_cuts_are_the_closure(&closed(), 500);
}

#[test]
fn a_bad_store_delays_and_no_more() {
    crate::flights::a_bad_store_delays_and_no_more(&scan());
}

#[test]
fn what_is_seen_from_behind_stays_coarse() {
    crate::facing::what_is_seen_from_behind_stays_coarse(&data::log(meshes::ball(30, 0.0)), 6000.0, 20);
    crate::facing::what_is_seen_from_behind_stays_coarse(
        &data::log(meshes::with_handles(0, 20)),
        40_000.0,
        5,
    );
}

#[test]
fn the_hard_quota_holds() {
    crate::quotas::the_hard_quota_holds(&scan(), 20_000);
}

#[test]
fn at_rest_the_cut_is_reached_or_loading_ends() {
    crate::quotas::at_rest_the_cut_is_reached_or_loading_ends(&closed());
}

#[test]
fn the_schedule_spares_misses() {
    crate::quotas::the_schedule_spares_misses(&data::log(meshes::ball(40, 0.05)), 4.0);
}
