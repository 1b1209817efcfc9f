//! From a collapse log to an XFM file: the paper's seven steps (section 3.5).
//!
//! 1 and 2, the merge tree and the coarsest mesh: [`replay`](crate::replay), with bounds from
//! [`nesting`](crate::nesting). 4, the numbers of nodes and half-edges: [`layout`](crate::layout). 3 and 5 to 7, writing
//! initial mesh, root list, block index and blocks: [`writing`](crate::writing). The sizes of blocks are known before any is written, so the
//! index can stand before them and the file is written from front to back.
//!
//! Besides the log and what is written, memory for some 60 bytes a triangle and 100 a vertex is taken.

use std::path::Path;

use vertex_tree::{Collapse, CollapseLog, Mesh, NONE, NormalCone};

use crate::error::XfmError;
use crate::format::{Header, OFFSET_BITS};
use crate::half_edges::BOUNDARY;
use crate::layout::Layout;
use crate::nesting::Nesting;
use crate::numbering::{Levels, MOST_FACES, MOST_LEVELS};
use crate::quantize::Scale;
use crate::replay::Replay;
use crate::split_apart::Manifold;

/// How to build a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
    /// Vertices that the log removes and that stay, as that would not have been a collapse of the manifold mesh.
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
    pub(crate) header: Header,
    pub(crate) replay: Replay,
    pub(crate) nesting: Nesting,
    pub(crate) layout: Layout,
    /// The fully refined mesh in the vertices of the manifold one.
    pub(crate) mesh: Mesh,
    /// For each initial face, its input triangle; and the reverse.
    pub(crate) faces: Vec<u32>,
    pub(crate) face_of: Vec<u32>,
    /// The vertices that initial faces use, ascending.
    pub(crate) initial: Vec<u32>,
    /// Bytes of the blocks.
    pub(crate) lengths: Vec<u16>,
}

impl Arrangement {
    /// Arranges a log.
    ///
    /// # Errors
    /// As for [`write()`], except for writing.
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
        let added_vertices = (manifold.origin.len() - log.mesh.positions.len()) as u64;
        let cut_edges = manifold.cut_edges;
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

    /// For each collapse of [`effective_log`](Self::effective_log), the cone of normals that the file knows: roots have
    /// none.
    #[must_use]
    pub fn cones(&self) -> Vec<NormalCone> {
        let mut order: Vec<u32> = (0..self.replay.merges.len() as u32).collect();
        order.sort_unstable_by_key(|&n| std::cmp::Reverse(self.layout.node_of[n as usize]));
        let mut cones: Vec<_> = order.iter().map(|&n| self.nesting.cone(n)).collect();
        for root in self.replay.roots() {
            let place = order
                .partition_point(|&n| self.layout.node_of[n as usize] > self.layout.node_of[root as usize]);
            cones[place] = NormalCone::NONE;
        }
        cones
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
}
