//! How much memory place holders may take.

use super::{LEAST_HOLDERS, Pager};
use crate::error::MetaNodeError;
use crate::lists::Class;
use crate::settings::InUse;

impl Pager {
    /// Sets how much memory the place holders may take. Less than now takes effect at once.
    pub fn set_page_memory(&mut self, bytes: u64) -> Result<(), MetaNodeError> {
        let largest = self.file.holder_bytes();
        if bytes < largest * u64::from(LEAST_HOLDERS) {
            let least = largest * u64::from(LEAST_HOLDERS);
            return Err(MetaNodeError::Memory { given: bytes, least, holders: LEAST_HOLDERS });
        }
        // Room for three that are not in use, even where all are.
        let all = match self.in_use {
            InUse::Printed => largest.saturating_mul(self.file.header.pages.into()),
            InUse::Yields | InUse::Stays => self.file.header.page_bytes,
        };
        let most = all.saturating_add(largest * u64::from(LEAST_HOLDERS));
        let allowed = bytes.min(most) / 4;
        if self.is_complete() && allowed < self.taken {
            self.recount();
        }
        self.allowed = allowed;
        // Roots stay, unless a forest of thousands of trees would leave no room for anything else.
        let roots = self.file.header.root_pages;
        let words = (0..roots).map(|page| self.file.page_words(page) as u64).sum::<u64>();
        let kept = if words <= allowed / 2 && !self.is_printed() { roots } else { 0 };
        let before = std::mem::replace(&mut self.kept, kept);
        for page in 0..before.max(kept) {
            self.classify(page);
        }
        self.shrink();
        Ok(())
    }

    /// Gives place holders up until they take no more than allowed.
    pub(super) fn shrink(&mut self) {
        while self.taken > self.allowed {
            let lists = &self.lists;
            if let Some(victim) = Class::ALL.into_iter().find_map(|class| lists.front(class)) {
                self.evict(victim);
            } else if self.withdraw(true) {
            } else if self.take_arrivals() > 0 {
                // What has come meanwhile can go too. Then one at most is being read, and with the roots that are kept
                // that is no more than is allowed. On virtual time it may be more: those end first.
            } else {
                return;
            }
        }
    }
}
