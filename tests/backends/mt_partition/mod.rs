//! The partitioned multi-triangulation: what is displayed, how it pages, and what it does with bad stores and bad files.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

mod ahead;
mod damage;
mod paging;
mod surface;
mod within;

use std::sync::Arc;

use crate::common::{data, random_step, random_view, seeded};
use crate::patches::{advance_settled, all_around, finest};
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::{Engine, Settings};
use foldfront::selection::view::View;
use foldfront::vertex_tree::MeshSink;
use foldfront::{CollapseLog, Mesh};
use glam::DVec3;
use mt_partition::{CacheMode, Memory, MtFile, MtTree};
use rand_pcg::Pcg64;

/// A closed surface of extent about 2: a subdivided octahedron with bumps. Each level has four times the triangles.
fn bumpy_ball(levels: u32) -> Mesh {
    let mut points: Vec<DVec3> = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|p| [p, -p]).collect();
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    let bump = |p: DVec3| 1.0 + 0.05 * (17.0 * p.x).sin() * (13.0 * p.y).sin() * (11.0 * p.z).cos();
    let positions = points.into_iter().map(|p| (p * bump(p)).as_vec3().to_array()).collect();
    Mesh { positions, triangles, ..Mesh::default() }
}

fn ball_log(levels: u32) -> CollapseLog {
    data::log(bumpy_ball(levels))
}

/// A walk around the origin that rests, hurries and teleports.
struct Walk {
    random: Pcg64,
    view: View,
}

impl Walk {
    fn new(seed: u64, k: f64) -> Self {
        let mut random = seeded(seed);
        Self { view: random_view(&mut random).with_k(k).unwrap(), random }
    }

    fn step(&mut self) -> [View; 1] {
        random_step(&mut self.view, &mut self.random);
        [self.view]
    }
}

fn engine<M: MeshSink>(file: &Arc<MtFile>, cache: CacheMode, memory: Memory, mesh: M) -> Engine<MtTree, M> {
    let settings = mt_partition::Settings { cache, memory, ..mt_partition::Settings::default() };
    let tree = MtTree::new(file.clone(), settings).unwrap();
    Engine::new(tree, mesh, Settings { rho: 0.02, ..Settings::default() }).unwrap()
}

const CRITERION: Criterion = Criterion::ScreenError;
