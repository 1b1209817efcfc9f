//! An open XFM file.

use std::path::Path;
use std::sync::Arc;

use container::{FileError, Georeference, Sections, read_at};
use page_store::source::{FileSource, MappedSource, PageSource};
use vertex_tree::{Bounds, NodeId};

use crate::block::{Block, Inflated, resident_bytes};
use crate::error::XfmError;
use crate::format::{ENTRY_BYTES, Header, OFFSET_BITS, RECORD_BYTES};
use crate::half_edges::{BOUNDARY, HalfEdges, Triangle, next};
use crate::header::{long, read_header};
use crate::numbering::{Levels, Owner, owner};
use crate::tables::Tables;

/// Where blocks are: the block index, in memory or in the mapped file (section 3.3).
enum Index {
    Loaded(Vec<u64>),
    Mapped(MappedSource, usize),
}

impl Index {
    #[inline]
    fn entry(&self, block: u32) -> u64 {
        match self {
            Self::Loaded(entries) => entries[block as usize],
            Self::Mapped(map, start) => {
                let at = start + block as usize * ENTRY_BYTES as usize;
                let bytes = map.bytes().get(at..).and_then(|bytes| bytes.first_chunk());
                bytes.map_or(0, |bytes| u64::from_le_bytes(*bytes))
            }
        }
    }
}

/// An open XFM file: header, initial mesh, root list and block index. Shared by any number of trees.
pub struct XfmFile {
    source: Arc<dyn PageSource>,
    header: Header,
    index: Index,
    /// For each block, how many nodes are in the blocks before it.
    nodes_before: Vec<u32>,
    roots: Vec<(NodeId, Bounds)>,
    /// Position and normal of each initial vertex.
    initial_vertices: Vec<[[f32; 3]; 2]>,
    /// Their reverses are slots, as initial faces come first in those of the displayed mesh.
    initial_faces: HalfEdges,
    georeference: Georeference,
    sections: Sections,
}

impl XfmFile {
    /// Opens a file; the block index is read into memory.
    ///
    /// # Errors
    /// Whatever is wrong with header, initial mesh, root list or block index. Blocks are looked at when they are loaded.
    pub fn open(source: Arc<dyn PageSource>) -> Result<Self, XfmError> {
        Self::with_index(source, None)
    }

    /// Opens a file by its path; blocks are read by position, the block index is mapped into memory, as in the paper
    /// (section 3.3). To have it read by [`open`](Self::open) takes 8 bytes a block of memory.
    ///
    /// # Safety
    /// As for [`MappedSource::open`]: nobody may change the file or cut it short while it is open.
    ///
    /// # Errors
    /// As for [`open`](Self::open), and if there is no such file.
    #[expect(
        unsafe_code,
        reason = "the paper's own way, for comparison; no command of this project takes it"
    )]
    pub unsafe fn open_mapped(path: &Path) -> Result<Self, XfmError> {
        let file = path.display().to_string();
        let read = |source| FileError::Read { file: file.clone(), offset: 0, length: 0, source };
        // SAFETY: that the file stays as it is has been promised by the caller.
        let map = unsafe { MappedSource::open(path) }.map_err(read)?;
        Self::with_index(Arc::new(FileSource::open(path).map_err(read)?), Some(map))
    }

    fn with_index(source: Arc<dyn PageSource>, map: Option<MappedSource>) -> Result<Self, XfmError> {
        let header = read_header(&*source)?;
        let Tables { at, bytes, blocks, georeference, sections } = Tables::read(&*source, &header)?;
        let [vertices_at, faces_at, roots_at, index_at] = at;
        let [vertices, faces, roots, index] = bytes;
        let mut file = Self {
            index: Index::Loaded(index.chunks_exact(8).map(long).collect()),
            source,
            header,
            nodes_before: Vec::with_capacity(header.blocks as usize),
            roots: Vec::with_capacity(header.roots as usize),
            initial_vertices: records(&vertices).map(positions).collect(),
            initial_faces: HalfEdges::default(),
            georeference,
            sections,
        };
        if let Some(i) = file.initial_vertices.iter().flatten().flatten().position(|x| !x.is_finite()) {
            let offset = vertices_at + 4 * i as u64;
            return Err(file.field(offset, "a coordinate", 0, "expected a finite number"));
        }
        file.check_faces(&faces, faces_at)?;
        file.check_roots(&roots, roots_at)?;
        file.check_index(index_at, blocks)?;
        if let Some(map) = map {
            file.index = Index::Mapped(map, index_at as usize);
        }
        Ok(file)
    }

    fn check_faces(&mut self, faces: &[u8], at: u64) -> Result<(), XfmError> {
        for (i, [a, b, c, d, e, f]) in (0_u64..).zip(records(faces)) {
            let start = [a, b, c];
            let offset = at + i * RECORD_BYTES;
            if let Some(&v) = start.iter().find(|&&v| u64::from(v) >= self.header.initial_vertices) {
                return Err(self.field(offset, "a corner", v.into(), "expected an initial vertex"));
            }
            if a == b || b == c || c == a {
                return Err(self.field(offset, "a corner", a.into(), "which is there twice"));
            }
            let mut rev = [BOUNDARY; 3];
            for (rev, h) in rev.iter_mut().zip([d, e, f]) {
                *rev = match owner(h) {
                    Owner::Boundary => BOUNDARY,
                    Owner::Face(face, k) if u64::from(face) < self.header.initial_faces && k < 3 => {
                        face << 2 | k
                    }
                    _ => {
                        return Err(self.field(
                            offset + 12,
                            "a reverse",
                            h.into(),
                            "expected an initial face",
                        ));
                    }
                };
            }
            self.initial_faces.triangles.push(Triangle { start, rev });
        }
        self.check_reverses(at)?;
        self.check_fans(at)
    }

    /// Whether reverses are those of each other.
    fn check_reverses(&self, at: u64) -> Result<(), XfmError> {
        let edges = &self.initial_faces;
        for t in 0..edges.triangles.len() as u32 {
            for h in [4 * t, 4 * t + 1, 4 * t + 2] {
                let back = edges.rev(h);
                if back != BOUNDARY
                    && (edges.rev(back) != h
                        || edges.start(back) != edges.end(h)
                        || edges.start(next(back)) != edges.start(h))
                {
                    let offset = at + u64::from(t) * RECORD_BYTES + 12;
                    return Err(self.field(offset, "a reverse", back.into(), "which runs elsewhere"));
                }
            }
        }
        Ok(())
    }

    /// Whether the faces around each vertex are one fan, as those of a manifold are; reverses have been checked.
    fn check_fans(&self, at: u64) -> Result<(), XfmError> {
        let edges = &self.initial_faces;
        let mut corners = vec![(0_u32, BOUNDARY); self.initial_vertices.len()];
        for t in 0..edges.triangles.len() as u32 {
            for h in [4 * t, 4 * t + 1, 4 * t + 2] {
                let (count, first) = &mut corners[edges.start(h) as usize];
                (*count, *first) = (*count + 1, h);
            }
        }
        let mut fan = Vec::new();
        for (vertex, (count, first)) in (0_u64..).zip(corners) {
            if first == BOUNDARY {
                return Err(self.field(24, "an initial vertex", vertex, "which no face has"));
            }
            edges.orbit(first, &mut fan);
            if fan.len() as u32 != count {
                let offset = at + u64::from(first / 4) * RECORD_BYTES;
                return Err(self.field(
                    offset,
                    "an initial vertex",
                    vertex,
                    "around which faces are several fans",
                ));
            }
        }
        Ok(())
    }

    fn check_roots(&mut self, roots: &[u8], at: u64) -> Result<(), XfmError> {
        let levels = self.header.levels;
        for (i, [node, words @ ..]) in (0_u64..).zip(records(roots)) {
            let [x, y, z, radius, eps] = words.map(f32::from_bits);
            let bounds = Bounds { center: [x, y, z], radius, eps };
            let offset = at + i * RECORD_BYTES;
            let node_id = NodeId(node);
            let ascends = self.roots.last().is_none_or(|&(last, _)| last < node_id);
            if u64::from(levels.block(node_id)) >= self.header.blocks
                || levels.offset(node_id) != 0
                || !ascends
            {
                return Err(self.field(offset, "a root", node.into(), "expected block roots, ascending"));
            }
            let lengths = [radius, eps].iter().all(|&x| x.is_finite() && x >= 0.0);
            if !(lengths && bounds.center.iter().all(|x| x.is_finite())) {
                return Err(self.field(offset + 4, "a sphere", 0, "expected finite numbers"));
            }
            self.roots.push((node_id, bounds));
        }
        Ok(())
    }

    fn check_index(&mut self, index_at: u64, (blocks_at, blocks_end): (u64, u64)) -> Result<(), XfmError> {
        let (mut at, mut nodes) = (blocks_at, 0_u64);
        for block in 0..self.header.blocks as u32 {
            let entry = self.index.entry(block);
            let (offset, length) = split_entry(entry);
            let place = index_at + u64::from(block) * ENTRY_BYTES;
            let Some((count, _)) = self.header.nodes_of(length) else {
                return Err(self.field(place, "the length of a block", length, "which no block has"));
            };
            if offset != at {
                return Err(self.field(
                    place,
                    "the offset of a block",
                    offset,
                    "expected the end of the last",
                ));
            }
            self.nodes_before.push(nodes as u32);
            at += length;
            nodes += u64::from(count);
        }
        if at != blocks_end {
            return Err(self.field(48, "the number of blocks", self.header.blocks, "but they end elsewhere"));
        }
        if nodes != self.header.nodes {
            return Err(self.field(56, "the number of nodes", self.header.nodes, "but blocks have others"));
        }
        Ok(())
    }

    fn field(&self, offset: u64, field: &'static str, value: u64, expected: &'static str) -> XfmError {
        XfmError::Field { file: self.name().to_owned(), offset, field, value, expected }
    }

    /// What the file is called.
    #[must_use]
    pub fn name(&self) -> &str {
        self.source.name()
    }

    /// Where the mesh lies in the world.
    #[must_use]
    pub fn georeference(&self) -> &Georeference {
        &self.georeference
    }

    /// Compares the checksums of what this version does not know.
    pub(crate) fn verify_unknown(&self) -> Result<(), XfmError> {
        let error = |error| FileError::of_sections(self.name(), error);
        Ok(self.sections.verify_unknown(&*self.source).map_err(error)?)
    }

    pub(crate) fn header(&self) -> &Header {
        &self.header
    }

    pub(crate) fn source(&self) -> &dyn PageSource {
        &*self.source
    }

    pub(crate) fn levels(&self) -> Levels {
        self.header.levels
    }

    pub(crate) fn roots(&self) -> &[(NodeId, Bounds)] {
        &self.roots
    }

    pub(crate) fn initial_vertices(&self) -> &[[[f32; 3]; 2]] {
        &self.initial_vertices
    }

    pub(crate) fn initial_faces(&self) -> &HalfEdges {
        &self.initial_faces
    }

    /// How many nodes are in the blocks before a block.
    #[inline]
    pub(crate) fn nodes_before(&self, block: u32) -> u32 {
        self.nodes_before[block as usize]
    }

    /// How many nodes a block has.
    #[inline]
    pub(crate) fn nodes_in(&self, block: u32) -> u32 {
        let end = self.nodes_before.get(block as usize + 1).copied().unwrap_or(self.header.nodes as u32);
        end - self.nodes_before[block as usize]
    }

    /// Offset and length of a block.
    pub(crate) fn place(&self, block: u32) -> (u64, u64) {
        split_entry(self.index.entry(block))
    }

    /// The least memory in which any change can be made: a block and two below it.
    #[must_use]
    pub fn least_memory(&self) -> u64 {
        let largest = (0..self.header.blocks as u32).map(|block| self.nodes_in(block)).max();
        largest.map_or(0, |nodes| 3 * resident_bytes(nodes))
    }

    /// Bytes that all blocks together would take in memory.
    #[must_use]
    pub fn resident_bytes_of_all(&self) -> u64 {
        resident_bytes(0) * self.header.blocks + self.header.nodes * (resident_bytes(1) - resident_bytes(0))
    }

    /// Bytes that stay in memory whatever is displayed: initial mesh, root list, block index.
    pub(crate) fn fixed_bytes(&self) -> u64 {
        let h = &self.header;
        24 * (h.initial_vertices + h.initial_faces + h.roots) + 12 * h.blocks
    }

    /// Reads a block and checks it.
    pub(crate) fn read_block(&self, block: u32, bytes: &mut Vec<u8>) -> Result<Inflated, XfmError> {
        let (offset, length) = self.place(block);
        bytes.resize(length as usize, 0);
        read_at(&*self.source, offset, bytes)?;
        Block::decode(&self.header, block, bytes).map_err(|reason| self.damaged(block, reason))
    }

    pub(crate) fn damaged(&self, block: u32, reason: &'static str) -> XfmError {
        XfmError::Block { file: self.name().to_owned(), offset: self.place(block).0, block, reason }
    }

    /// What there is to say about the file, for `info`.
    #[must_use]
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        let h = &self.header;
        let per_triangle = if h.triangles == 0 { 0.0 } else { h.length as f64 / h.triangles as f64 };
        let leaves =
            (0..h.blocks as u32).filter(|&b| h.nodes_of(self.place(b).1).is_some_and(|(_, leaf)| leaf));
        let fill = if h.blocks == 0 { 0.0 } else { h.nodes as f64 / h.blocks as f64 };
        let mut facts = vec![
            ("format", format!("XFM version {}, detail blocks (XFastMesh)", h.version)),
            ("node bytes", h.node_bytes().to_string()),
            ("quantised", if h.quantised { "yes" } else { "no" }.to_owned()),
            ("bounds nested over w x y z", if h.nested { "yes" } else { "no" }.to_owned()),
            ("levels a block", h.levels.get().to_string()),
            ("input vertices", h.input_vertices.to_string()),
            ("triangles", h.triangles.to_string()),
            ("degenerate triangles left out", h.degenerate.to_string()),
            ("non-manifold edges cut", h.cut_edges.to_string()),
            ("vertices added by splitting apart", h.added_vertices.to_string()),
            ("vertices kept against the log", h.left_out.to_string()),
            ("nodes", h.nodes.to_string()),
            ("roots", h.roots.to_string()),
            ("initial vertices", h.initial_vertices.to_string()),
            ("initial faces", h.initial_faces.to_string()),
            ("detail blocks", h.blocks.to_string()),
            ("leaf blocks", leaves.count().to_string()),
            ("nodes a block", format!("{fill:.2}")),
            ("bytes", h.length.to_string()),
            ("bytes a triangle", format!("{per_triangle:.2}")),
            ("least page memory, bytes", self.least_memory().to_string()),
        ];
        facts.extend(self.georeference.facts());
        facts
    }
}

fn split_entry(entry: u64) -> (u64, u64) {
    (entry & ((1 << OFFSET_BITS) - 1), entry >> OFFSET_BITS)
}

fn records(bytes: &[u8]) -> impl Iterator<Item = [u32; 6]> + '_ {
    bytes.chunks_exact(24).map(|record| std::array::from_fn(|i| long(&record[4 * i..4 * i + 4]) as u32))
}

fn positions(words: [u32; 6]) -> [[f32; 3]; 2] {
    let [a, b, c, d, e, f] = words.map(f32::from_bits);
    [[a, b, c], [d, e, f]]
}
