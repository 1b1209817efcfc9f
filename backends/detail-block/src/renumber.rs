//! An order of collapses, and numbers of vertices and triangles, by which what is near in time is near in the arrays.
//!
//! A log goes round by round, but in each round over the whole mesh, in the order of keys; and its vertices and triangles
//! are in the input's order, in which neighbours may be far apart. So the collapses of a round are put in the order of a
//! curve through space (Morton 1966). A round is told by the log alone: it has ended before a collapse that names a
//! vertex which it has named already. A few collapses of the next round may have come by then without naming any, so the
//! last [`TAIL`] before keep their order.
//! In these rounds collapses do not touch each other, so they may be put in any order; other logs remain logs, as no
//! collapse comes before one that it builds on.
//!
//! Vertices are ranked by the collapse that removes them, and triangles by the one that lets them vanish; what stays comes
//! last, in the input's order. Then what the collapses of a round remove lies together, in the order in which they come
//! up; what they look at besides lies in as many places as there are rounds to come, and through each of these the round
//! goes from the beginning to the end. And what is left after a round is at the end of the arrays, without gaps: so
//! much less passes through memory in each later round.
//!
//! Collapses of the log join input vertices: a corner at a removed vertex goes to the kept one, and its triangle vanishes when
//! two of its corners meet. The mesh in half-edges does not follow the log in every case (see [`replay`](crate::replay)),
//! but ranks decide only what is where.

use std::collections::VecDeque;

use bytemuck::{Pod, Zeroable};
use collapse_log::external::Sorter;
use collapse_log::{Collapse, LogError, LogSource, z_order};

use crate::error::{Failure, XfmError};
use crate::half_edges::{BOUNDARY, HalfEdge, Reverses, triangle_of};
use crate::storage::{Elements, Storage};

/// A triangle in half-edges, and what the nesting of bounds remembers of it.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Face {
    /// The corners, [`NONE`](vertex_tree::NONE) in the first once the triangle has been removed.
    pub start: [u32; 3],
    pub rev: [HalfEdge; 3],
    /// The collapse that last moved a corner.
    pub creator: u32,
    /// For each half-edge, the collapse that made its edge.
    pub edge_creator: [u32; 3],
}

/// Triangles in the order of their ranks.
pub(crate) struct Faces<A>(pub A);

impl<A: Elements<Face>> Reverses for Faces<A> {
    type Error = std::io::Error;

    #[inline(always)]
    fn rev(&mut self, h: HalfEdge) -> Result<HalfEdge, Self::Error> {
        let (t, k) = triangle_of(h);
        Ok(self.0.get(t)?.rev[k])
    }
}

impl<A: Elements<Face>> Faces<A> {
    #[inline(always)]
    pub fn start(&mut self, h: HalfEdge) -> std::io::Result<u32> {
        let (t, k) = triangle_of(h);
        Ok(self.0.get(t)?.start[k])
    }

    /// Makes two half-edges each other's reverse, or one of them a boundary if the other is [`BOUNDARY`].
    #[inline(always)]
    pub fn pair(&mut self, h: HalfEdge, g: HalfEdge) -> std::io::Result<()> {
        for (h, g) in [(h, g), (g, h)] {
            if h != BOUNDARY {
                let (t, k) = triangle_of(h);
                self.0.get_mut(t)?.rev[k] = g;
            }
        }
        Ok(())
    }
}

/// A log's mesh, renumbered.
pub(crate) struct Renumbered<S: Storage> {
    /// For each collapse, the rank of the kept vertex; that of the removed one is the number of the collapse.
    pub kept: S::Array<u32>,
    /// For each collapse, its error in the log.
    pub eps: S::Array<f32>,
    /// For each rank, the input vertex and the bits of its position.
    pub places: S::Array<[u32; 4]>,
    /// The triangles, with ranks as corners and without reverses.
    pub faces: Faces<S::Array<Face>>,
    /// For each of them, the input triangle.
    pub input: S::Array<u32>,
    /// Corners of the bounding box.
    pub corners: [[f32; 3]; 2],
    /// Input triangles that name a vertex twice: never shown, left out.
    pub degenerate: u64,
}

/// There is no number for a half-edge of more triangles than this.
pub(crate) const MOST_TRIANGLES: u64 = 1 << 30;

impl<S: Storage> Renumbered<S> {
    /// Reads a log. Finds whether its collapses fit its mesh.
    pub fn new(log: &dyn LogSource, storage: &S) -> Result<Self, Failure> {
        let counts = log.counts();
        if counts.triangles >= MOST_TRIANGLES {
            let (count, most) = (counts.triangles, MOST_TRIANGLES - 1);
            return Err(XfmError::TooLarge { what: "triangles", count, most }.into());
        }
        let vertices = counts.vertices as usize;
        let corners = bounding_box(log, storage)?;
        let rounds = sort_collapses(log, corners, storage)?;
        let mut rank = storage.array::<u32>(vertices, UNKNOWN, 28);
        let mut kept = storage.array::<u32>(counts.collapses as usize, UNKNOWN, 20);
        let mut eps = storage.growing(counts.collapses as usize, 1);
        let mut next = 0;
        rounds.finish(|[.., removed, into, error]| {
            storage.check_stop()?;
            *rank.get_mut(removed as usize)? = next;
            *kept.get_mut(next as usize)? = into;
            next += 1;
            eps.push(f32::from_bits(error))
        })?;
        for v in 0..vertices {
            let rank = rank.get_mut(v)?;
            if *rank == UNKNOWN {
                *rank = next;
                next += 1;
            }
        }
        for n in 0..kept.len() {
            storage.check_stop()?;
            let into = kept.get_mut(n)?;
            *into = rank.get(*into as usize)?;
        }

        let mut by_rank = storage.sorter::<5>(25);
        for (v, position) in log.positions().enumerate() {
            let [x, y, z] = position.map_err(Failure::Source)?.map(f32::to_bits);
            by_rank.push([rank.get(v)?, v as u32, x, y, z])?;
        }
        let mut places = storage.growing(vertices, 2);
        by_rank.finish(|[_, v, x, y, z]| places.push([v, x, y, z]))?;

        let (mut by_end, mut degenerate) = (storage.sorter::<5>(25), 0);
        for (t, corners) in log.triangles().enumerate() {
            storage.check_stop()?;
            let corners = corners.map_err(Failure::Source)?;
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices) {
                return Err(LogError::CornerOutOfRange { triangle: t, vertex, vertices }.into());
            }
            let [a, b, c] = corners;
            if a == b || b == c || c == a {
                degenerate += 1;
                continue;
            }
            let corners = [rank.get(a as usize)?, rank.get(b as usize)?, rank.get(c as usize)?];
            let [a, b, c] = corners;
            by_end.push([end(corners, &mut kept)?, t as u32, a, b, c])?;
        }
        drop(rank);
        let expected = (counts.triangles - degenerate) as usize;
        let mut faces = storage.growing(expected, 42);
        let mut input = storage.growing(expected, 4);
        by_end.finish(|[_, t, a, b, c]| {
            storage.check_stop()?;
            input.push(t)?;
            let unknown = [UNKNOWN; 3];
            faces.push(Face { start: [a, b, c], rev: [BOUNDARY; 3], creator: UNKNOWN, edge_creator: unknown })
        })?;
        // From now on it is read in order, and needs less room.
        let mut in_order = storage.growing(kept.len(), 1);
        for n in 0..kept.len() {
            in_order.push(kept.get(n)?)?;
        }
        Ok(Self { kept: in_order, eps, places, faces: Faces(faces), input, corners, degenerate })
    }

    /// The extent of the mesh: see [`Mesh::extent`](collapse_log::Mesh::extent).
    pub fn extent(&self) -> f64 {
        let positions = self.corners.to_vec();
        collapse_log::Mesh { positions, ..collapse_log::Mesh::default() }.extent()
    }
}

const UNKNOWN: u32 = vertex_tree::NONE;

/// The lowest and the highest corner of the bounding box, both 0 if there are no vertices.
fn bounding_box<S: Storage>(log: &dyn LogSource, storage: &S) -> Result<[[f32; 3]; 2], Failure> {
    let mut corners = None;
    for (vertex, position) in log.positions().enumerate() {
        storage.check_stop()?;
        let position = position.map_err(Failure::Source)?;
        if !position.iter().all(|x| x.is_finite()) {
            return Err(LogError::BadPosition { vertex, position }.into());
        }
        let [low, high] = corners.get_or_insert([position; 2]);
        for axis in 0..3 {
            low[axis] = low[axis].min(position[axis]);
            high[axis] = high[axis].max(position[axis]);
        }
    }
    Ok(corners.unwrap_or_default())
}

/// What is known of a vertex while collapses are put in order.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct Named {
    /// The last round that has named it, [`UNKNOWN`] once it has been removed.
    round: u32,
    /// Its place on the curve.
    place: u32,
}

/// The collapses by round, place on the curve, and number in the log; then removed and kept vertex, and the error. Finds
/// whether the collapses fit the mesh.
fn sort_collapses<S: Storage>(
    log: &dyn LogSource,
    corners: [[f32; 3]; 2],
    storage: &S,
) -> Result<Sorter<6>, Failure> {
    let mut vertices = storage.growing(log.counts().vertices as usize, 60);
    for position in log.positions() {
        storage.check_stop()?;
        let place = place(position.map_err(Failure::Source)?, corners);
        vertices.push(Named { round: 0, place })?;
    }
    let mut sorter = storage.sorter(25);
    // `number` is that under which collapses are sorted; the last ones of a round get numbers of their own.
    let (mut round, mut number, mut tail) = (1, 0, VecDeque::with_capacity(TAIL));
    for (n, c) in log.collapses().enumerate() {
        storage.check_stop()?;
        let c = c.map_err(Failure::Source)?;
        check(n, &c, &mut vertices)?;
        let (removed, kept) = (c.removed as usize, c.kept as usize);
        if vertices.get(removed)?.round == round || vertices.get(kept)?.round == round {
            for rest in tail.drain(..) {
                number += 1;
                sorter.push(after(number, rest))?;
            }
            (round, number) = (round + 1, number + 1);
        } else if tail.len() == TAIL
            && let Some(first) = tail.pop_front()
        {
            sorter.push(after(number, first))?;
        }
        vertices.get_mut(kept)?.round = round;
        let removed = vertices.get_mut(removed)?;
        removed.round = UNKNOWN;
        tail.push_back([removed.place, n as u32, c.removed, c.kept, c.bounds.eps.to_bits()]);
    }
    for rest in tail {
        number += 1;
        sorter.push(after(number, rest))?;
    }
    Ok(sorter)
}

/// Collapses before the end of a round that keep their order.
const TAIL: usize = 64;

fn after(number: u32, [place, n, removed, kept, eps]: [u32; 5]) -> [u32; 6] {
    [number, place, n, removed, kept, eps]
}

/// The place of a point on the Z-order curve through a grid of 1024 cells a side.
fn place(position: [f32; 3], [low, high]: [[f32; 3]; 2]) -> u32 {
    let side = (0..3).fold(0.0_f64, |side, i| side.max(f64::from(high[i]) - f64::from(low[i])));
    z_order(std::array::from_fn(|axis| {
        let along = f64::from(position[axis]) - f64::from(low[axis]);
        if side > 0.0 { ((along / side * 1024.0) as u32).min(1023) } else { 0 }
    }))
}

/// Fails if a collapse is none that can be.
fn check(n: usize, c: &Collapse, vertices: &mut impl Elements<Named>) -> Result<(), Failure> {
    for vertex in [c.removed, c.kept] {
        let there = (vertex as usize) < vertices.len() && vertices.get(vertex as usize)?.round != UNKNOWN;
        if !there {
            return Err(LogError::NoSuchVertex { collapse: n, vertex }.into());
        }
    }
    Ok(c.check(n)?)
}

/// The collapse that lets a triangle vanish, or a number that is none's. The corner that is removed first moves, until two
/// are one. That ends: a kept vertex is removed later, if at all.
fn end(mut corners: [u32; 3], kept: &mut impl Elements<u32>) -> std::io::Result<u32> {
    loop {
        corners.sort_unstable();
        let first = corners[0];
        if first as usize >= kept.len() {
            return Ok(UNKNOWN);
        }
        corners[0] = kept.get(first as usize)?;
        if corners[0] == corners[1] || corners[0] == corners[2] {
            return Ok(first);
        }
    }
}
