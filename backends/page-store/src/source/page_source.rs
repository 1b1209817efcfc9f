//! What a store of bytes must be able to do.

use std::io;

/// A store that is read by position. Shared between threads: reads may be under way at the same time.
pub trait PageSource: Send + Sync {
    /// What errors call it: the name of a file.
    fn name(&self) -> &str;

    /// Bytes in the store. It does not change while the source is open.
    fn len(&self) -> u64;

    /// Whether the store is empty.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Fills `buffer` with the bytes from `offset` on. May block.
    ///
    /// # Errors
    /// [`io::ErrorKind::UnexpectedEof`] if the store ends before the buffer is full, and whatever the store says. What
    /// is in the buffer then is of no use.
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()>;
}

impl<S: PageSource + ?Sized> PageSource for std::sync::Arc<S> {
    fn name(&self) -> &str {
        (**self).name()
    }
    fn len(&self) -> u64 {
        (**self).len()
    }
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        (**self).read_at(offset, buffer)
    }
}

impl<S: PageSource + ?Sized> PageSource for Box<S> {
    fn name(&self) -> &str {
        (**self).name()
    }
    fn len(&self) -> u64 {
        (**self).len()
    }
    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        (**self).read_at(offset, buffer)
    }
}

/// Copies from bytes that are all in memory.
pub(super) fn copy_from(bytes: &[u8], offset: u64, buffer: &mut [u8]) -> io::Result<()> {
    let found = usize::try_from(offset).ok().and_then(|start| {
        let end = start.checked_add(buffer.len())?;
        bytes.get(start..end)
    });
    buffer.copy_from_slice(found.ok_or(io::ErrorKind::UnexpectedEof)?);
    Ok(())
}
