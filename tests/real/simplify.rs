//! Hierarchies of scans, terrain and cities, in memory and within little of it.

use std::path::PathBuf;

use foldfront::Mesh;
use foldfront::container::Georeference;
use libtest_mimic::Trial;

use crate::hierarchy::{errors_are_honest, is_deterministic, simplify_and_check};
use crate::kit::{self, needs};
use crate::within;

macro_rules! real_mesh {
    ($name:ident, $file:literal, $merge:literal, $($holds:tt)*) => {
        needs(concat!("simplify::", stringify!($name)), [$file], |[file]| {
            let report = simplify_and_check(&kit::mesh(file), $merge);
            assert!(report $($holds)*, "{report:?}");
        })
    };
}

/// The same town about its own middle: where that is in the world is not sent.
fn town(name: &str, check: fn(&Mesh)) -> Trial {
    needs(name, ["city/denhaag01_lod2_terrain.obj"], move |[file]: [PathBuf; 1]| {
        check(&Mesh { georeference: Georeference::default(), ..kit::mesh(file) });
    })
}

pub fn trials() -> Vec<Trial> {
    vec![
        real_mesh!(armadillo, "meshes/armadillo_100k.ply", false, .base_triangles < 100),
        real_mesh!(beast, "meshes/beast.ply", false, .base_triangles < 1000),
        real_mesh!(bunny, "meshes/bunny.ply", false, .base_triangles < 100),
        real_mesh!(dragon, "meshes/dragon.ply", false, .base_triangles < 5000),
        real_mesh!(happy, "meshes/happy.ply", false, .base_triangles < 5000),
        real_mesh!(horse, "meshes/horse.ply", false, .base_triangles < 100),
        real_mesh!(lucy, "meshes/lucy_100k.ply", false, .base_triangles < 100),
        real_mesh!(ogre, "meshes/ogre.ply", false, .base_triangles < 1000),
        real_mesh!(turbine_blade, "meshes/turbineblade_200k.ply", false, .base_triangles < 100),
        real_mesh!(sierra, "terrain/N36W119.hgt", false, .roots < 10),
        real_mesh!(everest_with_voids, "terrain/N27E086.hgt", false, .base_triangles < 50_000),
        real_mesh!(rainier_with_voids, "terrain/N46W122.hgt", false, .base_triangles < 50_000),
        real_mesh!(death_valley, "terrain/N36W118.hgt", false, .roots < 10),
        real_mesh!(great_basin, "terrain/N37W118.hgt", false, .roots < 10),
        real_mesh!(white_mountains, "terrain/N37W119.hgt", false, .roots < 10),
        real_mesh!(lake_constance, "terrain/N47E009.hgt", false, .roots < 10),
        real_mesh!(mont_blanc, "terrain/alps_montblanc_647_16bit.png", false, .roots < 10),
        real_mesh!(grand_canyon, "terrain/gcanyon_elev_1200_8bit.png", false, .roots < 10),
        real_mesh!(boston, "city/boston_blocks.obj", false, .roots > 1000),
        real_mesh!(den_haag, "city/denhaag01_lod2_terrain.obj", false, .roots > 1000),
        real_mesh!(den_haag_joined, "city/denhaag01_lod2_terrain.obj", true, .roots < 10),
        real_mesh!(boston_joined, "city/boston_blocks.obj", true, .roots < 10),
        real_mesh!(dragon_joined, "meshes/dragon.ply", true, .roots < 10),
        needs("simplify::is_deterministic", ["meshes/ogre.ply"], |[file]| is_deterministic(&kit::mesh(file))),
        needs("simplify::errors_are_honest", ["meshes/bunny.ply"], |[file]| {
            errors_are_honest(&kit::mesh(file));
        }),
        needs("simplify::within::the_memory_does_not_matter", ["meshes/bunny.ply"], |[file]| {
            within::the_memory_does_not_matter(&kit::mesh(file));
        }),
        needs("simplify::within::threads_do_not_matter", ["meshes/lucy_100k.ply"], |[file]| {
            within::threads_do_not_matter(&kit::mesh(file), 1 << 20, 100);
        }),
        // Stars that vanish as a whole, and edges that are long for blocks as small as these.
        town("simplify::within::threads_do_not_matter_to_a_town", |town| {
            within::threads_do_not_matter(town, 4 << 20, 10);
        }),
        town(
            "simplify::within::components_are_merged_as_in_memory",
            within::components_are_merged_as_in_memory,
        ),
        town("simplify::within::components_are_merged_late", |town| {
            within::components_are_merged_late(town, 4 << 20);
        }),
        needs("simplify::within::a_twentieth_is_enough_for_the_dragon", ["meshes/dragon.ply"], |[file]| {
            within::a_twentieth_is_enough(&kit::mesh(file));
        }),
        needs("simplify::within::a_twentieth_is_enough_for_the_buddha", ["meshes/happy.ply"], |[file]| {
            within::a_twentieth_is_enough(&kit::mesh(file));
        }),
    ]
}
