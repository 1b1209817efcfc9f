//! From the input to the first blocks: everything sorted in space, on disk.
//!
//! Vertices are numbered along the Z-order curve, as in memory. Triangles get the new numbers of their corners and are
//! sorted by the lowest, and in the order of the input among equals.

use std::io;

use collapse_log::external::{Scratch, Sorter, Spool};
use container::{Georeference, Rounding};
use glam::Vec3;
use vertex_tree::NONE;

use super::super::initial::is_flat;
use super::super::spatial_order::Curve;
use super::blocks::{Blocks, VERTEX_WORDS, Words};
use crate::edge_lengths::EdgeLengths;
use crate::mesh_io::{Bounds, Placing, exact};

/// The input on disk, as it will be in the log.
#[derive(Debug)]
pub(super) struct Input {
    /// Relative to the origin, once [`place`](Self::place) has been called.
    pub positions: Spool<3>,
    pub triangles: Spool<3>,
    pub georeference: Georeference,
    /// All positions in 64 bits, once 32 do not hold one of them exactly; then there are none in `positions`.
    wide: Option<Spool<6>>,
    scratch: Scratch,
    /// Of the world coordinates.
    bounds: Bounds,
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
            georeference: Georeference::default(),
            wide: None,
            scratch: scratch.clone(),
            bounds: Bounds::default(),
            low: Vec3::INFINITY,
            high: Vec3::NEG_INFINITY,
            lengths: EdgeLengths::default(),
        })
    }

    /// How many vertices there are.
    pub fn vertices(&self) -> u64 {
        self.wide.as_ref().map_or(self.positions.len(), Spool::len)
    }

    pub fn push_position(&mut self, position: [f64; 3]) -> io::Result<()> {
        self.bounds.include(position);
        if self.wide.is_none() {
            if let Some(short) = exact(position) {
                return self.push_placed(short);
            }
            let mut wide = self.scratch.spool()?;
            for short in self.positions.read()? {
                wide.push(to_words(short?.map(|x| f64::from(f32::from_bits(x)))))?;
            }
            self.forget_positions()?;
            self.wide = Some(wide);
        }
        match &mut self.wide {
            Some(wide) => wide.push(to_words(position)),
            None => Ok(()),
        }
    }

    pub fn position_of(&mut self, vertex: u32) -> io::Result<[f64; 3]> {
        match &mut self.wide {
            Some(wide) => Ok(from_words(wide.get(u64::from(vertex))?)),
            None => Ok(self.positions.get(u64::from(vertex))?.map(|x| f64::from(f32::from_bits(x)))),
        }
    }

    /// Once everything has been read: makes 32-bit positions about the middle, if 32 bits do not hold the world coordinates, as
    /// the collector of `mesh_io` does in memory. `memory` is in bytes.
    pub fn place(&mut self, memory: usize, mut check: impl FnMut() -> io::Result<()>) -> io::Result<()> {
        let Some(mut wide) = self.wide.take() else { return Ok(()) };
        let mut placing = Placing::new(&self.bounds);
        for position in wide.read()? {
            check()?;
            self.push_placed(placing.place(from_words(position?)))?;
        }
        let mut edges = EdgeLengths::default();
        if placing.largest_move > 0.0 {
            let mut wide = wide.into_paged(memory)?;
            for triangle in self.triangles.read()? {
                check()?;
                let mut corners = [[0.0; 3]; 3];
                for (corner, vertex) in corners.iter_mut().zip(triangle?) {
                    *corner = from_words(wide.get(u64::from(vertex))?);
                }
                edges.add(corners);
            }
        }
        self.georeference.origin = placing.origin;
        self.georeference.rounding =
            Rounding { largest_move: placing.largest_move, median_edge: edges.median() };
        Ok(())
    }

    fn push_placed(&mut self, position: [f32; 3]) -> io::Result<()> {
        let p = Vec3::from_array(position);
        (self.low, self.high) = (self.low.min(p), self.high.max(p));
        self.positions.push(position.map(f32::to_bits))
    }

    fn forget_positions(&mut self) -> io::Result<()> {
        self.positions = self.scratch.spool()?;
        (self.low, self.high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        Ok(())
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
        let (mut corners, mut places) = ([0; 3], [[0.0; 3]; 3]);
        for ((corner, place), old) in corners.iter_mut().zip(&mut places).zip(triangle?) {
            let [new, x, y, z] = numbers.get(u64::from(old))?;
            (*corner, *place) = (new, [x, y, z].map(|x| f64::from(f32::from_bits(x))));
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

/// Each coordinate in two words, the lower first.
fn to_words(position: [f64; 3]) -> [u32; 6] {
    let [x, y, z] = position.map(f64::to_bits);
    [x as u32, (x >> 32) as u32, y as u32, (y >> 32) as u32, z as u32, (z >> 32) as u32]
}

fn from_words(words: [u32; 6]) -> [f64; 3] {
    std::array::from_fn(|axis| {
        f64::from_bits(u64::from(words[2 * axis + 1]) << 32 | u64::from(words[2 * axis]))
    })
}
