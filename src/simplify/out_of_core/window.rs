//! The part of the mesh that is in memory: some blocks, put together for the same code that simplifies a whole mesh.
//!
//! Vertices keep their order, so that ties are broken as they would be in memory: they are the first slots. Then come
//! corners of triangles that reach out of the window, of which nothing is known, and then the sample points. Triangles,
//! nodes and sample points are in any order, and carry their numbers in the whole construction instead.

use std::collections::HashMap;
use std::hash::BuildHasherDefault;
use std::io;

use glam::Vec3;
use rustc_hash::FxHasher;
use vertex_tree::{Bounds, Collapse, NONE};

use super::super::candidates::{Parity, State};
use super::super::key_counts::KeyCounts;
use super::super::marks::Marks;
use super::super::nodes::Nodes;
use super::super::quadric::Quadric;
use super::super::rounds::Builder;
use super::super::surface::{Surface, Triangle};
use super::blocks::{Blocks, Counts, NODE_WORDS, POINT_WORDS, TRIANGLE_WORDS, VERTEX_WORDS, Words};

type FastMap = HashMap<u32, u32, BuildHasherDefault<FxHasher>>;

/// How near a block is to those whose vertices come up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Ring {
    /// Not in the window.
    #[default]
    Outside,
    /// Shares triangles with those that are near: the stars of their vertices are complete.
    Far,
    /// Shares triangles with those whose vertices come up.
    Near,
    /// Its vertices come up.
    Inner,
}

/// What does not change during a pass, or is counted over all windows.
#[derive(Clone, Debug)]
pub(super) struct Whole {
    /// Length of a unit of the simplification in object units.
    pub scale: f64,
    /// Diagonal of the bounding box in object units.
    pub extent: f64,
    pub live_triangles: usize,
    /// The number that the next node gets, and that of the first node of the current round.
    pub next_id: u32,
    pub first_id: u32,
    pub parity: Parity,
    pub merge: bool,
}

/// Blocks in memory.
#[derive(Debug)]
pub(super) struct Window {
    pub builder: Builder,
    /// Ascending, each with how near it is.
    blocks: Vec<(u32, Ring)>,
    /// For each block the slot of its first vertex, and the number of vertices.
    starts: Vec<u32>,
    /// The input's number of each vertex.
    pub originals: Vec<u32>,
    /// Nodes that were there from the beginning.
    pub loaded_nodes: u32,
    words: Words,
}

/// What is read before slots can be told.
#[derive(Default)]
struct Parts {
    numbers: Vec<u32>,
    originals: Vec<u32>,
    positions: Vec<Vec3>,
    special: Vec<bool>,
    joined: Vec<bool>,
    quadrics: Vec<Quadric>,
    key: Vec<f32>,
    target: Vec<u32>,
    state: Vec<State>,
    top: Vec<u32>,
    trace: Vec<u32>,
    leaf_radius: Vec<f32>,
    triangles: Vec<Triangle>,
    triangle_ids: Vec<u32>,
    point_numbers: Vec<u32>,
    point_special: Vec<bool>,
    point_positions: Vec<Vec3>,
    /// Number of the next point of the same triangle.
    point_next: Vec<u32>,
    remap: Vec<u32>,
    node_of: FastMap,
}

impl Window {
    /// Reads blocks, which are ascending.
    pub fn load(blocks: &Blocks, list: Vec<(u32, Ring)>, whole: &Whole) -> io::Result<Window> {
        let mut parts = Parts::new(blocks, &list);
        let mut nodes = Nodes::new(Vec::new(), whole.extent);
        (nodes.ids, nodes.next_id) = (Some(Vec::new()), whole.next_id);
        let mut starts = Vec::with_capacity(list.len() + 1);
        let mut words = Vec::new();
        for &(block, _) in &list {
            starts.push(parts.numbers.len() as u32);
            blocks.read(block, &mut words, |words, counts| parts.take(words, counts, &mut nodes))?;
        }
        starts.push(parts.numbers.len() as u32);
        parts.find_slots(blocks, &list, &starts);

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
        );
        let known = parts.originals.len();
        surface.quadrics[..known].copy_from_slice(&parts.quadrics);
        surface.joined[..known].copy_from_slice(&parts.joined);
        parts.leaf_radius.resize(vertices, 0.0);
        parts.top.resize(vertices, NONE);
        parts.trace.resize(vertices, NONE);
        (nodes.leaf_radius, nodes.top, nodes.trace) = (parts.leaf_radius, parts.top, parts.trace);
        let loaded_nodes = nodes.next();
        let mut builder = Builder::new(surface, nodes, Marks::new(vertices), whole.merge, whole.scale);
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
        window.hide_gains(whole.first_id);
        Ok(window)
    }

    /// During a round, stars are as they were before it.
    fn hide_gains(&mut self, first: u32) {
        let nodes = &self.builder.nodes;
        for v in 0..self.originals.len() as u32 {
            let top = nodes.top[v as usize];
            if nodes.is_from(top, first) {
                self.builder.surface.hide(v, |t| t.creator == top);
            }
        }
    }

    /// The slots of the vertices that come up, as one range for each block.
    pub fn inner(&self) -> impl Iterator<Item = (u32, std::ops::Range<usize>)> + '_ {
        let ranges = self.starts.windows(2).map(|ends| ends[0] as usize..ends[1] as usize);
        self.blocks.iter().zip(ranges).filter(|((_, ring), _)| *ring == Ring::Inner).map(|(b, r)| (b.0, r))
    }

    /// The slots of all vertices that come up.
    pub fn inner_slots(&self) -> Option<std::ops::Range<u32>> {
        let start = self.inner().next()?.1.start;
        let end = self.inner().last()?.1.end;
        Some(start as u32..end as u32)
    }

    /// Numbers in the whole mesh of all vertices.
    pub fn numbers(&self) -> &[u32] {
        self.builder.samples.ids.as_deref().unwrap_or_default()
    }

    /// The number of a vertex in the whole mesh.
    fn number(&self, v: u32) -> u32 {
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

    /// Writes the blocks in which something has changed. `stays` says which of the vertices that are left are still of
    /// interest.
    ///
    /// Returns the number of vertices that have been written in inner blocks.
    pub fn store(&mut self, blocks: &mut Blocks, stays: impl Fn(&Surface, u32) -> bool) -> io::Result<usize> {
        let mut inner = 0;
        let mut block_of = vec![0_u32; self.originals.len()];
        for (i, ends) in self.starts.windows(2).enumerate() {
            block_of[ends[0] as usize..ends[1] as usize].fill(i as u32);
        }
        let mut changed: Vec<bool> = self.blocks.iter().map(|&(_, ring)| ring == Ring::Inner).collect();
        for &v in self.builder.touched.as_deref().unwrap_or_default() {
            if let Some(&block) = block_of.get(v as usize) {
                changed[block as usize] = true;
            }
        }
        self.find_neighbours(blocks, &block_of, &changed);
        // Triangles by the block of their lowest corner.
        let surface = &self.builder.surface;
        let home = |t: &Triangle| {
            let [a, b, c] = t.corners;
            (a != NONE).then(|| block_of.get(a.min(b).min(c) as usize)).flatten().map(|&b| b as usize)
        };
        let mut start = vec![0_u32; self.blocks.len() + 1];
        surface.triangles.iter().filter_map(home).for_each(|b| start[b + 1] += 1);
        for b in 1..start.len() {
            start[b] += start[b - 1];
        }
        let mut sorted = vec![0_u32; start.last().copied().unwrap_or(0) as usize];
        for (t, triangle) in (0..).zip(&surface.triangles) {
            if let Some(b) = home(triangle) {
                sorted[start[b] as usize] = t;
                start[b] += 1;
            }
        }
        let mut node_marks = Marks::new(self.builder.nodes.next() as usize);
        for b in 0..self.blocks.len() {
            if changed[b] {
                let from = if b == 0 { 0 } else { start[b - 1] };
                let vertices = self.starts[b]..self.starts[b + 1];
                let mut words = std::mem::take(&mut self.words);
                words.clear();
                node_marks.clear();
                for v in vertices.filter(|&v| self.builder.surface.merged_into[v as usize] == NONE) {
                    if stays(&self.builder.surface, v) {
                        self.put_vertex(v, &mut words, &mut node_marks);
                    }
                }
                for &t in &sorted[from as usize..start[b] as usize] {
                    self.put_triangle(t, &mut words, &mut node_marks);
                }
                blocks.write(self.blocks[b].0, &words)?;
                if self.blocks[b].1 == Ring::Inner {
                    inner += words.vertices.len() / VERTEX_WORDS;
                }
                self.words = words;
            }
        }
        Ok(inner)
    }

    fn put_vertex(&self, v: u32, words: &mut Words, marks: &mut Marks) {
        let (surface, candidates, nodes) =
            (&self.builder.surface, &self.builder.candidates, &self.builder.nodes);
        let i = v as usize;
        let state = candidates.state[i];
        let has_target = !matches!(state, State::Outdated(_) | State::Nothing);
        let target = if has_target { self.number(candidates.target[i]) } else { NONE };
        let flags = code(state) | u32::from(surface.special[i]) << 4 | u32::from(surface.joined[i]) << 5;
        let [top, trace] = [nodes.top[i], nodes.trace[i]].map(|node| put_node(node, nodes, words, marks));
        let mut record = [0; VERTEX_WORDS];
        record[..2].copy_from_slice(&[self.number(v), self.originals[i]]);
        record[2..5].copy_from_slice(&surface.positions[i].to_array().map(f32::to_bits));
        record[5..16].copy_from_slice(&surface.quadrics[i].to_array().map(f32::to_bits));
        record[16..21].copy_from_slice(&[candidates.key[i].to_bits(), target, flags, top, trace]);
        record[21] = nodes.leaf_radius[i].to_bits();
        words.vertices.extend_from_slice(&record);
    }

    fn put_triangle(&self, t: u32, words: &mut Words, marks: &mut Marks) {
        let (surface, samples) = (&self.builder.surface, &self.builder.samples);
        let triangle = &surface.triangles[t as usize];
        let mut count = 0;
        let mut point = triangle.samples;
        while point != NONE {
            let p = point as usize;
            let [x, y, z] = surface.positions[p].to_array().map(f32::to_bits);
            words.points.extend_from_slice(&[self.number(point), u32::from(surface.special[p]), x, y, z]);
            point = samples.next[p];
            count += 1;
        }
        let creator = put_node(triangle.creator, &self.builder.nodes, words, marks);
        let id = surface.triangle_ids.as_ref().map_or(t, |ids| ids[t as usize]);
        let [a, b, c] = triangle.corners.map(|v| self.number(v));
        words.triangles.extend_from_slice(&[id, a, b, c, creator, count]);
    }

    /// Finds anew with which blocks those near the inner ones share triangles, as far as something has changed there.
    fn find_neighbours(&self, blocks: &mut Blocks, block_of: &[u32], changed: &[bool]) {
        let mut neighbours = vec![Vec::new(); self.blocks.len()];
        for t in self.builder.surface.triangles.iter().filter(|t| t.corners[0] != NONE) {
            let [a, b, c] = t.corners.map(|v| block_of.get(v as usize).copied());
            if a == b && b == c && a.is_some() {
                continue;
            }
            let of = t.corners.map(|v| blocks.of(self.number(v)));
            for (i, block) in [a, b, c].into_iter().enumerate() {
                let Some(block) = block else { continue };
                let list = &mut neighbours[block as usize];
                for other in [of[(i + 1) % 3], of[(i + 2) % 3]] {
                    if other != of[i] && list.last() != Some(&other) && !list.contains(&other) {
                        list.push(other);
                    }
                }
            }
        }
        for (i, &(block, ring)) in self.blocks.iter().enumerate() {
            if changed[i] && ring >= Ring::Near {
                blocks.set_neighbours(block, &mut neighbours[i]);
            }
        }
    }
}

/// The place of a node in the table of the segment that is being put together.
fn put_node(node: u32, nodes: &Nodes, words: &mut Words, marks: &mut Marks) -> u32 {
    if node == NONE {
        return NONE;
    }
    if let Some(place) = marks.get(node) {
        return place;
    }
    let place = (words.nodes.len() / NODE_WORDS) as u32;
    marks.set(node, place);
    let (i, bounds) = (node as usize, nodes.collapses[node as usize].bounds);
    let [x, y, z] = bounds.center.map(f32::to_bits);
    let [radius, eps] = [bounds.radius, bounds.eps].map(f32::to_bits);
    let [depth, height] = [nodes.depth[i], nodes.height[i]];
    words.nodes.extend_from_slice(&[nodes.id(node), x, y, z, radius, eps, depth, height]);
    place
}

impl Parts {
    fn new(blocks: &Blocks, list: &[(u32, Ring)]) -> Parts {
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

    fn take(&mut self, words: &[u32], counts: Counts, nodes: &mut Nodes) {
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
            nodes.keys.push(0.0);
            nodes.depth.push(words[6]);
            nodes.height.push(words[7]);
            if let Some(ids) = &mut nodes.ids {
                ids.push(words[0]);
            }
            node
        })
    }

    /// Puts slots in the place of numbers of vertices, and the corners that are not here behind the others.
    fn find_slots(&mut self, blocks: &Blocks, list: &[(u32, Ring)], starts: &[u32]) {
        self.node_of = FastMap::default();
        let span = blocks.span() as usize;
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
            let block = blocks.of(number);
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

/// Stands for [`State::Nothing`], and for a vertex that is neither special nor joined.
pub(super) const NO_CANDIDATE: u32 = 7;

/// The number that stands for a state.
fn code(state: State) -> u32 {
    match state {
        State::Outdated(Parity::Even) => 0,
        State::Outdated(Parity::Odd) => 1,
        State::Updated(Parity::Even) => 2,
        State::Updated(Parity::Odd) => 3,
        State::Cheapest => 4,
        State::Legal => 5,
        State::Forced => 6,
        State::Nothing => NO_CANDIDATE,
    }
}

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
