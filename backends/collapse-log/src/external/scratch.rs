//! Temporary files, and records in them that are written and read in sequence.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::PathBuf;

use super::paged::Paged;

/// Bytes that are written or read at a time.
const BUFFER_BYTES: usize = 1 << 18;

/// Where temporary files are made.
#[derive(Clone, Debug)]
pub struct Scratch {
    /// The folder.
    pub folder: PathBuf,
}

impl Scratch {
    /// An empty file.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn file(&self) -> io::Result<File> {
        tempfile::tempfile_in(&self.folder)
    }

    /// The beginning of a sequence of records.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn spool<const N: usize>(&self) -> io::Result<Spool<N>> {
        Ok(Spool { file: self.file()?, buffer: Vec::new(), len: 0 })
    }
}

/// Records of `N` words, written one after the other.
#[derive(Debug)]
pub struct Spool<const N: usize> {
    file: File,
    buffer: Vec<[u32; N]>,
    len: u64,
}

impl<const N: usize> Spool<N> {
    const RECORDS: usize = BUFFER_BYTES / (4 * N);

    /// How many there are.
    pub fn len(&self) -> u64 {
        self.len
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Writes one more.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn push(&mut self, record: [u32; N]) -> io::Result<()> {
        self.buffer.push(record);
        self.len += 1;
        if self.buffer.len() >= Self::RECORDS { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.seek(SeekFrom::End(0))?;
        self.file.write_all(bytemuck::cast_slice(self.buffer.as_flattened()))?;
        self.buffer.clear();
        Ok(())
    }

    /// The record with a number, also while more are being written.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn get(&mut self, number: u64) -> io::Result<[u32; N]> {
        let written = self.len - self.buffer.len() as u64;
        if let Some(record) = number.checked_sub(written).and_then(|i| self.buffer.get(i as usize)) {
            return Ok(*record);
        }
        let mut record = [0_u32; N];
        self.file.seek(SeekFrom::Start(number * 4 * N as u64))?;
        self.file.read_exact(bytemuck::cast_slice_mut(&mut record))?;
        Ok(record)
    }

    /// Reads all records from the first on.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn read(&mut self) -> io::Result<Reader<'_, N>> {
        self.flush()?;
        Ok(Reader::new(&self.file, 0, 0..self.len, Self::RECORDS))
    }

    /// Reads all records from the last on.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn read_back(&mut self) -> io::Result<BackReader<'_, N>> {
        self.flush()?;
        Ok(BackReader::new(&self.file, 0, self.len))
    }

    /// Reads records by number, and keeps those of about so many bytes in memory.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn into_paged(mut self, bytes: usize) -> io::Result<Paged<N>> {
        self.flush()?;
        Ok(Paged::new(self.file, self.len, bytes))
    }
}

/// A sequence of records that is being read.
#[derive(Debug)]
pub struct Reader<'f, const N: usize> {
    file: &'f File,
    /// Where the first record of all is, in bytes.
    base: u64,
    /// Number of the record that follows those in the buffer, and of the one after the last.
    at: u64,
    end: u64,
    buffer: Vec<[u32; N]>,
    next: usize,
    records: usize,
}

impl<'f, const N: usize> Reader<'f, N> {
    /// Records of a file, of which the first is at byte `base`, so many at a time.
    #[must_use]
    pub fn new(file: &'f File, base: u64, which: Range<u64>, records: usize) -> Self {
        Reader {
            file,
            base,
            at: which.start,
            end: which.end,
            buffer: Vec::new(),
            next: 0,
            records: records.max(1),
        }
    }

    fn fill(&mut self) -> io::Result<()> {
        let count = (self.end - self.at).min(self.records as u64) as usize;
        self.buffer.resize(count, [0; N]);
        self.next = 0;
        let mut file = self.file;
        file.seek(SeekFrom::Start(self.base + self.at * 4 * N as u64))?;
        file.read_exact(bytemuck::cast_slice_mut(self.buffer.as_flattened_mut()))?;
        self.at += count as u64;
        Ok(())
    }
}

impl<const N: usize> Iterator for Reader<'_, N> {
    type Item = io::Result<[u32; N]>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.next == self.buffer.len() {
            if self.at == self.end {
                return None;
            }
            if let Err(error) = self.fill() {
                self.at = self.end;
                self.buffer.clear();
                self.next = 0;
                return Some(Err(error));
            }
        }
        self.next += 1;
        Some(Ok(self.buffer[self.next - 1]))
    }
}

/// A sequence of records that is being read from its end.
#[derive(Debug)]
pub struct BackReader<'f, const N: usize> {
    file: &'f File,
    base: u64,
    /// How many records come before those in the buffer.
    before: u64,
    buffer: Vec<[u32; N]>,
}

impl<'f, const N: usize> BackReader<'f, N> {
    /// The first so many records of a file, of which the first is at byte `base`.
    #[must_use]
    pub fn new(file: &'f File, base: u64, count: u64) -> Self {
        BackReader { file, base, before: count, buffer: Vec::new() }
    }
}

impl<const N: usize> Iterator for BackReader<'_, N> {
    type Item = io::Result<[u32; N]>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.buffer.is_empty() && self.before > 0 {
            let count = self.before.min(Spool::<N>::RECORDS as u64);
            let start = self.before - count;
            let mut reader = Reader::new(self.file, self.base, start..self.before, count as usize);
            self.before = start;
            if let Err(error) = reader.fill() {
                self.before = 0;
                return Some(Err(error));
            }
            self.buffer = reader.buffer;
        }
        self.buffer.pop().map(Ok)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_come_back() {
        let scratch = Scratch { folder: std::env::temp_dir() };
        let count = 3 * Spool::<3>::RECORDS as u32 + 7;
        let mut spool = scratch.spool::<3>().unwrap();
        for i in 0..count {
            spool.push([i, i * 2, 5]).unwrap();
            if i % 10_007 == 0 {
                assert_eq!(spool.get(u64::from(i / 2)).unwrap(), [i / 2, i / 2 * 2, 5]);
            }
        }
        assert_eq!(spool.len(), u64::from(count));
        let read: Vec<u32> = spool.read().unwrap().map(|r| r.unwrap()[0]).collect();
        assert!(read.iter().copied().eq(0..count));
        let back: Vec<u32> = spool.read_back().unwrap().map(|r| r.unwrap()[0]).collect();
        assert!(back.iter().copied().eq((0..count).rev()));
        let mut paged = spool.into_paged(20_000).unwrap();
        for i in (0..count).step_by(997).chain((0..count).rev().step_by(101)) {
            assert_eq!(paged.get(u64::from(i)).unwrap(), [i, i * 2, 5]);
        }
        assert!(paged.get(u64::from(count)).is_err());
    }
}
