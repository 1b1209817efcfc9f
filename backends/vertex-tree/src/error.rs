//! What keeps a backend from going on.

/// A backend can not go on: its store failed in a way that asking again will not mend.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TreeError {
    /// Reading from the store failed.
    #[error("{file}: reading {length} bytes at offset {offset} failed")]
    Read {
        /// The file or store, as it was named to the backend.
        file: String,
        /// Where, in bytes from the start.
        offset: u64,
        /// How much.
        length: usize,
        /// Why.
        source: std::io::Error,
    },
    /// The [`origin`](crate::Hierarchy::origin) is no place where a camera can be.
    #[error("the origin {origin:?} is not finite, or farther away than a camera can be")]
    Origin {
        /// As the tree gives it.
        origin: [f64; 3],
    },
    /// A store of a kind that this enum does not know can not go on.
    #[error("{0}")]
    Store(Box<dyn std::error::Error + Send + Sync>),
    /// All nodes were asked for, and some can not be unfolded in the memory that there is.
    #[error("{nodes} nodes can not be unfolded in the memory that there is")]
    Incomplete {
        /// How many, and nothing is known of those below them.
        nodes: usize,
    },
    /// A page does not hold what it should.
    #[error("{file}: page at offset {offset} is damaged: {reason}")]
    Damaged {
        /// The file or store.
        file: String,
        /// Start of the page, in bytes.
        offset: u64,
        /// What is wrong with it.
        reason: &'static str,
    },
}
