//! Scene files: the names of objects and where they are placed.

use foldfront::experiment::stored_scene::read_scene;

use super::{Desk, check_error};

pub fn run(bytes: &[u8], desk: &Desk) -> bool {
    let file = desk.lay("input.scene", bytes);
    match read_scene(&file) {
        Err(error) => {
            check_error(&error);
            false
        }
        Ok(objects) => {
            assert!(!objects.is_empty(), "a scene without an object");
            true
        }
    }
}
