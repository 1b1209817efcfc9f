//! Logs that are read in sequence, whether they are in memory or not.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use vertex_tree::Georeference;

use crate::external::{BackReader, Reader};
use crate::log::{Collapse, CollapseLog};
use crate::log_file::read::{self, Opened};
use crate::log_file::{LogCounts, LogFileError};

/// Records, one after the other.
pub type Records<'a, T> = Box<dyn Iterator<Item = io::Result<T>> + 'a>;

/// A log that is read in sequence, as often as one likes, but one sequence at a time. What it gives need not make a
/// log, as [`CollapseLog::forest`] demands: that is up to whoever reads it.
pub trait LogSource {
    /// How many records there are of each kind.
    fn counts(&self) -> LogCounts;

    /// Where the mesh lies in the world.
    fn georeference(&self) -> &Georeference;

    /// The positions of the vertices.
    fn positions(&self) -> Records<'_, [f32; 3]>;

    /// The triangles.
    fn triangles(&self) -> Records<'_, [u32; 3]>;

    /// The collapses in order.
    fn collapses(&self) -> Records<'_, Collapse>;

    /// The collapses from the last on.
    fn collapses_back(&self) -> Records<'_, Collapse>;
}

impl LogSource for CollapseLog {
    fn counts(&self) -> LogCounts {
        LogCounts {
            vertices: self.mesh.positions.len() as u64,
            triangles: self.mesh.triangles.len() as u64,
            collapses: self.collapses.len() as u64,
        }
    }

    fn georeference(&self) -> &Georeference {
        &self.mesh.georeference
    }

    fn positions(&self) -> Records<'_, [f32; 3]> {
        Box::new(self.mesh.positions.iter().map(|&p| Ok(p)))
    }

    fn triangles(&self) -> Records<'_, [u32; 3]> {
        Box::new(self.mesh.triangles.iter().map(|&t| Ok(t)))
    }

    fn collapses(&self) -> Records<'_, Collapse> {
        Box::new(self.collapses.iter().map(|&c| Ok(c)))
    }

    fn collapses_back(&self) -> Records<'_, Collapse> {
        Box::new(self.collapses.iter().rev().map(|&c| Ok(c)))
    }
}

/// A log in a file, of which no more is in memory than a few buffers.
#[derive(Debug)]
pub struct LogFile {
    path: PathBuf,
    opened: Opened,
}

impl LogFile {
    /// Opens a file that [`write_log`](crate::write_log) wrote, reads it once and compares its checksums.
    ///
    /// # Errors
    /// Whatever is wrong with the file, except for what [`CollapseLog::forest`] would find.
    pub fn open(path: &Path) -> Result<Self, LogFileError> {
        let io = |source| LogFileError::Io { file: path.to_owned(), source };
        let opened = read::open(path)?;
        let mut found = [0; 3];
        for (sum, (start, end)) in found.iter_mut().zip(opened.places) {
            *sum = checksum(opened.file(), start, end).map_err(io)?;
        }
        read::compare_checksums(path, &opened, found)?;
        Ok(Self { path: path.to_owned(), opened })
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the mesh lies in the world.
    #[must_use]
    pub fn georeference(&self) -> &Georeference {
        &self.opened.georeference
    }

    /// The version of the format that the file is in.
    #[must_use]
    pub fn version(&self) -> u32 {
        self.opened.version
    }

    fn read<const N: usize>(&self, section: usize, count: u64) -> Reader<'_, N> {
        Reader::new(self.opened.file(), self.opened.places[section].0, 0..count, RECORDS)
    }
}

/// Records that are read at a time.
const RECORDS: usize = 1 << 14;

/// The checksum of the bytes `at..end` of a file.
fn checksum(mut file: &File, at: u64, end: u64) -> io::Result<u32> {
    file.seek(SeekFrom::Start(at))?;
    let mut hasher = crc32fast::Hasher::new();
    let mut buffer = vec![0; 1 << 18];
    let mut left = end - at;
    while left > 0 {
        let bytes = &mut buffer[..left.min(1 << 18) as usize];
        file.read_exact(bytes)?;
        hasher.update(bytes);
        left -= bytes.len() as u64;
    }
    Ok(hasher.finalize())
}

impl LogSource for LogFile {
    fn counts(&self) -> LogCounts {
        self.opened.counts
    }

    fn georeference(&self) -> &Georeference {
        &self.opened.georeference
    }

    fn positions(&self) -> Records<'_, [f32; 3]> {
        let words = self.read::<3>(0, self.counts().vertices);
        Box::new(words.map(|w| w.map(|w| w.map(|w| f32::from_bits(u32::from_le(w))))))
    }

    fn triangles(&self) -> Records<'_, [u32; 3]> {
        let words = self.read::<3>(1, self.counts().triangles);
        Box::new(words.map(|w| w.map(|w| w.map(u32::from_le))))
    }

    fn collapses(&self) -> Records<'_, Collapse> {
        let words = self.read::<7>(2, self.counts().collapses);
        Box::new(words.map(|w| w.map(|w| read::collapse(w.map(u32::from_le)))))
    }

    fn collapses_back(&self) -> Records<'_, Collapse> {
        let words =
            BackReader::<7>::new(self.opened.file(), self.opened.places[2].0, self.counts().collapses);
        Box::new(words.map(|w| w.map(|w| read::collapse(w.map(u32::from_le)))))
    }
}

#[cfg(test)]
mod tests {
    use vertex_tree::Bounds;

    use super::*;
    use crate::log_file::write_log;
    use crate::mesh::Mesh;

    /// What a file gives, forwards and backwards, is what is in memory; a changed byte anywhere is found.
    #[test]
    fn a_file_gives_what_is_in_memory() {
        let count = 2 * RECORDS as u32 + 5;
        let position = |v: u32| [v as f32, 0.5, -(v as f32)];
        let bounds = |v: u32| Bounds { center: position(v), radius: v as f32, eps: 0.25 };
        let log = CollapseLog {
            mesh: Mesh {
                positions: (0..count).map(position).collect(),
                triangles: (2..count).map(|v| [v - 2, v - 1, v]).collect(),
                ..Mesh::default()
            },
            collapses: (1..count).map(|v| Collapse { removed: v, kept: 0, bounds: bounds(v) }).collect(),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log");
        write_log(&path, &log).unwrap();
        let file = LogFile::open(&path).unwrap();
        assert_eq!(file.counts(), log.counts());
        fn same<T: PartialEq>(a: Records<'_, T>, b: Records<'_, T>) -> bool {
            a.map(Result::unwrap).eq(b.map(Result::unwrap))
        }
        assert!(same(file.positions(), log.positions()));
        assert!(same(file.triangles(), log.triangles()));
        assert!(same(file.collapses(), log.collapses()));
        assert!(same(file.collapses_back(), log.collapses_back()));
        let bytes = std::fs::read(&path).unwrap();
        for at in [160, bytes.len() / 3, bytes.len() - 100, bytes.len() - 1] {
            let mut changed = bytes.clone();
            changed[at] ^= 1;
            std::fs::write(&path, changed).unwrap();
            assert!(matches!(LogFile::open(&path), Err(LogFileError::Checksum { .. })), "byte {at}");
        }
    }
}
