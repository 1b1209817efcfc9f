//! Where what a construction works on lies: in memory, or in temporary files of which a part is in memory.
//!
//! Everything that grows with the mesh is an array that is read and written by number ([`Elements`]) or a sequence that is
//! sorted. In memory the arrays are vectors; for larger meshes they are pages of temporary files ([`external`]). The
//! construction is the same code either way, and so is what it makes.

use std::io;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use bytemuck::Pod;
use collapse_log::external::{self, Scratch, Sorter, Workspace};

/// An array that is read and written by number.
pub(crate) trait Elements<T> {
    fn len(&self) -> usize;
    /// The element with a number, which there is.
    fn get(&mut self, number: usize) -> io::Result<T>;
    /// The same, to be changed.
    fn get_mut(&mut self, number: usize) -> io::Result<&mut T>;
    fn push(&mut self, value: T) -> io::Result<()>;
}

impl<T: Copy> Elements<T> for Vec<T> {
    #[inline(always)]
    fn len(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn get(&mut self, number: usize) -> io::Result<T> {
        Ok(self[number])
    }

    #[inline(always)]
    fn get_mut(&mut self, number: usize) -> io::Result<&mut T> {
        Ok(&mut self[number])
    }

    #[inline(always)]
    fn push(&mut self, value: T) -> io::Result<()> {
        self.push(value);
        Ok(())
    }
}

impl<T: Pod> Elements<T> for external::Array<T> {
    #[inline(always)]
    fn len(&self) -> usize {
        self.len()
    }

    #[inline(always)]
    fn get(&mut self, number: usize) -> io::Result<T> {
        self.get(number)
    }

    #[inline(always)]
    fn get_mut(&mut self, number: usize) -> io::Result<&mut T> {
        self.get_mut(number)
    }

    #[inline(always)]
    fn push(&mut self, value: T) -> io::Result<()> {
        self.push(value)
    }
}

/// Makes arrays and sorters. Each is told which part of the memory it may have, in hundredths: what is there at the same
/// time has a hundred together at most.
pub(crate) trait Storage {
    type Array<T: Pod>: Elements<T>;

    /// So many elements.
    fn array<T: Pod>(&self, len: usize, blank: T, part: usize) -> Self::Array<T>;

    /// None yet, but about so many later.
    fn growing<T: Pod>(&self, expected: usize, part: usize) -> Self::Array<T>;

    fn sorter<const N: usize>(&self, part: usize) -> Sorter<N>;

    /// Fails if somebody wants the construction to end.
    fn check_stop(&self) -> io::Result<()>;
}

/// All in memory.
pub(crate) struct Memory;

impl Storage for Memory {
    type Array<T: Pod> = Vec<T>;

    fn array<T: Pod>(&self, len: usize, blank: T, _part: usize) -> Vec<T> {
        vec![blank; len]
    }

    fn growing<T: Pod>(&self, expected: usize, _part: usize) -> Vec<T> {
        Vec::with_capacity(expected)
    }

    fn sorter<const N: usize>(&self, _part: usize) -> Sorter<N> {
        // Nothing leaves the memory, so nothing is ever made in a folder.
        Sorter::new(&Scratch { folder: PathBuf::new() }, usize::MAX)
    }

    #[inline(always)]
    fn check_stop(&self) -> io::Result<()> {
        Ok(())
    }
}

/// In temporary files.
pub(crate) struct Disk<'a> {
    scratch: Scratch,
    memory: usize,
    stop: &'a AtomicBool,
}

impl<'a> Disk<'a> {
    pub fn new(workspace: &Workspace<'a>) -> Self {
        Self {
            scratch: Scratch { folder: workspace.folder.clone() },
            // The allocator keeps back some of what has been freed.
            memory: usize::try_from(workspace.memory - workspace.memory / 8).unwrap_or(usize::MAX),
            stop: workspace.stop,
        }
    }

    fn bytes(&self, part: usize) -> usize {
        self.memory / 100 * part
    }
}

impl Storage for Disk<'_> {
    type Array<T: Pod> = external::Array<T>;

    fn array<T: Pod>(&self, len: usize, blank: T, part: usize) -> external::Array<T> {
        external::Array::new(&self.scratch, len, blank, self.bytes(part))
    }

    fn growing<T: Pod>(&self, _expected: usize, part: usize) -> external::Array<T> {
        self.array(0, T::zeroed(), part)
    }

    fn sorter<const N: usize>(&self, part: usize) -> Sorter<N> {
        Sorter::new(&self.scratch, self.bytes(part))
    }

    #[inline(always)]
    fn check_stop(&self) -> io::Result<()> {
        external::check_stop(self.stop)
    }
}
