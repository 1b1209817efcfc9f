//! An open file: header and tables in memory, nodes read on demand.

use std::sync::Arc;

use vertex_tree::source::PageSource;
use vertex_tree::{Bounds, NONE, NodeId};

use crate::MtError;
use crate::format::{CHECKSUM, HEADER, Header, MAGIC, NODE, PARTITION, ROOT, VERSION};
use crate::record::{Limits, Record};

/// A file, opened. Its tables stay in memory, about 16 bytes a node, and with them the base mesh; shared between trees.
pub struct MtFile {
    source: Arc<dyn PageSource>,
    pub(crate) header: Header,
    pub(crate) roots: Vec<NodeId>,
    root_bounds: Vec<Bounds>,
    /// First node of each partition, and one entry more: the number of nodes.
    pub(crate) partitions: Vec<u32>,
    /// The partition of each node.
    partition_of: Vec<u32>,
    /// Where each node's record starts, and one entry more: where the last one ends.
    offsets: Vec<u64>,
    pub(crate) log_numbers: Vec<u32>,
    pub(crate) base: Record,
}

impl std::fmt::Debug for MtFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("MtFile")
            .field("name", &self.name())
            .field("header", &self.header)
            .finish_non_exhaustive()
    }
}

/// A node, as the file has it: for tests and for those who want to look at the graph.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct StoredNode {
    /// Sphere and error.
    pub bounds: Bounds,
    /// Arcs on the longest path from the source.
    pub layer: u32,
    /// Nodes above, without the source.
    pub parents: Vec<NodeId>,
    /// Nodes below, without the drain.
    pub children: Vec<NodeId>,
    /// Number in the collapse log of the collapse that stands for the node.
    pub log_number: u32,
    /// Triangles on the ingoing and on the outgoing arcs.
    pub triangles: [u32; 2],
}

impl MtFile {
    /// Opens a file: reads and checks its header, tables and base mesh.
    ///
    /// # Errors
    /// What does not fit: see [`MtError`].
    pub fn open(source: Arc<dyn PageSource>) -> Result<Self, MtError> {
        let opener = Opener { source: &*source };
        let header = opener.header()?;
        let nodes = header.nodes as usize;
        let mut at = HEADER as u64;
        let mut roots = Vec::with_capacity(header.roots as usize);
        let mut root_bounds = Vec::with_capacity(header.roots as usize);
        let range = |offset, what, value: u32| opener.range(offset, what, value.into());
        for entry in opener.table("roots", &mut at, header.roots * ROOT)?.chunks_exact(ROOT as usize) {
            let [node, x, y, z, radius, eps] = words(entry);
            if u64::from(node) >= header.nodes || roots.last().is_some_and(|&last| NodeId(node) <= last) {
                return Err(range(HEADER as u64, "root", node));
            }
            let [x, y, z, radius, eps] = [x, y, z, radius, eps].map(f32::from_bits);
            if ![x, y, z].iter().all(|x| x.is_finite())
                || !(0.0..=f32::MAX).contains(&radius)
                || !(0.0..=f32::MAX).contains(&eps)
            {
                return Err(range(HEADER as u64, "bounds of root", node));
            }
            roots.push(NodeId(node));
            root_bounds.push(Bounds { center: [x, y, z], radius, eps });
        }
        let start = at;
        let table = opener.table("partitions", &mut at, header.partitions * PARTITION)?;
        let mut partitions: Vec<u32> =
            table.chunks_exact(PARTITION as usize).map(|e| words::<1>(e)[0]).collect();
        partitions.push(header.nodes as u32);
        let ascending = partitions.windows(2).find(|pair| pair[0] >= pair[1]);
        if let Some(pair) =
            ascending.or(partitions.first().filter(|&&first| first != 0).map(|_| &partitions[..1]))
        {
            return Err(range(start, "first node of a partition", pair[0]));
        }
        // The first is 0, the last the number of nodes, so this adds up.
        let partition_of = (0..)
            .zip(partitions.windows(2))
            .flat_map(|(p, pair)| std::iter::repeat_n(p, (pair[1] - pair[0]) as usize))
            .collect();
        let start = at;
        let table = opener.table("nodes", &mut at, header.nodes * NODE)?;
        let mut offsets = Vec::with_capacity(nodes + 1);
        let mut log_numbers = Vec::with_capacity(nodes);
        let mut end = at + header.source_bytes;
        offsets.push(end);
        for entry in table.chunks_exact(NODE as usize) {
            let [length, log_number] = words(entry);
            if u64::from(log_number) >= header.collapses {
                return Err(range(start, "number in the log", log_number));
            }
            // At most 2^32 lengths below 2^32, on top of a source that is shorter than the file.
            end += u64::from(length);
            offsets.push(end);
            log_numbers.push(log_number);
        }
        if end != source.len() {
            return Err(MtError::Length {
                file: source.name().to_owned(),
                expected: end,
                actual: source.len(),
            });
        }
        // Memory is measured by it.
        if header.change_bytes > end {
            return Err(opener.range(104, "bytes of the largest change", header.change_bytes));
        }
        let bytes = opener.read(at, header.source_bytes)?;
        let limits = Limits { nodes: header.nodes as u32, vertices: header.vertices as u32 };
        let base = Record::new(&bytes, limits).map_err(|wrong| opener.record(at, wrong))?;
        if base.number() != NONE || base.above().next().is_some() {
            return Err(range(at, "number of the source", base.number()));
        }
        Ok(Self { source, header, roots, root_bounds, partitions, partition_of, offsets, log_numbers, base })
    }

    /// What errors call the file.
    #[must_use]
    pub fn name(&self) -> &str {
        self.source.name()
    }

    /// How many nodes there are.
    #[must_use]
    pub fn nodes(&self) -> u32 {
        self.header.nodes as u32
    }

    /// Triangles of the base mesh.
    #[must_use]
    pub fn base_triangles(&self) -> u32 {
        self.base.fine()
    }

    /// Bytes of memory that trees over this file need at least, see [`Memory`](crate::Memory).
    #[must_use]
    pub fn least_memory(&self) -> u64 {
        self.header.change_bytes + self.header.change_nodes * crate::residents::OVERHEAD
    }

    /// Name and value of what there is to know about the file.
    #[must_use]
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        let h = &self.header;
        let per = |a: u64, b: u64| a as f64 / b.max(1) as f64;
        let (bytes, triangles) = (self.source.len(), h.triangles);
        let partitions = self.partitions.len() - 1;
        vec![
            ("format", "partitioned multi-triangulation, version 1 (backend mt-partition)".to_owned()),
            ("bytes", format!("{bytes} ({:.1} a triangle)", per(bytes, triangles))),
            ("vertices", h.vertices.to_string()),
            ("triangles", triangles.to_string()),
            ("collapses", h.collapses.to_string()),
            ("nodes", format!("{} ({:.1} collapses each)", h.nodes, per(h.collapses, h.nodes))),
            (
                "partitions",
                format!(
                    "{partitions} ({:.1} nodes each, at most {})",
                    per(h.nodes, h.partitions),
                    h.partition_limit
                ),
            ),
            ("queue order", if h.decreasing == 1 { "decreasing" } else { "increasing" }.to_owned()),
            ("roots", h.roots.to_string()),
            (
                "triangles on arcs",
                format!(
                    "{} ({:.2} an input triangle, {:.2} unreduced)",
                    h.stored,
                    per(h.stored, triangles),
                    per(h.unreduced_stored, triangles)
                ),
            ),
            (
                "arcs",
                format!(
                    "{} ({:.2} triangles each, {:.2} unreduced, {} requested)",
                    h.arcs,
                    per(h.stored, h.arcs),
                    per(h.unreduced_stored, h.unreduced_arcs),
                    h.patch
                ),
            ),
            ("growth of radii", format!("{:.3} mean, {:.2} largest", h.inflation[0], h.inflation[1])),
            ("base triangles", self.base.fine().to_string()),
            ("least memory", self.least_memory().to_string()),
        ]
    }

    pub(crate) fn root_bounds(&self, node: NodeId) -> Option<Bounds> {
        self.roots.binary_search(&node).ok().map(|at| self.root_bounds[at])
    }

    /// Bytes of a node as stored.
    pub(crate) fn length(&self, node: u32) -> u64 {
        self.offsets[node as usize + 1] - self.offsets[node as usize]
    }

    /// The partition that a node is in.
    #[inline]
    pub(crate) fn partition_of(&self, node: u32) -> u32 {
        self.partition_of[node as usize]
    }

    /// Bytes of nodes with consecutive numbers as stored.
    pub(crate) fn bytes(&self, nodes: std::ops::Range<u32>) -> u64 {
        self.offsets[nodes.end as usize] - self.offsets[nodes.start as usize]
    }

    /// Reads the records of nodes with consecutive numbers, in one go. A record that is damaged is told apart from the
    /// others.
    pub(crate) fn read(&self, nodes: std::ops::Range<u32>) -> Result<Vec<Result<Record, MtError>>, MtError> {
        let opener = Opener { source: &*self.source };
        let start = self.offsets[nodes.start as usize];
        let bytes = opener.read(start, self.offsets[nodes.end as usize] - start)?;
        let limits = Limits { nodes: self.nodes(), vertices: self.header.vertices as u32 };
        let record = |node: u32| {
            let [from, to] = [node, node + 1].map(|n| (self.offsets[n as usize] - start) as usize);
            let offset = start + from as u64;
            let record =
                Record::new(&bytes[from..to], limits).map_err(|wrong| opener.record(offset, wrong))?;
            if record.number() == node {
                Ok(record)
            } else {
                Err(opener.range(offset, "node", record.number().into()))
            }
        };
        Ok(nodes.map(record).collect())
    }

    pub(crate) fn read_node(&self, node: u32) -> Result<Record, MtError> {
        // One range, one record.
        self.read(node..node + 1)?.remove(0)
    }

    /// Reads a node. May wait for the disk.
    ///
    /// # Errors
    /// [`MtError::Io`], or what is wrong with the record.
    pub fn node(&self, node: NodeId) -> Result<StoredNode, MtError> {
        if node.0 >= self.nodes() {
            let opener = Opener { source: &*self.source };
            return Err(opener.range(0, "node", node.0.into()));
        }
        let record = self.read_node(node.0)?;
        Ok(StoredNode {
            bounds: record.bounds(),
            layer: record.layer(),
            parents: record.above().map(|(n, _)| n).filter(|&n| n != NONE).map(NodeId).collect(),
            children: record.below().map(NodeId).collect(),
            log_number: self.log_numbers[node.index()],
            triangles: [record.coarse(), record.fine()],
        })
    }

    /// Bytes that a node takes in memory.
    #[must_use]
    pub fn memory_of(&self, node: NodeId) -> u64 {
        self.length(node.0) + crate::residents::OVERHEAD
    }

    /// The partition that a node is in.
    #[must_use]
    pub fn partition(&self, node: NodeId) -> u32 {
        self.partition_of(node.0)
    }

    pub(crate) fn offset(&self, node: u32) -> u64 {
        self.offsets[node as usize]
    }
}

/// Reads while there is no file yet, and makes errors.
struct Opener<'a> {
    source: &'a dyn PageSource,
}

impl Opener<'_> {
    fn file(&self) -> String {
        self.source.name().to_owned()
    }

    fn range(&self, offset: u64, what: &'static str, value: u64) -> MtError {
        MtError::Range { file: self.file(), offset, what, value }
    }

    fn record(&self, offset: u64, (what, value): (&'static str, u64)) -> MtError {
        if what == "checksum" {
            return MtError::Checksum { file: self.file(), offset, section: "node" };
        }
        self.range(offset, what, value)
    }

    /// Reads bytes, of which there are so many.
    fn read(&self, offset: u64, length: u64) -> Result<Vec<u8>, MtError> {
        let io = |source| MtError::Io { file: self.file(), offset, length, source };
        let room = usize::try_from(length).map_err(|_| io(std::io::ErrorKind::OutOfMemory.into()))?;
        let mut bytes = vec![0; room];
        self.source.read_at(offset, &mut bytes).map_err(io)?;
        Ok(bytes)
    }

    fn header(&self) -> Result<Header, MtError> {
        let actual = self.source.len();
        let mut bytes = [0; HEADER];
        let known = actual.min(HEADER as u64) as usize;
        bytes[..known].copy_from_slice(&self.read(0, known as u64)?);
        if bytes[..8] != MAGIC {
            return Err(MtError::NotThis { file: self.file() });
        }
        if known < HEADER {
            return Err(MtError::Length { file: self.file(), expected: HEADER as u64, actual });
        }
        let [version, stride] = words(&bytes[8..16]);
        if version != VERSION {
            return Err(MtError::Version { file: self.file(), version });
        }
        if stride != 0 {
            return Err(MtError::Attributes { file: self.file(), stride });
        }
        if words(&bytes[HEADER - 4..]) != [crc32fast::hash(&bytes[..HEADER - 4])] {
            return Err(MtError::Checksum { file: self.file(), offset: 0, section: "header" });
        }
        let header = Header::decode(&bytes);
        let most = u64::from(NONE) - 1;
        let limits = [
            (16, "vertices", header.vertices, most),
            (24, "triangles", header.triangles, most),
            (32, "collapses", header.collapses, most),
            (40, "nodes", header.nodes, header.collapses),
            (48, "partitions", header.partitions, header.nodes),
            (56, "roots", header.roots, header.nodes),
            (112, "nodes of the largest change", header.change_nodes, header.nodes),
        ];
        for (offset, what, value, limit) in limits {
            if value > limit {
                return Err(self.range(offset, what, value));
            }
        }
        if header.nodes > 0 && header.partitions == 0 {
            return Err(self.range(48, "partitions", 0));
        }
        let least = header.tables_end().saturating_add(header.source_bytes);
        if actual < least {
            return Err(MtError::Length { file: self.file(), expected: least, actual });
        }
        Ok(header)
    }

    /// Reads a table of a known length and checks it.
    fn table(&self, section: &'static str, at: &mut u64, length: u64) -> Result<Vec<u8>, MtError> {
        let mut bytes = self.read(*at, length + CHECKSUM)?;
        let checksum = bytes.split_off(length as usize);
        if words(&checksum) != [crc32fast::hash(&bytes)] {
            return Err(MtError::Checksum { file: self.file(), offset: *at, section });
        }
        *at += length + CHECKSUM;
        Ok(bytes)
    }
}

/// The first numbers in some bytes, of which there are enough.
fn words<const N: usize>(bytes: &[u8]) -> [u32; N] {
    std::array::from_fn(|i| {
        let mut word = [0; 4];
        word.copy_from_slice(&bytes[4 * i..4 * i + 4]);
        u32::from_le_bytes(word)
    })
}
