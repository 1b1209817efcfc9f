//! Where things are in a file of sections.

/// Sections in a file.
pub const MOST: usize = 64;
/// Bytes of an entry of the table.
pub(crate) const ENTRY: usize = 32;
/// Bytes before the entries.
pub(crate) const START: usize = 8;

/// The next multiple of 8.
pub(crate) fn aligned(at: u64) -> u64 {
    at.next_multiple_of(8)
}

/// Where the table of so many sections ends after a header of so many bytes.
pub(crate) fn table_end(header: u64, sections: usize) -> u64 {
    aligned(header) + (START + sections * ENTRY) as u64
}
