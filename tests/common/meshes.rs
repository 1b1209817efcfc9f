//! Meshes made up with what is difficult about real ones, the same bits on every machine: four operations and the square
//! root are all they are made of.

use std::collections::HashMap;

use foldfront::Mesh;
use foldfront::experiment::scene::SceneKind;
use glam::DVec3;
use rand::RngExt;
use rand_pcg::Pcg64;

use super::{direction, scenes};

/// Noise that is smooth between the corners of a lattice of spacing 1: in -1..1, of mean 0.
fn noise(p: DVec3, seed: u64) -> f64 {
    let cell = p.floor();
    let corner = |offset: DVec3| {
        let at = cell + offset;
        let mixed = [at.x, at.y, at.z].iter().fold(seed, |hash, &x| {
            (hash ^ x as i64 as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29)
        });
        // A hash, not a generator: what it gives is in the bits of every shape (`made_up.rs`).
        let mixed = mixed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (mixed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let t = p - cell;
    let t = t * t * (3.0 - 2.0 * t);
    let along = |axis: usize, low: f64, high: f64| low + t[axis] * (high - low);
    let row = |y: f64, z: f64| along(0, corner(DVec3::new(0.0, y, z)), corner(DVec3::new(1.0, y, z)));
    let plane = |z: f64| along(1, row(0.0, z), row(1.0, z));
    along(2, plane(0.0), plane(1.0))
}

/// Noise of several sizes, each half as large and two thirds as high as the one before.
fn relief(p: DVec3, octaves: u32, seed: u64) -> f64 {
    let (mut sum, mut scale, mut height) = (0.0, 1.0, 1.0);
    for octave in 0..octaves {
        sum += height * noise(p * scale, seed + u64::from(octave));
        scale *= 2.0;
        height *= 2.0 / 3.0;
    }
    sum
}

fn of(p: [f32; 3]) -> DVec3 {
    DVec3::from(p.map(f64::from))
}

/// What is left of a mesh where triangles have gone: vertices without any go too.
fn compact(mesh: &mut Mesh) {
    let mut to = vec![None; mesh.positions.len()];
    let mut positions = Vec::new();
    for v in mesh.triangles.iter_mut().flatten() {
        *v = *to[*v as usize].get_or_insert_with(|| {
            positions.push(mesh.positions[*v as usize]);
            positions.len() as u32 - 1
        });
    }
    mesh.positions = positions;
}

/// A closed surface of this genus, without a defect: a [slab] with so many tunnels, its edges worn, with bumps of all
/// sizes.
pub fn with_handles(genus: usize, side: usize) -> Mesh {
    let mut mesh = slab(genus, side);
    wear(&mut mesh, side / 2);
    roughen(&mut mesh, 0.06);
    mesh
}

/// A slab with so many tunnels. `side` is the number of edges along a tunnel.
///
/// ```text
/// +-----------------------+
/// |   +---+       +---+   |    genus 2, seen along the tunnels
/// |   |   |       |   |   |
/// |   +---+       +---+   |
/// +-----------------------+
/// ```
fn slab(genus: usize, side: usize) -> Mesh {
    let is_solid = |[x, y, z]: [isize; 3]| {
        let [x, y, z] = [x, y, z].map(|i| i.div_euclid(side as isize));
        let is_inside = (0..=2 * genus as isize).contains(&x) && (0..3).contains(&y) && z == 0;
        is_inside && !(y == 1 && x % 2 == 1)
    };
    let mut mesh = Mesh::default();
    let mut vertices = HashMap::new();
    for x in 0..((2 * genus + 1) * side) as isize {
        for y in 0..(3 * side) as isize {
            for z in 0..side as isize {
                for (axis, sign) in (0..3).flat_map(|axis| [(axis, -1), (axis, 1)]) {
                    let mut beside = [x, y, z];
                    beside[axis] += sign;
                    if !is_solid([x, y, z]) || is_solid(beside) {
                        continue;
                    }
                    let corners = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                        let mut at = [x, y, z];
                        at[axis] += (sign + 1) / 2;
                        // The other two axes in the order that makes the face look outwards.
                        let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
                        let [u, v] = if sign > 0 { [u, v] } else { [v, u] };
                        at[a] += u;
                        at[b] += v;
                        *vertices.entry(at).or_insert_with(|| {
                            mesh.positions.push(at.map(|i| i as f32 / side as f32));
                            mesh.positions.len() as u32 - 1
                        })
                    });
                    let [a, b, c, d] = corners;
                    mesh.triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
        }
    }
    mesh
}

/// Moves every vertex outwards by noise up to about this height.
fn roughen(mesh: &mut Mesh, height: f64) {
    let outwards = normals(mesh);
    for (position, normal) in mesh.positions.iter_mut().zip(outwards) {
        let p = of(*position);
        *position = (p + normal * height * relief(2.0 * p, 4, 7)).as_vec3().to_array();
    }
}

/// A ball of radius 1 with bumps of this height, `14 * side * side` quads.
pub fn ball(side: usize, bumps: f64) -> Mesh {
    let mut mesh = slab(0, side);
    for position in &mut mesh.positions {
        let [x, y, z] = *position;
        let p = DVec3::new(2.0 * f64::from(x) - 1.0, f64::from(y) / 1.5 - 1.0, 2.0 * f64::from(z) - 1.0);
        *position = p.normalize().as_vec3().to_array();
    }
    roughen(&mut mesh, bumps);
    mesh
}

/// Moves every vertex halfway to the middle of its neighbours, so many times.
fn wear(mesh: &mut Mesh, rounds: usize) {
    for _ in 0..rounds {
        let mut sums = vec![(DVec3::ZERO, 0.0); mesh.positions.len()];
        for &[a, b, c] in &mesh.triangles {
            for (v, w) in [(a, b), (b, c), (c, a)] {
                sums[v as usize].0 += of(mesh.positions[w as usize]);
                sums[v as usize].1 += 1.0;
            }
        }
        for (position, (sum, count)) in mesh.positions.iter_mut().zip(sums) {
            *position = ((of(*position) + sum / count) / 2.0).as_vec3().to_array();
        }
    }
}

fn normals(mesh: &Mesh) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; mesh.positions.len()];
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|v| of(mesh.positions[v as usize]));
        corners.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// A scan as it comes from merging range images: a surface with handles, holes where nothing was seen, noise, vertices in
/// one place (and so triangles without area), and shards beside it. Every edge has two triangles or one, and around every
/// vertex they are one fan.
pub fn scan(side: usize, random: &mut Pcg64) -> Mesh {
    let mut mesh = with_handles(2, side);
    let edge = 1.0 / side as f64;
    for position in &mut mesh.positions {
        *position =
            (of(*position) + direction(random) * 0.2 * edge * random.random::<f64>()).as_vec3().to_array();
    }
    // In one place with a neighbour.
    for _ in 0..mesh.triangles.len() / 500 {
        let [a, b, _] = mesh.triangles[random.random_range(0..mesh.triangles.len())];
        mesh.positions[a as usize] = mesh.positions[b as usize];
    }
    pierce(&mut mesh, 12, 3.0 * edge, random);
    for _ in 0..20 {
        let [a, b, c] =
            mesh.triangles[random.random_range(0..mesh.triangles.len())].map(|v| mesh.positions[v as usize]);
        let first = mesh.positions.len() as u32;
        let aside = direction(random) * 2.0 * edge;
        let far = of(a) + of(b) - of(c);
        mesh.positions.extend([of(a), of(b), of(c), far].map(|p| (p + aside).as_vec3().to_array()));
        mesh.triangles.extend([[0, 1, 2], [1, 0, 3]].map(|t| t.map(|v| first + v)));
    }
    mesh
}

/// Takes away what is within up to `radius` of so many places, and then whatever hangs together at a vertex alone.
fn pierce(mesh: &mut Mesh, holes: usize, radius: f64, random: &mut Pcg64) {
    for _ in 0..holes {
        let center = of(mesh.positions[random.random_range(0..mesh.positions.len())]);
        let radius = radius * random.random::<f64>();
        let positions = &mesh.positions;
        mesh.triangles.retain(|t| t.iter().all(|&v| of(positions[v as usize]).distance(center) > radius));
    }
    loop {
        let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
        for &[a, b, c] in &mesh.triangles {
            for (v, w) in [(a, b), (b, c), (c, a)] {
                *edges.entry([v.min(w), v.max(w)]).or_default() += 1;
            }
        }
        let mut open = vec![0; mesh.positions.len()];
        for (ends, _) in edges.iter().filter(|&(_, &count)| count == 1) {
            ends.iter().for_each(|&v| open[v as usize] += 1);
        }
        let before = mesh.triangles.len();
        mesh.triangles.retain(|t| t.iter().all(|&v| open[v as usize] <= 2));
        if mesh.triangles.len() == before {
            break;
        }
    }
    compact(mesh);
}

/// Ground of `side * side` samples, 30 apart, with mountains that are rough at every size; `voids` is the number of places
/// where nothing is known.
pub fn ground(side: usize, voids: usize, random: &mut Pcg64) -> Mesh {
    let mut mesh = Mesh::default();
    let at = |i: usize| i as f64 / side as f64;
    for (y, x) in (0..side * side).map(|i| (i / side, i % side)) {
        let height = 6.0 * side as f64 * relief(3.0 * DVec3::new(at(x), at(y), 0.0), 6, 11);
        // In whole metres, as tiles have it: there is plane ground, too.
        mesh.positions.push([30.0 * x as f32, 30.0 * y as f32, height.round() as f32]);
        if x > 0 && y > 0 {
            let d = (y * side + x) as u32;
            let [a, b, c] = [d - side as u32 - 1, d - side as u32, d - 1];
            mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    pierce(&mut mesh, voids, 30.0 * side as f64 / 12.0, random);
    mesh
}

/// What is wholly within the middle of a built-in scene, `share` of its width and depth.
pub fn part_of(kind: SceneKind, share: f32) -> Mesh {
    let mut mesh = scenes::mesh(kind).clone();
    let (low, high) = mesh.bounding_box().unwrap();
    let is_within = |v: u32| {
        let p = mesh.positions[v as usize];
        (0..2).all(|axis| {
            let half = (high[axis] - low[axis]) / 2.0;
            (p[axis] - low[axis] - half).abs() <= share * half
        })
    };
    let mut triangles = std::mem::take(&mut mesh.triangles);
    triangles.retain(|t| t.iter().all(|&v| is_within(v)));
    mesh.triangles = triangles;
    compact(&mut mesh);
    mesh
}

/// What an artist left: parts that touch in a vertex, fins at edges that have two triangles already, faces twice, faces
/// turned over, and holes.
pub fn patchwork(side: usize, random: &mut Pcg64) -> Mesh {
    let mut mesh = scan(side, random);
    for part in 0..10 {
        let first = mesh.positions.len() as u32;
        let limb = with_handles(0, side / 2);
        let [x, y] = [part % 5, part / 5].map(|i| i as f32);
        mesh.positions.extend(limb.positions.iter().map(|p| [p[0] + 1.1 * x, p[1] + 4.0 * y - 3.6, p[2]]));
        let mut corners = |v: u32| first + v;
        mesh.triangles.extend(limb.triangles.iter().map(|t| t.map(&mut corners)));
        // One of its vertices is one of the body's.
        let joint = random.random_range(0..first);
        let own = random.random_range(first..mesh.positions.len() as u32);
        mesh.triangles.iter_mut().flatten().filter(|v| **v == own).for_each(|v| *v = joint);
    }
    for _ in 0..20 {
        let [a, b, c] = mesh.triangles[random.random_range(0..mesh.triangles.len())];
        mesh.positions.push((of(mesh.positions[a as usize]) + direction(random) * 0.1).as_vec3().to_array());
        mesh.triangles.extend([[a, b, mesh.positions.len() as u32 - 1], [a, b, c]]);
    }
    for _ in 0..20 {
        let turned = random.random_range(0..mesh.triangles.len());
        mesh.triangles[turned].swap(0, 1);
    }
    compact(&mut mesh);
    mesh
}
