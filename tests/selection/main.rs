//! Selection: the front, the queue, the criteria and what the engine makes of them.

#[path = "../common/mod.rs"]
mod common;
#[path = "../checks/unfolding.rs"]
mod unfolding;

mod allocations;
mod capped;
mod dependencies;
mod engine;
mod foresight;
mod objects;
mod proof;
mod queue;
mod refinement;
