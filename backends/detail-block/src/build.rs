//! From a collapse log to an XFM file: the paper's seven steps (section 3.5).
//!
//! 1 and 2, the merge tree and the coarsest mesh: [`replay`](crate::replay), with bounds from
//! [`nesting`](crate::nesting). 4, the numbers of nodes and half-edges: [`layout`](crate::layout). 3 and 5 to 7, writing
//! initial mesh, root list, block index and blocks: here. The sizes of blocks are known before any is written, so the
//! index can stand before them and the file is written from front to back.
//!
//! Besides the log and what is written, memory for some 60 bytes a triangle and 100 a vertex is taken.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use vertex_tree::{Collapse, CollapseLog, Mesh, NONE, output};

use crate::error::XfmError;
use crate::format::{Header, OFFSET_BITS, block_sum};
use crate::half_edges::{BOUNDARY, HalfEdge};
use crate::layout::Layout;
use crate::nesting::Nesting;
use crate::node::Stored;
use crate::numbering::{Levels, MOST_FACES, MOST_LEVELS, face_half_edge, node_half_edge};
use crate::quantize::Scale;
use crate::replay::Replay;
use crate::split_apart::Manifold;

/// How to build a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct BuildOptions {
    /// Levels of a detail block, 1 to 5. The paper found 4 efficient.
    pub levels: u32,
    /// Whether to store nodes in 30 bytes instead of 52. Positions then move to a lattice of 2^19 points a side.
    pub quantize: bool,
    /// Whether to nest bounds over what splits need beyond the tree, so that nothing is ever forced.
    pub nest_needs: bool,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { levels: 4, quantize: false, nest_needs: true }
    }
}

/// What a build did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Triangles of the fully refined mesh.
    pub triangles: u64,
    /// Input triangles that name a vertex twice: never shown, left out.
    pub degenerate: u64,
    /// Vertices that were added to split non-manifold ones apart.
    pub added_vertices: u64,
    /// Non-manifold edges that were cut.
    pub cut_edges: u64,
    /// Collapses of the log that are none of the manifold mesh.
    pub left_out: u64,
    /// Nodes.
    pub nodes: u64,
    /// Roots of the forest.
    pub roots: u64,
    /// Vertices of the base mesh.
    pub initial_vertices: u64,
    /// Faces of the base mesh.
    pub initial_faces: u64,
    /// Detail blocks.
    pub blocks: u64,
    /// Those of them without children.
    pub leaf_blocks: u64,
    /// Bytes of the file.
    pub bytes: u64,
}

/// Builds a file: written to a temporary name, synced, then renamed.
///
/// # Errors
/// If the log does not fit its mesh, an option is out of range, the hierarchy is too large for the format, or writing
/// fails. Nothing is left behind then.
pub fn write(path: &Path, log: &CollapseLog, options: &BuildOptions) -> Result<WriteReport, XfmError> {
    Arrangement::new(log, options)?.write(path)
}

/// A log arranged for an XFM file.
pub struct Arrangement {
    header: Header,
    replay: Replay,
    nesting: Nesting,
    layout: Layout,
    /// Positions of the input, and what became of its triangles.
    mesh: Mesh,
    /// Number in the file of each triangle's first half-edge; for each face, its triangle.
    faces: Vec<u32>,
    face_of: Vec<u32>,
    initial: Vec<u32>,
    /// Bytes of the blocks.
    lengths: Vec<u16>,
}

impl Arrangement {
    /// Arranges a log.
    ///
    /// # Errors
    /// As for [`write`], except for writing.
    pub fn new(log: &CollapseLog, options: &BuildOptions) -> Result<Self, XfmError> {
        log.forest()?;
        let levels = Levels::new(options.levels)
            .ok_or(XfmError::Levels { levels: options.levels, most: MOST_LEVELS })?;
        let (low, high) = log.mesh.bounding_box().unwrap_or_default();
        let scale = Scale::new(low, high);
        let stored = |p: [f32; 3]| if options.quantize { scale.point(scale.position(p)) } else { p };
        let manifold = Manifold::new(&log.mesh);
        let positions: Vec<_> =
            manifold.origin.iter().map(|&v| stored(log.mesh.positions[v as usize])).collect();
        let (added_vertices, cut_edges) = (manifold.copies.len() as u64, manifold.cut_edges);
        let degenerate = manifold.degenerate;
        // What the fully refined mesh is in the manifold's vertices.
        let mut mesh = Mesh { positions: positions.clone(), triangles: log.mesh.triangles.clone() };
        for (corners, shown) in mesh.triangles.iter_mut().zip(&manifold.edges.triangles) {
            if shown.start[0] != NONE {
                *corners = shown.start;
            }
        }
        let mut nesting = Nesting::new(
            &manifold,
            positions,
            log.mesh.extent(),
            options.quantize.then_some(scale),
            options.nest_needs,
        );
        let replay = Replay::new(log, manifold, &mut nesting, |nesting, step| {
            nesting.add(step).map_err(|length| XfmError::Length { length })
        })?;
        let layout = Layout::new(&replay, levels)?;

        let mut arrangement = Self {
            header: Header {
                levels,
                quantised: options.quantize,
                nested: options.nest_needs,
                initial_vertices: 0,
                initial_faces: 0,
                roots: replay.roots().count() as u64,
                blocks: layout.blocks.len() as u64,
                nodes: replay.merges.len() as u64,
                triangles: log.mesh.triangles.len() as u64 - degenerate,
                input_vertices: log.mesh.positions.len() as u64,
                added_vertices,
                cut_edges,
                left_out: replay.left_out,
                degenerate,
                scale: if options.quantize { scale } else { Scale::default() },
                length: 0,
            },
            replay,
            nesting,
            layout,
            mesh,
            faces: Vec::new(),
            face_of: Vec::new(),
            initial: Vec::new(),
            lengths: Vec::new(),
        };
        arrangement.find_initial()?;
        let header = &mut arrangement.header;
        let own = levels.leaf_bit() - 1;
        let lengths =
            arrangement.layout.blocks.iter().map(|block| {
                header.block_bytes((block.flags & own).count_ones(), block.children == 0) as u16
            });
        arrangement.lengths = lengths.collect();
        header.length =
            header.sections()[4] + arrangement.lengths.iter().map(|&bytes| u64::from(bytes)).sum::<u64>();
        let most = 1 << OFFSET_BITS;
        if header.length > most {
            return Err(XfmError::TooLarge { what: "bytes", count: header.length, most });
        }
        Ok(arrangement)
    }

    /// Numbers the faces of the base mesh, and the vertices that they use.
    fn find_initial(&mut self) -> Result<(), XfmError> {
        let triangles = &self.replay.manifold.edges.triangles;
        self.face_of = vec![NONE; triangles.len()];
        let mut vertex_of = vec![false; self.nesting.positions.len()];
        for (t, triangle) in triangles.iter().enumerate() {
            if self.replay.owner[t] == NONE && triangle.start[0] != NONE {
                self.face_of[t] = self.faces.len() as u32;
                self.faces.push(t as u32);
                for v in triangle.start {
                    vertex_of[v as usize] = true;
                }
            }
        }
        self.initial = (0..vertex_of.len() as u32).filter(|&v| vertex_of[v as usize]).collect();
        self.header.initial_faces = self.faces.len() as u64;
        self.header.initial_vertices = self.initial.len() as u64;
        if self.header.initial_faces >= MOST_FACES {
            let count = self.header.initial_faces;
            return Err(XfmError::TooLarge { what: "initial faces", count, most: MOST_FACES - 1 });
        }
        Ok(())
    }

    /// What the file will hold.
    #[must_use]
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

    /// The log that the file stands for: the manifold mesh, and the collapses that were made on it with their bounds as
    /// stored, in descending order of node numbers. [`log_number`](vertex_tree::VertexTree::log_number) of the tree counts
    /// in it. Positions are those stored. An oracle made from it knows what the tree's cut should be, as long as bounds are
    /// nested over needs.
    #[must_use]
    pub fn effective_log(&self) -> CollapseLog {
        let mut order: Vec<u32> = (0..self.replay.merges.len() as u32).collect();
        order.sort_unstable_by_key(|&n| std::cmp::Reverse(self.layout.node_of[n as usize]));
        let collapse = |&n: &u32| {
            let merge = &self.replay.merges[n as usize];
            let bounds = self.nesting.bounds[n as usize];
            Collapse { removed: merge.removed, kept: merge.kept, bounds }
        };
        CollapseLog { mesh: self.mesh.clone(), collapses: order.iter().map(collapse).collect() }
    }

    /// For each collapse of [`effective_log`](Self::effective_log), those that its split needs beyond the tree:
    /// the dependencies to close a cut over where bounds are not nested over them.
    #[must_use]
    pub fn needs(&self) -> Vec<Vec<u32>> {
        let mut order: Vec<u32> = (0..self.replay.merges.len() as u32).collect();
        order.sort_unstable_by_key(|&n| std::cmp::Reverse(self.layout.node_of[n as usize]));
        let mut number = vec![0; order.len()];
        for (i, &n) in (0..).zip(&order) {
            number[n as usize] = i;
        }
        let needs = |&n: &u32| {
            let adjacent = self.replay.merges[n as usize].adjacent;
            let half_edges = [adjacent.w, adjacent.x, adjacent.y, adjacent.z].into_iter();
            let owners = half_edges.filter(|&h| h != BOUNDARY).map(|h| self.replay.owner[(h >> 2) as usize]);
            owners.filter(|&m| m != NONE).map(|m| number[m as usize]).collect()
        };
        order.iter().map(needs).collect()
    }

    /// Writes the file: to a temporary name, synced, then renamed.
    ///
    /// # Errors
    /// [`XfmError::Write`]; nothing is left behind then.
    pub fn write(&self, path: &Path) -> Result<WriteReport, XfmError> {
        output::write_with(path, |file| {
            let mut out = BufWriter::with_capacity(1 << 20, file);
            self.write_to(&mut out)?;
            out.flush()
        })
        .map_err(|source| XfmError::Write { file: path.display().to_string(), source })?;
        Ok(self.report())
    }

    /// Writes what the file holds, from front to back.
    ///
    /// # Errors
    /// What `out` says.
    pub fn write_to(&self, out: &mut impl Write) -> io::Result<()> {
        out.write_all(&self.header.encode())?;
        let (positions, normals) = (&self.nesting.positions, &self.nesting.normals);
        write_section(out, self.initial.iter(), |&v, bytes| {
            for x in positions[v as usize].iter().chain(&normals[v as usize]) {
                bytes.extend_from_slice(&x.to_le_bytes());
            }
        })?;
        write_section(out, self.faces.iter(), |&t, bytes| {
            let triangle = self.replay.manifold.edges.triangles[t as usize];
            let vertex = |v| self.initial.partition_point(|&initial| initial < v) as u32;
            for word in triangle.start.map(vertex).into_iter().chain(triangle.rev.map(|h| self.number(h))) {
                bytes.extend_from_slice(&word.to_le_bytes());
            }
        })?;
        write_section(out, self.replay.roots(), |n, bytes| {
            bytes.extend_from_slice(&self.layout.node_of[n as usize].to_le_bytes());
            let bounds = self.nesting.bounds[n as usize];
            for x in bounds.center.into_iter().chain([bounds.radius, bounds.eps]) {
                bytes.extend_from_slice(&x.to_le_bytes());
            }
        })?;
        let mut at = self.header.sections()[4];
        write_section(out, self.lengths.iter(), |&length, bytes| {
            bytes.extend_from_slice(&(at | u64::from(length) << OFFSET_BITS).to_le_bytes());
            at += u64::from(length);
        })?;
        let (mut places, mut bytes) = (Vec::new(), Vec::new());
        for block in 0..self.layout.blocks.len() as u32 {
            bytes.clear();
            self.encode_block(block, &mut places, &mut bytes);
            out.write_all(&bytes)?;
        }
        Ok(())
    }

    /// The file's number of a half-edge of an input triangle.
    fn number(&self, h: HalfEdge) -> u32 {
        if h == BOUNDARY {
            return BOUNDARY;
        }
        let (t, k) = ((h >> 2) as usize, h & 3);
        match self.replay.owner[t] {
            NONE => face_half_edge(self.face_of[t], k),
            n => {
                let place = u32::from(self.replay.place[t]);
                // A or D is number 0.
                node_half_edge(self.layout.node_of[n as usize], place >> 2, (k + 3 - (place & 3)) % 3)
            }
        }
    }

    fn encode_block(&self, block: u32, places: &mut Vec<u32>, bytes: &mut Vec<u8>) {
        let planned = self.layout.blocks[block as usize];
        let set = self.header.levels.flag_bytes();
        bytes.extend_from_slice(&planned.flags.to_le_bytes()[..set]);
        bytes.extend_from_slice(&planned.parent.to_le_bytes());
        if planned.children != 0 {
            bytes.extend_from_slice(&planned.first_child.to_le_bytes());
            bytes.extend_from_slice(&planned.children.to_le_bytes()[..set]);
        }
        self.layout.places(&self.replay, planned.root, places);
        for &n in places.iter().filter(|&&n| n != NONE) {
            let n = n as usize;
            let merge = &self.replay.merges[n];
            let bounds = self.nesting.bounds[n];
            let adjacent = merge.adjacent;
            Stored {
                position: bounds.center,
                normal: self.nesting.normals[merge.removed as usize],
                radius: bounds.radius,
                sine: self.nesting.sines[n],
                adjacent: [adjacent.w, adjacent.x, adjacent.y, adjacent.z].map(|h| self.number(h)),
                eps: bounds.eps,
            }
            .encode(self.header.quantisation(), bytes);
        }
        let sum = block_sum(block, bytes);
        bytes.extend_from_slice(&sum.to_le_bytes());
    }
}

/// Writes records and their checksum.
fn write_section<T>(
    out: &mut impl Write,
    records: impl Iterator<Item = T>,
    mut encode: impl FnMut(T, &mut Vec<u8>),
) -> io::Result<()> {
    const CHUNK: usize = 1 << 16;
    let mut sum = crc32fast::Hasher::new();
    let mut bytes = Vec::with_capacity(CHUNK + 64);
    for record in records {
        encode(record, &mut bytes);
        if bytes.len() >= CHUNK {
            sum.update(&bytes);
            out.write_all(&bytes)?;
            bytes.clear();
        }
    }
    sum.update(&bytes);
    out.write_all(&bytes)?;
    out.write_all(&sum.finalize().to_le_bytes())
}
