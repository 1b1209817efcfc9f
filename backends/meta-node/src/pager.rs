//! Main-memory buffer management: El-Sana & Chiang (2000), section 3.3.3, and the urgent requests of section 3.3.2.
//!
//! There are K place holders, each as large as the largest page. A table says for each page where it is, if it is
//! anywhere: the paper's hash table, whose hash function is the identity here. A page has two counts, kept whether it is
//! in memory or not: its *usage count*, the nodes and leaves of the front on it, and its *reference count*, how many of
//! the pages above and below it are in use. A page whose counts are both 0 is flushed: its place holder joins the free
//! list at the end, and keeps the page until the place is taken, first in, first out (its *second chance*). A count that
//! rises above 0 asks for the page; where no place is free, that is given up for now, and tried again when one is.
//!
//! A page that is missing at a change is asked for *urgently*: a place is taken from the free list, or from a page that is
//! only referred to. Switching down is allowed that only while three place holders are not in use, so that switching
//! up always finds one; those on their way are reserved and do not count.
//!
//! # Beyond the paper
//!
//! The paper's navigation reads the nodes of the front in every frame, so that their pages must stay. Ours does not: the
//! engine keeps sphere and error of the front itself, and a page is touched only by a change. So with
//! [`InUse::Yields`], the default, what has been prefetched and not touched yet makes room first, then what has not been
//! touched for longest, whatever its counts, for switching down too; and every cut can be reached with any number of
//! place holders from four on. With [`InUse::Stays`] free
//! places go first, then those of pages that are only referred to, the three-free rule holds as printed, and a front that
//! needs more pages than there are is coarser.
//!
//! A page that is asked for urgently is not evicted before the end of the frame at whose start it came, nor is one that
//! has been touched in the frame. So each urgent read leads to a change at least, and a camera at rest gets its cut.
//!
//! A node can unfold before the page of its children is there, since links carry their spheres; so what is asked for is
//! not only what the front has come to, but also the pages to which the next levels below it lead.

mod counts;
mod requests;

use std::collections::VecDeque;
use std::sync::Arc;

use rustc_hash::FxHashMap;
use vertex_tree::{NONE, PageStats, prefetch};

use crate::board::{Board, Command, Done};
use crate::error::MetaNodeError;
use crate::file::MetaNodeFile;
use crate::lists::{Class, Lists};
use crate::page::{Layout, Page};

/// The least number of place holders: one in use and three that are not.
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

/// What happens to pages with nodes of the front where there is no other place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InUse {
    /// The one that has not been touched for longest makes room. Every cut can be reached.
    #[default]
    Yields,
    /// They stay, as in the paper, but for switching up and for less memory. A cut that needs more is not reached.
    Stays,
}

/// Which way a change goes that finds its page missing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Switch {
    Down,
    Up,
}

/// A place for a page.
#[derive(Debug, Default)]
struct Holder {
    /// Empty until it is used for the first time, and while it travels with a command.
    words: Box<[u32]>,
    /// [`NONE`] while it holds none and waits for none.
    page: u32,
    layout: Layout,
    /// The last frame in which the page was touched, or came in answer to an urgent request; 0 for neither.
    touched: u64,
    /// Whether the pages around are counting this one as in use.
    counted: bool,
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
    board: Arc<Board>,
    in_use: InUse,
    frame: u64,
    /// For each page: its place holder, with [`PENDING`] while it is on its way; [`NONE`] if it is nowhere.
    table: Vec<u32>,
    usage: Vec<u16>,
    references: Vec<u16>,
    holders: Vec<Holder>,
    lists: Lists,
    /// K, and how many place holders there are.
    allowed: u32,
    live: u32,
    /// Place holders that are there only in name.
    retired: Vec<u32>,
    /// Pages below this number are never evicted.
    kept: u32,
    /// Place holders with a page, and those on their way.
    resident: u32,
    pending: u32,
    /// A place holder whose page is asking for those around it: it does not make room for them.
    guarded: u32,
    given_up: VecDeque<u32>,
    failures: FxHashMap<u32, Failure>,
    outbox: Vec<Command>,
    promoted: Vec<u32>,
    done: Vec<Done>,
    /// Whether anything has arrived between two frames.
    arrived_between: bool,
    stats: PageStats,
    last_fault: Option<MetaNodeError>,
}

impl Drop for Pager {
    /// The thread ends after the read that it is at. Nobody waits for that.
    fn drop(&mut self) {
        self.board.stop();
    }
}

impl Pager {
    /// Starts the I/O thread.
    pub fn new(file: Arc<MetaNodeFile>, page_memory: u64, in_use: InUse) -> Result<Self, MetaNodeError> {
        let pages = file.header.pages as usize;
        let board = Arc::new(Board::default());
        let mut pager = Self {
            board: board.clone(),
            in_use,
            frame: 1,
            table: vec![NONE; pages],
            usage: vec![0; pages],
            references: vec![0; pages],
            holders: Vec::new(),
            lists: Lists::new(pages + LEAST_HOLDERS as usize),
            allowed: 0,
            live: 0,
            retired: Vec::new(),
            kept: 0,
            resident: 0,
            pending: 0,
            guarded: NONE,
            given_up: VecDeque::new(),
            failures: FxHashMap::default(),
            outbox: Vec::new(),
            promoted: Vec::new(),
            done: Vec::new(),
            arrived_between: false,
            stats: PageStats::default(),
            last_fault: None,
            file,
        };
        pager.set_page_memory(page_memory)?;
        let file = pager.file.clone();
        let read = move |page, words: &mut [u32]| {
            // A store is other people's code: a panic there is a fault like any other.
            let read = std::panic::AssertUnwindSafe(|| file.read_page(page, words));
            std::panic::catch_unwind(read).unwrap_or_else(|_| {
                Err(MetaNodeError::Page {
                    file: file.name().to_owned(),
                    page,
                    offset: file.page_offset(page),
                    reason: "the store panicked",
                })
            })
        };
        std::thread::Builder::new()
            .name("meta-node I/O".to_owned())
            .spawn(move || board.serve(read))
            .map_err(MetaNodeError::Thread)?;
        Ok(pager)
    }

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
            self.lists.push(holder, Class::Free);
            self.live += 1;
        }
        self.shrink();
        Ok(())
    }

    /// Gives place holders up until there are no more than allowed.
    fn shrink(&mut self) {
        while self.live > self.allowed {
            let lists = &self.lists;
            let victim =
                [Class::Free, Class::Prefetched, Class::InUse].into_iter().find_map(|c| lists.front(c));
            let holder = match victim {
                Some(holder) => {
                    self.evict(holder);
                    holder
                }
                None => match self.withdraw(true) {
                    Some(holder) => holder,
                    // What has come meanwhile can go too. Then one at most is being read, and with the roots that are
                    // kept that is no more than is allowed.
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

    /// Where a page is, if it is in memory.
    #[inline(always)]
    pub fn find(&self, page: u32) -> Option<u32> {
        Some(self.table[page as usize]).filter(|&holder| holder < PENDING)
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

    /// Drops the page from a place holder.
    fn evict(&mut self, holder: u32) {
        let page = std::mem::replace(&mut self.holders[holder as usize].page, NONE);
        if page != NONE {
            self.count_around(holder, false);
            self.table[page as usize] = NONE;
            self.resident -= 1;
        }
    }

    /// Starts a frame: takes what has arrived. Says whether anything has since the frame before.
    pub fn begin_frame(&mut self) -> bool {
        self.frame += 1;
        let since = std::mem::take(&mut self.arrived_between);
        let now = self.take_arrivals();
        self.shrink();
        since || now
    }

    /// Takes what has arrived, and says whether anything has.
    fn take_arrivals(&mut self) -> bool {
        let mut done = std::mem::take(&mut self.done);
        self.board.collect(&mut done);
        let any = !done.is_empty();
        for Done { command, result } in done.drain(..) {
            match result {
                Ok(layout) => self.arrive(command, layout),
                Err(fault) => self.fail(command, fault),
            }
        }
        self.done = done;
        any
    }

    fn arrive(&mut self, command: Command, layout: Layout) {
        let Command { page, holder, words, urgent } = command;
        self.failures.remove(&page);
        self.stats.reads += 1;
        self.stats.read_bytes += 4 * self.file.page_words(page) as u64;
        self.table[page as usize] = holder;
        self.pending -= 1;
        self.resident += 1;
        let touched = if urgent { self.frame } else { 0 };
        self.holders[holder as usize] = Holder { words, page, layout, touched, counted: false };
        self.classify(page);
        if self.usage[page as usize] > 0 {
            self.count_around(holder, true);
        }
    }

    fn fail(&mut self, command: Command, fault: MetaNodeError) {
        let Command { page, holder, words, .. } = command;
        self.stats.faults += 1;
        self.last_fault = Some(fault);
        self.table[page as usize] = NONE;
        self.pending -= 1;
        let slot = &mut self.holders[holder as usize];
        slot.words = words;
        slot.page = NONE;
        slot.touched = 0;
        self.lists.push(holder, Class::Free);
        // Asked for again, but not in every frame forever.
        let failure = self.failures.entry(page).or_default();
        failure.until = self.frame + (1 << failure.times.min(63)).min(LONGEST_REST) - 1;
        failure.times += 1;
        self.give_up(page);
    }

    /// Ends a frame: tries again what was given up, and posts all commands.
    pub fn end_frame(&mut self) -> PageStats {
        for _ in 0..self.given_up.len() {
            if self.takeable(Class::Free, self.frame).is_none() {
                break;
            }
            let Some(page) = self.given_up.pop_front() else { break };
            if self.usage[page as usize] > 0 || self.references[page as usize] > 0 {
                self.prefetch(page);
            }
        }
        self.post();
        self.stats.resident_bytes = u64::from(self.resident + self.pending) * self.file.holder_bytes();
        std::mem::take(&mut self.stats)
    }

    fn post(&mut self) {
        self.board.post(&mut self.outbox, &mut self.promoted);
    }

    /// Waits until everything that has been asked for is there, or has failed.
    pub fn settle(&mut self) {
        self.post();
        self.board.settle();
    }

    pub fn last_fault(&self) -> Option<&MetaNodeError> {
        self.last_fault.as_ref()
    }
}
