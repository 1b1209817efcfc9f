//! Every backend: the conformance table, and what each does by itself when pages are slow, missing, damaged or lying.

#[path = "../common/mod.rs"]
mod common;
#[path = "../checks/cones.rs"]
mod facing;
#[path = "../checks/flights.rs"]
mod flights;
#[path = "../checks/lies.rs"]
mod lies;
#[path = "../checks/dependencies.rs"]
mod needs;
#[path = "../checks/patches.rs"]
mod patches;
#[path = "../checks/quotas.rs"]
mod quotas;
#[path = "../checks/walks.rs"]
mod walks;

mod conformance;
mod conforming;
mod corpora;
mod detail_block;
mod faults;
mod meta_node;
mod mt_partition;
mod page_store;
mod sharing;
mod slow_store;
