use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

/// Records that are read by number. Neighbours in the file are read together, since those who ask for one mostly ask
/// for others near it.
#[derive(Debug)]
pub struct Paged<const N: usize> {
    file: File,
    len: u64,
    /// Each page has one place where it can be, given by its number.
    pages: Vec<Option<(u64, Vec<[u32; N]>)>>,
}

impl<const N: usize> Paged<N> {
    /// Records of a page.
    const PAGE: usize = 4096 / (4 * N);

    /// The first `len` records of a file, of which those of about so many bytes are kept in memory.
    pub(super) fn new(file: File, len: u64, bytes: usize) -> Self {
        let all = usize::try_from(len.div_ceil(Self::PAGE as u64)).unwrap_or(usize::MAX);
        let slots = (bytes / (4 * N * Self::PAGE)).min(all).max(2);
        Self { file, len, pages: vec![None; slots] }
    }

    /// The record with a number.
    ///
    /// # Errors
    /// What the operating system says, and [`io::ErrorKind::UnexpectedEof`] if there are not so many.
    #[inline]
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
