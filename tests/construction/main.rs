//! Construction: files read, meshes simplified, soups that would have it never end.

#[path = "../common/mod.rs"]
mod common;
#[path = "../checks/hierarchy.rs"]
mod hierarchy;
#[path = "../checks/reading.rs"]
mod reading;
#[path = "simplify/replay.rs"]
mod replay;
#[path = "../common/soup.rs"]
mod soup;
#[path = "../checks/within.rs"]
mod within;

mod made_up;
mod mesh_io;
mod simplify;
mod soups;
