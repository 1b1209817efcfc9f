//! What needs real meshes, terrain and trajectories: trials that run where those are, and are counted as ignored where they
//! are not. The same checks run on made-up input in the other test targets.

#[path = "../common/mod.rs"]
mod common;
mod conformance;
mod kit;
#[path = "../checks/walks.rs"]
mod walks;

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
    let trials: Vec<Trial> = [conformance::trials()].into_iter().flatten().collect();
    run(&arguments, trials).exit_code()
}
