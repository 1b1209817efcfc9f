//! Meta-nodes of a scan.

use libtest_mimic::Trial;

use crate::common::data;
use crate::dependencies::force_block_and_off;
use crate::kit::{self, needs};

pub fn trials() -> Vec<Trial> {
    vec![needs("meta_node::dependencies_force_block_and_off", ["meshes/bunny.ply"], |[file]| {
        force_block_and_off(&data::reduced(&kit::log(file), 6000));
    })]
}
