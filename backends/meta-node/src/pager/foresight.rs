//! Prefetching by the schedule: which pages the engine expects to need, and when.
//!
//! At the end of each frame the engine names nodes that are about to change, each with the number of frames until then.
//! For a page the earliest counts. What is not there is asked for in that order, behind all that a refused change has
//! asked for already; requests that wait are taken back and put in order anew in every frame, so that what nobody names
//! any more is not read.
//!
//! Room is made by what is needed last: pages that nobody has named, the least recently used first, and then the ones
//! that are needed farthest in the future, as long as that is farther than what they make room for (Belady 1966, as far as
//! the future is known). So of two pages that compete for a place the nearer one always wins, and there is no loading in
//! turns.

use vertex_tree::{LookAhead, NONE};

use super::Pager;
use crate::lists::Class;
use crate::waiting::Command;

/// Look this far ahead at least.
const LEAST_AHEAD: u32 = 2;
/// At least where memory is full. What is let go of has to come again, and where a car turns in a large city, more pages are
/// needed in a frame than a store can read in one: they are fetched in the time before.
const LEAST_AHEAD_FULL: u32 = 4;

/// What is known of a page that some change is expected on.
#[derive(Clone, Copy, Debug, Default)]
struct Due {
    /// The frame at whose end this was said; 0 for never.
    said: u32,
    /// The frame of the earliest change.
    at: u32,
}

/// What is foreseen.
#[derive(Debug)]
pub(super) struct Foresight {
    /// By page; empty where the schedule is not used.
    due: Vec<Due>,
    /// The pages named at the end of this frame, and those named at the end of the one before.
    named: Vec<u32>,
    before: Vec<u32>,
    /// What was said at the end of this frame or later holds.
    since: u32,
    /// What is known of the store.
    store: LookAhead,
    /// Pages that are needed and not there, with when; and commands that have been taken back, by page.
    missing: Vec<(u32, u32)>,
    taken_back: Vec<Command>,
    /// Place holders whose pages are foreseen, the farthest last; whether that is so in this frame.
    farthest: Vec<(u32, u32)>,
    is_sorted: bool,
}

impl Foresight {
    pub fn new(pages: usize) -> Self {
        Self {
            due: vec![Due::default(); pages],
            named: Vec::new(),
            before: Vec::new(),
            since: 1,
            store: LookAhead::default(),
            missing: Vec::new(),
            taken_back: Vec::new(),
            farthest: Vec::new(),
            is_sorted: false,
        }
    }

    /// A frame begins in which so many pages have come, and so many commands still wait.
    pub fn next_frame(&mut self, came: usize, waiting: usize) {
        self.is_sorted = false;
        self.store.begin_frame(came, waiting);
    }

    /// A page has come so many frames after reading it began.
    pub fn arrived(&mut self, frames: u64) {
        self.store.arrived(frames);
    }

    #[inline]
    pub fn is_foreseen(&self, page: u32) -> bool {
        self.due.get(page as usize).is_some_and(|due| due.said >= self.since)
    }
}

impl Pager {
    /// How many frames ahead it is worth to know what is needed.
    pub fn frames_ahead(&self) -> u32 {
        if self.foresight.due.is_empty() || self.is_complete() {
            return 0;
        }
        let least = if self.room_for_largest() == 0 { LEAST_AHEAD_FULL } else { LEAST_AHEAD };
        let [missed, _] = self.store.waiting();
        let missed = missed + self.outbox.iter().filter(|command| command.urgent).count();
        self.foresight.store.frames(missed, least)
    }

    /// A change on a page is expected in so many frames.
    #[inline]
    pub fn foresee(&mut self, page: u32, frames: u32) {
        let (now, foresight) = (self.frame as u32, &mut self.foresight);
        let Some(due) = foresight.due.get_mut(page as usize) else { return };
        let at = now.saturating_add(frames);
        if due.said != now {
            *due = Due { said: now, at };
            foresight.named.push(page);
        } else if at < due.at {
            due.at = at;
        }
    }

    /// Puts the requests that wait in order anew, and adds what is foreseen and missing.
    pub(super) fn plan(&mut self) {
        let foresight = &mut self.foresight;
        foresight.since = self.frame as u32;
        foresight.is_sorted = false;
        std::mem::swap(&mut foresight.named, &mut foresight.before);
        // What was named before is in `named` now.
        for at in 0..self.foresight.named.len() {
            let page = self.foresight.named[at];
            if !self.foresight.is_foreseen(page) {
                self.classify(page);
            }
        }
        self.foresight.named.clear();
        self.take_back_ahead();

        let mut missing = std::mem::take(&mut self.foresight.missing);
        missing.clear();
        for at in 0..self.foresight.before.len() {
            let page = self.foresight.before[at];
            match self.table[page as usize] {
                NONE => missing.push((self.foresight.due[page as usize].at, page)),
                _ => self.classify(page),
            }
        }
        missing.sort_unstable();
        // Room for what is needed now must be left, however much is under way.
        let most = self.allowed / 2;
        for &(due, page) in &missing {
            if self.rests(page) {
                continue;
            }
            let is_full = self.under_way + self.file.page_words(page) as u64 > most;
            if is_full || !self.make_room(page, |pager| pager.give_place(due)) {
                break;
            }
            self.ask(page, false);
        }
        self.foresight.missing = missing;
    }

    /// Takes back the requests that wait and that no change has asked for.
    fn take_back_ahead(&mut self) {
        let mut commands = std::mem::take(&mut self.foresight.taken_back);
        // Urgency that has not been posted yet is: then what is taken back is not urgent.
        self.post();
        self.store.take_back_ahead(&mut commands);
        for command in commands.drain(..) {
            self.release(&command);
        }
        self.foresight.taken_back = commands;
    }

    /// Makes room for a page that is needed in a frame to come.
    fn give_place(&mut self, due: u32) -> bool {
        let victim = self.unused().or_else(|| self.farthest(self.frame, u64::from(due)));
        self.evict_one(victim)
    }

    /// Of the place holders whose pages are foreseen, the one that is needed last, if that is after a frame; not one that
    /// has been touched since another.
    pub(super) fn farthest(&mut self, before: u64, after: u64) -> Option<u32> {
        if self.foresight.due.is_empty() {
            return None;
        }
        let Self { foresight, lists, holders, .. } = self;
        if !std::mem::replace(&mut foresight.is_sorted, true) {
            let due = |holder: u32| foresight.due[holders[holder as usize].page as usize].at;
            foresight.farthest.clear();
            foresight.farthest.extend(lists.iter(Class::Foreseen).map(|holder| (due(holder), holder)));
            foresight.farthest.sort_unstable();
        }
        while let Some(&(due, holder)) = foresight.farthest.last() {
            if u64::from(due) <= after {
                return None;
            }
            foresight.farthest.pop();
            let is_still = lists.class(holder) == Some(Class::Foreseen);
            if is_still && holder != self.guarded && holders[holder as usize].touched < before {
                return Some(holder);
            }
        }
        None
    }
}
