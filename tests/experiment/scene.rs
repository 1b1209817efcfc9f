//! The built-in scenes: sizes as published, solids closed, the same bits for ever.

use std::collections::HashMap;

use foldfront::Mesh;
use foldfront::experiment::scene::{Scene, SceneError, SceneKind};

use crate::common::scenes;

/// A scene at a scale other than its own.
fn finer(name: &str) -> Mesh {
    Scene::parse(name).unwrap().mesh(&mut |_, _| ())
}

/// CRC-32 of all coordinates and indices, little-endian.
fn fingerprint(mesh: &Mesh) -> u32 {
    let mut crc = crc32fast::Hasher::new();
    mesh.positions.iter().flatten().for_each(|x| crc.update(&x.to_le_bytes()));
    mesh.triangles.iter().flatten().for_each(|i| crc.update(&i.to_le_bytes()));
    crc.finalize()
}

/// Number of connected components, and for each the signed volume and whether every edge is shared by exactly two
/// triangles that run through it in opposite senses.
fn components(mesh: &Mesh) -> Vec<(f64, bool)> {
    let mut parent: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for &[a, b, c] in &mesh.triangles {
        let a = root(&mut parent, a);
        let b = root(&mut parent, b);
        parent[b as usize] = a;
        let c = root(&mut parent, c);
        parent[c as usize] = a;
    }
    let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
    for t in &mesh.triangles {
        for i in 0..3 {
            *edges.entry((t[i], t[(i + 1) % 3])).or_default() += 1;
        }
    }
    let mut found: HashMap<u32, (f64, bool)> = HashMap::new();
    for t in &mesh.triangles {
        let entry = found.entry(root(&mut parent, t[0])).or_insert((0.0, true));
        let [a, b, c] = t.map(|v| mesh.positions[v as usize].map(f64::from));
        entry.0 += (a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]))
            / 6.0;
        for i in 0..3 {
            let (from, to) = (t[i], t[(i + 1) % 3]);
            entry.1 &= edges[&(from, to)] == 1 && edges.get(&(to, from)) == Some(&1);
        }
    }
    found.into_values().collect()
}

fn assert_within(value: f64, expected: f64, part: f64) {
    assert!((value / expected - 1.0).abs() <= part, "{value} is not within {part} of {expected}");
}

fn assert_sound(mesh: &Mesh) {
    assert!(mesh.positions.iter().flatten().all(|x| x.is_finite()));
    assert!(mesh.triangles.iter().flatten().all(|&i| (i as usize) < mesh.positions.len()));
    assert!(mesh.triangles.iter().all(|[a, b, c]| a != b && b != c && c != a));
}

#[test]
fn the_city_has_the_size_of_graz_and_closed_buildings() {
    let city = scenes::mesh(SceneKind::City);
    assert_sound(city);
    assert_within(city.triangles.len() as f64, 162_146.0, 0.03);
    assert_within(city.extent(), 2970.0, 0.03);
    let components = components(city);
    assert!((3000..=5000).contains(&components.len()), "{} components", components.len());
    let open: Vec<_> = components.iter().filter(|(_, closed)| !closed).collect();
    assert_eq!(open.len(), 1, "only the ground is open");
    assert!(components.iter().all(|&(volume, closed)| !closed || volume > 50.0), "a building is inside out");
}

#[test]
fn a_finer_city_is_the_same_city() {
    let (city, finer) = (scenes::mesh(SceneKind::City), finer("scene:city@3"));
    assert_sound(&finer);
    assert_within(finer.triangles.len() as f64, 9.0 * city.triangles.len() as f64, 0.06);
    assert_within(finer.extent(), city.extent(), 1e-3);
    let (coarse, fine) = (components(city), components(&finer));
    assert_eq!(coarse.len(), fine.len());
    assert_eq!(fine.iter().filter(|(_, closed)| !closed).count(), 1);
    assert!(fine.iter().all(|&(volume, closed)| !closed || volume > 50.0));
}

#[test]
fn the_alps_have_the_size_of_styria_and_scales_share_samples() {
    let alps = scenes::mesh(SceneKind::Alps);
    assert_sound(alps);
    assert_eq!(alps.triangles.len(), 524_288);
    assert_within(alps.extent(), 73_704.0, 1e-4);
    let finer = finer("scene:alps@2");
    assert_eq!(finer.triangles.len(), 4 * 524_288);
    let heights_differ = (0..513 * 513).filter(|i| {
        let (column, row) = (i % 513, i / 513);
        alps.positions[*i][2] != finer.positions[2 * row * 1025 + 2 * column][2]
    });
    assert_eq!(heights_differ.count(), 0);
}

#[test]
fn the_scan_has_the_size_of_the_published_one() {
    let scan = scenes::mesh(SceneKind::Laserscan);
    assert_sound(scan);
    assert_eq!(scan.triangles.len(), 720_000);
    assert_within(scan.extent(), 1032.0, 1e-3);
}

#[test]
fn scenes_are_the_same_bits_for_ever() {
    let prints = SceneKind::ALL.map(|kind| fingerprint(scenes::mesh(kind)));
    assert_eq!(prints, [2_850_477_306, 4_213_856_385, 3_396_801_077], "city, alps, laserscan");
}

#[test]
fn progress_ends_at_the_total() {
    for kind in [SceneKind::City, SceneKind::Laserscan] {
        let mut last = (0, 1);
        let _ = Scene::new(kind).mesh(&mut |done, total| {
            assert!(done <= total && (done >= last.0 || total != last.1));
            last = (done, total);
        });
        assert_eq!(last.0, last.1, "{kind:?}");
    }
}

#[test]
fn names_are_read_and_written() {
    for name in ["scene:city", "scene:alps@4", "scene:laserscan@18"] {
        assert_eq!(Scene::parse(name).unwrap().to_string(), name);
    }
    assert_eq!(Scene::parse("scene:alps@1"), Scene::parse("scene:alps"));
    assert!(matches!(Scene::parse("alps"), Err(SceneError::NotAScene { .. })));
    assert!(matches!(Scene::parse("scene:sea"), Err(SceneError::Unknown { .. })));
    assert!(matches!(Scene::parse("scene:"), Err(SceneError::Unknown { .. })));
    for scale in ["0", "19", "-1", "4.5", "", "99999999999999999999"] {
        let name = format!("scene:alps@{scale}");
        assert_eq!(Scene::parse(&name), Err(SceneError::Scale { name, scale: scale.to_owned() }));
    }
}
