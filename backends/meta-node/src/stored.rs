//! The pages of a file, as the store reads them.

use std::sync::Arc;

use page_store::{Pages, Requests, Store};

use crate::error::MetaNodeError;
use crate::file::MetaNodeFile;
use crate::page::Layout;
use crate::settings::Io;

/// A page that has been read and has passed its own check.
#[derive(Debug)]
pub(crate) struct Content {
    pub words: Box<[u32]>,
    pub layout: Layout,
}

/// A file of pages.
pub(crate) struct Stored(Arc<MetaNodeFile>);

impl Stored {
    /// A tree's requests, to a store of its own.
    pub fn requests(file: Arc<MetaNodeFile>, io: Io) -> Result<Requests<Self>, MetaNodeError> {
        let store = match io {
            Io::Simulated(store) => Store::simulated(store),
            Io::Thread => Store::new()?,
        };
        Ok(Requests::new(store, Arc::new(Self(file))))
    }
}

impl Pages for Stored {
    /// The number of a page.
    type Read = u32;
    type Content = Content;
    type Error = MetaNodeError;

    fn bytes(&self, &page: &u32) -> u64 {
        4 * self.0.page_words(page) as u64
    }

    fn read(&self, &page: &u32, _: &mut Vec<u8>) -> Result<Content, MetaNodeError> {
        let mut words: Box<[u32]> = vec![0; self.0.page_words(page)].into();
        let layout = self.0.read_page(page, &mut words)?;
        Ok(Content { words, layout })
    }

    fn panicked(&self, &page: &u32) -> MetaNodeError {
        self.0.damaged(page, "the store panicked")
    }
}
