//! What is larger than memory: records in temporary files, written and read in sequence, read by number, and sorted; arrays
//! that are read and written by number.
//!
//! Records are arrays of words of 32 bits. The files have no name, or lose it as soon as they are open: whatever ends the
//! program, the system takes them away. Only the process that wrote them reads them, so words are as in memory.

mod array;
mod paged;
mod scratch;
mod sort;
mod workspace;

pub use array::Array;
pub use paged::Paged;
pub use scratch::{BackReader, Reader, Scratch, Spool};
pub use sort::Sorter;
pub use workspace::{Workspace, WorkspaceError, check_stop, too_few};
