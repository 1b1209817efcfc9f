//! Where pages come from: random access to the bytes of a store, behind a trait small enough to be implemented by
//! anything.
//!
//! A backend reads through [`PageSource`] alone, so a file, a memory-mapped file, bytes in memory, a slow store and a
//! failing one are interchangeable. [`Counted`] counts reads and bytes, whatever it wraps.

mod counted;
mod faulty;
mod file;
mod mapped;
mod memory;
mod page_source;
mod throttled;

pub use counted::Counted;
pub use faulty::{Faults, Faulty};
pub use file::FileSource;
pub use mapped::MappedSource;
pub use memory::MemorySource;
pub use page_source::PageSource;
pub use throttled::Throttled;
