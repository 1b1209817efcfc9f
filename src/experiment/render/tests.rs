use super::*;
use glam::{DQuat, dvec3};

/// At the origin, looking along -z; at depth 1 the image spans -1 to 1.
fn camera() -> Camera {
    let fov_y = std::f64::consts::FRAC_PI_2;
    Camera::new(DVec3::ZERO, DQuat::IDENTITY, fov_y, 1.0).unwrap()
}

const PLAIN: Style = Style { width: 64, shading: Shading::Flat, wires: false };
const WIRED: Style = Style { wires: true, ..PLAIN };

/// A square of two triangles that spans `-half..half` at depth `depth`.
fn square(half: f32, depth: f32) -> Mesh {
    let positions = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    Mesh {
        positions: positions.map(|[x, y]| [x * half, y * half, -depth]).to_vec(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

fn joined(mut a: Mesh, b: &Mesh) -> Mesh {
    let first = a.positions.len() as u32;
    a.positions.extend(&b.positions);
    a.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + first)));
    a
}

fn pixel(image: &Image, x: u32, y: u32) -> [u8; 3] {
    let at = 3 * (y * image.width + x) as usize;
    [image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]]
}

#[test]
fn a_square_covers_its_pixels_and_no_others() {
    let empty = render(&Mesh::default(), &camera(), &PLAIN);
    let image = render(&square(0.5, 1.0), &camera(), &PLAIN);
    assert_eq!((image.width, image.height, image.rgb.len()), (64, 64, 64 * 64 * 3));
    let inside = pixel(&image, 32, 32);
    for y in 0..64 {
        for x in 0..64 {
            let covered = (16..48).contains(&x) && (16..48).contains(&y);
            let expected = if covered { inside } else { pixel(&empty, x, y) };
            assert_eq!(pixel(&image, x, y), expected, "at {x}, {y}");
        }
    }
}

#[test]
fn the_nearer_surface_is_seen_whatever_the_order() {
    let (mut near, far) = (square(0.5, 1.0), square(4.0, 4.0));
    // Turned away from the light, it looks different.
    near.positions[2][2] = -1.6;
    near.positions[3][2] = -1.6;
    let image = render(&joined(near.clone(), &far), &camera(), &PLAIN);
    assert_eq!(image, render(&joined(far.clone(), &near), &camera(), &PLAIN));
    assert_ne!(pixel(&image, 32, 40), pixel(&image, 2, 40));
    assert_eq!(pixel(&image, 32, 40), pixel(&render(&near, &camera(), &PLAIN), 32, 40));
}

/// The floor passes below the eye and on behind it: it fills the lower half of the picture, up to the horizon.
#[test]
fn a_surface_that_passes_the_eye_is_clipped() {
    let mut floor = square(1000.0, 0.0);
    for p in &mut floor.positions {
        *p = [p[0], -1.0, -p[1]];
    }
    let empty = render(&Mesh::default(), &camera(), &PLAIN);
    let image = render(&floor, &camera(), &PLAIN);
    assert_eq!(pixel(&image, 5, 30), pixel(&empty, 5, 30));
    let covered = pixel(&image, 32, 50);
    assert_ne!(covered, pixel(&empty, 32, 50));
    assert!((34..64).all(|y| (0..64).all(|x| pixel(&image, x, y) == covered)));
}

#[test]
fn wires_are_on_the_edges() {
    let plain = render(&square(0.75, 1.0), &camera(), &PLAIN);
    let wired = render(&square(0.75, 1.0), &camera(), &WIRED);
    let darker = |x, y| pixel(&wired, x, y)[1] + 20 < pixel(&plain, x, y)[1];
    assert!(darker(8, 30) && darker(55, 30) && darker(30, 8) && darker(30, 55), "the sides");
    assert!(darker(31, 32) || darker(32, 32), "the diagonal");
    assert_eq!(pixel(&wired, 20, 20), pixel(&plain, 20, 20));
    assert_eq!(pixel(&wired, 45, 35), pixel(&plain, 45, 35));
}

/// Where the picture cuts a triangle there is no edge.
#[test]
fn clipping_makes_no_wires() {
    let mut large = square(100.0, 1.0);
    large.triangles.truncate(1);
    large.positions = vec![[-90.0, -100.0, -1.0], [90.0, -100.0, -1.0], [0.0, 200.0, -1.0], [0.0; 3]];
    assert_eq!(render(&large, &camera(), &PLAIN), render(&large, &camera(), &WIRED));
}

#[test]
fn smooth_shading_varies_over_a_triangle() {
    let mut roof = square(0.9, 1.5);
    roof.positions[0][2] = -2.5;
    let shades = |shading| {
        let image = render(&roof, &camera(), &Style { shading, ..PLAIN });
        let mut reds: Vec<u8> = (20..44).map(|x| pixel(&image, x, 40)[0]).collect();
        reds.dedup();
        reds.len()
    };
    assert!(shades(Shading::Flat) <= 3);
    assert!(shades(Shading::Smooth) > 4);
}

#[test]
fn from_outside_the_part_in_view_is_tinted() {
    // A strip of squares from the view's axis far out to the right.
    let mut strip = Mesh::default();
    for i in 0..10 {
        let mut tile = square(1.0, 6.0);
        tile.positions.iter_mut().for_each(|p| *p = [p[0] + 2.0 * i as f32, -1.0, p[1] - 6.0]);
        strip = joined(strip, &tile);
    }
    let image = render_outside(&strip, &camera(), &Style { wires: false, width: 256, ..PLAIN });
    let count = |blue: bool| {
        let tinted = |p: &[u8]| i32::from(p[2]) - i32::from(p[0]) > 20;
        let grey = |p: &[u8]| p[0] > p[2];
        image.rgb.chunks(3).filter(|p| if blue { tinted(p) } else { grey(p) }).count()
    };
    assert!(count(true) > 100, "{} tinted pixels", count(true));
    assert!(count(false) > 100, "{} grey pixels", count(false));
}

#[test]
fn impossible_cameras_and_sizes_do_no_harm() {
    let mesh = square(0.5, 1.0);
    let fov_y = camera().fov_y();
    for (position, fov_y, aspect) in [
        (DVec3::ZERO, fov_y, f64::NAN),
        (DVec3::ZERO, fov_y, 0.0),
        (DVec3::NAN, fov_y, 1.0),
        (dvec3(0.0, 0.0, -1.0), fov_y, 1.0),
        (DVec3::ZERO, 0.0, 1.0),
    ] {
        let camera = Camera::unchecked(position, DQuat::IDENTITY, fov_y, aspect);
        for width in [0, 16] {
            let image = render(&mesh, &camera, &Style { width, ..WIRED });
            assert_eq!(image.rgb.len() as u32, 3 * image.width * image.height);
            let image = render_outside(&mesh, &camera, &Style { width, ..WIRED });
            assert_eq!(image.rgb.len() as u32, 3 * image.width * image.height);
        }
    }
}
