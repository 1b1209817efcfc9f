//! What is read of some blocks, before it is put together to a window.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;

use collapse_log::Collapse;
use glam::Vec3;
use rustc_hash::FxHasher;
use vertex_tree::{Bounds, NONE};

use super::super::candidates::{Parity, State};
use super::super::nodes::Nodes;
use super::super::quadric::Quadric;
use super::super::surface::Triangle;
use super::blocks::{Blocks, Counts, NODE_WORDS, POINT_WORDS, Ring, TRIANGLE_WORDS, VERTEX_WORDS};

type FastMap = HashMap<u32, u32, BuildHasherDefault<FxHasher>>;

/// What is read before slots can be told.
#[derive(Default)]
pub(super) struct Parts {
    pub numbers: Vec<u32>,
    pub originals: Vec<u32>,
    pub positions: Vec<Vec3>,
    pub special: Vec<bool>,
    pub joined: Vec<bool>,
    pub quadrics: Vec<Quadric>,
    pub key: Vec<f32>,
    pub target: Vec<u32>,
    pub state: Vec<State>,
    pub top: Vec<u32>,
    pub trace: Vec<u32>,
    pub leaf_radius: Vec<f32>,
    pub triangles: Vec<Triangle>,
    pub triangle_ids: Vec<u32>,
    pub point_numbers: Vec<u32>,
    pub point_special: Vec<bool>,
    pub point_positions: Vec<Vec3>,
    /// Number of the next point of the same triangle.
    pub point_next: Vec<u32>,
    remap: Vec<u32>,
    node_of: FastMap,
}

impl Parts {
    pub fn new(blocks: &Blocks, list: &[(u32, Ring)]) -> Parts {
        let mut all = Counts::default();
        for &(block, _) in list {
            let counts = blocks.counts(block);
            all.vertices += counts.vertices;
            all.triangles += counts.triangles;
            all.points += counts.points;
        }
        let [v, t, p] = [all.vertices, all.triangles, all.points].map(|n| n as usize);
        // A few corners reach out of the window; without room for them everything would move.
        let (foreign, points) = (v / 16 + 64, p);
        Parts {
            numbers: Vec::with_capacity(v + foreign + points),
            originals: Vec::with_capacity(v),
            positions: Vec::with_capacity(v + foreign + points),
            special: Vec::with_capacity(v + foreign + points),
            joined: Vec::with_capacity(v),
            quadrics: Vec::with_capacity(v),
            key: Vec::with_capacity(v),
            target: Vec::with_capacity(v),
            state: Vec::with_capacity(v),
            top: Vec::with_capacity(v + foreign),
            trace: Vec::with_capacity(v + foreign),
            leaf_radius: Vec::with_capacity(v + foreign),
            triangles: Vec::with_capacity(t),
            triangle_ids: Vec::with_capacity(t),
            point_numbers: Vec::with_capacity(p),
            point_special: Vec::with_capacity(p),
            point_positions: Vec::with_capacity(p),
            point_next: Vec::with_capacity(p),
            remap: Vec::new(),
            node_of: FastMap::default(),
        }
    }

    pub fn take(&mut self, words: &[u32], counts: Counts, nodes: &mut Nodes) {
        let (vertices, words) = words.split_at(counts.vertices as usize * VERTEX_WORDS);
        let (triangles, words) = words.split_at(counts.triangles as usize * TRIANGLE_WORDS);
        let (node_words, points) = words.split_at(counts.nodes as usize * NODE_WORDS);
        self.remap.clear();
        for words in node_words.as_chunks::<NODE_WORDS>().0 {
            let node = self.take_node(words, nodes);
            self.remap.push(node);
        }
        let node = |place: u32| self.remap.get(place as usize).copied().unwrap_or(NONE);
        for words in vertices.as_chunks::<VERTEX_WORDS>().0 {
            let float = |i: usize| f32::from_bits(words[i]);
            self.numbers.push(words[0]);
            self.originals.push(words[1]);
            self.positions.push(Vec3::new(float(2), float(3), float(4)));
            self.quadrics.push(Quadric::from_array(std::array::from_fn(|i| float(5 + i))));
            self.key.push(float(16));
            self.target.push(words[17]);
            self.state.push(state(words[18]));
            self.special.push(words[18] & 16 != 0);
            self.joined.push(words[18] & 32 != 0);
            self.top.push(node(words[19]));
            self.trace.push(node(words[20]));
            self.leaf_radius.push(float(21));
        }
        for words in triangles.as_chunks::<TRIANGLE_WORDS>().0 {
            let [id, a, b, c, creator, count] = *words;
            let first = self.point_next.len() as u32;
            self.point_next.extend((1..=count).map(|i| if i < count { first + i } else { NONE }));
            self.triangle_ids.push(id);
            let samples = if count == 0 { NONE } else { first };
            self.triangles.push(Triangle { corners: [a, b, c], creator: node(creator), samples });
        }
        for words in points.as_chunks::<POINT_WORDS>().0 {
            self.point_numbers.push(words[0]);
            self.point_special.push(words[1] != 0);
            self.point_positions.push(Vec3::from_array([words[2], words[3], words[4]].map(f32::from_bits)));
        }
    }

    /// The same node comes in several blocks.
    fn take_node(&mut self, words: &[u32; NODE_WORDS], nodes: &mut Nodes) -> u32 {
        *self.node_of.entry(words[0]).or_insert_with(|| {
            let node = nodes.next();
            let float = |i: usize| f32::from_bits(words[i]);
            let bounds = Bounds { center: [float(1), float(2), float(3)], radius: float(4), eps: float(5) };
            nodes.collapses.push(Collapse { removed: NONE, kept: NONE, bounds });
            nodes.keys.push(float(8));
            nodes.depth.push(words[6]);
            nodes.height.push(words[7]);
            if let Some(ids) = &mut nodes.ids {
                ids.push(words[0]);
            }
            node
        })
    }

    /// Puts slots in the place of numbers of vertices, and the corners that are not here behind the others.
    pub fn find_slots(&mut self, numbers_in_block: u32, list: &[(u32, Ring)], starts: &[u32]) {
        self.node_of = FastMap::default();
        let span = numbers_in_block as usize;
        let mut table_of = FastMap::default();
        let mut slots = vec![NONE; list.len() * span];
        for (i, &(block, _)) in list.iter().enumerate() {
            table_of.insert(block, (i * span) as u32);
            for v in starts[i]..starts[i + 1] {
                slots[i * span + self.numbers[v as usize] as usize % span] = v;
            }
        }
        let mut foreign = FastMap::default();
        let mut last = (NONE, NONE);
        let numbers = &mut self.numbers;
        let mut slot = |number: u32| {
            let block = number / numbers_in_block;
            if block != last.0 {
                last = (block, table_of.get(&block).copied().unwrap_or(NONE));
            }
            let known = match last.1 {
                NONE => NONE,
                table => slots[table as usize + number as usize % span],
            };
            if known != NONE {
                return known;
            }
            *foreign.entry(number).or_insert_with(|| {
                numbers.push(number);
                numbers.len() as u32 - 1
            })
        };
        for triangle in &mut self.triangles {
            triangle.corners = triangle.corners.map(&mut slot);
        }
        for target in self.target.iter_mut().filter(|t| **t != NONE) {
            *target = slot(*target);
        }
        let vertices = self.numbers.len() as u32;
        for triangle in self.triangles.iter_mut().filter(|t| t.samples != NONE) {
            triangle.samples += vertices;
        }
    }
}

/// The state that a number stands for; see [`code`](super::store::code).
fn state(code: u32) -> State {
    match code & 7 {
        0 => State::Outdated(Parity::Even),
        1 => State::Outdated(Parity::Odd),
        2 => State::Updated(Parity::Even),
        3 => State::Updated(Parity::Odd),
        4 => State::Cheapest,
        5 => State::Legal,
        6 => State::Forced,
        _ => State::Nothing,
    }
}
