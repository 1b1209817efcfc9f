//! What needs real meshes, terrain and trajectories: trials that run where those are, and are counted as ignored where they
//! are not. The same checks run on made-up input in the other test targets.

#[path = "../common/mod.rs"]
mod common;
mod conformance;
mod detail_block;
mod deviation;
mod kit;
mod mesh_io;
mod meta_node;
mod mt_partition;
mod path;
mod refinement;
#[path = "../construction/simplify/replay.rs"]
mod replay;
mod simplify;

#[path = "../checks/arriving.rs"]
mod arriving;
#[path = "../checks/dependencies.rs"]
mod dependencies;
#[path = "../checks/cones.rs"]
mod facing;
#[path = "../checks/flights.rs"]
mod flights;
#[path = "../checks/hierarchy.rs"]
mod hierarchy;
#[path = "../checks/nominal.rs"]
mod nominal;
#[path = "../checks/patches.rs"]
mod patches;
#[path = "../checks/quotas.rs"]
mod quotas;
#[path = "../checks/reading.rs"]
mod reading;
#[path = "../checks/unfolding.rs"]
mod unfolding;
#[path = "../checks/walks.rs"]
mod walks;
#[path = "../checks/within.rs"]
mod within;

use std::process::ExitCode;
use std::thread::available_parallelism;

use libtest_mimic::{Arguments, Trial, run};

/// Some trials take gigabytes: no more than this many at a time, unless it is said otherwise.
const MOST_THREADS: usize = 4;

fn main() -> ExitCode {
    kit::assert_folder();
    let mut arguments = Arguments::from_args();
    let threads = available_parallelism().map_or(1, |threads| threads.get().min(MOST_THREADS));
    arguments.test_threads = arguments.test_threads.or(Some(threads));
    let trials: Vec<Trial> = [
        conformance::trials(),
        detail_block::trials(),
        deviation::trials(),
        mesh_io::trials(),
        meta_node::trials(),
        mt_partition::trials(),
        path::trials(),
        refinement::trials(),
        simplify::trials(),
    ]
    .into_iter()
    .flatten()
    .collect();
    run(&arguments, trials).exit_code()
}
