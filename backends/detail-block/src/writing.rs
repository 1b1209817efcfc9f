//! Writing an XFM file from front to back: steps 3 and 5 to 7 of the paper's construction.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use vertex_tree::{NONE, output};

use crate::build::{Arrangement, WriteReport};
use crate::error::XfmError;
use crate::format::{OFFSET_BITS, block_sum};
use crate::half_edges::{BOUNDARY, HalfEdge};
use crate::node::Stored;
use crate::numbering::{face_half_edge, node_half_edge};

impl Arrangement {
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
