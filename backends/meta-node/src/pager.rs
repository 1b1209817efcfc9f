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

mod arrivals;
mod counts;
mod foresight;
mod memory;
mod requests;
#[cfg(test)]
mod tests;
mod well_formed;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use rustc_hash::FxHashMap;
use vertex_tree::{NONE, PageStats, Prefetch, prefetch};

use self::foresight::Foresight;
use crate::error::MetaNodeError;
use crate::file::MetaNodeFile;
use crate::lists::Lists;
use crate::page::{Layout, Page};
use crate::settings::{InUse, Settings};
use crate::store::Store;
use crate::waiting::{Command, Done};

/// The least number of place holders of the largest size: one in use and three that are not.
pub(crate) const LEAST_HOLDERS: u32 = 4;

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

/// In the table: the page is on its way.
const PENDING: u32 = 1 << 31;

/// Which way a change goes that finds its page missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Switch {
    Down,
    Up,
}

/// A place for a page, and all that is asked of it at a change: a cache line.
#[derive(Debug, Default)]
#[repr(align(64))]
struct Holder {
    /// As large as the page; empty without one, and while it travels with a command.
    words: Box<[u32]>,
    /// [`NONE`] while it holds none and waits for none.
    page: u32,
    layout: Layout,
    /// The last frame in which the page was touched, or came in answer to an urgent request; 0 for neither.
    touched: u64,
    /// Whether the pages around are counting this one as in use.
    counted: bool,
    /// While the page is on its way: whether a change has been refused for want of it.
    demanded: bool,
    /// The page was fetched ahead, and no change has used it yet.
    ahead: bool,
}

/// A page that could not be read.
#[derive(Clone, Copy, Debug, Default)]
struct Failure {
    times: u32,
    /// Not to be asked for before this frame.
    until: u64,
}

pub(crate) struct Pager {
    pub file: Arc<MetaNodeFile>,
    store: Store,
    in_use: InUse,
    how: Prefetch,
    foresight: Foresight,
    frame: u64,
    /// For each page: its place holder, with [`PENDING`] while it is on its way; [`NONE`] if it is nowhere.
    table: Vec<u32>,
    usage: Vec<u16>,
    references: Vec<u16>,
    holders: Vec<Holder>,
    lists: Lists,
    /// Words that place holders may take, those that they do, and of these those that are on their way.
    allowed: u64,
    taken: u64,
    under_way: u64,
    /// Place holders that are there only in name.
    empty: Vec<u32>,
    /// Pages below this number are never evicted.
    kept: u32,
    /// Place holders with a page.
    resident: u32,
    /// A place holder whose page is asking for those around it: it does not make room for them.
    guarded: u32,
    given_up: VecDeque<u32>,
    failures: FxHashMap<u32, Failure>,
    outbox: Vec<Command>,
    promoted: Vec<u32>,
    done: Vec<Done>,
    /// Pages whose requests have come to an end since the frame began, or between two: they have come, could not be read, or
    /// have been taken back.
    pub news: Vec<u32>,
    stats: PageStats,
    last_fault: Option<MetaNodeError>,
}

impl Pager {
    /// Starts the I/O thread, where there is to be one.
    pub fn new(file: Arc<MetaNodeFile>, settings: &Settings) -> Result<Self, MetaNodeError> {
        let pages = file.header.pages as usize;
        let how = match settings.in_use {
            InUse::Printed => Prefetch::Paper,
            InUse::Yields | InUse::Stays => settings.prefetch,
        };
        let mut pager = Self {
            store: Store::new(&file, settings.io)?,
            in_use: settings.in_use,
            how,
            foresight: Foresight::new(if how == Prefetch::Schedule { pages } else { 0 }),
            frame: 1,
            table: vec![NONE; pages],
            usage: vec![0; pages],
            references: vec![0; pages],
            holders: Vec::new(),
            lists: Lists::new(pages),
            allowed: 0,
            taken: 0,
            under_way: 0,
            empty: Vec::new(),
            kept: 0,
            resident: 0,
            guarded: NONE,
            given_up: VecDeque::new(),
            failures: FxHashMap::default(),
            outbox: Vec::new(),
            promoted: Vec::new(),
            done: Vec::new(),
            news: Vec::new(),
            stats: PageStats::default(),
            last_fault: None,
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

    /// Words of a place holder for a page of so many.
    fn place_words(&self, words: usize) -> u64 {
        if self.is_printed() { self.file.header.largest_words.into() } else { words as u64 }
    }

    /// Where a page is, if it is in memory.
    #[inline(always)]
    pub fn find(&self, page: u32) -> Option<u32> {
        Some(self.table[page as usize]).filter(|&holder| holder < PENDING)
    }

    /// Whether a page has been asked for and has not come yet.
    pub fn is_under_way(&self, page: u32) -> bool {
        let holder = self.table[page as usize];
        holder != NONE && holder & PENDING != 0
    }

    #[inline(always)]
    pub fn page(&self, holder: u32) -> Page<'_> {
        let holder = &self.holders[holder as usize];
        Page { words: &holder.words, layout: &holder.layout }
    }

    /// Starts to read where a page is into the cache.
    #[inline(always)]
    pub fn prefetch_table(&self, page: u32) {
        prefetch(&self.table, page as usize);
        prefetch(&self.usage, page as usize);
    }

    /// Starts to read what is known of a place holder into the cache.
    #[inline(always)]
    pub fn prefetch_holder(&self, holder: u32) {
        prefetch(&self.holders, holder as usize);
    }

    /// Drops a page from memory.
    fn evict(&mut self, holder: u32) {
        self.count_around(holder, false);
        self.lists.remove(holder);
        self.taken -= self.place_words(self.holders[holder as usize].words.len());
        let slot = &mut self.holders[holder as usize];
        self.table[slot.page as usize] = NONE;
        (slot.page, slot.words) = (NONE, Box::default());
        self.resident -= 1;
        self.empty.push(holder);
    }

    /// Ends a frame: asks for what is likely to be needed, and posts all commands.
    pub fn end_frame(&mut self) -> PageStats {
        match self.how {
            Prefetch::Paper => self.try_again(),
            Prefetch::Schedule => self.plan(),
            Prefetch::None => {}
        }
        self.post();
        self.stats.resident_bytes = 4 * self.taken;
        std::mem::take(&mut self.stats)
    }

    fn post(&mut self) {
        if !self.outbox.is_empty() || !self.promoted.is_empty() {
            self.store.post(&mut self.outbox, &mut self.promoted);
        }
    }

    /// Waits until everything that has been asked for is there, or has failed. Returns how long that took.
    pub fn settle(&mut self) -> Duration {
        self.post();
        self.store.settle()
    }

    /// Lets time pass on a store that has its own.
    pub fn pass(&mut self, time: Duration) {
        self.store.pass(time);
    }

    pub fn last_fault(&self) -> Option<&MetaNodeError> {
        self.last_fault.as_ref()
    }
}
