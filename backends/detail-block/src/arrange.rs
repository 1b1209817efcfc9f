//! A log arranged for a file: all that there is to write, and where it goes.

use std::io;

use collapse_log::LogSource;
use container::Georeference;
use vertex_tree::NONE;

use crate::error::{Failure, XfmError};
use crate::format::{Header, OFFSET_BITS, VERSION};
use crate::half_edges::{BOUNDARY, HalfEdge, triangle_of};
use crate::layout::Layout;
use crate::nesting::{Nesting, Node};
use crate::numbering::{Levels, MOST_FACES, MOST_LEVELS, face_half_edge, node_half_edge};
use crate::options::{BuildOptions, WriteReport};
use crate::quantize::Scale;
use crate::renumber::Renumbered;
use crate::replay::{Merge, Replay, Replayed};
use crate::storage::{Elements, Storage};
use crate::surface::{Leaf, Surface};

/// A log arranged for an XFM file.
pub(crate) struct Arranged<S: Storage> {
    pub header: Header,
    pub merges: S::Array<Merge>,
    pub nodes: S::Array<Node>,
    pub layout: Layout<S>,
    /// The vertices of the base mesh: the bits of position and normal.
    pub initial_vertices: S::Array<[u32; 6]>,
    /// Its faces: their vertices and the reverses of their half-edges.
    pub initial_faces: S::Array<[u32; 6]>,
    /// For each triangle, the file's number of the half-edge that is number 0 there, with its number here in the last two
    /// bits.
    pub triangles: S::Array<u32>,
    pub georeference: Georeference,
}

impl<S: Storage> Arranged<S> {
    /// Arranges a log. `see` is shown the mesh before it is simplified.
    pub fn new(
        log: &dyn LogSource,
        options: &BuildOptions,
        storage: &S,
        see: impl FnOnce(&mut Surface<S>) -> io::Result<()>,
    ) -> Result<Self, Failure> {
        let levels = Levels::new(options.levels)
            .ok_or(XfmError::Levels { levels: options.levels, most: MOST_LEVELS })?;
        let counts = log.counts();
        let mut surface = Surface::new(Renumbered::new(log, storage)?, options.quantize, storage)?;
        see(&mut surface)?;
        let mut nesting = Nesting::new(&surface, options.quantize, options.nest_needs, storage);
        let Replayed { mut merges, left_out } = Replay::run(&mut surface, &mut nesting, storage)?;
        let mut header = Header {
            version: VERSION,
            levels,
            quantised: options.quantize,
            nested: options.nest_needs,
            initial_vertices: 0,
            initial_faces: 0,
            roots: 0,
            blocks: 0,
            nodes: merges.len() as u64,
            triangles: counts.triangles - surface.degenerate,
            input_vertices: counts.vertices,
            added_vertices: surface.added,
            cut_edges: surface.cut_edges,
            left_out,
            degenerate: surface.degenerate,
            scale: if options.quantize { surface.scale } else { Scale::default() },
            length: 0,
        };
        let triangles = surface.faces.0.len();
        let Base { vertices, faces, mut slots } = Base::new(surface, storage)?;
        header.initial_vertices = vertices.len() as u64;
        header.initial_faces = faces.len() as u64;
        if header.initial_faces >= MOST_FACES {
            let count = header.initial_faces;
            return Err(XfmError::TooLarge { what: "initial faces", count, most: MOST_FACES - 1 }.into());
        }
        let mut numbers = storage.array(triangles, NONE, 30);
        for face in 0..slots.len() {
            *numbers.get_mut(slots.get(face)? as usize)? = face_half_edge(face as u32, 0);
        }
        let mut layout = Layout::new(&mut merges, levels, storage)?;
        for n in 0..merges.len() {
            storage.check_stop()?;
            let number = layout.nodes.get(n)?.number;
            for (side, h) in (0..).zip(merges.get(n)?.edge).filter(|&(_, h)| h != BOUNDARY) {
                // A or D is number 0.
                let (t, k) = triangle_of(h);
                *numbers.get_mut(t)? = node_half_edge(number, side, k as u32);
            }
        }
        header.roots = layout.roots.len() as u64;
        header.blocks = layout.blocks;
        let georeference = log.georeference().clone();
        let blocks = layout.leaf_blocks * header.block_bytes(0, true)
            + (layout.blocks - layout.leaf_blocks) * header.block_bytes(0, false)
            + header.nodes * header.node_bytes() as u64;
        header.length = header.file_length(blocks, &georeference).map_err(Failure::Output)?;
        let most = 1 << OFFSET_BITS;
        if header.length > most {
            return Err(XfmError::TooLarge { what: "bytes", count: header.length, most }.into());
        }
        let (nodes, initial_vertices, initial_faces) = (nesting.nodes, vertices, faces);
        let triangles = numbers;
        Ok(Self { header, merges, nodes, layout, initial_vertices, initial_faces, triangles, georeference })
    }

    /// The file's number of a half-edge.
    pub fn number(&mut self, h: HalfEdge) -> io::Result<u32> {
        if h == BOUNDARY {
            return Ok(BOUNDARY);
        }
        let (t, k) = triangle_of(h);
        let first = self.triangles.get(t)?;
        Ok((first & !3) | ((k as u32 + 3 - (first & 3)) % 3))
    }

    /// What the file will hold.
    pub fn report(&self) -> WriteReport {
        let h = &self.header;
        WriteReport {
            triangles: h.triangles,
            degenerate: h.degenerate,
            added_vertices: h.added_vertices,
            cut_edges: h.cut_edges,
            left_out: h.left_out,
            nodes: h.nodes,
            roots: h.roots,
            initial_vertices: h.initial_vertices,
            initial_faces: h.initial_faces,
            blocks: h.blocks,
            leaf_blocks: self.layout.leaf_blocks,
            bytes: h.length,
        }
    }
}

/// The base mesh.
struct Base<S: Storage> {
    vertices: S::Array<[u32; 6]>,
    faces: S::Array<[u32; 6]>,
    /// For each face, the triangle that it is.
    slots: S::Array<u32>,
}

impl<S: Storage> Base<S> {
    /// Numbers faces and vertices that are left in the input's order.
    fn new(mut surface: Surface<S>, storage: &S) -> io::Result<Self> {
        let mut by_input = storage.sorter::<2>(4);
        let mut by_order = storage.sorter::<3>(4);
        // No vertex needs its place in a list any more: here it is NONE, 0 once it is used, then its number.
        for v in 0..surface.vertices.len() {
            surface.vertices.get_mut(v)?.next = NONE;
        }
        for t in 0..surface.faces.0.len() {
            storage.check_stop()?;
            let start = surface.faces.0.get(t)?.start;
            if start[0] == NONE {
                continue;
            }
            by_input.push([surface.input.get(t)?, t as u32])?;
            for v in start {
                let vertex = surface.vertices.get_mut(v as usize)?;
                if vertex.next == NONE {
                    vertex.next = 0;
                    let [copy, order] = surface.leaves.get(v as usize)?.order;
                    by_order.push([copy, order, v])?;
                }
            }
        }
        let mut base = Self {
            vertices: storage.growing(0, 1),
            faces: storage.growing(0, 1),
            slots: storage.growing(0, 1),
        };
        by_order.finish(|[_, _, v]| {
            surface.vertices.get_mut(v as usize)?.next = base.vertices.len() as u32;
            let Leaf { position, normal, .. } = surface.leaves.get(v as usize)?;
            let [[x, y, z], [a, b, c]] = [position, normal].map(|x| x.map(f32::to_bits));
            base.vertices.push([x, y, z, a, b, c])
        })?;
        by_input.finish(|[_, t]| {
            let face = surface.faces.0.get(t as usize)?;
            let mut words = [0; 6];
            for (word, v) in words.iter_mut().zip(face.start) {
                *word = surface.vertices.get(v as usize)?.next;
            }
            words[3..].copy_from_slice(&face.rev);
            base.faces.push(words)?;
            base.slots.push(t)
        })?;
        Ok(base)
    }
}
