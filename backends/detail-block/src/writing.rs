//! Writing an XFM file: steps 3 and 5 to 7 of the paper's construction.
//!
//! Blocks are written in order, so nodes are sorted by their numbers. The index follows, when all of their lengths are known.

use std::io::{self, Seek, Write};
use std::path::Path;

use container::{BY_PAGE, Kind, SectionWriter, output};
use vertex_tree::{NONE, NodeId};

use crate::arrange::Arranged;
use crate::error::Failure;
use crate::format::{HEADER_BYTES, OFFSET_BITS, block_sum};
use crate::node::Stored;
use crate::options::WriteReport;
use crate::storage::{Elements, Storage};

impl<S: Storage> Arranged<S> {
    /// Writes the file: to a temporary name, synced, then renamed. Nothing is left behind if it fails.
    pub fn write(&mut self, path: &Path, storage: &S) -> Result<WriteReport, Failure> {
        let mut failed = None;
        output::write_with(path, |file| {
            self.write_to(file, storage).map_err(|failure| {
                failed = Some(failure);
                io::ErrorKind::Other.into()
            })
        })
        .map_err(|source| failed.unwrap_or(Failure::Output(source)))?;
        Ok(self.report())
    }

    /// Writes what the file holds.
    pub fn write_to(&mut self, out: &mut (impl Write + Seek), storage: &S) -> Result<(), Failure> {
        let output = Failure::Output;
        let mut out =
            SectionWriter::new(out, HEADER_BYTES, &self.georeference, &[], &KINDS).map_err(output)?;
        out.begin(Kind::BASE_VERTICES).map_err(output)?;
        for v in 0..self.initial_vertices.len() {
            put(&mut out, &self.initial_vertices.get(v)?)?;
        }
        out.begin(Kind::BASE_TRIANGLES).map_err(output)?;
        for t in 0..self.initial_faces.len() {
            let [a, b, c, reverses @ ..] = self.initial_faces.get(t)?;
            put(&mut out, &[a, b, c])?;
            for h in reverses {
                put(&mut out, &[self.number(h)?])?;
            }
        }
        out.begin(Kind::ROOTS).map_err(output)?;
        for i in 0..self.layout.roots.len() {
            let n = self.layout.roots.get(i)? as usize;
            let node = self.nodes.get(n)?;
            put(&mut out, &[self.layout.nodes.get(n)?.number])?;
            put(&mut out, &node.center.map(f32::to_bits))?;
            put(&mut out, &[node.radius, node.eps].map(f32::to_bits))?;
        }
        let mut at = out.begin(Kind::PAGES).map_err(output)?;
        let mut lengths = self.write_blocks(&mut out, storage)?;
        out.begin(Kind::PAGE_TABLE).map_err(output)?;
        for block in 0..lengths.len() {
            let length = u64::from(lengths.get(block)?);
            let entry = at | length << OFFSET_BITS;
            put(&mut out, &[entry as u32, (entry >> 32) as u32])?;
            at += length;
        }
        let length = out.finish(&self.header.encode()).map_err(output)?;
        debug_assert_eq!(length, self.header.length);
        Ok(())
    }

    /// Writes the blocks, and says how long each is.
    fn write_blocks(&mut self, out: &mut impl Write, storage: &S) -> Result<S::Array<u32>, Failure> {
        let levels = self.header.levels;
        // The tables that are there, and what the allocator keeps of those before them, take most of the memory by now.
        let mut sorter = storage.sorter::<RECORD>(10);
        for n in 0..self.merges.len() {
            storage.check_stop()?;
            let (merge, node, planned) = (self.merges.get(n)?, self.nodes.get(n)?, self.layout.nodes.get(n)?);
            let mut children = 0;
            if planned.level + 1 == levels.get() {
                let present = merge.children.map(|child| u32::from(child != NONE));
                children = present[0] | present[1] << 1;
            }
            let [x, y, z] = node.center.map(f32::to_bits);
            let [a, b, c] = node.axis.map(f32::to_bits);
            let [radius, sine, eps] = [node.radius, node.sine, node.eps].map(f32::to_bits);
            let mut adjacent = merge.adjacent;
            for h in &mut adjacent {
                *h = self.number(*h)?;
            }
            let [p, q, r, s] = adjacent;
            let place = [planned.number, planned.parent, planned.first_child, children];
            let [number, parent, first_child, children] = place;
            sorter.push([
                number,
                parent,
                first_child,
                children,
                x,
                y,
                z,
                a,
                b,
                c,
                radius,
                sine,
                p,
                q,
                r,
                s,
                eps,
            ])?;
        }
        let mut lengths = storage.growing(self.header.blocks as usize, 1);
        let (mut block, mut bytes, mut failed) = (Vec::new(), Vec::new(), None);
        let mut close = |block: &mut Vec<[u32; RECORD]>| {
            if block.is_empty() {
                return Ok(());
            }
            self.encode_block(block, &mut bytes);
            block.clear();
            lengths.push(bytes.len() as u32)?;
            out.write_all(&bytes).map_err(|error| {
                failed = Some(error);
                io::Error::from(io::ErrorKind::Other)
            })
        };
        let outcome = sorter.finish(|record| {
            storage.check_stop()?;
            let number = |record: &[u32; RECORD]| levels.block(NodeId(record[0]));
            if block.last().is_some_and(|last| number(last) != number(&record)) {
                close(&mut block)?;
            }
            block.push(record);
            Ok(())
        });
        let outcome = outcome.and_then(|()| close(&mut block));
        match failed {
            Some(error) => Err(Failure::Output(error)),
            None => Ok(outcome.map(|()| lengths)?),
        }
    }

    /// The bytes of a block of these nodes, which are in the order of their offsets.
    fn encode_block(&self, nodes: &[[u32; RECORD]], bytes: &mut Vec<u8>) {
        let levels = self.header.levels;
        let set = levels.flag_bytes();
        let [number, parent, first_child, ..] = nodes[0];
        let (mut flags, mut children) = (0, 0);
        for node in nodes {
            let offset = levels.offset(NodeId(node[0]));
            flags |= 1 << offset;
            if offset >= levels.lowest() {
                children |= node[3] << (2 * (offset - levels.lowest()));
            }
        }
        if children == 0 {
            flags |= levels.leaf_bit();
        }
        bytes.clear();
        bytes.extend_from_slice(&flags.to_le_bytes()[..set]);
        bytes.extend_from_slice(&parent.to_le_bytes());
        if children != 0 {
            bytes.extend_from_slice(&first_child.to_le_bytes());
            bytes.extend_from_slice(&children.to_le_bytes()[..set]);
        }
        for &[_, _, _, _, x, y, z, a, b, c, radius, sine, p, q, r, s, eps] in nodes {
            let stored = Stored {
                position: [x, y, z].map(f32::from_bits),
                normal: [a, b, c].map(f32::from_bits),
                radius: f32::from_bits(radius),
                sine: f32::from_bits(sine),
                adjacent: [p, q, r, s],
                eps: f32::from_bits(eps),
            };
            stored.encode(self.header.quantisation(), bytes);
        }
        let sum = block_sum(levels.block(NodeId(number)), bytes);
        bytes.extend_from_slice(&sum.to_le_bytes());
    }
}

/// Words of a node on its way to its place: number; of the root of a block, the number of the node above and the first child
/// block; of a node of the lowest level, which children there are; position, normal, radius, sine, w x y z, eps.
const RECORD: usize = 17;

/// The sections in their order, and how they are checked.
const KINDS: [(Kind, u32); 5] = [
    (Kind::BASE_VERTICES, 0),
    (Kind::BASE_TRIANGLES, 0),
    (Kind::ROOTS, 0),
    (Kind::PAGES, BY_PAGE),
    (Kind::PAGE_TABLE, 0),
];

fn put(out: &mut impl Write, words: &[u32]) -> Result<(), Failure> {
    words.iter().try_for_each(|word| out.write_all(&word.to_le_bytes())).map_err(Failure::Output)
}
