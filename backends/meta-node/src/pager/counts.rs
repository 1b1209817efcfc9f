//! Usage and reference counts, and the lists that follow from them.

use vertex_tree::NONE;

use super::{Holder, Pager};
use crate::lists::Class;
use crate::page::Layout;
use crate::settings::InUse;

impl Pager {
    /// Whether every page is in memory. Then nothing is asked for and nothing evicted until less memory is allowed, and
    /// neither lists nor reference counts are kept: see [`recount`](Self::recount).
    #[inline(always)]
    pub(super) fn is_complete(&self) -> bool {
        self.resident == self.file.header.pages
    }

    /// Makes reference counts and lists what the usage counts ask for.
    pub(super) fn recount(&mut self) {
        self.references.fill(0);
        self.holders.iter_mut().for_each(|holder| holder.counted = false);
        for page in 0..self.file.header.pages {
            self.classify(page);
        }
        for page in 0..self.file.header.pages {
            if self.usage[page as usize] > 0
                && let Some(holder) = self.find(page)
            {
                self.count_around(holder, true);
            }
        }
    }

    /// A change has been made on a page: what is around it may be needed soon.
    #[inline(always)]
    pub fn touch(&mut self, holder: u32) {
        let Holder { touched, ahead, .. } = self.holders[holder as usize];
        if ahead || !self.is_complete() && touched != self.frame {
            self.touch_first(holder);
        }
    }

    pub(super) fn touch_first(&mut self, holder: u32) {
        let slot = &mut self.holders[holder as usize];
        slot.touched = self.frame;
        if std::mem::take(&mut slot.ahead) {
            self.stats.ahead_used += 1;
        }
        // In the paper a page is what its counts make of it.
        if self.is_printed() {
            return;
        }
        self.classify(self.holders[holder as usize].page);
        if let Some(class) = self.lists.class(holder) {
            self.lists.push(holder, class);
        }
        let parent = self.holders[holder as usize].layout.parent;
        if parent != NONE {
            self.prefetch(parent);
        }
    }

    /// Nodes of the front have come to a page or left it.
    #[inline(always)]
    pub fn count_usage(&mut self, page: u32, by: i32) {
        let before = self.usage[page as usize];
        // A count never exceeds the children of the nodes on a page.
        let now = (i32::from(before) + by) as u16;
        self.usage[page as usize] = now;
        if (before == 0) != (now == 0) && !self.is_complete() {
            self.switch_usage(page, now > 0);
        }
    }

    pub(super) fn switch_usage(&mut self, page: u32, in_use: bool) {
        self.classify(page);
        match self.find(page) {
            Some(holder) => self.count_around(holder, in_use),
            None if in_use => self.prefetch(page),
            None => {}
        }
    }

    /// Tells the pages around one that is in memory whether it is in use.
    pub(super) fn count_around(&mut self, holder: u32, in_use: bool) {
        let Holder { counted, layout, .. } = &mut self.holders[holder as usize];
        if std::mem::replace(counted, in_use) == in_use {
            return;
        }
        let Layout { parent, first_child, children, .. } = *layout;
        let guarded = self.guarded;
        if in_use {
            self.guarded = holder;
        }
        let parent = Some(parent).filter(|&parent| parent != NONE);
        for page in parent.into_iter().chain(first_child..first_child + children) {
            let count = &mut self.references[page as usize];
            *count = if in_use { *count + 1 } else { count.saturating_sub(1) };
            let is_first = *count == u16::from(in_use);
            if is_first {
                self.classify(page);
            }
            // In the paper every reference to a page that is not there asks for it.
            if in_use && (is_first || self.is_printed()) {
                self.prefetch(page);
            }
        }
        self.guarded = guarded;
    }

    /// Puts a page's place holder into the list where it belongs.
    pub(super) fn classify(&mut self, page: u32) {
        let Some(holder) = self.find(page) else { return };
        if page < self.kept {
            self.lists.remove(holder);
            return;
        }
        let untouched = self.holders[holder as usize].touched == 0;
        let stays = self.in_use != InUse::Yields && self.usage[page as usize] > 0;
        let class = match (self.usage[page as usize], self.references[page as usize]) {
            _ if !stays && self.foresight.is_foreseen(page) => Class::Foreseen,
            (0, 0) => Class::Free,
            // Where pages yield, what has been of no use yet goes first.
            _ if self.in_use == InUse::Yields => {
                if untouched {
                    Class::Prefetched
                } else {
                    Class::InUse
                }
            }
            (0, _) => Class::Prefetched,
            _ => Class::InUse,
        };
        if self.lists.class(holder) != Some(class) {
            self.lists.push(holder, class);
        }
    }
}
