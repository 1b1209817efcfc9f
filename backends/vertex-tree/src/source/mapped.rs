use std::fs::File;
use std::io;
use std::path::Path;

use memmap2::Mmap;

use super::{PageSource, copy_from};

/// A file mapped into memory: no system call a read, and a page fault where the page cache does not have it.
#[derive(Debug)]
pub struct MappedSource {
    name: String,
    map: Mmap,
}

impl MappedSource {
    /// Maps a file. It must not be changed or cut short while it is mapped: formats here are written to a new file and
    /// renamed, which leaves the old one as it is for those who have it open.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = File::open(path)?;
        // SAFETY: the map is read only and private to this value. A file that another process changes meanwhile could
        // show bytes that change under a reference; reads copy them out before anything looks at them, pages carry
        // checksums, and nothing in this project ever writes to a file that it has published.
        #[allow(unsafe_code, reason = "a file can not be mapped without")]
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
