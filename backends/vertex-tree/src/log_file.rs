//! The collapse log as a file, little-endian throughout.
//!
//! ```text
//! offset  bytes  field
//!      0      8  magic "FFCOLLOG"
//!      8      4  version, 1
//!     12      4  attribute stride: bytes of further vertex attributes, 0 in version 1
//!     16      8  V, number of vertices, at most 2^32 - 2
//!     24      8  T, number of triangles, at most 2^32 - 2
//!     32      8  C, number of collapses, less than V (0 if V is 0)
//!     40      4  CRC-32 of bytes 0 to 39
//!     44   12 V  positions: x y z as f32
//!          12 T  triangles: three vertex numbers as u32
//!          28 C  collapses, in order: removed u32, kept u32, centre 3 f32, radius f32, eps f32
//!            12  CRC-32 of the positions, of the triangles, of the collapses
//! ```
//!
//! The length of the file follows from the header and is checked before anything is allocated.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

use crate::{Bounds, Collapse, CollapseLog, LogError, Mesh, output};

const MAGIC: [u8; 8] = *b"FFCOLLOG";
const VERSION: u32 = 1;
const HEADER_BYTES: u64 = 44;
const CHECKSUMS_BYTES: u64 = 12;
const VERTEX_BYTES: usize = 12;
const TRIANGLE_BYTES: usize = 12;
const COLLAPSE_BYTES: usize = 28;
/// Records are converted this many at a time.
const CHUNK: usize = 4096;

/// A collapse log could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogFileError {
    /// The operating system said no.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{}: not a collapse log: the file does not start with \"FFCOLLOG\"", file.display())]
    NotALog {
        /// The file.
        file: PathBuf,
    },
    /// The file was written by another version.
    #[error("{}: offset 8: version {version}, expected {VERSION}", file.display())]
    Version {
        /// The file.
        file: PathBuf,
        /// As found.
        version: u32,
    },
    /// The header names a vertex attribute layout that this version does not know.
    #[error("{}: offset 12: attribute stride {stride}, expected 0", file.display())]
    Attributes {
        /// The file.
        file: PathBuf,
        /// As found.
        stride: u32,
    },
    /// A count in the header is out of range.
    #[error("{}: offset {offset}: count {count} out of range", file.display())]
    Count {
        /// The file.
        file: PathBuf,
        /// Where the count stands.
        offset: u64,
        /// As found.
        count: u64,
    },
    /// The file is shorter or longer than its header says.
    #[error("{}: {actual} bytes, but its header asks for {expected}", file.display())]
    Length {
        /// The file.
        file: PathBuf,
        /// What the header says.
        expected: u64,
        /// What there is.
        actual: u64,
    },
    /// Bytes have changed since the file was written.
    #[error("{}: offset {offset}: checksum of the {section} does not match", file.display())]
    Checksum {
        /// The file.
        file: PathBuf,
        /// Start of the damaged section.
        offset: u64,
        /// Its name.
        section: &'static str,
    },
    /// The numbers are intact, but they do not make a log.
    #[error("{}: {source}", file.display())]
    Log {
        /// The file.
        file: PathBuf,
        /// What does not fit.
        source: LogError,
    },
}

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
        positions.map(|&p| Ok(p)),
        triangles.map(|&t| Ok(t)),
        collapses.map(|&c| Ok(c)),
    )
}

/// How many records a log has of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LogCounts {
    /// Vertices.
    pub vertices: u64,
    /// Triangles.
    pub triangles: u64,
    /// Collapses.
    pub collapses: u64,
}

/// Writes a log that is not in memory, as [`write_log`] does. What the iterators give is taken as it is: that it makes
/// a log, as [`CollapseLog::forest`] demands, is up to the caller.
///
/// # Errors
/// [`LogFileError::Io`], also with whatever an iterator says, and if one gives more or fewer records than announced.
pub fn write_log_from(
    path: &Path,
    counts: LogCounts,
    positions: impl Iterator<Item = io::Result<[f32; 3]>>,
    triangles: impl Iterator<Item = io::Result<[u32; 3]>>,
    collapses: impl Iterator<Item = io::Result<Collapse>>,
) -> Result<(), LogFileError> {
    let io = |source| LogFileError::Io { file: path.to_owned(), source };
    output::write_with(path, |file| {
        let mut out = BufWriter::with_capacity(1 << 20, file);
        write_to(&mut out, counts, positions, triangles, collapses)?;
        out.flush()
    })
    .map_err(io)
}

fn write_to(
    out: &mut impl Write,
    counts: LogCounts,
    positions: impl Iterator<Item = io::Result<[f32; 3]>>,
    triangles: impl Iterator<Item = io::Result<[u32; 3]>>,
    collapses: impl Iterator<Item = io::Result<Collapse>>,
) -> io::Result<()> {
    let mut header = Vec::with_capacity(HEADER_BYTES as usize);
    header.extend_from_slice(&MAGIC);
    header.extend_from_slice(&VERSION.to_le_bytes());
    header.extend_from_slice(&0_u32.to_le_bytes());
    for count in [counts.vertices, counts.triangles, counts.collapses] {
        header.extend_from_slice(&count.to_le_bytes());
    }
    header.extend_from_slice(&crc32fast::hash(&header).to_le_bytes());
    out.write_all(&header)?;
    let checksums = [
        write_section(out, counts.vertices, positions, |p, bytes| put(bytes, p.map(f32::to_le_bytes)))?,
        write_section(out, counts.triangles, triangles, |t, bytes| put(bytes, t.map(u32::to_le_bytes)))?,
        write_section(out, counts.collapses, collapses, |c, bytes| {
            put(bytes, [c.removed.to_le_bytes(), c.kept.to_le_bytes()]);
            put(bytes, c.bounds.center.map(f32::to_le_bytes));
            put(bytes, [c.bounds.radius.to_le_bytes(), c.bounds.eps.to_le_bytes()]);
        })?,
    ];
    for checksum in checksums {
        out.write_all(&checksum.to_le_bytes())?;
    }
    Ok(())
}

fn put<const N: usize>(bytes: &mut Vec<u8>, words: [[u8; 4]; N]) {
    bytes.extend_from_slice(words.as_flattened());
}

fn write_section<T>(
    out: &mut impl Write,
    count: u64,
    mut records: impl Iterator<Item = io::Result<T>>,
    encode: impl Fn(&T, &mut Vec<u8>),
) -> io::Result<u32> {
    let mut checksum = crc32fast::Hasher::new();
    let mut bytes = Vec::new();
    let mut left = count;
    while left > 0 {
        bytes.clear();
        let now = left.min(CHUNK as u64);
        for _ in 0..now {
            encode(&records.next().ok_or(io::ErrorKind::UnexpectedEof)??, &mut bytes);
        }
        checksum.update(&bytes);
        out.write_all(&bytes)?;
        left -= now;
    }
    match records.next() {
        None => Ok(checksum.finalize()),
        Some(_) => Err(io::Error::other(format!("more records than the {count} announced"))),
    }
}

/// A log in a file whose header fits its length.
#[derive(Debug)]
pub(crate) struct Opened {
    pub file: File,
    pub counts: LogCounts,
    /// Where positions, triangles, collapses and checksums begin, in bytes.
    pub starts: [u64; 4],
}

/// Opens a log and reads its header.
pub(crate) fn open(path: &Path) -> Result<Opened, LogFileError> {
    let io = |source| LogFileError::Io { file: path.to_owned(), source };
    let mut file = File::open(path).map_err(io)?;
    let actual = file.metadata().map_err(io)?.len();
    let mut header = [0; HEADER_BYTES as usize];
    if actual < HEADER_BYTES {
        let mut start = [0; MAGIC.len()];
        return match file.read_exact(&mut start) {
            Ok(()) if start == MAGIC => {
                Err(LogFileError::Length { file: path.to_owned(), expected: HEADER_BYTES, actual })
            }
            _ => Err(LogFileError::NotALog { file: path.to_owned() }),
        };
    }
    file.read_exact(&mut header).map_err(io)?;
    let word = |at: usize| u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]]);
    let long = |at: usize| u64::from(word(at)) | u64::from(word(at + 4)) << 32;
    if header[..8] != MAGIC {
        return Err(LogFileError::NotALog { file: path.to_owned() });
    }
    if word(8) != VERSION {
        return Err(LogFileError::Version { file: path.to_owned(), version: word(8) });
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
    let positions_at = HEADER_BYTES;
    let triangles_at = positions_at + vertices * VERTEX_BYTES as u64;
    let collapses_at = triangles_at + triangles * TRIANGLE_BYTES as u64;
    let checksums_at = collapses_at + collapses * COLLAPSE_BYTES as u64;
    let expected = checksums_at + CHECKSUMS_BYTES;
    if expected != actual {
        return Err(LogFileError::Length { file: path.to_owned(), expected, actual });
    }
    let counts = LogCounts { vertices, triangles, collapses };
    Ok(Opened { file, counts, starts: [positions_at, triangles_at, collapses_at, checksums_at] })
}

/// Compares the checksums of the sections with those that the file ends with.
pub(crate) fn compare_checksums(
    path: &Path,
    found: [u32; 3],
    written: &[u32],
    starts: [u64; 4],
) -> Result<(), LogFileError> {
    let sections = ["positions", "triangles", "collapses"];
    for (((found, written), offset), section) in found.iter().zip(written).zip(starts).zip(sections) {
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
    let Opened { file, counts, starts } = open(path)?;
    let mut input = BufReader::with_capacity(1 << 20, file);
    let (positions, positions_sum) =
        read_section(&mut input, counts.vertices, |w: [u32; 3]| w.map(f32::from_bits)).map_err(io)?;
    let (triangles, triangles_sum) =
        read_section(&mut input, counts.triangles, |w: [u32; 3]| w).map_err(io)?;
    let (collapses, collapses_sum) = read_section(&mut input, counts.collapses, collapse).map_err(io)?;
    let (sums, _) = read_section(&mut input, 3, |[w]: [u32; 1]| w).map_err(io)?;
    compare_checksums(path, [positions_sum, triangles_sum, collapses_sum], &sums, starts)?;
    let log = CollapseLog { mesh: Mesh { positions, triangles, ..Mesh::default() }, collapses };
    log.forest().map_err(|source| LogFileError::Log { file: path.to_owned(), source })?;
    Ok(log)
}

/// Reads `count` records of `N` words each and their checksum.
fn read_section<T, const N: usize>(
    input: &mut impl Read,
    count: u64,
    decode: impl Fn([u32; N]) -> T,
) -> io::Result<(Vec<T>, u32)> {
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
