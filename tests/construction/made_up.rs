//! Made-up meshes have the difficulties that they are made for, and are the same bits on every machine.

use std::collections::{HashMap, HashSet};

use crate::common::{meshes, seeded};
use foldfront::Mesh;
use foldfront::experiment::scene::SceneKind;

/// Vertices less edges plus triangles, edges by the number of their triangles (1, 2, more), edges that two triangles run
/// through in the same sense, and vertices whose triangles are more than one fan.
#[derive(Debug, PartialEq)]
struct Shape {
    euler: i64,
    edges: [usize; 3],
    turned: usize,
    pinched: usize,
}

fn shape(mesh: &Mesh) -> Shape {
    let mut edges: HashMap<[u32; 2], [usize; 2]> = HashMap::new();
    let mut fans: HashMap<u32, Vec<[u32; 2]>> = HashMap::new();
    for &[a, b, c] in &mesh.triangles {
        for [v, w, opposite] in [[a, b, c], [b, c, a], [c, a, b]] {
            edges.entry([v.min(w), v.max(w)]).or_default()[usize::from(v > w)] += 1;
            fans.entry(v).or_default().push([w, opposite]);
        }
    }
    let mut shape = Shape {
        euler: fans.len() as i64 - edges.len() as i64 + mesh.triangles.len() as i64,
        edges: [0; 3],
        turned: edges.values().filter(|count| count[0] > 1 || count[1] > 1).count(),
        pinched: 0,
    };
    edges.values().for_each(|[up, down]| shape.edges[(up + down).min(3) - 1] += 1);
    for mut fan in fans.into_values() {
        // From one triangle to those beside it, as long as there are any.
        let mut seen: HashSet<u32> = fan.pop().unwrap().into();
        while let Some(next) = fan.iter().position(|ends| ends.iter().any(|v| seen.contains(v))) {
            seen.extend(fan.swap_remove(next));
        }
        shape.pinched += usize::from(!fan.is_empty());
    }
    shape
}

#[test]
fn surfaces_are_closed_and_have_their_genus() {
    for (genus, side) in [(0, 6), (1, 4), (3, 8), (20, 4)] {
        let shape = shape(&meshes::with_handles(genus, side));
        assert_eq!((shape.edges[0], shape.edges[2], shape.turned, shape.pinched), (0, 0, 0, 0), "{shape:?}");
        assert_eq!(shape.euler, 2 - 2 * genus as i64);
    }
    let ball = shape(&meshes::ball(10, 0.05));
    assert_eq!((ball.euler, ball.edges[0], ball.edges[2], ball.turned, ball.pinched), (2, 0, 0, 0, 0));
}

#[test]
fn scans_have_holes_and_are_manifold() {
    for seed in 0..5 {
        let mesh = meshes::scan(12, &mut seeded(seed));
        let shape = shape(&mesh);
        assert!(shape.edges[0] > 100 && shape.edges[2] + shape.turned + shape.pinched == 0, "{shape:?}");
        let places: HashSet<_> = mesh.positions.iter().map(|p| p.map(f32::to_bits)).collect();
        assert!(mesh.positions.len() - places.len() > 10, "vertices in one place");
    }
}

#[test]
fn voids_are_holes_in_the_ground() {
    let [whole, pierced] = [0, 8].map(|voids| shape(&meshes::ground(60, voids, &mut seeded(1))));
    assert_eq!((whole.euler, whole.edges[0], whole.edges[2]), (1, 4 * 59, 0));
    assert!(pierced.edges[0] > 4 * 59 && pierced.euler < 0 && pierced.pinched == 0, "{pierced:?}");
}

#[test]
fn patchwork_is_not_manifold() {
    let shape = shape(&meshes::patchwork(12, &mut seeded(2)));
    assert!(shape.edges[0] > 0 && shape.edges[2] > 10, "{shape:?}");
    assert!(shape.turned > 10 && shape.pinched > 5, "{shape:?}");
}

#[test]
fn a_part_of_the_city_has_whole_houses() {
    let town = meshes::part_of(SceneKind::City, 0.3);
    let shape = shape(&town);
    assert!(town.triangles.len() > 10_000 && shape.euler > 500, "{shape:?}: many components");
    assert_eq!(shape.edges[2], 0);
}

#[test]
fn they_are_the_same_bits_for_ever() {
    let print = |mesh: Mesh| {
        let mut crc = crc32fast::Hasher::new();
        mesh.positions.iter().flatten().for_each(|x| crc.update(&x.to_le_bytes()));
        mesh.triangles.iter().flatten().for_each(|i| crc.update(&i.to_le_bytes()));
        crc.finalize()
    };
    let prints = [
        print(meshes::with_handles(2, 8)),
        print(meshes::ball(8, 0.05)),
        print(meshes::scan(8, &mut seeded(1))),
        print(meshes::ground(40, 4, &mut seeded(1))),
        print(meshes::patchwork(8, &mut seeded(1))),
    ];
    assert_eq!(prints, [1_722_857_128, 329_884_554, 1_598_267_049, 2_390_648_773, 2_847_641_031]);
}
