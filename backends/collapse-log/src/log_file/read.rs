//! Reads logs of all versions.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use container::{Georeference, Kind, SectionError, Sections};
use page_store::source::{FileSource, PageSource};
use vertex_tree::Bounds;

use super::error::LogFileError;
use super::layout::{
    CHUNK, COLLAPSE_BYTES, HEADER_BYTES, LogCounts, MAGIC, TRIANGLE_BYTES, VERSION, VERTEX_BYTES,
};
use crate::log::{Collapse, CollapseLog};
use crate::mesh::Mesh;

/// A log in a file whose header fits its length.
#[derive(Debug)]
pub(crate) struct Opened {
    source: FileSource,
    pub version: u32,
    pub counts: LogCounts,
    /// Where positions, triangles and collapses begin, and where the last of them end, in bytes.
    pub places: [(u64, u64); 3],
    /// Their checksums as the file has them.
    pub checksums: [u32; 3],
    pub georeference: Georeference,
}

impl Opened {
    pub fn file(&self) -> &File {
        self.source.file()
    }
}

/// Opens a log and reads all but its positions, triangles and collapses.
pub(crate) fn open(path: &Path) -> Result<Opened, LogFileError> {
    let io = |source| LogFileError::Io { file: path.to_owned(), source };
    let source = FileSource::open(path).map_err(io)?;
    let actual = source.len();
    let mut header = [0; HEADER_BYTES as usize];
    let known = &mut header[..actual.min(HEADER_BYTES) as usize];
    source.read_at(0, known).map_err(io)?;
    if !known.starts_with(&MAGIC) {
        return Err(LogFileError::NotALog { file: path.to_owned() });
    }
    if actual < HEADER_BYTES {
        return Err(LogFileError::Length { file: path.to_owned(), expected: HEADER_BYTES, actual });
    }
    let (version, counts) = check_header(path, &header)?;
    let lengths = [
        counts.vertices * VERTEX_BYTES as u64,
        counts.triangles * TRIANGLE_BYTES as u64,
        counts.collapses * COLLAPSE_BYTES as u64,
    ];
    let mut places = [(0, 0); 3];
    let mut checksums = [0; 3];
    if version == 1 {
        let mut at = HEADER_BYTES;
        for (place, length) in places.iter_mut().zip(lengths) {
            *place = (at, at + length);
            at += length;
        }
        let expected = at + 4 * 3;
        if expected != actual {
            return Err(LogFileError::Length { file: path.to_owned(), expected, actual });
        }
        let mut bytes = [[0; 4]; 3];
        source.read_at(at, bytes.as_flattened_mut()).map_err(io)?;
        checksums = bytes.map(u32::from_le_bytes);
        let georeference = Georeference::default();
        return Ok(Opened { source, version, counts, places, checksums, georeference });
    }
    let kinds = [Kind::POSITIONS, Kind::TRIANGLES, Kind::COLLAPSES];
    let mut read = || -> Result<_, SectionError> {
        let sections = Sections::read(&source, HEADER_BYTES, &kinds)?;
        for (i, kind) in kinds.into_iter().enumerate() {
            let section = sections.find(kind, 0, lengths[i])?;
            (places[i], checksums[i]) = ((section.offset, section.end()), section.checksum);
        }
        sections.verify_unknown(&source)?;
        sections.georeference(&source)
    };
    let georeference = read().map_err(|error| LogFileError::of_sections(path, error))?;
    Ok(Opened { source, version, counts, places, checksums, georeference })
}

/// Version and counts, which are in range.
fn check_header(path: &Path, header: &[u8; HEADER_BYTES as usize]) -> Result<(u32, LogCounts), LogFileError> {
    let word = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    let long = |at: usize| u64::from(word(at)) | u64::from(word(at + 4)) << 32;
    let version = word(8);
    if !(1..=VERSION).contains(&version) {
        return Err(LogFileError::Version { file: path.to_owned(), version });
    }
    if crc32fast::hash(&header[..40]) != word(40) {
        return Err(LogFileError::Checksum { file: path.to_owned(), offset: 0, section: "header" });
    }
    if word(12) != 0 {
        return Err(LogFileError::Attributes { file: path.to_owned(), stride: word(12) });
    }
    let (vertices, triangles, collapses) = (long(16), long(24), long(32));
    let most = u64::from(u32::MAX) - 1;
    let most_collapses = vertices.saturating_sub(1);
    for (offset, count, limit) in
        [(16, vertices, most), (24, triangles, most), (32, collapses, most_collapses)]
    {
        if count > limit {
            return Err(LogFileError::Count { file: path.to_owned(), offset, count });
        }
    }
    Ok((version, LogCounts { vertices, triangles, collapses }))
}

/// The version of the format that a log is in.
///
/// # Errors
/// Whatever is wrong with its header.
pub fn log_file_version(path: &Path) -> Result<u32, LogFileError> {
    open(path).map(|opened| opened.version)
}

/// Compares the checksums of positions, triangles and collapses with those that the file has.
pub(crate) fn compare_checksums(path: &Path, opened: &Opened, found: [u32; 3]) -> Result<(), LogFileError> {
    let sections = ["positions", "triangles", "collapses"];
    let both = found.iter().zip(&opened.checksums);
    for (((found, written), (offset, _)), section) in both.zip(opened.places).zip(sections) {
        if found != written {
            return Err(LogFileError::Checksum { file: path.to_owned(), offset, section });
        }
    }
    Ok(())
}

/// A collapse from its words in a file.
pub(crate) fn collapse([removed, kept, x, y, z, radius, eps]: [u32; 7]) -> Collapse {
    let bounds = Bounds {
        center: [x, y, z].map(f32::from_bits),
        radius: f32::from_bits(radius),
        eps: f32::from_bits(eps),
    };
    Collapse { removed, kept, bounds }
}

/// Reads a log and checks it.
///
/// # Errors
/// Whatever is wrong with the file; a log that is returned passes [`CollapseLog::forest`].
pub fn read_log(path: &Path) -> Result<CollapseLog, LogFileError> {
    let io = |source| LogFileError::Io { file: path.to_owned(), source };
    let opened = open(path)?;
    let LogCounts { vertices, triangles, collapses } = opened.counts;
    let mut input = BufReader::with_capacity(1 << 20, opened.file());
    let [positions_at, triangles_at, collapses_at] = opened.places.map(|(start, _)| start);
    let (positions, positions_sum) =
        read_section(&mut input, positions_at, vertices, |w: [u32; 3]| w.map(f32::from_bits)).map_err(io)?;
    let (triangles, triangles_sum) =
        read_section(&mut input, triangles_at, triangles, |w: [u32; 3]| w).map_err(io)?;
    let (collapses, collapses_sum) =
        read_section(&mut input, collapses_at, collapses, collapse).map_err(io)?;
    compare_checksums(path, &opened, [positions_sum, triangles_sum, collapses_sum])?;
    let mesh = Mesh { positions, triangles, georeference: opened.georeference };
    let log = CollapseLog { mesh, collapses };
    log.forest().map_err(|source| LogFileError::Log { file: path.to_owned(), source })?;
    Ok(log)
}

/// Reads `count` records of `N` words each from a byte on, and their checksum.
fn read_section<T, const N: usize>(
    input: &mut (impl Read + Seek),
    start: u64,
    count: u64,
    decode: impl Fn([u32; N]) -> T,
) -> io::Result<(Vec<T>, u32)> {
    input.seek(SeekFrom::Start(start))?;
    let mut records = Vec::with_capacity(count as usize);
    let mut checksum = crc32fast::Hasher::new();
    let mut bytes = vec![0; 4 * N * CHUNK];
    let mut left = count as usize;
    while left > 0 {
        let now = left.min(CHUNK);
        let chunk = &mut bytes[..4 * N * now];
        input.read_exact(chunk)?;
        checksum.update(chunk);
        records.extend(chunk.chunks_exact(4 * N).map(|record| {
            decode(std::array::from_fn(|i| {
                u32::from_le_bytes([record[4 * i], record[4 * i + 1], record[4 * i + 2], record[4 * i + 3]])
            }))
        }));
        left -= now;
    }
    Ok((records, checksum.finalize()))
}
