//! Writes a file from a collapse log.

use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;

use vertex_tree::{Bounds, CollapseLog, NONE, output};

use crate::format::{CHECKSUM, HEADER, Header, PARTITION, ROOT};
use crate::plan::Plan;
use crate::record::{Draft, Patch};
use crate::versions::Version;
use crate::{BuildOptions, MtError, QueueOrder};

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct WriteReport {
    /// Triangles of the input.
    pub triangles: u64,
    /// Nodes of the reduced graph.
    pub nodes: u64,
    /// Partitions of nodes.
    pub partitions: u64,
    /// Triangles on the arcs, those of the input included.
    pub stored_triangles: u64,
    /// Arcs, those of the source and the drain included.
    pub arcs: u64,
    /// Triangles on arcs, and arcs, before the reduction.
    pub unreduced: (u64, u64),
    /// Arc collapses that were given up because of a second path between the nodes.
    pub refused: u64,
    /// By how much the radius of a node exceeds the largest of its collapses', mean and maximum.
    pub inflation: [f64; 2],
    /// Bytes of the file.
    pub bytes: u64,
}

/// Arranges a log as a reduced, partitioned multi-triangulation and writes it to a file, whole or not at all. Memory
/// grows with the triangles of the input: about 200 bytes each while the graph is reduced.
///
/// # Errors
/// [`MtError::Log`] if the log does not fit its mesh, [`MtError::TooLarge`], and [`MtError::Io`].
pub fn write(path: &Path, log: &CollapseLog, options: &BuildOptions) -> Result<WriteReport, MtError> {
    log.forest()?;
    let counts = [
        ("vertices", log.mesh.positions.len()),
        ("triangles", log.mesh.triangles.len()),
        ("collapses", log.collapses.len()),
    ];
    for (what, count) in counts {
        // The reduction counts triangles of a node, and there are at most this many versions of each, in 32 bits.
        if count as u64 >= u64::from(NONE) / 16 {
            return Err(MtError::TooLarge { what, value: count as u64 });
        }
    }
    let plan = Plan::new(log, options);
    let file = || path.display().to_string();
    let mut bytes = 0;
    output::write_with(path, |out| {
        bytes = Writer::new(log, &plan, options).write(out)?;
        Ok(())
    })
    .map_err(|source| MtError::Io { file: file(), offset: 0, length: bytes, source })?;
    Ok(WriteReport {
        triangles: log.mesh.triangles.len() as u64,
        nodes: plan.nodes.len() as u64,
        partitions: plan.partitions.len() as u64,
        stored_triangles: plan.stored,
        arcs: plan.arcs,
        unreduced: plan.unreduced,
        refused: plan.refused,
        inflation: plan.inflation,
        bytes,
    })
}

struct Writer<'a> {
    log: &'a CollapseLog,
    plan: &'a Plan,
    options: &'a BuildOptions,
    /// For each node, and behind the last for the source, where its outgoing arcs start in `arcs`.
    starts: Vec<u32>,
    /// Outgoing arcs: the node below, and where its triangles start in the plan.
    arcs: Vec<(u32, u32)>,
    /// For each node, where its ingoing arcs start in `above`: the node above and the position there.
    above_starts: Vec<u32>,
    above: Vec<(u32, u32)>,
}

impl<'a> Writer<'a> {
    fn new(log: &'a CollapseLog, plan: &'a Plan, options: &'a BuildOptions) -> Self {
        let nodes = plan.nodes.len();
        let mut starts = Vec::with_capacity(nodes + 2);
        let mut arcs: Vec<(u32, u32)> = Vec::with_capacity(plan.arcs as usize);
        let (mut t, mut bare) = (0, plan.bare.iter().peekable());
        for node in (0..nodes as u32).chain([NONE]) {
            let start = arcs.len();
            starts.push(start as u32);
            while plan.triangles.get(t).is_some_and(|v| v.above == node) {
                let below = plan.triangles[t].below;
                arcs.push((below, t as u32));
                t += plan.triangles[t..].partition_point(|v: &Version| (v.above, v.below) == (node, below));
            }
            // Without triangles; their place among the others follows from where the next ones start.
            while let Some(&(_, below)) = bare.next_if(|&&(above, _)| above == node) {
                let at = start + arcs[start..].partition_point(|&(b, _)| b < below);
                let triangles = arcs.get(at).map_or(t as u32, |&(_, triangles)| triangles);
                arcs.insert(at, (below, triangles));
            }
        }
        starts.push(arcs.len() as u32);
        // Counting sort by the node below.
        let mut above_starts = vec![0_u32; nodes + 1];
        for &(below, _) in arcs.iter().filter(|&&(below, _)| below != NONE) {
            above_starts[below as usize + 1] += 1;
        }
        for n in 0..nodes {
            above_starts[n + 1] += above_starts[n];
        }
        let mut next = above_starts.clone();
        let mut above = vec![(0, 0); above_starts[nodes] as usize];
        for n in 0..=nodes {
            let (start, end) = (starts[n] as usize, starts[n + 1] as usize);
            for (position, &(below, _)) in
                (0..).zip(&arcs[start..end]).filter(|(_, (below, _))| *below != NONE)
            {
                let at = &mut next[below as usize];
                above[*at as usize] = (if n == nodes { NONE } else { n as u32 }, position);
                *at += 1;
            }
        }
        Self { log, plan, options, starts, arcs, above_starts, above }
    }

    fn above(&self, node: usize) -> &[(u32, u32)] {
        &self.above[self.above_starts[node] as usize..self.above_starts[node + 1] as usize]
    }

    /// Triangles on an arc.
    fn triangles(&self, arc: usize) -> &[Version] {
        let start = self.arcs[arc].1 as usize;
        let end = self.arcs.get(arc + 1).map_or(self.plan.triangles.len(), |next| next.1 as usize);
        &self.plan.triangles[start..end]
    }

    fn encode(&self, node: usize, record: &mut Vec<u8>) {
        let first = self.starts[node] as usize;
        let range = first..self.starts[node + 1] as usize;
        let corners: Vec<Vec<[u32; 3]>> =
            range.clone().map(|arc| self.triangles(arc).iter().map(|v| v.corners).collect()).collect();
        let arcs: Vec<Patch> = range
            .zip(&corners)
            .map(|(arc, triangles)| Patch { below: self.arcs[arc].0, triangles })
            .collect();
        let blank = Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 };
        let draft = match self.plan.nodes.get(node) {
            None => Draft { number: NONE, bounds: blank, layer: 0, coarse: 0, above: &[], arcs: &arcs },
            Some(planned) => {
                let above = self.above(node);
                let arc = |&(n, position): &(u32, u32)| {
                    let n = if n == NONE { self.plan.nodes.len() } else { n as usize };
                    self.triangles((self.starts[n] + position) as usize).len() as u32
                };
                let coarse = above.iter().map(arc).sum();
                let &crate::plan::PlannedNode { bounds, layer, .. } = planned;
                Draft { number: node as u32, bounds, layer, coarse, above, arcs: &arcs }
            }
        };
        record.clear();
        draft.encode(&self.log.mesh.positions, record);
    }

    /// Writes everything; returns how many bytes there are.
    fn write(&self, file: &mut std::fs::File) -> io::Result<u64> {
        let nodes = self.plan.nodes.len();
        let is_root = |n: &usize| self.above(*n).iter().all(|&(above, _)| above == NONE);
        let roots: Vec<usize> = (0..nodes).filter(is_root).collect();
        let mut header = Header {
            vertices: self.log.mesh.positions.len() as u64,
            triangles: self.log.mesh.triangles.len() as u64,
            collapses: self.log.collapses.len() as u64,
            nodes: nodes as u64,
            partitions: self.plan.partitions.len() as u64,
            roots: roots.len() as u64,
            stored: self.plan.stored,
            arcs: self.arcs.len() as u64,
            unreduced_stored: self.plan.unreduced.0,
            unreduced_arcs: self.plan.unreduced.1,
            patch: self.options.patch,
            inflation: self.plan.inflation,
            partition_limit: self.options.partition.max(1),
            decreasing: u32::from(self.options.order == QueueOrder::Decreasing),
            ..Header::default()
        };
        let mut out = BufWriter::with_capacity(1 << 20, file);
        out.seek(SeekFrom::Start(header.tables_end()))?;
        let mut record = Vec::new();
        self.encode(nodes, &mut record);
        header.source_bytes = record.len() as u64;
        out.write_all(&record)?;
        let mut lengths = Vec::with_capacity(nodes);
        let mut bytes = header.tables_end() + header.source_bytes;
        for node in 0..nodes {
            self.encode(node, &mut record);
            out.write_all(&record)?;
            lengths.push(u32::try_from(record.len()).map_err(io::Error::other)?);
            bytes += record.len() as u64;
        }
        let length = |n: u32| u64::from(lengths[n as usize]);
        for node in 0..nodes {
            let below = &self.arcs[self.starts[node] as usize..self.starts[node + 1] as usize];
            let below = || below.iter().map(|arc| arc.0).filter(|&n| n != NONE);
            let above = || self.above(node).iter().map(|arc| arc.0).filter(|&n| n != NONE);
            let own = length(node as u32);
            let change = below().map(length).sum::<u64>().max(above().map(length).sum()) + own;
            header.change_bytes = header.change_bytes.max(change);
            header.change_nodes = header.change_nodes.max(below().count().max(above().count()) as u64 + 1);
        }
        out.seek(SeekFrom::Start(0))?;
        out.write_all(&header.encode())?;
        let mut table = Vec::with_capacity(HEADER.max((ROOT * header.roots + PARTITION) as usize));
        for &n in &roots {
            let Bounds { center: [x, y, z], radius, eps } = self.plan.nodes[n].bounds;
            table.extend_from_slice(&(n as u32).to_le_bytes());
            for value in [x, y, z, radius, eps] {
                table.extend_from_slice(&value.to_bits().to_le_bytes());
            }
        }
        finish(&mut table, &mut out)?;
        for first in &self.plan.partitions {
            table.extend_from_slice(&first.to_le_bytes());
        }
        finish(&mut table, &mut out)?;
        for (length, planned) in lengths.iter().zip(&self.plan.nodes) {
            table.extend_from_slice(&length.to_le_bytes());
            table.extend_from_slice(&planned.collapse.to_le_bytes());
        }
        finish(&mut table, &mut out)?;
        debug_assert_eq!(out.stream_position()?, header.tables_end());
        out.flush()?;
        Ok(bytes)
    }
}

/// Writes a table and its checksum, and empties it.
fn finish(table: &mut Vec<u8>, out: &mut impl Write) -> io::Result<()> {
    let checksum = crc32fast::hash(table).to_le_bytes();
    debug_assert_eq!(checksum.len() as u64, CHECKSUM);
    out.write_all(table)?;
    out.write_all(&checksum)?;
    table.clear();
    Ok(())
}
