//! Writes a log from front to back.

use std::io::{self, Seek, Write};
use std::path::Path;

use container::{Georeference, Kind, SectionWriter, output};

use super::error::LogFileError;
use super::layout::{CHUNK, HEADER_BYTES, LogCounts, MAGIC, VERSION};
use crate::log::{Collapse, CollapseLog};

/// Writes a log: to a temporary name beside `path`, synced, then renamed, so that a failure leaves nothing behind.
///
/// # Errors
/// [`LogFileError::Io`].
pub fn write_log(path: &Path, log: &CollapseLog) -> Result<(), LogFileError> {
    let counts = LogCounts {
        vertices: log.mesh.positions.len() as u64,
        triangles: log.mesh.triangles.len() as u64,
        collapses: log.collapses.len() as u64,
    };
    let (positions, triangles) = (log.mesh.positions.iter(), log.mesh.triangles.iter());
    let collapses = log.collapses.iter();
    write_log_from(
        path,
        counts,
        &log.mesh.georeference,
        positions.map(|&p| Ok(p)),
        triangles.map(|&t| Ok(t)),
        collapses.map(|&c| Ok(c)),
    )
}

/// Writes a log that is not in memory, as [`write_log`] does. What the iterators give is taken as it is: that it makes
/// a log, as [`CollapseLog::forest`] demands, is up to the caller.
///
/// # Errors
/// [`LogFileError::Io`], also with whatever an iterator says, if one gives more or fewer records than announced, and if the
/// georeference has a number that is none or a name of more than 4096 bytes.
pub fn write_log_from(
    path: &Path,
    counts: LogCounts,
    georeference: &Georeference,
    positions: impl Iterator<Item = io::Result<[f32; 3]>>,
    triangles: impl Iterator<Item = io::Result<[u32; 3]>>,
    collapses: impl Iterator<Item = io::Result<Collapse>>,
) -> Result<(), LogFileError> {
    let io = |source| LogFileError::Io { file: path.to_owned(), source };
    output::write_with(path, |file| write_to(file, counts, georeference, positions, triangles, collapses))
        .map_err(io)
}

fn write_to(
    out: &mut (impl Write + Seek),
    counts: LogCounts,
    georeference: &Georeference,
    positions: impl Iterator<Item = io::Result<[f32; 3]>>,
    triangles: impl Iterator<Item = io::Result<[u32; 3]>>,
    collapses: impl Iterator<Item = io::Result<Collapse>>,
) -> io::Result<()> {
    let kinds = [Kind::POSITIONS, Kind::TRIANGLES, Kind::COLLAPSES].map(|kind| (kind, 0));
    let mut out = SectionWriter::new(out, HEADER_BYTES, georeference, &[], &kinds)?;
    out.begin(Kind::POSITIONS)?;
    write_section(&mut out, counts.vertices, positions, |p, bytes| put(bytes, p.map(f32::to_le_bytes)))?;
    out.begin(Kind::TRIANGLES)?;
    write_section(&mut out, counts.triangles, triangles, |t, bytes| put(bytes, t.map(u32::to_le_bytes)))?;
    out.begin(Kind::COLLAPSES)?;
    write_section(&mut out, counts.collapses, collapses, |c, bytes| {
        put(bytes, [c.removed.to_le_bytes(), c.kept.to_le_bytes()]);
        put(bytes, c.bounds.center.map(f32::to_le_bytes));
        put(bytes, [c.bounds.radius.to_le_bytes(), c.bounds.eps.to_le_bytes()]);
    })?;
    out.finish(&header(counts))?;
    Ok(())
}

fn header(counts: LogCounts) -> Vec<u8> {
    let mut header = Vec::with_capacity(HEADER_BYTES as usize);
    header.extend_from_slice(&MAGIC);
    header.extend_from_slice(&VERSION.to_le_bytes());
    header.extend_from_slice(&0_u32.to_le_bytes());
    for count in [counts.vertices, counts.triangles, counts.collapses] {
        header.extend_from_slice(&count.to_le_bytes());
    }
    header.extend_from_slice(&crc32fast::hash(&header).to_le_bytes());
    header
}

fn put<const N: usize>(bytes: &mut Vec<u8>, words: [[u8; 4]; N]) {
    bytes.extend_from_slice(words.as_flattened());
}

fn write_section<T>(
    out: &mut impl Write,
    count: u64,
    mut records: impl Iterator<Item = io::Result<T>>,
    encode: impl Fn(&T, &mut Vec<u8>),
) -> io::Result<()> {
    let mut bytes = Vec::new();
    let mut left = count;
    while left > 0 {
        bytes.clear();
        let now = left.min(CHUNK as u64);
        for _ in 0..now {
            encode(&records.next().ok_or(io::ErrorKind::UnexpectedEof)??, &mut bytes);
        }
        out.write_all(&bytes)?;
        left -= now;
    }
    match records.next() {
        None => Ok(()),
        Some(_) => Err(io::Error::other(format!("more records than the {count} announced"))),
    }
}
