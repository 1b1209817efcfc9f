//! Main-memory buffer management: El-Sana & Chiang (2000), section 3.3.3, and the urgent requests of section 3.3.2.
//!
//! A page in memory lies in a place holder. A table says for each page where it is, if it is anywhere: the paper's hash
//! table, whose hash function is the identity here. A page has two counts, kept whether it is in memory or not: its *usage
//! count*, the nodes and leaves of the front on it, and its *reference count*, how many of the pages above and below it are
//! in use. A page whose counts are both 0 is flushed: its place holder joins the free list at the end, and keeps the page
//! until the room is needed, first in, first out (its *second chance*). A count that rises above 0 asks for the page; where
//! there is no room, that is given up for now, and tried again when there is.
//!
//! A page that is missing at a change is asked for *urgently*: room is made by those of the free list, or by a page that is
//! only referred to. Switching down is allowed that only while three place holders are not in use, so that switching
//! up always finds one; those on their way are reserved and do not count.
//!
//! # Beyond the paper
//!
//! The paper has K place holders of the size of the largest page, since pages do not differ much. Ours are filled to 70 %
//! on average, so that memory for a quarter of the file would hold 17 % of the pages. Here a place holder is as large as
//! its page; what is limited is the sum, which counts what is on its way too. Where the paper counts free place holders,
//! room for so many of the largest is meant.
//!
//! The paper's navigation reads the nodes of the front in every frame, so that their pages must stay. Ours does not: the
//! engine keeps sphere and error of the front itself, and a page is touched only by a change. So with
//! [`InUse::Yields`], the default and what `--prefetch paper` means, what has been prefetched and not touched yet makes room
//! first, then what has not been
//! touched for longest, whatever its counts, for switching down too; and every cut can be reached with any number of
//! place holders from four on. With [`InUse::Stays`] free
//! places go first, then those of pages that are only referred to, the three-free rule holds as printed, and a front that
//! needs more pages than there are is coarser.
//!
//! # As printed
//!
//! [`InUse::Printed`] is the paper's section 3.3 to the letter, for comparison. Beyond what stays in use staying:
//!
//! * K place holders, each of the size of the largest page: memory for a quarter of the file holds fewer than a quarter of the pages.
//! * Root pages are pages like others: they stay while they are in use or referred to.
//! * What is prefetched are the pages above and below those in use, and nothing else. It takes the first place of the free
//!   list. Where there is none it is given up: only another reference, or an urgent request, asks again.
//! * An urgent request takes the first of the free list, or else the first that is only prefetched, whether
//!   or not that has just come; pages in use never make room, for switching up neither, since one that is not in use is always left.
//! * A switch down to a page takes that page: a node with children on other pages is unfolded only when these are there. The
//!   request for them is urgent.
//!
//! What remains different, and can not be told from outside: a place holder is reserved when a page is asked for,
//! not when I/O comes to it, so an urgent request may take back one that waits; and counts are kept for pages that are not in memory,
//! where the paper lets them be.
//!
//! # Liveness
//!
//! But for the printed rules, a page that is asked for urgently is not evicted before the end of the frame at whose start it came, nor is one that
//! has been touched in the frame. So each urgent read leads to a change at least, and a camera at rest gets its cut.
//!
//! A node can unfold before the page of its children is there, since links carry their spheres; so what is asked for is
//! not only what the front has come to, but also the pages to which the next levels below it lead.
//!
//! # Navigation and I/O
//!
//! In the paper place holders, hash table, free list and command board (section 3.3.4) are shared by two threads under two locks, and much care
//! goes into not reusing a place holder that is being navigated. Here all of them belong to navigation; the store has its own memory to read
//! into, and a page's words move into its place holder when it has come. A page that contradicts those around it counts as one that could not be read.

mod foresight;
mod place_holders;
#[cfg(test)]
mod tests;
mod well_formed;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use container::FileError;
use page_store::{Arrival, Failures, NOW, Requests, Ticket};
use rustc_hash::FxHashMap;
use vertex_tree::{NONE, PageStats, Prefetch, TreeError, prefetch};

use self::foresight::Foresight;
use self::place_holders::{Holder, PlaceHolders};
use crate::check::{check_between, check_roots};
use crate::error::MetaNodeError;
use crate::file::{LEAST_HOLDERS, MetaNodeFile};
use crate::lists::Class;
use crate::page::{Child, Layout, Page};
use crate::settings::{InUse, Settings};
use crate::stored::{Content, Stored};

/// Frames without a touch after which a page may make room for one that is only likely to be needed: a minute. What has
/// once been needed is far more likely to be needed again: along a drone's path over the dragon, with a quarter of the
/// pages in memory, 0.8 % of the changes missed their page without any prefetching, 7 % where prefetched pages displaced
/// those left alone for 5 seconds and 12 % for 8 frames.
const IDLE: u64 = 3600;

/// Levels below a node that has been unfolded in which links to other pages are followed.
const AHEAD: usize = 3;

/// The longest that a page that could not be read is left alone, in frames.
const LONGEST_REST: u64 = 64;

/// Pages that were given up for want of a place and are tried again later; beyond so many, the oldest are forgotten.
const MOST_GIVEN_UP: usize = 4096;

/// The urgency of what no change has been refused for.
const LATER: u64 = NOW + 1;

/// Look this far ahead at least.
const LEAST_AHEAD: u32 = 2;
/// At least where memory is full. What is let go of has to come again, and where a car turns in a large city, more pages are
/// needed in a frame than a store can read in one: they are fetched in the time before.
const LEAST_AHEAD_FULL: u32 = 4;

/// Which way a change goes that finds its page missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Switch {
    Down,
    Up,
}

pub(crate) struct Pager {
    pub file: Arc<MetaNodeFile>,
    requests: Requests<Stored>,
    /// The requests for the pages that are on their way.
    tickets: FxHashMap<u32, Ticket>,
    in_use: InUse,
    how: Prefetch,
    places: PlaceHolders,
    usage: Vec<u16>,
    references: Vec<u16>,
    foresight: Foresight,
    frame: u64,
    /// Pages below this number are never evicted.
    kept: u32,
    given_up: VecDeque<u32>,
    failures: Failures<u32>,
    /// Pages whose requests have come to an end since the frame began, or between two: they have come, could not be read, or
    /// have been taken back.
    pub news: Vec<u32>,
    stats: PageStats,
    fault: Option<TreeError>,
    /// Kept for their allocations.
    arrivals: Vec<Arrival<Stored>>,
    withdrawn: Vec<u32>,
    missing: Vec<(u32, u32)>,
}

impl Pager {
    pub fn new(file: Arc<MetaNodeFile>, settings: &Settings) -> Result<Self, MetaNodeError> {
        let pages = file.header.pages as usize;
        let how = match settings.in_use {
            InUse::Printed => Prefetch::Paper,
            InUse::Yields | InUse::Stays => settings.prefetch,
        };
        let mut pager = Self {
            requests: Stored::requests(file.clone(), settings.io)?,
            tickets: FxHashMap::default(),
            in_use: settings.in_use,
            how,
            // The paper knows no grace.
            places: PlaceHolders::new(pages, settings.in_use != InUse::Printed),
            usage: vec![0; pages],
            references: vec![0; pages],
            foresight: Foresight::new(if how == Prefetch::Schedule { pages } else { 0 }),
            frame: 1,
            kept: 0,
            given_up: VecDeque::new(),
            failures: Failures::new(LONGEST_REST),
            news: Vec::new(),
            stats: PageStats::default(),
            fault: None,
            arrivals: Vec::new(),
            withdrawn: Vec::new(),
            missing: Vec::new(),
            file,
        };
        pager.set_page_memory(settings.page_memory)?;
        Ok(pager)
    }

    /// Whether all is as in the paper.
    #[inline(always)]
    pub fn is_printed(&self) -> bool {
        self.in_use == InUse::Printed
    }

    /// Words of the place holder of a page.
    fn words_of(&self, page: u32) -> u64 {
        if self.is_printed() {
            self.file.header.largest_words.into()
        } else {
            self.file.page_words(page) as u64
        }
    }

    /// Where a page is, if it is in memory.
    #[inline(always)]
    pub fn find(&self, page: u32) -> Option<u32> {
        self.places.find(page)
    }

    /// Whether a page has been asked for and has not come yet.
    pub fn is_under_way(&self, page: u32) -> bool {
        self.places.is_under_way(page)
    }

    #[inline(always)]
    pub fn page(&self, holder: u32) -> Page<'_> {
        self.places.page(holder)
    }

    /// Starts to read where a page is into the cache.
    #[inline(always)]
    pub fn prefetch_table(&self, page: u32) {
        self.places.prefetch_table(page);
        prefetch(&self.usage, page as usize);
    }

    /// Starts to read what is known of a place holder into the cache.
    #[inline(always)]
    pub fn prefetch_holder(&self, holder: u32) {
        prefetch(&self.places.holders, holder as usize);
    }

    /// The first fault since the last call.
    pub fn take_fault(&mut self) -> Option<TreeError> {
        self.fault.take()
    }

    // Frames.

    /// Starts a frame: takes what has arrived.
    pub fn begin_frame(&mut self) {
        self.frame += 1;
        self.foresight.begin_frame();
        let mut arrivals = std::mem::take(&mut self.arrivals);
        self.requests.begin_frame(self.frame, &mut arrivals);
        self.take_in(arrivals);
        self.shrink();
    }

    /// Takes what has arrived, and says how much that is.
    fn take_in(&mut self, mut arrivals: Vec<Arrival<Stored>>) -> usize {
        let count = arrivals.len();
        for Arrival { read: page, is_demanded, content } in arrivals.drain(..) {
            match content.and_then(|content| self.check_around(page, &content).map(|()| content)) {
                Ok(content) => self.arrive(page, content, is_demanded),
                Err(fault) => self.fail(page, fault),
            }
        }
        self.arrivals = arrivals;
        count
    }

    /// Whether a page that has come and those around it that are in memory, or the file for its roots, say the same of each other.
    fn check_around(&mut self, page: u32, content: &Content) -> Result<(), MetaNodeError> {
        let came = Page { words: &content.words, layout: &content.layout };
        let Layout { parent, first_child, children, .. } = content.layout;
        let bits = self.file.header.slot_bits;
        let in_memory = |other: u32| self.find(other).map(|holder| (other, self.page(holder)));
        let mut agreed = Ok(());
        if page < self.file.header.root_pages {
            agreed = check_roots(page, came, self.file.roots_of(page), bits);
        } else if let Some(above) = in_memory(parent) {
            agreed = check_between(above, (page, came), bits);
        }
        for below in (first_child..first_child + children).filter_map(in_memory) {
            agreed = agreed.and_then(|()| check_between((page, came), below, bits));
        }
        agreed.map_err(|reason| {
            // It has been read, and is of no use all the same.
            self.stats.faults += 1;
            self.file.damaged(page, reason)
        })
    }

    fn arrive(&mut self, page: u32, content: Content, is_demanded: bool) {
        self.failures.forget(page);
        self.news.push(page);
        self.tickets.remove(&page);
        let Content { words, layout } = content;
        let touched = if is_demanded { self.frame } else { 0 };
        let filled = Holder { words, page, layout, touched, counted: false, ahead: !is_demanded };
        let holder = self.places.fill(page, self.words_of(page), filled);
        self.classify(page);
        if self.usage[page as usize] > 0 {
            self.count_around(holder, true);
        }
    }

    fn fail(&mut self, page: u32, fault: MetaNodeError) {
        self.fault.get_or_insert_with(|| TreeError::Store(fault.into()));
        self.release(page);
        self.failures.failed(page, self.frame);
        if self.how == Prefetch::Paper {
            self.give_up(page);
        }
    }

    /// Ends a frame: asks for what is likely to be needed.
    pub fn end_frame(&mut self) -> PageStats {
        match self.how {
            Prefetch::Paper => self.try_again(),
            Prefetch::Schedule => self.plan(),
            Prefetch::None => {}
        }
        let resident_bytes = 4 * self.places.taken;
        std::mem::take(&mut self.stats)
            + self.requests.take_stats()
            + PageStats { resident_bytes, ..PageStats::default() }
    }

    /// Waits until everything that has been asked for is there, or has failed. Returns how long that took.
    pub fn settle(&mut self) -> Duration {
        self.requests.settle()
    }

    /// Lets time pass on a store that has its own.
    pub fn pass(&mut self, time: Duration) {
        self.requests.pass(time);
    }

    // Usage and reference counts, and the lists that follow from them. While every page is in memory nothing is asked for and
    // nothing evicted until less memory is allowed: then neither lists nor reference counts are kept, see `recount`.

    /// Makes reference counts and lists what the usage counts ask for.
    fn recount(&mut self) {
        self.references.fill(0);
        self.places.holders.iter_mut().for_each(|holder| holder.counted = false);
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
        let Holder { touched, ahead, .. } = self.places.holders[holder as usize];
        if ahead || !self.places.is_complete() && touched != self.frame {
            self.touch_first(holder);
        }
    }

    fn touch_first(&mut self, holder: u32) {
        let slot = &mut self.places.holders[holder as usize];
        slot.touched = self.frame;
        if std::mem::take(&mut slot.ahead) {
            self.stats.ahead_used += 1;
        }
        let (page, parent) = (slot.page, slot.layout.parent);
        // In the paper a page is what its counts make of it.
        if self.is_printed() {
            return;
        }
        self.classify(page);
        if let Some(class) = self.places.lists.class(holder) {
            self.places.lists.push(holder, class);
        }
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
        if (before == 0) != (now == 0) && !self.places.is_complete() {
            self.switch_usage(page, now > 0);
        }
    }

    fn switch_usage(&mut self, page: u32, in_use: bool) {
        self.classify(page);
        match self.find(page) {
            Some(holder) => self.count_around(holder, in_use),
            None if in_use => self.prefetch(page),
            None => {}
        }
    }

    /// Tells the pages around one that is in memory whether it is in use.
    fn count_around(&mut self, holder: u32, in_use: bool) {
        let Holder { counted, layout, .. } = &mut self.places.holders[holder as usize];
        if std::mem::replace(counted, in_use) == in_use {
            return;
        }
        let Layout { parent, first_child, children, .. } = *layout;
        let guarded = self.places.guarded;
        if in_use {
            self.places.guarded = holder;
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
        self.places.guarded = guarded;
    }

    /// Puts a page's place holder into the list where it belongs.
    fn classify(&mut self, page: u32) {
        let Some(holder) = self.find(page) else { return };
        if page < self.kept {
            self.places.lists.remove(holder);
            return;
        }
        let untouched = self.places.holders[holder as usize].touched == 0;
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
        if self.places.lists.class(holder) != Some(class) {
            self.places.lists.push(holder, class);
        }
    }

    // Asking for pages.

    /// Asks for a page for which there is room.
    fn ask(&mut self, page: u32, urgency: u64) {
        self.places.reserve(page, self.words_of(page));
        self.tickets.insert(page, self.requests.ask(page, urgency));
    }

    /// A page that has been asked for does not come: its place holder is given up.
    fn release(&mut self, page: u32) {
        self.tickets.remove(&page);
        self.news.push(page);
        self.places.release(page, self.words_of(page));
    }

    /// Whether a page has failed so recently that it is left alone for now.
    fn rests(&self, page: u32) -> bool {
        self.failures.rests(page, self.frame)
    }

    /// Asks for every page for which there is room.
    pub fn load_all(&mut self) {
        for page in 0..self.file.header.pages {
            if self.places.is_missing(page) && !self.rests(page) {
                if !self.make_room(page, Self::give_free) {
                    break;
                }
                self.ask(page, LATER);
            }
        }
    }

    /// Takes back a page that has been asked for, with something not urgent if there is a choice. Says whether there was
    /// one.
    fn withdraw(&mut self, even_urgent: bool) -> bool {
        self.requests.withdraw_last(even_urgent).inspect(|&page| self.release(page)).is_some()
    }

    /// A node has been unfolded: the pages to which the nodes below it lead may be needed next.
    #[inline(always)]
    pub fn look_ahead(&mut self, holder: u32, slot: u32) {
        if self.how == Prefetch::Paper && !self.is_printed() && !self.places.is_complete() {
            self.look_below(holder, slot);
        }
    }

    fn look_below(&mut self, holder: u32, slot: u32) {
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

    /// The paper's prefetching: asks for a page that is likely to be needed, if there is room for it.
    fn prefetch(&mut self, page: u32) {
        if self.how != Prefetch::Paper || !self.places.is_missing(page) {
            return;
        }
        let has_room = !self.rests(page)
            && match self.in_use {
                InUse::Stays | InUse::Printed => self.make_room(page, Self::give_free),
                InUse::Yields => {
                    let before = self.frame.saturating_sub(IDLE).max(1);
                    self.make_room(page, |pager| pager.evict_one(pager.places.oldest(before)))
                }
            };
        if has_room {
            self.ask(page, LATER);
        } else {
            self.give_up(page);
        }
    }

    /// Asks again for what has been given up, as long as there is room.
    fn try_again(&mut self) {
        for _ in 0..self.given_up.len() {
            if self.room_for_largest() == 0 && self.places.takeable(Class::Free, self.frame).is_none() {
                break;
            }
            let Some(page) = self.given_up.pop_front() else { break };
            if self.usage[page as usize] > 0 || self.references[page as usize] > 0 {
                self.prefetch(page);
            }
        }
    }

    /// Leaves a page for later. In the paper it is left until something refers to it anew.
    fn give_up(&mut self, page: u32) {
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
        if let Some(&ticket) = self.tickets.get(&page) {
            return self.requests.demand(ticket);
        }
        if !self.places.is_missing(page) || self.rests(page) {
            return;
        }
        if self.may_switch(switch) && self.make_room(page, |pager| pager.give_way(switch)) {
            self.ask(page, NOW);
        } else {
            self.stats.no_room += 1;
        }
    }

    /// No change waits any more for a page that is under way. If it has not been started, it is not urgent any more, and
    /// without anything that fetches pages ahead it is not read.
    pub fn demote(&mut self, page: u32) {
        let Some(&ticket) = self.tickets.get(&page) else { return };
        if !self.requests.withdraw(ticket) {
            return;
        }
        if self.how == Prefetch::None {
            return self.release(page);
        }
        self.tickets.insert(page, self.requests.ask(page, LATER));
    }

    // Foresight.

    /// How many frames ahead it is worth to know what is needed.
    pub fn frames_ahead(&self) -> u32 {
        if !self.foresight.is_used() || self.places.is_complete() {
            return 0;
        }
        self.requests.look_ahead(if self.room_for_largest() == 0 { LEAST_AHEAD_FULL } else { LEAST_AHEAD })
    }

    /// A change on a page is expected in so many frames.
    #[inline]
    pub fn foresee(&mut self, page: u32, frames: u32) {
        self.foresight.foresee(page, self.frame, frames);
    }

    /// Puts the requests that wait in order anew, and adds what is foreseen and missing.
    fn plan(&mut self) {
        let [before, foreseen] = self.foresight.end_frame(self.frame);
        for &page in &before {
            if !self.foresight.is_foreseen(page) {
                self.classify(page);
            }
        }
        let mut withdrawn = std::mem::take(&mut self.withdrawn);
        self.requests.withdraw_ahead(&mut withdrawn);
        withdrawn.drain(..).for_each(|page| self.release(page));
        self.withdrawn = withdrawn;

        let mut missing = std::mem::take(&mut self.missing);
        missing.clear();
        for &page in &foreseen {
            if self.places.is_missing(page) {
                missing.push((self.foresight.due(page), page));
            } else {
                self.classify(page);
            }
        }
        self.foresight.keep([before, foreseen]);
        missing.sort_unstable();
        // Room for what is needed now must be left, however much is under way.
        let most = self.places.allowed / 2;
        for &(due, page) in &missing {
            if self.rests(page) {
                continue;
            }
            let is_full = self.places.under_way + self.file.page_words(page) as u64 > most;
            if is_full || !self.make_room(page, |pager| pager.give_place(due)) {
                break;
            }
            self.ask(page, LATER);
        }
        self.missing = missing;
    }

    // Making room.

    /// Makes room for a page, by what `give` drops each time. Says whether there is enough.
    fn make_room(&mut self, page: u32, mut give: impl FnMut(&mut Self) -> bool) -> bool {
        let words = self.words_of(page);
        while self.places.taken + words > self.places.allowed {
            if !give(self) {
                return false;
            }
        }
        true
    }

    /// Drops a page from memory.
    fn evict(&mut self, holder: u32) {
        self.count_around(holder, false);
        let words = self.words_of(self.places.holders[holder as usize].page);
        self.places.drop_page(holder, words);
    }

    fn evict_one(&mut self, holder: Option<u32>) -> bool {
        holder.inspect(|&holder| self.evict(holder)).is_some()
    }

    fn give_free(&mut self) -> bool {
        self.evict_one(self.places.takeable(Class::Free, self.frame))
    }

    /// For how many of the largest pages there is room without dropping any.
    fn room_for_largest(&self) -> u64 {
        self.places.room_for(self.file.header.largest_words.into())
    }

    /// The three-free rule.
    fn may_switch(&self, switch: Switch) -> bool {
        let not_in_use = [Class::Free, Class::Prefetched, Class::Foreseen];
        let not_in_use = not_in_use.map(|class| u64::from(self.places.lists.len(class))).iter().sum::<u64>();
        switch == Switch::Up || self.in_use == InUse::Yields || not_in_use + self.room_for_largest() >= 3
    }

    /// What makes room first: a page that nobody needs, as far as is known.
    fn unused(&self) -> Option<u32> {
        match self.in_use {
            InUse::Yields => self.places.oldest(self.frame),
            InUse::Stays | InUse::Printed => [Class::Free, Class::Prefetched]
                .into_iter()
                .find_map(|class| self.places.takeable(class, self.frame)),
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
        let farthest = self.foresight.farthest(&self.places, self.frame, 0);
        let is_up = switch == Switch::Up;
        let in_use = || self.places.takeable(Class::InUse, self.frame).filter(|_| is_up);
        self.evict_one(farthest.or_else(in_use))
    }

    /// Makes room for a page that is needed in a frame to come.
    fn give_place(&mut self, due: u32) -> bool {
        let unused = self.unused();
        let victim = unused.or_else(|| self.foresight.farthest(&self.places, self.frame, u64::from(due)));
        self.evict_one(victim)
    }

    /// Sets how much memory the place holders may take. Less than now takes effect at once.
    pub fn set_page_memory(&mut self, bytes: u64) -> Result<(), MetaNodeError> {
        let largest = self.file.holder_bytes();
        FileError::check_memory(self.file.name(), bytes, self.file.least_memory())?;
        // Room for three that are not in use, even where all are.
        let all = match self.in_use {
            InUse::Printed => largest.saturating_mul(self.file.header.pages.into()),
            InUse::Yields | InUse::Stays => self.file.header.page_bytes,
        };
        let most = all.saturating_add(largest * u64::from(LEAST_HOLDERS));
        let allowed = bytes.min(most) / 4;
        if self.places.is_complete() && allowed < self.places.taken {
            self.recount();
        }
        self.places.allowed = allowed;
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
    fn shrink(&mut self) {
        while self.places.taken > self.places.allowed {
            let lists = &self.places.lists;
            if let Some(victim) = Class::ALL.into_iter().find_map(|class| lists.front(class)) {
                self.evict(victim);
            } else if !self.withdraw(true) {
                // What has come meanwhile can go too. Then one at most is being read, and with the roots that are kept
                // that is no more than is allowed. On virtual time it may be more: those end first.
                let mut arrivals = std::mem::take(&mut self.arrivals);
                self.requests.take(&mut arrivals);
                if self.take_in(arrivals) == 0 {
                    return;
                }
            }
        }
    }
}
