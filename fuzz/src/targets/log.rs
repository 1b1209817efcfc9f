//! Collapse logs: whole, in sequence from the file, and as the hierarchy in memory, which a front is led over.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use foldfront::collapse_log::{CollapseLog, LogFile, read_log};
use foldfront::experiment::store::{self, Backend, BuildOptions, Store, WriteLimits};
use foldfront::in_memory::{InMemoryHierarchy, InMemoryTree};

use super::{Desk, check_error, choice, walk};

pub fn run(bytes: &[u8], desk: &Desk) -> bool {
    let file = desk.lay("input.fold", bytes);
    let in_sequence = LogFile::open(&file);
    let log = match read_log(&file) {
        Err(error) => {
            check_error(&error);
            match in_sequence {
                Err(error) => check_error(&error),
                // Whatever is made of it within little memory is an error or a file.
                Ok(log) if choice(bytes).is_multiple_of(BUILD_EVERY) => {
                    for backend in PAGING {
                        let (stop, temporary) = (AtomicBool::new(false), desk.folder.clone());
                        let limits = WriteLimits { memory: 1 << 20, temporary, stop: &stop };
                        let built = desk.folder.join("built");
                        if let Err(error) =
                            store::write_within(backend, &built, &log, &BuildOptions::default(), &limits)
                        {
                            check_error(&error);
                        }
                    }
                }
                Ok(_) => {}
            }
            return false;
        }
        Ok(log) => log,
    };
    in_sequence.expect("what can be read whole can be read in sequence");
    walk(&log, choice(bytes));
    if choice(bytes).is_multiple_of(BUILD_EVERY) {
        PAGING.into_iter().for_each(|backend| build(&log, backend, desk));
    }
    true
}

/// One in so many logs is turned into the files of other backends.
const BUILD_EVERY: u64 = 64;
const PAGING: [Backend; 3] = [Backend::MetaNode, Backend::DetailBlock, Backend::MtPartition];

/// What is made of a log that has been read is a file that is verified, but for nesting, or an error.
fn build(log: &CollapseLog, backend: Backend, desk: &Desk) {
    let built = desk.folder.join("built");
    match store::write(backend, &built, log, &BuildOptions::default()) {
        Err(error) => check_error(&error),
        Ok(()) => {
            if let Err(error) = Store::open(&built).and_then(|store| store.verify()) {
                check_error(&error);
                // Whether spheres are nested is not looked at in a log.
                let text = error.to_string();
                assert!(
                    text.contains("not nested") || text.contains("do not hold"),
                    "a file that has just been built: {text}"
                );
            }
        }
    }
}

fn walk(log: &CollapseLog, seed: u64) {
    match InMemoryHierarchy::new(log) {
        Err(error) => check_error(&error),
        Ok(hierarchy) => {
            let outcome =
                walk::follow(InMemoryTree::new(Arc::new(hierarchy)), seed, log.mesh.triangles.len(), true);
            assert!(outcome.is_clean(), "a log that has been read: {outcome:?}");
        }
    }
}
