//! Temporary files, and records in them that are written and read in sequence.
//!
//! The files have no name, or lose it as soon as they are open: whatever ends the program, the system takes them away.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

/// Bytes that are written or read at a time.
pub(super) const BUFFER_BYTES: usize = 1 << 18;

/// Where temporary files are made.
#[derive(Clone, Debug)]
pub(super) struct Scratch {
    pub folder: PathBuf,
}

impl Scratch {
    pub fn file(&self) -> io::Result<File> {
        tempfile::tempfile_in(&self.folder)
    }

    /// The beginning of a sequence of records.
    pub fn spool<const N: usize>(&self) -> io::Result<Spool<N>> {
        Ok(Spool { file: self.file()?, buffer: Vec::new(), len: 0 })
    }
}

/// Records of `N` words, written one after the other.
#[derive(Debug)]
pub(super) struct Spool<const N: usize> {
    file: File,
    buffer: Vec<[u32; N]>,
    len: u64,
}

impl<const N: usize> Spool<N> {
    const RECORDS: usize = BUFFER_BYTES / (4 * N);

    pub fn len(&self) -> u64 {
        self.len
    }

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
    pub fn read(&mut self) -> io::Result<Reader<'_, N>> {
        self.flush()?;
        Ok(Reader::new(&self.file, 0, self.len, Self::RECORDS))
    }

    /// Reads records by number, and keeps those of about so many bytes in memory.
    pub fn into_paged(mut self, bytes: usize) -> io::Result<Paged<N>> {
        self.flush()?;
        let slots = (bytes / (4 * N * Paged::<N>::PAGE)).max(2);
        Ok(Paged { file: self.file, len: self.len, pages: vec![None; slots] })
    }
}

/// A sequence of records that is being read.
#[derive(Debug)]
pub(super) struct Reader<'f, const N: usize> {
    file: &'f File,
    /// Number of the record that follows those in the buffer, and of the one after the last.
    at: u64,
    end: u64,
    buffer: Vec<[u32; N]>,
    next: usize,
    records: usize,
}

impl<'f, const N: usize> Reader<'f, N> {
    /// The records `at..end` of a file, so many at a time.
    pub fn new(file: &'f File, at: u64, end: u64, records: usize) -> Self {
        Reader { file, at, end, buffer: Vec::new(), next: 0, records: records.max(1) }
    }

    fn fill(&mut self) -> io::Result<()> {
        let count = (self.end - self.at).min(self.records as u64) as usize;
        self.buffer.resize(count, [0; N]);
        self.next = 0;
        let mut file = self.file;
        file.seek(SeekFrom::Start(self.at * 4 * N as u64))?;
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

/// Records that are read by number. Neighbours in the file are read together, since those who ask for one mostly ask
/// for others near it.
#[derive(Debug)]
pub(super) struct Paged<const N: usize> {
    file: File,
    len: u64,
    /// Each page has one place where it can be, given by its number.
    pages: Vec<Option<(u64, Vec<[u32; N]>)>>,
}

impl<const N: usize> Paged<N> {
    /// Records of a page.
    const PAGE: usize = 4096 / (4 * N);

    pub fn get(&mut self, number: u64) -> io::Result<[u32; N]> {
        let (page, within) = (number / Self::PAGE as u64, (number % Self::PAGE as u64) as usize);
        let slots = self.pages.len() as u64;
        let slot = &mut self.pages[(page % slots) as usize];
        if slot.as_ref().is_none_or(|(there, _)| *there != page) {
            let start = page * Self::PAGE as u64;
            let count = self.len.saturating_sub(start).min(Self::PAGE as u64) as usize;
            let (_, mut records) = slot.take().unwrap_or_default();
            records.resize(count, [0; N]);
            self.file.seek(SeekFrom::Start(start * 4 * N as u64))?;
            self.file.read_exact(bytemuck::cast_slice_mut(records.as_flattened_mut()))?;
            *slot = Some((page, records));
        }
        let record = slot.as_ref().and_then(|(_, records)| records.get(within));
        record.copied().ok_or_else(|| io::ErrorKind::UnexpectedEof.into())
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
        let mut paged = spool.into_paged(20_000).unwrap();
        for i in (0..count).step_by(997).chain((0..count).rev().step_by(101)) {
            assert_eq!(paged.get(u64::from(i)).unwrap(), [i, i * 2, 5]);
        }
        assert!(paged.get(u64::from(count)).is_err());
    }
}
