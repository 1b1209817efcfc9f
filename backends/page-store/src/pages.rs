//! What a backend must be able to do for a store to read for it.

use std::fmt::Debug;

/// The pages of a file, as a backend has them.
pub trait Pages: Send + Sync + 'static {
    /// Names what one read brings: the number of a page, a run of blocks, some nodes.
    type Read: Clone + Debug + Send + 'static;
    /// What a read brings: checked, as far as it can be known without any other page.
    type Content: Send + 'static;
    /// Why a read failed, or what is wrong with all that it has brought.
    type Error: Send + 'static;

    /// Bytes that a read takes from the source.
    fn bytes(&self, read: &Self::Read) -> u64;

    /// Reads from the source, and checks what has come by itself, wholly: later nobody does. Called by the store's thread, or on
    /// virtual time by whoever lets time pass. May block. `buffer` is room for the bytes, of which nothing is expected and
    /// nothing kept.
    ///
    /// # Errors
    /// Whatever the source says, or is wrong with the bytes.
    fn read(&self, read: &Self::Read, buffer: &mut Vec<u8>) -> Result<Self::Content, Self::Error>;

    /// The error of a read in which the source has panicked: a source is other people's code, and a panic there a fault like any
    /// other.
    fn panicked(&self, read: &Self::Read) -> Self::Error;
}
