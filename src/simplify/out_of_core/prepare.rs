//! From the input to the first blocks: everything sorted in space, on disk.
//!
//! Vertices are numbered along the Z-order curve, as in memory. Triangles get the new numbers of their corners and are
//! sorted by the lowest, and in the order of the input among equals.

use std::io;

use glam::Vec3;
use vertex_tree::NONE;
use vertex_tree::external::{Scratch, Sorter, Spool};

use super::super::edge_lengths::EdgeLengths;
use super::super::is_flat;
use super::super::spatial_order::Curve;
use super::blocks::{Blocks, VERTEX_WORDS, Words};

/// The input on disk, as it will be in the log.
#[derive(Debug)]
pub(super) struct Input {
    pub positions: Spool<3>,
    pub triangles: Spool<3>,
    low: Vec3,
    high: Vec3,
    /// Of the edges, once the first blocks have been made.
    pub lengths: EdgeLengths,
}

impl Input {
    pub fn new(scratch: &Scratch) -> io::Result<Input> {
        Ok(Input {
            positions: scratch.spool()?,
            triangles: scratch.spool()?,
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            lengths: EdgeLengths::new(),
        })
    }

    pub fn push_position(&mut self, position: [f32; 3]) -> io::Result<()> {
        let p = Vec3::from_array(position);
        (self.low, self.high) = (self.low.min(p), self.high.max(p));
        self.positions.push(position.map(f32::to_bits))
    }

    /// Diagonal of the bounding box in object units.
    pub fn extent(&self) -> f64 {
        if self.positions.is_empty() { 0.0 } else { (self.high.as_dvec3() - self.low.as_dvec3()).length() }
    }
}

/// Writes the first blocks, in which vertices have neither quadrics nor candidates yet. `memory` is in bytes. Progress
/// is told as parts of a thousand. Also returns the number of triangles, without those that name a vertex twice.
pub(super) fn first_blocks(
    input: &mut Input,
    scratch: &Scratch,
    memory: usize,
    mut progress: impl FnMut(u64) -> io::Result<()>,
) -> io::Result<(Blocks, usize)> {
    let (vertex_count, triangle_count) = (input.positions.len(), input.triangles.len());
    let curve = Curve::new(input.low, input.high);
    let mut share = |part: u64, done: u64, all: u64| {
        if done.is_multiple_of(1 << 16) { progress(part + 250 * done / all.max(1)) } else { Ok(()) }
    };

    let mut by_place = Sorter::<5>::new(scratch, memory / 2);
    for (old, position) in (0_u32..).zip(input.positions.read()?) {
        let [x, y, z] = position?;
        let p = Vec3::from_array([x, y, z].map(f32::from_bits));
        by_place.push([curve.key(p), old, x, y, z])?;
        share(0, u64::from(old), vertex_count)?;
    }
    let mut vertices = scratch.spool::<4>()?;
    let mut by_old = Sorter::<5>::new(scratch, memory / 4);
    by_place.finish(|[_, old, x, y, z]| {
        by_old.push([old, vertices.len() as u32, x, y, z])?;
        vertices.push([old, x, y, z])?;
        share(250, vertices.len(), vertex_count)
    })?;
    let mut numbers = scratch.spool::<4>()?;
    by_old.finish(|[_, new, x, y, z]| numbers.push([new, x, y, z]))?;
    let mut numbers = numbers.into_paged(memory / 4)?;

    let mut by_lowest = Sorter::<5>::new(scratch, memory / 2);
    for (number, triangle) in (0_u32..).zip(input.triangles.read()?) {
        let (mut corners, mut places) = ([0; 3], [Vec3::ZERO; 3]);
        for ((corner, place), old) in corners.iter_mut().zip(&mut places).zip(triangle?) {
            let [new, x, y, z] = numbers.get(u64::from(old))?;
            (*corner, *place) = (new, Vec3::from_array([x, y, z].map(f32::from_bits)));
        }
        let [a, b, c] = corners;
        if !is_flat(corners) {
            input.lengths.add(places);
            by_lowest.push([a.min(b).min(c), number, a, b, c])?;
        }
        share(500, u64::from(number), triangle_count)?;
    }
    drop(numbers);

    let mut blocks = Blocks::new(vertex_count, scratch.file()?);
    let mut vertices = vertices.read()?;
    let mut words = Words::default();
    let (mut block, mut id) = (0, 0_u32);
    let mut write = |blocks: &mut Blocks, block: u32, words: &mut Words| {
        for (number, vertex) in (block * blocks.span()..).zip((&mut vertices).take(blocks.span() as usize)) {
            let [old, x, y, z] = vertex?;
            let mut record = [0; VERTEX_WORDS];
            record[..5].copy_from_slice(&[number, old, x, y, z]);
            record[17..21].copy_from_slice(&[NONE, super::store::NO_CANDIDATE, NONE, NONE]);
            words.vertices.extend(record);
        }
        blocks.write(block, words)?;
        words.clear();
        Ok::<(), io::Error>(())
    };
    by_lowest.finish(|[lowest, _, a, b, c]| {
        let of = [a, b, c].map(|v| blocks.of(v));
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            if of[i] != of[j] {
                blocks.join(of[i], of[j]);
            }
        }
        while block < blocks.of(lowest) {
            write(&mut blocks, block, &mut words)?;
            block += 1;
        }
        words.triangles.extend([id, a, b, c, NONE, 0]);
        id += 1;
        share(750, u64::from(id), triangle_count)
    })?;
    while (block as usize) < blocks.len() {
        write(&mut blocks, block, &mut words)?;
        block += 1;
    }
    blocks.finish_joining();
    Ok((blocks, id as usize))
}
