//! Asking for pages: those that may be needed, and urgently those that are missing; and whose place they take.

use vertex_tree::{NONE, Prefetch};

use super::{AHEAD, IDLE, MOST_GIVEN_UP, PENDING, Pager, Switch};
use crate::lists::Class;
use crate::page::Child;
use crate::settings::InUse;
use crate::waiting::Command;

impl Pager {
    /// Asks for every page for which there is a place.
    pub fn load_all(&mut self) {
        for page in 0..self.file.header.pages {
            if self.table[page as usize] == NONE && !self.rests(page) {
                let Some(holder) = self.takeable(Class::Free, self.frame) else { break };
                self.ask(page, holder, false);
            }
        }
        self.post();
    }

    /// Takes back a place holder that is to be filled, with something not urgent if there is a choice.
    pub(super) fn withdraw(&mut self, even_urgent: bool) -> Option<u32> {
        let at = self.outbox.iter().rposition(|command| even_urgent || !command.urgent);
        let command = at.map(|at| self.outbox.remove(at)).or_else(|| self.store.take_back(even_urgent))?;
        Some(self.release(command))
    }

    /// A command that has been taken back gives its place holder up, which is in no list.
    pub(super) fn release(&mut self, command: Command) -> u32 {
        self.table[command.page as usize] = NONE;
        self.pending -= 1;
        let holder = &mut self.holders[command.holder as usize];
        holder.words = command.words;
        holder.page = NONE;
        holder.touched = 0;
        self.promoted.retain(|&page| page != command.page);
        command.holder
    }

    /// A node has been unfolded: the pages to which the nodes below it lead may be needed next.
    #[inline(always)]
    pub fn look_ahead(&mut self, holder: u32, slot: u32) {
        if self.how == Prefetch::Paper && !self.is_complete() {
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
    /// answer to an urgent request at its start.
    pub(super) fn takeable(&self, class: Class, before: u64) -> Option<u32> {
        let is_free =
            |&holder: &u32| holder != self.guarded && self.holders[holder as usize].touched < before;
        self.lists.front(class).filter(is_free)
    }

    /// The place holder that has not been touched for longest, and not since a frame. Empty ones count as never touched.
    pub(super) fn oldest(&self, before: u64) -> Option<u32> {
        let fronts = [Class::Free, Class::Prefetched, Class::InUse].map(|class| self.takeable(class, before));
        fronts.into_iter().flatten().min_by_key(|&holder| self.holders[holder as usize].touched)
    }

    /// The paper's prefetching: asks for a page that is likely to be needed, if there is a place for it.
    pub(super) fn prefetch(&mut self, page: u32) {
        if self.how != Prefetch::Paper || self.table[page as usize] != NONE {
            return;
        }
        if self.rests(page) {
            return self.give_up(page);
        }
        let place = match self.in_use {
            InUse::Stays => self.takeable(Class::Free, self.frame),
            InUse::Yields => self.oldest(self.frame.saturating_sub(IDLE).max(1)),
        };
        match place {
            Some(holder) => self.ask(page, holder, false),
            None => self.give_up(page),
        }
    }

    /// Asks again for what has been given up, as long as there are free places.
    pub(super) fn try_again(&mut self) {
        for _ in 0..self.given_up.len() {
            if self.takeable(Class::Free, self.frame).is_none() {
                break;
            }
            let Some(page) = self.given_up.pop_front() else { break };
            if self.usage[page as usize] > 0 || self.references[page as usize] > 0 {
                self.prefetch(page);
            }
        }
    }

    pub(super) fn give_up(&mut self, page: u32) {
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
        match self.place(switch) {
            Some(holder) => self.ask(page, holder, true),
            None => self.stats.no_room += 1,
        }
    }

    /// A place for an urgent request.
    pub(super) fn place(&mut self, switch: Switch) -> Option<u32> {
        let stays = self.in_use == InUse::Stays;
        let not_in_use = [Class::Free, Class::Prefetched, Class::Foreseen].map(|class| self.lists.len(class));
        if switch == Switch::Down && stays && not_in_use.iter().sum::<u32>() < 3 {
            return None;
        }
        // What is needed now goes before all that is foreseen.
        if !stays {
            let oldest = self.oldest(self.frame).or_else(|| self.withdraw(false));
            return oldest.or_else(|| self.farthest(self.frame, self.frame));
        }
        let free = self.takeable(Class::Free, self.frame);
        let place =
            free.or_else(|| self.takeable(Class::Prefetched, self.frame)).or_else(|| self.withdraw(false));
        let place = place.or_else(|| self.farthest(self.frame, self.frame));
        place.or_else(|| self.takeable(Class::InUse, self.frame).filter(|_| switch == Switch::Up))
    }

    /// Whether a page has failed so recently that it is left alone for now.
    pub(super) fn rests(&self, page: u32) -> bool {
        !self.failures.is_empty()
            && self.failures.get(&page).is_some_and(|failure| failure.until > self.frame)
    }

    pub(super) fn ask(&mut self, page: u32, holder: u32, urgent: bool) {
        self.evict(holder);
        self.lists.remove(holder);
        let room = self.file.header.largest_words as usize;
        let slot = &mut self.holders[holder as usize];
        slot.page = page;
        (slot.demanded, slot.ahead) = (urgent, false);
        let mut words = std::mem::take(&mut slot.words);
        if words.len() != room {
            words = vec![0; room].into();
        }
        self.table[page as usize] = PENDING | holder;
        self.pending += 1;
        let asked = self.foresight.asked_before(page).unwrap_or(self.frame);
        self.outbox.push(Command { page, holder, words, urgent, asked });
    }
}
