//! The part of the mesh that is in memory: some blocks, put together for the same code that simplifies a whole mesh.
//!
//! Vertices keep their order, so that ties are broken as they would be in memory: they are the first slots. Then come
//! corners of triangles that reach out of the window, of which nothing is known, and then the sample points. Triangles,
//! nodes and sample points are in any order, and carry their numbers in the whole construction instead.

use std::io;

use glam::Vec3;
use parking_lot::Mutex;
use vertex_tree::NONE;

use super::super::candidates::{Parity, State};
use super::super::key_counts::KeyCounts;
use super::super::marks::Marks;
use super::super::nodes::Nodes;
use super::super::rounds::Builder;
use super::super::surface::Surface;
use super::blocks::{Blocks, Ring, Words};
use super::parts::Parts;

/// What does not change during a pass.
#[derive(Clone, Debug)]
pub(super) struct Whole {
    /// Length of a unit of the simplification in object units.
    pub unit: f64,
    /// Diagonal of the bounding box in object units.
    pub extent: f64,
    pub live_triangles: usize,
    /// The number of the first node of the current round.
    pub first_id: u32,
    /// Whether candidates that come up in vain are given up.
    pub gives_up: bool,
    /// Whether triangles may turn by nearly a right angle.
    pub leans: bool,
    pub parity: Parity,
    pub merge: bool,
}

/// Blocks in memory.
#[derive(Debug)]
pub(super) struct Window {
    pub builder: Builder,
    /// Ascending, each with how near it is.
    pub(super) blocks: Vec<(u32, Ring)>,
    /// For each block the slot of its first vertex, and the number of vertices.
    pub(super) starts: Vec<u32>,
    /// The input's number of each vertex.
    pub originals: Vec<u32>,
    /// Nodes that were there from the beginning.
    pub loaded_nodes: u32,
    /// Work space for [`store`](Self::store).
    pub(super) words: Words,
}

impl Window {
    /// Reads blocks, which are ascending. The first new node gets the number `next_id`.
    pub fn load(
        blocks: &Mutex<&mut Blocks>,
        list: Vec<(u32, Ring)>,
        whole: &Whole,
        next_id: u32,
    ) -> io::Result<Window> {
        let (mut parts, span) = {
            let blocks = blocks.lock();
            (Parts::new(&blocks, &list), blocks.span())
        };
        let mut nodes = Nodes::new(Vec::new(), whole.extent, whole.unit);
        (nodes.ids, nodes.next_id, nodes.first_of_round) = (Some(Vec::new()), next_id, whole.first_id);
        let mut starts = Vec::with_capacity(list.len() + 1);
        let mut words = Vec::new();
        for &(block, _) in &list {
            starts.push(parts.numbers.len() as u32);
            let counts = blocks.lock().read(block, &mut words)?;
            let mut words = words.as_slice();
            for counts in counts {
                let (segment, rest) = words.split_at(counts.words());
                parts.take(segment, counts, &mut nodes);
                words = rest;
            }
        }
        starts.push(parts.numbers.len() as u32);
        parts.find_slots(span, &list, &starts);

        // Those that reach out of the window have been added to the numbers, but are no vertices of it.
        let vertices = parts.numbers.len();
        parts.positions.resize(vertices, Vec3::ZERO);
        parts.special.resize(vertices, false);
        parts.positions.append(&mut parts.point_positions);
        parts.special.append(&mut parts.point_special);
        let mut surface = Surface::part(
            vertices,
            parts.positions,
            parts.special,
            parts.triangles,
            parts.triangle_ids,
            whole.live_triangles,
            whole.unit,
        );
        let known = parts.originals.len();
        surface.quadrics[..known].copy_from_slice(&parts.quadrics);
        surface.joined[..known].copy_from_slice(&parts.joined);
        parts.leaf_radius.resize(vertices, 0.0);
        parts.top.resize(vertices, NONE);
        parts.trace.resize(vertices, NONE);
        (nodes.leaf_radius, nodes.top, nodes.trace) = (parts.leaf_radius, parts.top, parts.trace);
        let loaded_nodes = nodes.next();
        let mut builder = Builder::new(surface, nodes, Marks::new(vertices), whole.merge);
        (builder.gives_up, builder.leans) = (whole.gives_up, whole.leans);
        builder.touched = Some(Vec::new());
        let candidates = &mut builder.candidates;
        candidates.parity = whole.parity;
        candidates.key[..known].copy_from_slice(&parts.key);
        candidates.state[..known].copy_from_slice(&parts.state);
        candidates.state[known..].fill(State::Nothing);
        candidates.target[..known].copy_from_slice(&parts.target);
        let first_point = vertices as u32;
        let next = parts.point_next.iter().map(|&p| if p == NONE { NONE } else { p + first_point });
        builder.samples.next.truncate(vertices);
        builder.samples.next.extend(next);
        parts.numbers.append(&mut parts.point_numbers);
        builder.samples.ids = Some(parts.numbers);
        let mut window = Window {
            builder,
            blocks: list,
            starts,
            originals: parts.originals,
            loaded_nodes,
            words: Words::default(),
        };
        window.hide_gains();
        Ok(window)
    }

    /// During a round, stars are as they were before it.
    fn hide_gains(&mut self) {
        let nodes = &self.builder.nodes;
        for v in 0..self.originals.len() as u32 {
            let top = nodes.top[v as usize];
            if nodes.is_new(top) {
                let surface = &mut self.builder.surface;
                let before = surface.star_length(v);
                surface.hide(v, |t| t.creator == top);
                surface.gained[v as usize] = surface.star_length(v) < before;
            }
        }
    }

    /// The slots of the vertices that come up, as one range for each block.
    pub fn inner(&self) -> impl Iterator<Item = (u32, std::ops::Range<usize>)> + '_ {
        let ranges = self.starts.windows(2).map(|ends| ends[0] as usize..ends[1] as usize);
        self.blocks.iter().zip(ranges).filter(|((_, ring), _)| *ring == Ring::Inner).map(|(b, r)| (b.0, r))
    }

    /// Numbers in the whole mesh of all vertices.
    pub fn numbers(&self) -> &[u32] {
        self.builder.samples.ids.as_deref().unwrap_or_default()
    }

    /// The number of a vertex in the whole mesh.
    pub fn number(&self, v: u32) -> u32 {
        self.builder.samples.ids.as_ref().map_or(v, |ids| ids[v as usize])
    }

    /// Vertices of the window.
    pub fn vertices(&self) -> usize {
        self.builder.surface.merged_into.len()
    }

    /// Takes the keys of all vertices out of the counts, or puts them back in.
    pub fn count(&self, counts: &mut KeyCounts, back: bool) {
        let (surface, candidates) = (&self.builder.surface, &self.builder.candidates);
        for v in 0..self.originals.len() {
            if surface.merged_into[v] == NONE && candidates.state[v] != State::Nothing {
                if back {
                    counts.add(candidates.key[v]);
                } else {
                    counts.remove(candidates.key[v]);
                }
            }
        }
    }
}
