//! A window goes back on disk: those of its blocks in which something has changed.

use std::io;

use parking_lot::Mutex;
use vertex_tree::NONE;

use super::super::candidates::{Parity, State};
use super::super::marks::Marks;
use super::super::nodes::Nodes;
use super::super::surface::{Surface, Triangle};
use super::blocks::{Blocks, NODE_WORDS, Ring, VERTEX_WORDS, Words};
use super::window::Window;

impl Window {
    /// Writes the blocks in which something has changed. `stays` says which of the vertices that are left are still of
    /// interest.
    ///
    /// Returns the number of vertices that have been written in inner blocks.
    pub fn store(
        &mut self,
        blocks: &Mutex<&mut Blocks>,
        stays: impl Fn(&Surface, u32) -> bool,
    ) -> io::Result<usize> {
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
                blocks.lock().write(self.blocks[b].0, &words)?;
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
    fn find_neighbours(&self, blocks: &Mutex<&mut Blocks>, block_of: &[u32], changed: &[bool]) {
        let mut neighbours = vec![Vec::new(); self.blocks.len()];
        let span = blocks.lock().span();
        for t in self.builder.surface.triangles.iter().filter(|t| t.corners[0] != NONE) {
            let [a, b, c] = t.corners.map(|v| block_of.get(v as usize).copied());
            if a == b && b == c && a.is_some() {
                continue;
            }
            let of = t.corners.map(|v| self.number(v) / span);
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
        let mut blocks = blocks.lock();
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
    let key = nodes.keys[i].to_bits();
    words.nodes.extend_from_slice(&[nodes.id(node), x, y, z, radius, eps, depth, height, key]);
    place
}

/// Stands for [`State::Nothing`], and for a vertex that is neither special nor joined.
pub(super) const NO_CANDIDATE: u32 = 7;

/// The number that stands for a state.
pub(super) fn code(state: State) -> u32 {
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
