//! Collapse logs: whole, in sequence from the file, and as the hierarchy in memory, which a front is led over.

use std::sync::Arc;

use foldfront::collapse_log::{CollapseLog, LogFile, read_log};
use foldfront::in_memory::{InMemoryHierarchy, InMemoryTree};

use super::{Desk, check_error, choice, walk};

pub fn run(bytes: &[u8], desk: &Desk) -> bool {
    let file = desk.lay("input.fold", bytes);
    let in_sequence = LogFile::open(&file);
    let log = match read_log(&file) {
        Err(error) => {
            check_error(&error);
            if let Err(error) = in_sequence {
                check_error(&error);
            }
            return false;
        }
        Ok(log) => log,
    };
    in_sequence.expect("what can be read whole can be read in sequence");
    walk(&log, choice(bytes));
    true
}

fn walk(log: &CollapseLog, seed: u64) {
    match InMemoryHierarchy::new(log) {
        Err(error) => check_error(&error),
        Ok(hierarchy) => {
            let outcome = walk::follow(InMemoryTree::new(Arc::new(hierarchy)), seed, log.mesh.triangles.len(), true);
            assert!(outcome.is_clean(), "a log that has been read: {outcome:?}");
        }
    }
}
