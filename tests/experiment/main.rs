//! Scenes, paths, pictures, comparisons, and what is written down: frozen cuts and files, examples, records.

#[path = "../checks/arriving.rs"]
mod arriving;
#[path = "../common/mod.rs"]
mod common;
#[path = "../checks/nominal.rs"]
mod nominal;
#[path = "../cli/workplace.rs"]
#[expect(dead_code, reason = "the tests of the command line use the rest")]
mod workplace;

mod deviation;
mod documents;
mod frozen;
mod path;
mod path_import;
mod prefetch;
mod scene;
mod stored_scene;
