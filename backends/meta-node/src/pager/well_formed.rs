//! Whether the place holders, their lists and the counts are what they should be.

use vertex_tree::NONE;

use super::{PENDING, Pager};
use crate::page::Layout;

impl Pager {
    /// Checks that the table and the place holders name each other, what memory is taken, and, while not every page is in
    /// memory, that reference counts and lists are what the usage counts ask for.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        let (mut resident, mut waiting, mut words) = (0, 0, self.under_way);
        let mut references = vec![0; self.table.len()];
        for (page, &place) in (0..).zip(&self.table).filter(|&(_, &place)| place != NONE) {
            let holder = &self.holders[(place & !PENDING) as usize];
            assert_eq!(holder.page, page, "the page of place holder {}", place & !PENDING);
            if place & PENDING != 0 {
                waiting += 1;
                assert_eq!(self.lists.class(place & !PENDING), None, "page {page} is on its way");
                continue;
            }
            resident += 1;
            words += self.place_words(holder.words.len());
            if holder.counted {
                let Layout { parent, first_child, children, .. } = holder.layout;
                let parent = Some(parent).filter(|&parent| parent != NONE);
                for around in parent.into_iter().chain(first_child..first_child + children) {
                    references[around as usize] += 1;
                }
            }
            if !self.is_complete() {
                let in_use = self.usage[page as usize] > 0;
                assert_eq!(holder.counted, in_use, "page {page}: whether those around count it as in use");
                assert_eq!(self.lists.class(place).is_none(), page < self.kept, "page {page} is in a list");
            }
        }
        assert_eq!(resident, self.resident, "pages in memory");
        assert_eq!(words, self.taken, "words in place holders");
        let used = resident as usize + waiting + self.empty.len();
        assert_eq!(used, self.holders.len(), "place holders");
        if !self.is_complete() {
            assert_eq!(self.references, references, "reference counts");
        }
    }
}
