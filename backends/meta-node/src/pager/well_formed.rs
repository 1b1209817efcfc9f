//! Whether the place holders, their lists and the counts are what they should be.

use vertex_tree::NONE;

use super::Pager;
use crate::page::Layout;

impl Pager {
    /// Checks the place holders, that a request is under way for each page that is on its way, and, while not every page is in
    /// memory, that reference counts and lists are what the usage counts ask for.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        self.places.assert_well_formed(|page| self.words_of(page));
        let mut references = vec![0; self.references.len()];
        for page in 0..self.file.header.pages {
            assert_eq!(
                self.is_under_way(page),
                self.tickets.contains_key(&page),
                "a request for page {page}"
            );
            let Some(at) = self.find(page) else { continue };
            let holder = &self.places.holders[at as usize];
            if holder.counted {
                let Layout { parent, first_child, children, .. } = holder.layout;
                let parent = Some(parent).filter(|&parent| parent != NONE);
                for around in parent.into_iter().chain(first_child..first_child + children) {
                    references[around as usize] += 1;
                }
            }
            if !self.places.is_complete() {
                let in_use = self.usage[page as usize] > 0;
                assert_eq!(holder.counted, in_use, "page {page}: whether those around count it as in use");
                assert_eq!(
                    self.places.lists.class(at).is_none(),
                    page < self.kept,
                    "page {page} is in a list"
                );
            }
        }
        if !self.places.is_complete() {
            assert_eq!(self.references, references, "reference counts");
        }
    }
}
