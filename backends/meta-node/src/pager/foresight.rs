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

use super::place_holders::PlaceHolders;
use crate::lists::Class;

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
            farthest: Vec::new(),
            is_sorted: false,
        }
    }

    /// Whether anything is ever foreseen.
    pub fn is_used(&self) -> bool {
        !self.due.is_empty()
    }

    pub fn begin_frame(&mut self) {
        // Left over from a frame that ended in an error: whatever is named again would be there twice.
        self.named.clear();
        self.is_sorted = false;
    }

    #[inline]
    pub fn is_foreseen(&self, page: u32) -> bool {
        self.due.get(page as usize).is_some_and(|due| due.said >= self.since)
    }

    /// When the earliest change on a page is expected.
    pub fn due(&self, page: u32) -> u32 {
        self.due[page as usize].at
    }

    /// A change on a page is expected in so many frames.
    #[inline]
    pub fn foresee(&mut self, page: u32, now: u64, frames: u32) {
        let now = now as u32;
        let Some(due) = self.due.get_mut(page as usize) else { return };
        let at = now.saturating_add(frames);
        if due.said != now {
            *due = Due { said: now, at };
            self.named.push(page);
        } else if at < due.at {
            due.at = at;
        }
    }

    /// A frame ends: what was named in it is what is foreseen. Returns what was, and what is.
    pub fn end_frame(&mut self, now: u64) -> [Vec<u32>; 2] {
        self.since = now as u32;
        self.is_sorted = false;
        [std::mem::take(&mut self.before), std::mem::take(&mut self.named)]
    }

    /// Keeps what [`end_frame`](Self::end_frame) has returned for the next one.
    pub fn keep(&mut self, [mut before, named]: [Vec<u32>; 2]) {
        before.clear();
        (self.before, self.named) = (named, before);
    }

    /// Of the place holders whose pages are foreseen, the one that is needed last, if that is after a frame; not one that
    /// has been touched since another.
    pub fn farthest(&mut self, places: &PlaceHolders, before: u64, after: u64) -> Option<u32> {
        if !self.is_used() {
            return None;
        }
        let PlaceHolders { lists, holders, guarded, .. } = places;
        if !std::mem::replace(&mut self.is_sorted, true) {
            let due = |holder: u32| self.due[holders[holder as usize].page as usize].at;
            self.farthest.clear();
            self.farthest.extend(lists.iter(Class::Foreseen).map(|holder| (due(holder), holder)));
            self.farthest.sort_unstable();
        }
        while let Some(&(due, holder)) = self.farthest.last() {
            if u64::from(due) <= after {
                return None;
            }
            self.farthest.pop();
            let is_still = lists.class(holder) == Some(Class::Foreseen);
            if is_still && holder != *guarded && holders[holder as usize].touched < before {
                return Some(holder);
            }
        }
        None
    }
}
