//! Sorting of more records than fit in memory: sorted runs on disk, merged with a heap.
//!
//! Records are arrays of words and sort as such. Runs are half as long as the memory that is given; with more than
//! [`MOST_RUNS`] of them, which takes an input several thousand times as large as memory, groups are merged first.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;
use std::fs::File;
use std::io::{self, Write};

use super::scratch::{Reader, Scratch};

/// Runs that are merged at a time.
const MOST_RUNS: usize = 1024;

/// Fewer records than this are sorted sooner than a thread starts.
const FEW: usize = 1 << 14;

/// Records on the way to being sorted.
#[derive(Debug)]
pub struct Sorter<const N: usize> {
    scratch: Scratch,
    buffer: Vec<[u32; N]>,
    /// Records that are sorted at a time.
    most: usize,
    file: Option<File>,
    /// Numbers of the records after the last of each run.
    ends: Vec<u64>,
}

impl<const N: usize> Sorter<N> {
    /// `bytes` is the memory to use.
    #[must_use]
    pub fn new(scratch: &Scratch, bytes: usize) -> Self {
        let most = (bytes / (4 * N)).max(MOST_RUNS);
        Sorter { scratch: scratch.clone(), buffer: Vec::new(), most, file: None, ends: Vec::new() }
    }

    /// Takes one more record.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn push(&mut self, record: [u32; N]) -> io::Result<()> {
        if self.buffer.capacity() == 0 {
            // Small inputs take little; a vector that grows would take half as much again when it does.
            self.buffer.reserve_exact(self.most.min(1 << 12));
        } else if self.buffer.len() == self.buffer.capacity() && self.buffer.len() < self.most {
            let more = (self.most - self.buffer.len()).min(self.buffer.len());
            self.buffer.reserve_exact(more);
        }
        if self.buffer.len() == self.most {
            self.write_run()?;
        }
        self.buffer.push(record);
        Ok(())
    }

    /// Writes what there is as two runs, each sorted by a thread.
    fn write_run(&mut self) -> io::Result<()> {
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(self.scratch.file()?),
        };
        let mut start = self.ends.last().copied().unwrap_or(0);
        let middle = self.buffer.len() / 2;
        let (first, second) = self.buffer.split_at_mut(middle);
        if first.len() < FEW {
            first.sort_unstable();
            second.sort_unstable();
        } else {
            // A panic of the helper is passed on when the scope ends.
            let is_sorted = std::thread::scope(|scope| {
                let helper = std::thread::Builder::new().spawn_scoped(scope, || first.sort_unstable());
                second.sort_unstable();
                helper.is_ok()
            });
            // There may be no thread to be had.
            if !is_sorted {
                first.sort_unstable();
            }
        }
        for run in [&*first, &*second] {
            if !run.is_empty() {
                file.write_all(bytemuck::cast_slice(run.as_flattened()))?;
                start += run.len() as u64;
                self.ends.push(start);
            }
        }
        self.buffer.clear();
        Ok(())
    }

    /// Calls `take` with all records in order.
    ///
    /// # Errors
    /// What the operating system or `take` says.
    pub fn finish(mut self, mut take: impl FnMut([u32; N]) -> io::Result<()>) -> io::Result<()> {
        if self.file.is_none() {
            self.buffer.sort_unstable();
            return self.buffer.iter().try_for_each(|&record| take(record));
        }
        self.write_run()?;
        self.buffer = Vec::new();
        let Some(mut file) = self.file.take() else { return Ok(()) };
        while self.ends.len() > MOST_RUNS {
            let mut merged = self.scratch.file()?;
            let (mut ends, mut start) = (Vec::new(), 0);
            for group in self.ends.chunks(MOST_RUNS) {
                let mut buffer: Vec<[u32; N]> = Vec::new();
                merge(&file, start, group, self.most / MOST_RUNS, |record: [u32; N]| {
                    buffer.push(record);
                    if buffer.len() == 4096 {
                        merged.write_all(bytemuck::cast_slice(buffer.as_flattened()))?;
                        buffer.clear();
                    }
                    Ok(())
                })?;
                merged.write_all(bytemuck::cast_slice(buffer.as_flattened()))?;
                start = group.last().copied().unwrap_or(start);
                ends.push(start);
            }
            (file, self.ends) = (merged, ends);
        }
        merge(&file, 0, &self.ends, self.most / self.ends.len(), take)
    }
}

/// Merges the runs of a file that begin at record `start` and end at `ends`, reading `records` of each at a time.
fn merge<const N: usize>(
    file: &File,
    mut start: u64,
    ends: &[u64],
    records: usize,
    mut take: impl FnMut([u32; N]) -> io::Result<()>,
) -> io::Result<()> {
    let mut readers = Vec::with_capacity(ends.len());
    let mut heap = BinaryHeap::with_capacity(ends.len());
    for &end in ends {
        let mut reader = Reader::new(file, 0, start..end, records.min(1 << 16));
        start = end;
        if let Some(record) = reader.next() {
            heap.push(Reverse((record?, readers.len())));
            readers.push(reader);
        }
    }
    while let Some(mut least) = heap.peek_mut() {
        let Reverse((record, run)) = *least;
        take(record)?;
        match readers[run].next() {
            Some(record) => *least = Reverse((record?, run)),
            None => drop(PeekMut::pop(least)),
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// More runs than are merged at a time, so that groups are merged first.
    #[test]
    fn sorts_what_does_not_fit() {
        let scratch = Scratch { folder: std::env::temp_dir() };
        for count in [0, 1, 1000, MOST_RUNS as u32 * MOST_RUNS as u32 + 12_345] {
            let mut sorter = Sorter::<2>::new(&scratch, 1);
            let mut random = Pcg64::seed_from_u64(1);
            let mut expected: Vec<[u32; 2]> = (0..count).map(|i| [random.random::<u32>() >> 4, i]).collect();
            expected.iter().for_each(|&record| sorter.push(record).unwrap());
            expected.sort_unstable();
            let mut expected = expected.iter();
            sorter
                .finish(|record| {
                    assert_eq!(Some(&record), expected.next());
                    Ok(())
                })
                .unwrap();
            assert_eq!(expected.next(), None);
        }
    }
}
