//! What can be wrong with a file, and with building one.

use std::io;

use vertex_tree::LogError;

/// An XFM file could not be written or is not what it should be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XfmError {
    /// The log that a file was to be built from does not fit its mesh.
    #[error("the collapse log does not fit its mesh: {0}")]
    Log(#[from] LogError),
    /// A build option is out of range.
    #[error("{levels} levels a block, expected 1 to {most}")]
    Levels {
        /// As asked for.
        levels: u32,
        /// The most there can be.
        most: u32,
    },
    /// The hierarchy is larger than the format's numbers reach.
    #[error("{count} {what}, but the format has numbers for {most} only")]
    TooLarge {
        /// What there are too many of.
        what: &'static str,
        /// How many.
        count: u64,
        /// How many there can be.
        most: u64,
    },
    /// A radius or an error is too large to be stored.
    #[error("the radius or error {length} of a node is too large to be stored")]
    Length {
        /// As computed.
        length: f32,
    },
    /// Writing failed.
    #[error("{file}: {source}")]
    Write {
        /// The file.
        file: String,
        /// Why.
        source: io::Error,
    },
    /// Reading failed.
    #[error("{file}: reading {length} bytes at offset {offset}: {source}")]
    Read {
        /// The file or store.
        file: String,
        /// Where, in bytes from the start.
        offset: u64,
        /// How much.
        length: u64,
        /// Why.
        source: io::Error,
    },
    /// The file is something else.
    #[error("{file}: not an XFM file: it does not start with \"FFXFMESH\"")]
    NotXfm {
        /// The file or store.
        file: String,
    },
    /// A field of the header or of a table has a value that it can not have.
    #[error("{file}: offset {offset}: {field} is {value}, {expected}")]
    Field {
        /// The file or store.
        file: String,
        /// Where the field is.
        offset: u64,
        /// What it is called.
        field: &'static str,
        /// As found.
        value: u64,
        /// What was expected.
        expected: &'static str,
    },
    /// The file is shorter or longer than its header says.
    #[error("{file}: {actual} bytes, but its header asks for {expected}")]
    FileLength {
        /// The file or store.
        file: String,
        /// What the header says.
        expected: u64,
        /// What there is.
        actual: u64,
    },
    /// Bytes have changed since the file was written.
    #[error("{file}: offset {offset}: checksum of the {section} does not match")]
    Checksum {
        /// The file or store.
        file: String,
        /// Start of the damaged section.
        offset: u64,
        /// Its name.
        section: &'static str,
    },
    /// A detail block does not hold what it should, though it may be intact.
    #[error("{file}: offset {offset}: block {block} is damaged: {reason}")]
    Block {
        /// The file or store.
        file: String,
        /// Start of the block.
        offset: u64,
        /// Its number.
        block: u32,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// A node refers to what is not there, or does not fit what it refers to.
    #[error("{file}: offset {offset}: node {node}: {reason}")]
    Node {
        /// The file or store.
        file: String,
        /// Start of its block.
        offset: u64,
        /// Its number.
        node: u32,
        /// What is wrong with it.
        reason: &'static str,
    },
}
