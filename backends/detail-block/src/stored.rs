//! The blocks of a file, as the store reads them.

use std::ops::Range;
use std::sync::Arc;

use container::read_at;
use page_store::Pages;

use crate::block::{Block, Inflated};
use crate::error::XfmError;
use crate::file::XfmFile;

/// Consecutive blocks to be read with one read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub first: u32,
    pub count: u32,
}

impl Run {
    pub fn numbers(self) -> Range<u32> {
        self.first..self.first + self.count
    }

    /// Where it is in the file, and how many bytes it has there.
    fn place(self, file: &XfmFile) -> (u64, u64) {
        let (offset, _) = file.place(self.first);
        let (last, length) = file.place(self.first + self.count - 1);
        (offset, last + length - offset)
    }
}

/// A file of blocks.
pub(crate) struct Stored(pub Arc<XfmFile>);

impl Pages for Stored {
    type Read = Run;
    /// Each block by itself: one that is damaged says nothing of the others.
    type Content = Vec<Result<Inflated, XfmError>>;
    type Error = XfmError;

    fn bytes(&self, run: &Run) -> u64 {
        run.place(&self.0).1
    }

    /// Reads a run with one read and inflates its blocks.
    fn read(&self, run: &Run, buffer: &mut Vec<u8>) -> Result<Self::Content, XfmError> {
        let file = &self.0;
        let (offset, length) = run.place(file);
        buffer.resize(length as usize, 0);
        read_at(file.source(), offset, buffer)?;
        let decode = |block: u32| {
            let (start, length) = file.place(block);
            let start = (start - offset) as usize;
            let bytes = &buffer[start..start + length as usize];
            Block::decode(file.header(), block, bytes).map_err(|reason| file.damaged(block, reason))
        };
        Ok(run.numbers().map(decode).collect())
    }

    fn panicked(&self, run: &Run) -> XfmError {
        self.0.damaged(run.first, "the store panicked")
    }
}
