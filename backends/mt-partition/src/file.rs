//! An open file: header and tables in memory, nodes read on demand.

use std::sync::Arc;

use container::{FileError, Georeference, Sections, read_at};
use page_store::source::PageSource;
use vertex_tree::{Bounds, NONE, NodeId};

use super::error::MtError;
use crate::format::{Header, NODE, PARTITION, ROOT};
use crate::layout::Layout;
use crate::opening::{Opener, words};
use crate::record::{Limits, Record};

/// A file, opened. Its tables stay in memory, about 6 bytes a node and 12 a partition, and with them the base mesh; shared between
/// trees.
pub struct MtFile {
    source: Arc<dyn PageSource>,
    pub(crate) header: Header,
    pub(crate) roots: Vec<NodeId>,
    root_bounds: Vec<Bounds>,
    pub(crate) layout: Layout,
    pub(crate) log_numbers: Vec<u32>,
    pub(crate) base: Record,
    /// The nodes that arcs of the source lead to, each with the position of that arc, in the order of the nodes.
    below_base: Vec<(u32, u32)>,
    georeference: Georeference,
    sections: Option<Sections>,
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
        let tables = opener.tables(&header)?;
        let (start, table) = &tables.roots;
        let mut roots = Vec::with_capacity(header.roots as usize);
        let mut root_bounds = Vec::with_capacity(header.roots as usize);
        let range = |offset, what, value: u32| opener.range(offset, what, value.into());
        for entry in table.chunks_exact(ROOT as usize) {
            let [node, x, y, z, radius, eps] = words(entry);
            if u64::from(node) >= header.nodes || roots.last().is_some_and(|&last| NodeId(node) <= last) {
                return Err(range(*start, "root", node));
            }
            let [x, y, z, radius, eps] = [x, y, z, radius, eps].map(f32::from_bits);
            if ![x, y, z].iter().all(|x| x.is_finite())
                || !(0.0..=f32::MAX).contains(&radius)
                || !(0.0..=f32::MAX).contains(&eps)
            {
                return Err(range(*start, "bounds of root", node));
            }
            roots.push(NodeId(node));
            root_bounds.push(Bounds { center: [x, y, z], radius, eps });
        }
        let (start, table) = &tables.partitions;
        let mut partitions: Vec<u32> =
            table.chunks_exact(PARTITION as usize).map(|e| words::<1>(e)[0]).collect();
        partitions.push(header.nodes as u32);
        let ascending = partitions.windows(2).find(|pair| pair[0] >= pair[1]);
        if let Some(pair) =
            ascending.or(partitions.first().filter(|&&first| first != 0).map(|_| &partitions[..1]))
        {
            return Err(range(*start, "first node of a partition", pair[0]));
        }
        let (start, table) = &tables.nodes;
        let entries = || table.chunks_exact(NODE as usize).map(words::<2>);
        let log_numbers: Vec<u32> = entries().map(|[_, log_number]| log_number).collect();
        if let Some(&log_number) = log_numbers.iter().find(|&&n| u64::from(n) >= header.collapses) {
            return Err(range(*start, "number in the log", log_number));
        }
        // The first is 0, the last the number of nodes.
        let layout = Layout::new(partitions, tables.records_at, entries().map(|[length, _]| length));
        let end = layout.end();
        opener.check_records(&tables, end - tables.records_at)?;
        // Memory is measured by it.
        let largest = entries().map(|[length, _]| u64::from(length)).max().unwrap_or(0);
        if !(largest..=end - tables.records_at).contains(&header.change_bytes) {
            return Err(opener.range(104, "bytes of the largest change", header.change_bytes));
        }
        if header.nodes > 0 && header.change_nodes == 0 {
            return Err(opener.range(112, "nodes of the largest change", header.change_nodes));
        }
        let (at, bytes) = &tables.base;
        let limits = Limits { nodes: header.nodes as u32, vertices: header.vertices as u32 };
        let base = Record::new(bytes, limits).map_err(|wrong| opener.record(*at, wrong))?;
        if base.number() != NONE || base.above().next().is_some() {
            return Err(range(*at, "number of the source", base.number()));
        }
        let mut below_base: Vec<(u32, u32)> =
            base.arcs().map(|arc| arc.below).zip(0..).filter(|&(below, _)| below != NONE).collect();
        below_base.sort_unstable();
        let (georeference, sections) = (tables.georeference, tables.sections);
        Ok(Self {
            source,
            header,
            roots,
            root_bounds,
            layout,
            log_numbers,
            base,
            below_base,
            georeference,
            sections,
        })
    }

    /// Where the mesh lies in the world.
    #[must_use]
    pub fn georeference(&self) -> &Georeference {
        &self.georeference
    }

    /// Compares the checksums of what this version does not know.
    pub(crate) fn verify_unknown(&self) -> Result<(), MtError> {
        let Some(sections) = &self.sections else { return Ok(()) };
        Ok(sections
            .verify_unknown(&*self.source)
            .map_err(|error| FileError::of_sections(self.name(), error))?)
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
        let partitions = self.layout.partitions();
        let mut facts = vec![
            (
                "format",
                format!("partitioned multi-triangulation, version {} (backend mt-partition)", h.version),
            ),
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
        ];
        facts.extend(self.georeference.facts());
        facts
    }

    pub(crate) fn root_bounds(&self, node: NodeId) -> Option<Bounds> {
        self.roots.binary_search(&node).ok().map(|at| self.root_bounds[at])
    }

    /// The position of the arc from the source to a node among those of the source, if there is one.
    pub(crate) fn position_in_base(&self, node: u32) -> Option<u32> {
        let at = self.below_base.binary_search_by_key(&node, |&(below, _)| below).ok()?;
        Some(self.below_base[at].1)
    }

    /// Bytes of a node as stored.
    pub(crate) fn length(&self, node: u32) -> u64 {
        self.layout.length(node)
    }

    /// The partition that a node is in.
    #[inline]
    pub(crate) fn partition_of(&self, node: u32) -> u32 {
        self.layout.partition_of(node)
    }

    /// Bytes of nodes with consecutive numbers as stored.
    pub(crate) fn bytes(&self, nodes: std::ops::Range<u32>) -> u64 {
        self.layout.bytes(nodes)
    }

    /// Reads the records of nodes with consecutive numbers, in one go. A record that is damaged is told apart from the
    /// others.
    pub(crate) fn read(
        &self,
        nodes: std::ops::Range<u32>,
        bytes: &mut Vec<u8>,
    ) -> Result<Vec<Result<Record, MtError>>, MtError> {
        let opener = Opener { source: &*self.source };
        let start = self.offset(nodes.start);
        bytes.resize(self.bytes(nodes.clone()) as usize, 0);
        read_at(&*self.source, start, bytes)?;
        let limits = Limits { nodes: self.nodes(), vertices: self.header.vertices as u32 };
        let mut from = 0;
        let record = |node: u32| {
            let (offset, to) = (start + from as u64, from + self.length(node) as usize);
            let record = Record::new(&bytes[std::mem::replace(&mut from, to)..to], limits)
                .map_err(|wrong| opener.record(offset, wrong))?;
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
        self.read(node..node + 1, &mut Vec::new())?.remove(0)
    }

    /// Reads a node. May wait for the disk.
    ///
    /// # Errors
    /// [`FileError::Read`], or what is wrong with the record.
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
        self.layout.offset(node)
    }
}
