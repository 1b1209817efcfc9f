//! Polygons that name a place twice. An arrow of area 10:
//!
//! ```text
//! 5     3
//! |\   /|
//! | \4/ |
//! 1-----2
//! ```

use super::*;

const ARROW: &str = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\n";

/// The z axis sees its front, and nothing is turned over.
fn assert_area(mesh: &Mesh, area: f64, text: &str) {
    let (all, along_z) = areas(mesh);
    assert!((all - area).abs() < 1e-5 && (along_z - area).abs() < 1e-5, "{text}: {all} {along_z}");
}

#[test]
fn a_ring_may_be_closed_and_a_corner_repeated() {
    for face in ["1 2 3 4 5 1", "1 2 2 3 4 5", "1 2 3 4 4 4 5", "1 1 2 3 4 5 5 1"] {
        let mesh = read_bytes("s.obj", format!("{ARROW}f {face}\n")).unwrap();
        assert_eq!(counts(&mesh), (5, 3), "{face}");
        assert_area(&mesh, 10.0, face);
    }
    let off = "OFF\n5 1 0\n0 0 0\n4 0 0\n4 4 0\n2 1 0\n0 4 0\n6 1 2 2 3 4 0\n";
    assert_area(&read_bytes("s.off", off).unwrap(), 10.0, "off");
    let ply = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
               element face 1\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0 4 0 0 4 4 0 2 1 0 0 4 0 6 1 2 3 4 0 1";
    assert_area(&read_bytes("s.ply", ply).unwrap(), 10.0, "ply");
}

/// The sixth vertex is at the place of another, or nearly.
#[test]
fn two_corners_may_be_at_one_place() {
    for place in ["4 4 0", "4.0000001 4 0", "4 3.9999999 0", "3.9999999 4.0000001 0"] {
        for face in ["1 2 3 6 4 5", "1 2 6 3 4 5", "3 6 4 5 1 2", "6 4 5 1 2 3"] {
            let mesh = read_bytes("s.obj", format!("{ARROW}v {place}\nf {face}\n")).unwrap();
            assert_area(&mesh, 10.0, &format!("{place}, {face}"));
        }
    }
}

#[test]
fn spikes_have_no_area() {
    for face in ["1 6 7 6 2 3 4 5", "6 7 8 6 2 3 4 5 1", "1 2 9 2 3 4 5", "2 3 4 5 1 2 9"] {
        let mesh = read_bytes("s.obj", format!("{ARROW}v 2 0 0\nv 2 -5 0\nv 2 -2 0\nv 8 -1 0\nf {face}\n"));
        assert_area(&mesh.unwrap(), 10.0, face);
    }
}

#[test]
fn a_keyhole_is_a_hole() {
    let hole = "v 1 0.25 0\nv 1 1 0\nv 2 0.5 0\nv 3 0.25 0\n";
    let mesh = read_bytes("s.obj", format!("{ARROW}{hole}f 1 2 3 4 5 1 6 8 9 6\n"));
    // From 6 over 8 and 9 back: clockwise, as a hole has to be.
    let (all, along_z) = areas(&mesh.unwrap());
    assert!((all - 9.75).abs() < 1e-6 && (along_z - 9.75).abs() < 1e-6, "{all} {along_z}");
}

/// The same in a plane that lies askew, far from the origin.
#[test]
fn it_does_not_depend_on_the_plane() {
    let place = |[x, y]: [f64; 2]| format!("v {} {} {}\n", 5e6 + x, 4e5 + 0.6 * y, 0.8 * y);
    let corners =
        [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [2.0, 1.0], [0.0, 4.0], [4.0, 4.0], [2.0, 0.0], [2.0, -2.0]];
    let vertices: String = corners.into_iter().map(place).collect();
    for face in ["1 2 3 4 5 1", "1 2 3 6 4 5", "1 7 8 7 2 3 4 5"] {
        let mesh = read_bytes("s.obj", format!("{vertices}f {face}\n")).unwrap();
        let (all, along_z) = areas(&mesh);
        assert!((all - 10.0).abs() < 1e-5 && (along_z - 6.0).abs() < 1e-5, "{face}: {all} {along_z}");
    }
}
