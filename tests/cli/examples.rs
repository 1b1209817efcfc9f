//! The examples do what they say: each checks itself.

#[path = "../../examples/buffers.rs"]
mod buffers;
#[path = "../../examples/embed.rs"]
mod embed;
#[path = "../../examples/own_backend.rs"]
mod own_backend;
#[path = "../../examples/points/main.rs"]
mod points;

#[test]
fn the_engine_is_embedded() {
    embed::main().unwrap();
}

#[test]
fn a_backend_of_ones_own_is_refined() {
    own_backend::main().unwrap();
}

#[test]
fn points_are_followed() {
    points::main().unwrap();
}

#[test]
fn buffers_are_patched() {
    buffers::main().unwrap();
}
