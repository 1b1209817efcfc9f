use std::io;
use std::sync::atomic::{AtomicU64, Ordering};

use super::page_source::PageSource;

/// Counts what is read from another source.
#[derive(Debug)]
pub struct Counted<S> {
    source: S,
    reads: AtomicU64,
    bytes: AtomicU64,
}

impl<S> Counted<S> {
    /// Nothing read yet.
    pub fn new(source: S) -> Self {
        Self { source, reads: AtomicU64::new(0), bytes: AtomicU64::new(0) }
    }

    /// Reads that have ended well, and the bytes they brought, since the source was made.
    pub fn totals(&self) -> (u64, u64) {
        // Each is right by itself; nothing is published through them.
        (self.reads.load(Ordering::Relaxed), self.bytes.load(Ordering::Relaxed))
    }

    /// What is counted.
    pub fn get_ref(&self) -> &S {
        &self.source
    }
}

impl<S: PageSource> PageSource for Counted<S> {
    fn name(&self) -> &str {
        self.source.name()
    }

    fn len(&self) -> u64 {
        self.source.len()
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        self.source.read_at(offset, buffer)?;
        self.reads.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(buffer.len() as u64, Ordering::Relaxed);
        Ok(())
    }
}
