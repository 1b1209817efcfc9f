//! Who reads for trees, and what one read brings.

use std::ops::Range;
use std::sync::Arc;

use container::FileError;
use page_store::{Pages, Requests, Simulated, Store, ThreadError};

use crate::error::MtError;
use crate::file::MtFile;
use crate::record::Record;

/// The nodes of a file, as the store reads them.
#[derive(Debug)]
pub(crate) struct Stored(Arc<MtFile>);

impl Pages for Stored {
    /// Nodes with consecutive numbers.
    type Read = Range<u32>;
    /// Each node by itself: one that is damaged says nothing of the others.
    type Content = Vec<Result<Record, MtError>>;
    type Error = MtError;

    fn bytes(&self, nodes: &Range<u32>) -> u64 {
        self.0.bytes(nodes.clone())
    }

    fn read(&self, nodes: &Range<u32>, buffer: &mut Vec<u8>) -> Result<Self::Content, MtError> {
        self.0.read(nodes.clone(), buffer)
    }

    fn panicked(&self, nodes: &Range<u32>) -> MtError {
        let (offset, length) = (self.0.offset(nodes.start), self.0.bytes(nodes.clone()));
        let source = std::io::Error::other("the store panicked");
        FileError::Read { file: self.0.name().to_owned(), offset, length, source }.into()
    }
}

/// Reads for any number of trees, what is most urgent first.
#[derive(Clone, Debug)]
pub struct Reader(Store<Stored>);

impl Reader {
    /// Starts a thread that reads.
    ///
    /// # Errors
    /// If there is none to be had.
    pub fn new() -> Result<Self, ThreadError> {
        Store::new().map(Self)
    }

    /// A store on virtual time, without a thread: reads are made while a tree lets time
    /// [`pass`](vertex_tree::Hierarchy::pass), in the thread that calls it. Trees that share a reader share its clock: each of
    /// them says how much time has passed, and the one that is ahead counts.
    #[must_use]
    pub fn simulated(store: Simulated) -> Self {
        Self(Store::simulated(store))
    }

    /// A tree's requests.
    pub(crate) fn requests(&self, file: Arc<MtFile>) -> Requests<Stored> {
        Requests::new(self.0.clone(), Arc::new(Stored(file)))
    }
}
