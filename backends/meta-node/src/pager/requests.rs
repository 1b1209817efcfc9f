//! Asking for pages: those that may be needed, and urgently those that are missing; and whose place they take.

use vertex_tree::{NONE, Prefetch};

use super::{AHEAD, Holder, IDLE, MOST_GIVEN_UP, PENDING, Pager, Switch};
use crate::lists::Class;
use crate::page::Child;
use crate::settings::InUse;
use crate::waiting::Command;

impl Pager {
    /// Asks for every page for which there is room.
    pub fn load_all(&mut self) {
        for page in 0..self.file.header.pages {
            if self.table[page as usize] == NONE && !self.rests(page) {
                if !self.make_room(page, Self::give_free) {
                    break;
                }
                self.ask(page, false);
            }
        }
        self.post();
    }

    /// Takes back a page that has been asked for, with something not urgent if there is a choice. Says whether there was
    /// one.
    pub(super) fn withdraw(&mut self, even_urgent: bool) -> bool {
        let at = self.outbox.iter().rposition(|command| even_urgent || !command.urgent);
        let command = at.map(|at| self.outbox.remove(at)).or_else(|| self.store.take_back(even_urgent));
        command.inspect(|command| self.release(command)).is_some()
    }

    /// A command that has been taken back, or has failed, gives its place holder up.
    pub(super) fn release(&mut self, command: &Command) {
        let words = self.place_words(command.words.len());
        self.table[command.page as usize] = NONE;
        self.news.push(command.page);
        self.taken -= words;
        self.under_way -= words;
        self.holders[command.holder as usize].page = NONE;
        self.empty.push(command.holder);
        self.promoted.retain(|&page| page != command.page);
    }

    /// A node has been unfolded: the pages to which the nodes below it lead may be needed next.
    #[inline(always)]
    pub fn look_ahead(&mut self, holder: u32, slot: u32) {
        if self.how == Prefetch::Paper && !self.is_printed() && !self.is_complete() {
            self.look_below(holder, slot);
        }
    }

    pub(super) fn look_below(&mut self, holder: u32, slot: u32) {
        // In preorder the first levels below a node are not next to each other: a stack, of at most one entry a level.
        let mut stack = [(slot, 1); AHEAD + 1];
        let mut len = 1;
        while len > 0 {
            len -= 1;
            let (slot, level) = stack[len];
            for child in self.page(holder).node(slot).children() {
                match child {
                    Child::Slot(below) if level < AHEAD => {
                        stack[len] = (below, level + 1);
                        len += 1;
                    }
                    Child::Slot(_) | Child::Leaf => {}
                    Child::Link(link) => {
                        let page = self.page(holder).link(link).node.0 >> self.file.header.slot_bits;
                        self.prefetch(page);
                    }
                }
            }
        }
    }

    /// The first place holder of a list, if it may be taken: not if it has been touched in this frame, or has come in
    /// answer to an urgent request at its start. The paper knows no such grace.
    pub(super) fn takeable(&self, class: Class, before: u64) -> Option<u32> {
        let is_free = |&holder: &u32| {
            let has_grace = !self.is_printed() && self.holders[holder as usize].touched >= before;
            holder != self.guarded && !has_grace
        };
        self.lists.front(class).filter(is_free)
    }

    /// The place holder that has not been touched for longest, and not since a frame. One that has come ahead of time counts as never touched.
    pub(super) fn oldest(&self, before: u64) -> Option<u32> {
        let fronts = [Class::Free, Class::Prefetched, Class::InUse].map(|class| self.takeable(class, before));
        fronts.into_iter().flatten().min_by_key(|&holder| self.holders[holder as usize].touched)
    }

    /// Makes room for a page, by what `give` drops each time. Says whether there is enough.
    pub(super) fn make_room(&mut self, page: u32, mut give: impl FnMut(&mut Self) -> bool) -> bool {
        let words = self.place_words(self.file.page_words(page));
        while self.taken + words > self.allowed {
            if !give(self) {
                return false;
            }
        }
        true
    }

    pub(super) fn evict_one(&mut self, holder: Option<u32>) -> bool {
        holder.inspect(|&holder| self.evict(holder)).is_some()
    }

    pub(super) fn give_free(&mut self) -> bool {
        self.evict_one(self.takeable(Class::Free, self.frame))
    }

    /// The paper's prefetching: asks for a page that is likely to be needed, if there is room for it.
    pub(super) fn prefetch(&mut self, page: u32) {
        if self.how != Prefetch::Paper || self.table[page as usize] != NONE {
            return;
        }
        let has_room = !self.rests(page)
            && match self.in_use {
                InUse::Stays | InUse::Printed => self.make_room(page, Self::give_free),
                InUse::Yields => {
                    let before = self.frame.saturating_sub(IDLE).max(1);
                    self.make_room(page, |pager| pager.evict_one(pager.oldest(before)))
                }
            };
        if has_room {
            self.ask(page, false);
        } else {
            self.give_up(page);
        }
    }

    /// Asks again for what has been given up, as long as there is room.
    pub(super) fn try_again(&mut self) {
        for _ in 0..self.given_up.len() {
            if self.room_for_largest() == 0 && self.takeable(Class::Free, self.frame).is_none() {
                break;
            }
            let Some(page) = self.given_up.pop_front() else { break };
            if self.usage[page as usize] > 0 || self.references[page as usize] > 0 {
                self.prefetch(page);
            }
        }
    }

    /// Leaves a page for later. In the paper it is left until something refers to it anew.
    pub(super) fn give_up(&mut self, page: u32) {
        if self.is_printed() {
            return;
        }
        if self.given_up.len() == MOST_GIVEN_UP {
            self.given_up.pop_front();
        }
        self.given_up.push_back(page);
    }

    /// Asks for a page that is missing at a change.
    pub fn urge(&mut self, page: u32, switch: Switch) {
        match self.table[page as usize] {
            NONE => {}
            pending if pending & PENDING != 0 => {
                let holder = &mut self.holders[(pending & !PENDING) as usize];
                if !std::mem::replace(&mut holder.demanded, true) {
                    match self.outbox.iter_mut().find(|command| command.page == page) {
                        Some(command) => command.urgent = true,
                        None => self.promoted.push(page),
                    }
                }
                return;
            }
            _ => return,
        }
        if self.rests(page) {
            return;
        }
        if self.may_switch(switch) && self.make_room(page, |pager| pager.give_way(switch)) {
            self.ask(page, true);
        } else {
            self.stats.no_room += 1;
        }
    }

    /// No change waits any more for a page that is under way. If it has not been started, it is not urgent any more, and
    /// without anything that fetches pages ahead it is not read.
    pub fn demote(&mut self, page: u32) {
        let holder = self.table[page as usize];
        if holder == NONE || holder & PENDING == 0 {
            return;
        }
        let Some(mut command) = self.store.take_back_urgent(page) else { return };
        if self.how == Prefetch::None {
            return self.release(&command);
        }
        self.holders[(holder & !PENDING) as usize].demanded = false;
        command.urgent = false;
        self.outbox.push(command);
    }

    /// For how many of the largest pages there is room without dropping any.
    pub(super) fn room_for_largest(&self) -> u64 {
        self.allowed.saturating_sub(self.taken) / u64::from(self.file.header.largest_words).max(1)
    }

    /// The three-free rule.
    fn may_switch(&self, switch: Switch) -> bool {
        let not_in_use = [Class::Free, Class::Prefetched, Class::Foreseen];
        let not_in_use = not_in_use.map(|class| u64::from(self.lists.len(class))).iter().sum::<u64>();
        switch == Switch::Up || self.in_use == InUse::Yields || not_in_use + self.room_for_largest() >= 3
    }

    /// What makes room first: a page that nobody needs, as far as is known.
    pub(super) fn unused(&self) -> Option<u32> {
        match self.in_use {
            InUse::Yields => self.oldest(self.frame),
            InUse::Stays | InUse::Printed => [Class::Free, Class::Prefetched]
                .into_iter()
                .find_map(|class| self.takeable(class, self.frame)),
        }
    }

    /// Makes room for an urgent request. What is needed now goes before all that is foreseen.
    fn give_way(&mut self, switch: Switch) -> bool {
        if self.evict_one(self.unused()) || self.withdraw(false) {
            return true;
        }
        if self.is_printed() {
            return false;
        }
        let farthest = self.farthest(self.frame, 0);
        let is_up = switch == Switch::Up;
        self.evict_one(farthest.or_else(|| self.takeable(Class::InUse, self.frame).filter(|_| is_up)))
    }

    /// Whether a page has failed so recently that it is left alone for now.
    pub(super) fn rests(&self, page: u32) -> bool {
        !self.failures.is_empty()
            && self.failures.get(&page).is_some_and(|failure| failure.until > self.frame)
    }

    /// Asks for a page for which there is room.
    pub(super) fn ask(&mut self, page: u32, urgent: bool) {
        let words: Box<[u32]> = vec![0; self.file.page_words(page)].into();
        self.taken += self.place_words(words.len());
        self.under_way += self.place_words(words.len());
        let slot = Holder { page, demanded: urgent, ..Holder::default() };
        let holder = match self.empty.pop() {
            Some(holder) => {
                self.holders[holder as usize] = slot;
                holder
            }
            None => {
                self.holders.push(slot);
                self.holders.len() as u32 - 1
            }
        };
        self.table[page as usize] = PENDING | holder;
        self.outbox.push(Command { page, holder, words, urgent, started: 0 });
    }
}
