//! Every mesh and every city, unfolded and folded.

use libtest_mimic::Trial;

use crate::kit::{self, needs};
use crate::unfolding::everything_unfolds_and_folds;

const FILES: [&str; 11] = [
    "meshes/armadillo_100k.ply",
    "meshes/beast.ply",
    "meshes/bunny.ply",
    "meshes/dragon.ply",
    "meshes/happy.ply",
    "meshes/horse.ply",
    "meshes/lucy_100k.ply",
    "meshes/ogre.ply",
    "meshes/turbineblade_200k.ply",
    "city/boston_blocks.obj",
    "city/denhaag01_lod2_terrain.obj",
];

pub fn trials() -> Vec<Trial> {
    let trial = |file| {
        let name =
            format!("refinement::unfolds_to_the_input_and_folds_to_the_base_mesh::{}", kit::stem(file));
        needs(&name, [file], move |[path]| everything_unfolds_and_folds(file, &kit::mesh(path)))
    };
    FILES.map(trial).into()
}
