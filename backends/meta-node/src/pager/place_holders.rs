//! Place holders: where the pages in memory are, in which list each is, and how much memory they take.

use vertex_tree::{NONE, prefetch};

use crate::lists::{Class, Lists};
use crate::page::{Layout, Page};

/// In the table: the page is on its way.
const PENDING: u32 = 1 << 31;

/// A place for a page, and all that is asked of it at a change: a cache line.
#[derive(Debug, Default)]
#[repr(align(64))]
pub(super) struct Holder {
    /// As large as the page; empty without one, and while it is on its way.
    pub words: Box<[u32]>,
    /// [`NONE`] while it holds none and waits for none.
    pub page: u32,
    pub layout: Layout,
    /// The last frame in which the page was touched, or came in answer to an urgent request; 0 for neither.
    pub touched: u64,
    /// Whether the pages around are counting this one as in use.
    pub counted: bool,
    /// The page was fetched ahead, and no change has used it yet.
    pub ahead: bool,
}

/// The place holders of a tree. Memory is measured in words.
pub(super) struct PlaceHolders {
    /// For each page: its place holder, with [`PENDING`] while it is on its way; [`NONE`] if it is nowhere.
    table: Vec<u32>,
    pub holders: Vec<Holder>,
    pub lists: Lists,
    /// Place holders that are there only in name.
    empty: Vec<u32>,
    /// What they may take, what they do, and of this what is on its way.
    pub allowed: u64,
    pub taken: u64,
    pub under_way: u64,
    /// Place holders with a page.
    resident: u32,
    /// A place holder whose page is asking for those around it: it does not make room for them.
    pub guarded: u32,
    /// Whether a page that has been touched in this frame, or has come in answer to an urgent request at its start, stays.
    pub gives_grace: bool,
}

impl PlaceHolders {
    pub fn new(pages: usize, gives_grace: bool) -> Self {
        Self {
            table: vec![NONE; pages],
            holders: Vec::new(),
            lists: Lists::new(pages),
            empty: Vec::new(),
            allowed: 0,
            taken: 0,
            under_way: 0,
            resident: 0,
            guarded: NONE,
            gives_grace,
        }
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

    /// Whether a page is neither in memory nor on its way.
    pub fn is_missing(&self, page: u32) -> bool {
        self.table[page as usize] == NONE
    }

    /// Whether every page is in memory.
    #[inline(always)]
    pub fn is_complete(&self) -> bool {
        self.resident as usize == self.table.len()
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
    }

    /// Reserves a place holder of so many words for a page that is on its way.
    pub fn reserve(&mut self, page: u32, words: u64) {
        self.taken += words;
        self.under_way += words;
        let slot = Holder { page, ..Holder::default() };
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
    }

    /// The place holder of a page that is on its way, which takes so many words.
    fn end(&mut self, page: u32, words: u64) -> u32 {
        self.under_way -= words;
        self.table[page as usize] & !PENDING
    }

    /// A page that was on its way has come. Returns where it is.
    pub fn fill(&mut self, page: u32, words: u64, filled: Holder) -> u32 {
        let holder = self.end(page, words);
        self.table[page as usize] = holder;
        self.holders[holder as usize] = filled;
        self.resident += 1;
        holder
    }

    /// A page that was on its way does not come.
    pub fn release(&mut self, page: u32, words: u64) {
        let holder = self.end(page, words);
        self.taken -= words;
        self.clear(page, holder);
    }

    /// Drops the page in a place holder of so many words.
    pub fn drop_page(&mut self, holder: u32, words: u64) {
        self.lists.remove(holder);
        self.taken -= words;
        self.resident -= 1;
        self.clear(self.holders[holder as usize].page, holder);
    }

    fn clear(&mut self, page: u32, holder: u32) {
        self.table[page as usize] = NONE;
        let slot = &mut self.holders[holder as usize];
        (slot.page, slot.words) = (NONE, Box::default());
        self.empty.push(holder);
    }

    /// The first place holder of a list, if it may be taken: not if its page has been touched since a frame.
    pub fn takeable(&self, class: Class, before: u64) -> Option<u32> {
        let is_free = |&holder: &u32| {
            let has_grace = self.gives_grace && self.holders[holder as usize].touched >= before;
            holder != self.guarded && !has_grace
        };
        self.lists.front(class).filter(is_free)
    }

    /// The place holder that has not been touched for longest, and not since a frame. One that has come ahead of time counts as
    /// never touched.
    pub fn oldest(&self, before: u64) -> Option<u32> {
        let fronts = [Class::Free, Class::Prefetched, Class::InUse].map(|class| self.takeable(class, before));
        fronts.into_iter().flatten().min_by_key(|&holder| self.holders[holder as usize].touched)
    }

    /// For how many pages of so many words there is room without dropping any.
    pub fn room_for(&self, words: u64) -> u64 {
        self.allowed.saturating_sub(self.taken) / words.max(1)
    }

    /// Checks that the table and the place holders name each other, and what memory is taken. `words` says what a place holder
    /// takes for a page.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self, words: impl Fn(u32) -> u64) {
        let (mut resident, mut waiting, mut under_way, mut taken) = (0, 0, 0, 0);
        for (page, &place) in (0..).zip(&self.table).filter(|&(_, &place)| place != NONE) {
            let holder = &self.holders[(place & !PENDING) as usize];
            assert_eq!(holder.page, page, "the page of place holder {}", place & !PENDING);
            taken += words(page);
            if place & PENDING == 0 {
                resident += 1;
            } else {
                waiting += 1;
                under_way += words(page);
                assert_eq!(self.lists.class(place & !PENDING), None, "page {page} is on its way");
            }
        }
        assert_eq!(resident, self.resident, "pages in memory");
        assert_eq!((taken, under_way), (self.taken, self.under_way), "words in place holders");
        let used = resident as usize + waiting + self.empty.len();
        assert_eq!(used, self.holders.len(), "place holders");
    }
}
