//! Random steps over files of random collapses of all kinds of meshes.

mod damage;
mod driver;
mod foresight;
mod memory;
mod meshes;
mod paging;

use crate::{Arrangement, BuildOptions, Io, Settings};
use collapse_log::{CollapseLog, Mesh};
use driver::{Driver, bytes_of, open};
use meshes::{grid, random_log, rubble, torus};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use vertex_tree::{Hierarchy, NodeId, VertexTree};

fn options(levels: u32, quantize: bool, nest_needs: bool) -> BuildOptions {
    BuildOptions { levels, quantize, nest_needs }
}

fn blocking() -> Settings {
    Settings { io: Io::Blocking, grace: 0, ..Settings::default() }
}

/// The mesh of each kind.
fn kinds(random: &mut Pcg64) -> [(&'static str, Mesh); 3] {
    [("grid", grid(13, random)), ("torus", torus(12, random)), ("rubble", rubble(13, random))]
}

/// Unfolds everything, in random order.
fn unfold_all(driver: &mut Driver, random: &mut Pcg64) {
    let mut boundary = driver.boundary();
    while !boundary.is_empty() {
        assert!(driver.unfold(boundary[random.random_range(0..boundary.len())]).unwrap());
        boundary = driver.boundary();
    }
}

/// Folds everything.
fn fold_all(driver: &mut Driver) {
    while !driver.active.is_empty() {
        let nodes: Vec<NodeId> = driver.active.iter().rev().copied().collect();
        let before = nodes.len();
        for node in nodes {
            if driver.is_collapsible(node) {
                driver.fold(node).unwrap();
            }
        }
        assert!(driver.active.len() < before, "nothing folds any more");
    }
}

/// The whole way down, in random order, shows the input, triangle for triangle; the way up ends at the base mesh; and
/// whatever is between is a manifold mesh, the one that replaying the log shows.
#[test]
fn every_step_leaves_a_manifold_mesh() {
    let (mut forced, mut still_needed, mut nodes) = (0, 0, 0);
    for seed in 0..12 {
        let mut random = Pcg64::seed_from_u64(seed);
        for (kind, mesh) in kinds(&mut random) {
            let log = random_log(mesh, &mut random);
            let options = options(1 + seed as u32 % 5, seed % 2 == 1, seed % 3 == 0);
            let arrangement = Arrangement::new(&log, &options).unwrap();
            let report = arrangement.report();
            eprintln!("{kind}, seed {seed}: {report:?}");
            let file = open(bytes_of(&arrangement));
            file.verify().unwrap();
            let effective = arrangement.effective_log();
            effective.forest().unwrap();
            let mut driver = Driver::new(&file, blocking());
            driver.tree.assert_well_formed();
            driver.assert_shows(&effective);
            for step in 0..600 {
                let boundary = driver.boundary();
                let collapsible: Vec<NodeId> =
                    driver.active.iter().copied().filter(|&n| driver.is_collapsible(n)).collect();
                let up = step / 100 % 3 == 2;
                if random.random_range(0..10) < if up { 8 } else { 2 } && !collapsible.is_empty() {
                    driver.fold(collapsible[random.random_range(0..collapsible.len())]).unwrap();
                } else if !boundary.is_empty() {
                    assert!(driver.unfold(boundary[random.random_range(0..boundary.len())]).unwrap());
                }
                driver.tree.assert_well_formed();
                if step % 50 == 0 {
                    driver.assert_shows(&effective);
                }
            }
            unfold_all(&mut driver, &mut random);
            driver.tree.assert_well_formed();
            driver.assert_shows(&effective);
            assert_eq!(driver.active.len() as u64, report.nodes);
            assert_eq!(driver.tree.displayed(), report.triangles);
            if !options.quantize {
                assert_is_input(&driver, &log);
            }
            fold_all(&mut driver);
            driver.tree.assert_well_formed();
            driver.assert_shows(&effective);
            forced += driver.forced;
            still_needed += driver.still_needed;
            nodes += report.nodes;
        }
    }
    assert!(forced > 100 && still_needed > 100 && nodes > 3000, "{forced}, {still_needed}, {nodes}");
}

/// By positions: vertices of the input may have been split apart.
fn assert_is_input(driver: &Driver, log: &CollapseLog) {
    let bits = |p: [f32; 3]| p.map(f32::to_bits);
    let distinct = |&&[a, b, c]: &&[u32; 3]| a != b && b != c && c != a;
    let input = log.mesh.triangles.iter().filter(distinct);
    let mut input: Vec<_> =
        input.map(|t| driver::key(t.map(|v| bits(log.mesh.positions[v as usize])))).collect();
    let mesh = &driver.mesh;
    let mut shown: Vec<_> =
        mesh.triangles.values().map(|t| driver::key(t.map(|v| bits(mesh.vertices[&v].0)))).collect();
    input.sort_unstable();
    shown.sort_unstable();
    assert!(input == shown, "fully refined it is not the input");
}

/// Where nothing is kept of the mesh, steps are allowed and refused alike, and triangles are counted alike.
#[test]
fn selection_needs_no_mesh() {
    let mut random = Pcg64::seed_from_u64(5);
    let log = random_log(torus(14, &mut random), &mut random);
    let arrangement = Arrangement::new(&log, &options(3, false, false)).unwrap();
    let file = open(bytes_of(&arrangement));
    let mut driver = Driver::new(&file, blocking());
    let mut bare = crate::XfmTree::new(file, blocking()).unwrap();
    bare.base_mesh(&mut vertex_tree::NullSink).unwrap();
    for _ in 0..3000 {
        let nodes: Vec<NodeId> = driver.boundary();
        let collapsible: Vec<NodeId> =
            driver.active.iter().copied().filter(|&n| driver.is_collapsible(n)).collect();
        if random.random() && !collapsible.is_empty() {
            let node = collapsible[random.random_range(0..collapsible.len())];
            let step = driver.tree.fold(node, &mut driver.mesh).unwrap();
            assert_eq!(step, bare.fold(node, &mut vertex_tree::NullSink).unwrap());
            if step == vertex_tree::Step::Done {
                driver.active.remove(&node);
            }
        } else if !nodes.is_empty() {
            let node = nodes[random.random_range(0..nodes.len())];
            let step = driver.tree.unfold(node, &mut driver.mesh).unwrap();
            assert_eq!(step, bare.unfold(node, &mut vertex_tree::NullSink).unwrap());
            if step == vertex_tree::Step::Done {
                driver.active.insert(node);
            }
        }
        bare.assert_well_formed();
        assert_eq!(driver.tree.displayed(), bare.displayed());
    }
}

/// The same log gives the same bytes.
#[test]
fn building_is_deterministic() {
    let mut random = Pcg64::seed_from_u64(9);
    let log = random_log(rubble(20, &mut random), &mut random);
    let build = || bytes_of(&Arrangement::new(&log, &BuildOptions::default()).unwrap());
    assert_eq!(build(), build());
}

#[test]
fn options_out_of_range_are_an_error() {
    let log = random_log(grid(4, &mut Pcg64::seed_from_u64(1)), &mut Pcg64::seed_from_u64(1));
    for levels in [0, 6, u32::MAX] {
        let error = Arrangement::new(&log, &options(levels, false, true)).err().unwrap();
        assert_eq!(error.to_string(), format!("{levels} levels a block, expected 1 to 5"));
    }
}

#[test]
fn an_empty_mesh_and_one_that_is_all_degenerate() {
    let one = Mesh { positions: vec![[0.0; 3]; 3], triangles: vec![[0, 0, 1], [2, 2, 2]], ..Mesh::default() };
    for mesh in [Mesh::default(), one] {
        let log = CollapseLog { mesh, collapses: Vec::new() };
        let file = open(bytes_of(&Arrangement::new(&log, &BuildOptions::default()).unwrap()));
        file.verify().unwrap();
        let driver = Driver::new(&file, Settings::default());
        driver.tree.assert_well_formed();
        assert_eq!((driver.tree.displayed(), driver.tree.roots().len()), (0, 0));
    }
}
