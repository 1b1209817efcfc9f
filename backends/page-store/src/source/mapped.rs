use std::fs::File;
use std::io;
use std::path::Path;

use memmap2::Mmap;

use super::page_source::{PageSource, copy_from};

/// A file mapped into memory: no system call a read, and a page fault where the page cache does not have it.
#[derive(Debug)]
pub struct MappedSource {
    name: String,
    map: Mmap,
}

impl MappedSource {
    /// Maps a file. [`FileSource`](super::FileSource) asks for nothing of the kind that follows.
    ///
    /// # Safety
    /// Nobody may change the file or cut it short while it is mapped, in this process or another: its bytes are lent as if
    /// they could not change, and a page that is no longer there ends the process. Formats here are written to a new
    /// file and renamed, which leaves the old one as it is for those who have it open; a copy over it does not.
    ///
    /// # Errors
    /// What the operating system says.
    #[expect(unsafe_code, reason = "a file can not be mapped without; no command of this project does")]
    pub unsafe fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        // SAFETY: that the file stays as it is has been promised by the caller.
        let map = unsafe { Mmap::map(&file)? };
        Ok(Self { name: path.display().to_string(), map })
    }

    /// Says that accesses will be in no order: the operating system then reads nothing around what is touched. Does nothing
    /// where it can not be told.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn expect_random_access(&self) -> io::Result<()> {
        #[cfg(unix)]
        self.map.advise(memmap2::Advice::Random)?;
        Ok(())
    }

    /// The bytes of the file.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.map
    }
}

impl PageSource for MappedSource {
    fn name(&self) -> &str {
        &self.name
    }

    fn len(&self) -> u64 {
        self.map.len() as u64
    }

    fn read_at(&self, offset: u64, buffer: &mut [u8]) -> io::Result<()> {
        copy_from(&self.map, offset, buffer)
    }
}
