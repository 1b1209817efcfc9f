//! What becomes of each vertex, and the collapses in order along a curve through space.

use std::io;

use bytemuck::{Pod, Zeroable};
use collapse_log::external::{Array, Sorter, Spool};
use collapse_log::{LogError, z_order};
use vertex_tree::NONE;

use super::work::{Failure, Work};
use crate::reduce::reach;

/// What becomes of a vertex.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Fate {
    /// The collapse that removes it, [`NONE`] for one that stays.
    pub collapse: u32,
    /// The vertex that takes its place.
    pub kept: u32,
    /// The place of the collapse.
    pub place: u32,
}

impl Fate {
    pub const STAYS: Self = Self { collapse: NONE, kept: NONE, place: NONE };

    pub fn from_words([collapse, kept, place]: [u32; 3]) -> Self {
        Self { collapse, kept, place }
    }
}

/// A node of the graph.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct State {
    /// The collapse that stands for it.
    pub collapse: u32,
    pub reach: f32,
    /// Triangles on the outgoing and on the ingoing arcs.
    pub sizes: [u32; 2],
    /// In the topological order of the whole graph.
    pub position: u32,
}

pub(super) struct History {
    /// By vertex.
    pub fates: Array<Fate>,
    /// By place.
    pub states: Array<State>,
    /// By place: how far along another curve.
    pub others: Array<u32>,
    /// By place: collapse, removed and kept vertex.
    pub ends: Spool<3>,
}

impl History {
    /// Reads a log, and finds whether the collapses make one.
    pub fn new(work: Work<'_>) -> Result<Self, Failure> {
        let (log, memory) = (work.log, work.memory);
        let counts = log.counts();
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for (vertex, position) in log.positions().enumerate() {
            let position = position?;
            if !position.iter().all(|x| x.is_finite()) {
                return Err(LogError::BadPosition { vertex, position }.into());
            }
            for i in 0..3 {
                low[i] = low[i].min(position[i]);
                high[i] = high[i].max(position[i]);
            }
        }
        work.check()?;
        let vertices = counts.vertices as usize;
        for (triangle, corners) in log.triangles().enumerate() {
            if let Some(&vertex) = corners?.iter().find(|&&v| v as usize >= vertices) {
                return Err(LogError::CornerOutOfRange { triangle, vertex, vertices }.into());
            }
        }
        let side = (0..3).map(|i| high[i] - low[i]).fold(0.0, f32::max);
        let curve = Curve::new(low, side);
        // No border between cells of the one, of whatever size, is near one of the other.
        let other = Curve::new(low.map(|x| x - side / 3.0), 2.0 * side);
        let mut fates = Array::new(work.scratch, vertices, Fate::STAYS, memory / 8 * 3);
        let mut sorted = Sorter::<6>::new(work.scratch, memory / 8);
        for (n, c) in log.collapses().enumerate() {
            work.check()?;
            let c = c?;
            for vertex in [c.removed, c.kept] {
                if vertex as usize >= vertices || fates.get(vertex as usize)?.collapse != NONE {
                    return Err(LogError::NoSuchVertex { collapse: n, vertex }.into());
                }
            }
            c.check(n)?;
            fates.set(c.removed as usize, Fate { collapse: n as u32, kept: c.kept, place: NONE })?;
            let [key, other] = [&curve, &other].map(|curve| curve.key(c.bounds.center));
            sorted.push([key, n as u32, other, c.removed, c.kept, reach(&c.bounds).to_bits()])?;
        }
        let collapses = counts.collapses as u32;
        let mut states = Array::new(work.scratch, 0, State::default(), memory / 4);
        let mut ends = work.scratch.spool()?;
        let mut sorted_again = Sorter::<2>::new(work.scratch, memory / 16);
        sorted.finish(|[_, collapse, other, removed, kept, reach]| {
            work.check()?;
            sorted_again.push([other, states.len() as u32])?;
            ends.push([collapse, removed, kept])?;
            fates.get_mut(removed as usize)?.place = states.len() as u32;
            let (reach, position) = (f32::from_bits(reach), collapses - 1 - collapse);
            states.push(State { collapse, reach, sizes: [0; 2], position })
        })?;
        let mut others = Array::new(work.scratch, states.len(), 0, memory / 32);
        let mut next = 0;
        sorted_again.finish(|[_, place]| {
            others.set(place as usize, next)?;
            next += 1;
            Ok(())
        })?;
        Ok(Self { fates, states, others, ends })
    }

    /// Puts fates on disk for as long as nobody asks for them.
    pub fn store_fates(&mut self, work: Work<'_>) -> io::Result<Spool<3>> {
        let mut fates = work.scratch.spool()?;
        for vertex in 0..self.fates.len() {
            let Fate { collapse, kept, place } = self.fates.get(vertex)?;
            fates.push([collapse, kept, place])?;
        }
        self.fates = Array::new(work.scratch, 0, Fate::STAYS, 0);
        Ok(fates)
    }
}

/// The Z-order curve (Morton 1966) through a grid of 1024 cells a side.
struct Curve {
    low: [f32; 3],
    /// Cells a unit of length.
    cells: f32,
}

impl Curve {
    /// Through the cube with a corner at `low`.
    fn new(low: [f32; 3], side: f32) -> Self {
        Self { low, cells: if side > 0.0 { 1023.99 / side } else { 0.0 } }
    }

    /// How far along the curve a point lies. Centres of spheres may lie outside of the box.
    fn key(&self, point: [f32; 3]) -> u32 {
        z_order(std::array::from_fn(|i| ((point[i] - self.low[i]) * self.cells).clamp(0.0, 1023.0) as u32))
    }
}
