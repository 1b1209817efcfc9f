//! Multi-triangulations of scans.

use libtest_mimic::Trial;

use crate::kit::{self, needs};
use crate::patches::verifies_and_is_the_input;

pub fn trials() -> Vec<Trial> {
    let trial = |file| {
        let name = format!("mt_partition::verifies_and_is_the_input::{}", kit::stem(file));
        needs(&name, [file], move |[path]| verifies_and_is_the_input(file, &kit::log(path)))
    };
    ["meshes/bunny.ply", "meshes/beast.ply", "meshes/ogre.ply", "meshes/armadillo_100k.ply"].map(trial).into()
}
