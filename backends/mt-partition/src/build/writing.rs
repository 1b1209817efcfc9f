//! The file, from what is on disk.
//!
//! The triangles are followed once more and sorted by the arcs that they lie on; then nodes, their outgoing arcs, their
//! ingoing arcs and the triangles are all in the order of the file, and are read side by side.

use std::fs::File;
use std::io::{self, Write};

use collapse_log::external::{Array, Paged, Reader, Sorter, Spool, too_few};
use container::{BY_PAGE, Kind, SectionWriter};
use vertex_tree::{Bounds, NONE};

use super::arranging::{Arranged, bounds_of};
use super::history::Fate;
use super::report::WriteReport;
use super::versions::follow;
use super::work::{Failure, Work};
use crate::format::{HEADER, Header};
use crate::options::BuildOptions;
use crate::partition::QueueOrder;
use crate::record::{Draft, Patch};

/// Writes the file.
pub(super) fn write(
    work: Work<'_>,
    arranged: Arranged,
    options: &BuildOptions,
    file: &mut File,
) -> Result<WriteReport, Failure> {
    let Arranged { fates, numbers, mut nodes, mut partitions, mut arcs, .. } = arranged;
    let (triangles, mut base) = place_triangles(work, fates, numbers)?;
    let (mut ingoing, source) = ingoing(work, &mut arcs)?;
    let count = nodes.len() as u32;
    let roots = roots(&mut ingoing, count)?;
    let mut positions = work.scratch.spool()?;
    for position in work.log.positions() {
        positions.push(position?.map(f32::to_bits))?;
    }
    let counts = work.log.counts();
    let mut header = Header {
        vertices: counts.vertices,
        triangles: counts.triangles,
        collapses: counts.collapses,
        nodes: nodes.len(),
        partitions: partitions.len(),
        roots: roots.len() as u64,
        stored: arranged.totals.1,
        arcs: arranged.totals.0,
        unreduced_stored: arranged.unreduced.1,
        unreduced_arcs: arranged.unreduced.0,
        patch: options.patch,
        inflation: arranged.inflation,
        partition_limit: options.partition.max(1),
        decreasing: u32::from(options.order == QueueOrder::Decreasing),
        ..Header::default()
    };
    let output = Failure::Output;
    let kinds =
        [(Kind::ROOTS, 0), (Kind::PARTITIONS, 0), (Kind::BASE, 0), (Kind::PAGES, BY_PAGE), (Kind::NODES, 0)];
    let mut out =
        SectionWriter::new(file, HEADER as u64, work.log.georeference(), &[], &kinds).map_err(output)?;
    out.begin(Kind::ROOTS).map_err(output)?;
    let mut roots = roots.into_iter().peekable();
    for (n, node) in (0..).zip(nodes.read()?) {
        let [_, bounds @ .., _] = node?;
        if roots.next_if_eq(&n).is_some() {
            put(&mut out, &[n])?;
            put(&mut out, &bounds)?;
        }
    }
    out.begin(Kind::PARTITIONS).map_err(output)?;
    for first in partitions.read()? {
        put(&mut out, &first?)?;
    }
    out.begin(Kind::BASE).map_err(output)?;
    let mut records = Records {
        positions: positions.into_paged(work.memory / 4)?,
        out: &mut out,
        record: Vec::new(),
        arcs: Stream::new(arcs.read()?)?,
        ingoing: Stream::new(ingoing.read()?)?,
        nodes: nodes.read()?,
        lengths: Array::new(work.scratch, count as usize, 0, work.memory / 16),
        at: 0,
        corners: Vec::new(),
        failed: None,
    };
    base.sort_unstable();
    header.source_bytes = records.source(&source, &base)?;
    drop((source, base));
    records.out.begin(Kind::PAGES).map_err(output)?;
    let outcome = triangles.finish(|[above, _, _, _, a, b, c]| {
        work.check()?;
        let outcome = records.nodes_before(above);
        records.corners.push([a, b, c]);
        records.keep(outcome)
    });
    if let Some(failed) = records.failed.take() {
        return Err(failed);
    }
    outcome?;
    records.nodes_before(count)?;
    let Records { mut lengths, .. } = records;
    largest_change(&mut header, &mut arcs, &mut ingoing, &mut lengths)?;

    out.begin(Kind::NODES).map_err(output)?;
    for (n, node) in nodes.read()?.enumerate() {
        let [collapse, ..] = node?;
        put(&mut out, &[lengths.get(n)?, collapse])?;
    }
    let bytes = out.finish(&header.encode()).map_err(output)?;
    Ok(WriteReport {
        triangles: counts.triangles,
        nodes: header.nodes,
        partitions: header.partitions,
        stored_triangles: header.stored,
        arcs: header.arcs,
        unreduced: (header.unreduced_stored, header.unreduced_arcs),
        refused: arranged.refused,
        inflation: arranged.inflation,
        bytes,
    })
}

/// A triangle of the base mesh: node below, number in the input, corners.
type BaseTriangle = (u32, u32, [u32; 3]);

/// The triangles on arcs in the order of the file, as nodes above and below, the collapse that takes it away, number in the
/// input, corners; and those of the base mesh.
fn place_triangles(
    work: Work<'_>,
    mut fates: Paged<3>,
    mut numbers: Array<u32>,
) -> Result<(Sorter<7>, Vec<BaseTriangle>), Failure> {
    let mut triangles = Sorter::<7>::new(work.scratch, work.memory / 4);
    let mut base = Vec::new();
    follow(
        work,
        |v| fates.get(v.into()).map(Fate::from_words),
        |t, [a, b, c], above, below| {
            let below = if below == NONE { NONE } else { numbers.get(below as usize)? };
            if above.collapse == NONE {
                base.push((below, t, [a, b, c]));
                return Ok(());
            }
            let node = numbers.get(above.place as usize)?;
            // What lies within a node is never shown.
            if node == below { Ok(()) } else { triangles.push([node, below, above.collapse, t, a, b, c]) }
        },
    )?;
    Ok((triangles, base))
}

/// Ingoing arcs in the order of the file, as node below, node above, position there, triangles; and the arcs of the source, as
/// node below and triangles.
fn ingoing(work: Work<'_>, arcs: &mut Spool<3>) -> io::Result<(Spool<4>, Vec<[u32; 2]>)> {
    let mut sorted = Sorter::<4>::new(work.scratch, work.memory / 8);
    let (mut of, mut position, mut source) = (None, 0, Vec::new());
    for arc in arcs.read()? {
        work.check()?;
        let [above, below, triangles] = arc?;
        if above == NONE {
            source.push([below, triangles]);
        }
        position = if of == Some(above) { position + 1 } else { 0 };
        of = Some(above);
        if below != NONE {
            sorted.push([below, above, position, triangles])?;
        }
    }
    let mut ingoing = work.scratch.spool()?;
    sorted.finish(|arc| ingoing.push(arc))?;
    Ok((ingoing, source))
}

/// The nodes that no other node is above.
fn roots(ingoing: &mut Spool<4>, nodes: u32) -> io::Result<Vec<u32>> {
    let (mut roots, mut next) = (Vec::new(), 0);
    for arc in ingoing.read()? {
        let [below, above, ..] = arc?;
        if above != NONE && below >= next {
            roots.extend(next..below);
            next = below + 1;
        }
    }
    roots.extend(next..nodes);
    Ok(roots)
}

/// Finds out how much the largest change of the front needs.
fn largest_change(
    header: &mut Header,
    arcs: &mut Spool<3>,
    ingoing: &mut Spool<4>,
    lengths: &mut Array<u32>,
) -> io::Result<()> {
    let (mut arcs, mut ingoing) = (Stream::new(arcs.read()?)?, Stream::new(ingoing.read()?)?);
    for node in 0..lengths.len() as u32 {
        let (mut below, mut above) = ([0_u64; 2], [0_u64; 2]);
        while let Some([_, other, _]) = arcs.next_of(node)? {
            if other != NONE {
                below = [below[0] + u64::from(lengths.get(other as usize)?), below[1] + 1];
            }
        }
        while let Some([_, other, ..]) = ingoing.next_of(node)? {
            if other != NONE {
                above = [above[0] + u64::from(lengths.get(other as usize)?), above[1] + 1];
            }
        }
        let own = u64::from(lengths.get(node as usize)?);
        header.change_bytes = header.change_bytes.max(below[0].max(above[0]) + own);
        header.change_nodes = header.change_nodes.max(below[1].max(above[1]) + 1);
    }
    Ok(())
}

/// Records that are read side by side with others.
struct Stream<'f, const N: usize> {
    reader: Reader<'f, N>,
    next: Option<[u32; N]>,
}

impl<'f, const N: usize> Stream<'f, N> {
    fn new(mut reader: Reader<'f, N>) -> io::Result<Self> {
        let next = reader.next().transpose()?;
        Ok(Self { reader, next })
    }

    /// The next record, if it starts with `node`.
    fn next_of(&mut self, node: u32) -> io::Result<Option<[u32; N]>> {
        let record = self.next.filter(|record| record[0] == node);
        if record.is_some() {
            self.next = self.reader.next().transpose()?;
        }
        Ok(record)
    }
}

/// Writes the records of nodes, one after the other.
struct Records<'a, 'f> {
    positions: Paged<3>,
    out: &'a mut SectionWriter<&'f mut File>,
    record: Vec<u8>,
    arcs: Stream<'a, 3>,
    ingoing: Stream<'a, 4>,
    nodes: Reader<'a, 7>,
    /// Bytes of each record.
    lengths: Array<u32>,
    /// The next node.
    at: u32,
    /// The triangles on its outgoing arcs, as far as they have come up.
    corners: Vec<[u32; 3]>,
    /// What has gone wrong, where only errors of the operating system can be passed on.
    failed: Option<Failure>,
}

impl Records<'_, '_> {
    fn keep(&mut self, outcome: Result<(), Failure>) -> io::Result<()> {
        outcome.map_err(|failed| {
            self.failed = Some(failed);
            io::ErrorKind::Other.into()
        })
    }

    /// Writes the source; returns how long it is.
    fn source(&mut self, arcs: &[[u32; 2]], triangles: &[BaseTriangle]) -> Result<u64, Failure> {
        let corners: Vec<[u32; 3]> = triangles.iter().map(|&(.., corners)| corners).collect();
        let bounds = Bounds { center: [0.0; 3], radius: 0.0, eps: 0.0 };
        let patches = patches(arcs, &corners);
        let draft = Draft { number: NONE, bounds, layer: 0, coarse: 0, above: &[], arcs: &patches };
        self.write(&draft)
    }

    /// Writes the nodes up to a number, without that.
    fn nodes_before(&mut self, end: u32) -> Result<(), Failure> {
        let (mut arcs, mut above) = (Vec::new(), Vec::new());
        while self.at < end {
            let Some(node) = self.nodes.next() else { return Err(too_few().into()) };
            let [_, bounds @ .., layer] = node?;
            arcs.clear();
            above.clear();
            while let Some([_, below, triangles]) = self.arcs.next_of(self.at)? {
                arcs.push([below, triangles]);
            }
            let mut coarse = 0;
            while let Some([_, node, position, triangles]) = self.ingoing.next_of(self.at)? {
                above.push((node, position));
                coarse += triangles;
            }
            let corners = std::mem::take(&mut self.corners);
            let patches = patches(&arcs, &corners);
            let draft = Draft {
                number: self.at,
                bounds: bounds_of(bounds),
                layer,
                coarse,
                above: &above,
                arcs: &patches,
            };
            let length = self.write(&draft)?;
            let length = u32::try_from(length).map_err(io::Error::other).map_err(Failure::Output)?;
            self.lengths.set(self.at as usize, length)?;
            self.corners = corners;
            self.corners.clear();
            self.at += 1;
        }
        Ok(())
    }

    fn write(&mut self, draft: &Draft<'_>) -> Result<u64, Failure> {
        self.record.clear();
        let positions = &mut self.positions;
        draft.encode(|v| Ok(positions.get(v.into())?.map(f32::from_bits)), &mut self.record)?;
        self.out.write_all(&self.record).map_err(Failure::Output)?;
        Ok(self.record.len() as u64)
    }
}

/// The triangles of a node dealt out to its outgoing arcs, each node below and number of triangles.
fn patches<'a>(arcs: &[[u32; 2]], mut corners: &'a [[u32; 3]]) -> Vec<Patch<'a>> {
    arcs.iter()
        .map(|&[below, count]| {
            let (triangles, rest) = corners.split_at(corners.len().min(count as usize));
            corners = rest;
            Patch { below, triangles }
        })
        .collect()
}

fn put(out: &mut impl Write, words: &[u32]) -> Result<(), Failure> {
    words.iter().try_for_each(|word| out.write_all(&word.to_le_bytes())).map_err(Failure::Output)
}
