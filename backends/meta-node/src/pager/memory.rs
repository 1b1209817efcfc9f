//! How many place holders there are.

use vertex_tree::NONE;

use super::{Holder, LEAST_HOLDERS, Pager};
use crate::error::MetaNodeError;
use crate::lists::Class;

impl Pager {
    /// Sets how much memory the place holders may take. Less than now takes effect at once.
    pub fn set_page_memory(&mut self, bytes: u64) -> Result<(), MetaNodeError> {
        let each = self.file.holder_bytes();
        // With every page in use, three more are what the three-free rule asks for. Their memory is never taken.
        let most = self.file.header.pages.saturating_add(LEAST_HOLDERS);
        let allowed = u32::try_from(bytes / each).unwrap_or(u32::MAX).min(most);
        if allowed < LEAST_HOLDERS {
            let least = each * u64::from(LEAST_HOLDERS);
            return Err(MetaNodeError::Memory { given: bytes, least, holders: LEAST_HOLDERS });
        }
        if self.is_complete() && allowed < self.file.header.pages {
            self.recount();
        }
        self.allowed = allowed;
        // Roots stay, unless a forest of thousands of trees would leave no room for anything else.
        let roots = self.file.header.root_pages;
        let kept = if roots <= allowed / 2 { roots } else { 0 };
        let before = std::mem::replace(&mut self.kept, kept);
        for page in 0..before.max(kept) {
            self.classify(page);
        }
        while self.live < allowed {
            let holder = self.retired.pop().unwrap_or_else(|| {
                self.holders.push(Holder { page: NONE, ..Holder::default() });
                self.holders.len() as u32 - 1
            });
            self.lists.push_front(holder, Class::Free);
            self.live += 1;
        }
        self.shrink();
        Ok(())
    }

    /// Gives place holders up until there are no more than allowed.
    pub(super) fn shrink(&mut self) {
        while self.live > self.allowed {
            let lists = &self.lists;
            let victim = Class::ALL.into_iter().find_map(|class| lists.front(class));
            let holder = match victim {
                Some(holder) => {
                    self.evict(holder);
                    holder
                }
                None => match self.withdraw(true) {
                    Some(holder) => holder,
                    // What has come meanwhile can go too. Then one at most is being read, and with the roots that are
                    // kept that is no more than is allowed. On virtual time it may be more: those end first.
                    None if self.take_arrivals() => {
                        self.arrived_between = true;
                        continue;
                    }
                    None => return,
                },
            };
            self.lists.remove(holder);
            self.holders[holder as usize].words = Box::default();
            self.retired.push(holder);
            self.live -= 1;
        }
    }
}
