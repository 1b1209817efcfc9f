//! The changes that a cap on work has left for later frames, the most urgent first.
//!
//! They stay here from frame to frame, and no strategy watches them meanwhile. To test them all and to compute how urgent
//! they are anew in every frame would cost more than the cap allows; so they are spread over [`HEAPS`] heaps for each kind,
//! of which a frame looks at [`A_FRAME`]: an urgency is at most [`OLDEST`] frames old. While the views do not move, urgencies
//! do not change, and nothing is looked at twice.
//!
//! What ceases to be a boundary node or collapsible is taken out at once, by its *ticket*: each entry has one of its own, and
//! each slot that of its entry. An entry whose ticket is not its slot's is void, and dropped when it is come upon.

use std::collections::{BinaryHeap, VecDeque};

use crate::in_play::{Kind, Slot};

/// Heaps of a kind. A change is on that of its slot, modulo this: which one does not depend on the strategy.
pub const HEAPS: usize = 64;

/// The heaps that are looked at anew in a frame.
pub const A_FRAME: usize = 8;

/// After so many frames in which the views have moved, the turn of every heap has come.
const OLDEST: usize = HEAPS / A_FRAME;

/// An entry. The most urgent one is the greatest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Urgent {
    /// Bits of a number that is not negative, which are in the same order.
    urgency: u64,
    pub slot: Slot,
    ticket: u64,
}

/// What waits to fold or to unfold.
#[derive(Debug)]
struct Line {
    heaps: [BinaryHeap<Urgent>; HEAPS],
    /// Slots and tickets of what has been found and is not on a heap yet, in order.
    coming: VecDeque<(Slot, u64)>,
}

impl Default for Line {
    fn default() -> Self {
        Self { heaps: [const { BinaryHeap::new() }; HEAPS], coming: VecDeque::new() }
    }
}

/// The changes that wait.
#[derive(Debug)]
pub(crate) struct Carried {
    folds: Line,
    unfolds: Line,
    /// For each slot, the ticket of its entry; 0 if it has none.
    tickets: Vec<u64>,
    /// How many slots have one.
    len: usize,
    last_ticket: u64,
    /// The last ticket before the views moved for the last time, for the last time but one, and so on.
    moves: [u64; OLDEST],
    /// The heaps whose turn comes next, and of each what `moves[0]` was at its last turn.
    turn: usize,
    seen: [u64; HEAPS],
    /// Frames, for what has its turn in some of them.
    pub frame: u64,
}

impl Default for Carried {
    fn default() -> Self {
        Self {
            folds: Line::default(),
            unfolds: Line::default(),
            tickets: Vec::new(),
            len: 0,
            last_ticket: 0,
            moves: [0; OLDEST],
            turn: 0,
            seen: [0; HEAPS],
            frame: 0,
        }
    }
}

impl Carried {
    /// How many changes wait.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether a change of the node in a slot waits.
    pub fn contains(&self, slot: Slot) -> bool {
        self.tickets.get(slot.index()).is_some_and(|&ticket| ticket != 0)
    }

    /// The node in a slot is not any more what its change waits for, if one does. Without a cap, none does.
    #[inline(always)]
    pub fn remove(&mut self, slot: Slot) {
        if self.len != 0 {
            self.take(slot);
        }
    }

    fn take(&mut self, slot: Slot) {
        if let Some(ticket) = self.tickets.get_mut(slot.index()) {
            self.len -= usize::from(std::mem::take(ticket) != 0);
        }
    }

    fn line(&mut self, kind: Kind) -> &mut Line {
        match kind {
            Kind::Fold => &mut self.folds,
            Kind::Unfold => &mut self.unfolds,
        }
    }

    /// Starts a frame, in which the views may have moved.
    pub fn begin_frame(&mut self, moved: bool) {
        self.frame += 1;
        if moved {
            self.moves.rotate_right(1);
            self.moves[0] = self.last_ticket;
        }
    }

    fn give_ticket(&mut self, slot: Slot) -> u64 {
        if self.tickets.len() <= slot.index() {
            self.tickets.resize(slot.index() + 1, 0);
        }
        self.last_ticket += 1;
        let before = std::mem::replace(&mut self.tickets[slot.index()], self.last_ticket);
        self.len += usize::from(before == 0);
        self.last_ticket
    }

    /// A change has been found, and waits from now on. How urgent it is is asked for later.
    pub fn expect(&mut self, kind: Kind, slot: Slot) {
        let ticket = self.give_ticket(slot);
        self.line(kind).coming.push_back((slot, ticket));
    }

    /// The change that has been waiting for its place on a heap for longest, and whether it was found in these views. It waits
    /// no more, unless it is [put](Self::put) there.
    pub fn next_coming(&mut self, kind: Kind) -> Option<(Slot, bool)> {
        while let Some((slot, ticket)) = self.line(kind).coming.pop_front() {
            if self.is_valid(slot, ticket) {
                self.take(slot);
                return Some((slot, ticket > self.moves[0]));
            }
        }
        None
    }

    /// Puts a change where it waits for its turn; `urgency` is that in the views of this frame, and not negative.
    pub fn put(&mut self, kind: Kind, slot: Slot, urgency: f64) {
        let ticket = self.give_ticket(slot);
        let entry = Urgent { urgency: urgency.max(0.0).to_bits(), slot, ticket };
        let heap = &mut self.line(kind).heaps[slot.index() % HEAPS];
        // Which heap how many are on is chance: room enough that they seldom need more.
        if heap.len() == heap.capacity() {
            heap.reserve(heap.len().max(64));
        }
        heap.push(entry);
    }

    /// Takes out the most urgent change.
    pub fn pop(&mut self, kind: Kind) -> Option<Urgent> {
        loop {
            let heaps = &mut self.line(kind).heaps;
            let tops = heaps.iter().enumerate().filter_map(|(at, heap)| Some((*heap.peek()?, at)));
            let (entry, at) = tops.max()?;
            heaps[at].pop();
            if self.is_valid(entry.slot, entry.ticket) {
                self.take(entry.slot);
                return Some(entry);
            }
        }
    }

    /// Takes out the most urgent of the changes of which each is the most urgent on its heap and was looked at in these views.
    pub fn pop_current(&mut self, kind: Kind) -> Option<Urgent> {
        loop {
            let before = self.moves[0];
            let heaps = &mut self.line(kind).heaps;
            let tops = heaps.iter().enumerate().filter_map(|(at, heap)| Some((*heap.peek()?, at)));
            let (entry, at) = tops.filter(|(entry, _)| entry.ticket > before).max()?;
            heaps[at].pop();
            if self.is_valid(entry.slot, entry.ticket) {
                self.take(entry.slot);
                return Some(entry);
            }
        }
    }

    fn is_valid(&self, slot: Slot, ticket: u64) -> bool {
        self.tickets[slot.index()] == ticket
    }

    /// Whether the views have not moved since an entry's urgency was computed.
    pub fn is_current(&self, entry: &Urgent) -> bool {
        entry.ticket > self.moves[0]
    }

    /// Whether they have more than [`OLDEST`] times: its heap's turn has not come for want of time.
    pub fn is_old(&self, entry: &Urgent) -> bool {
        entry.ticket <= self.moves[OLDEST - 1]
    }

    /// The next heap is looked at anew. For each kind calls `rate` with the slots of what waits on it since before the views
    /// moved, which gives its urgency now, or `None` if it is not wanted any more and waits no longer.
    pub fn look_anew(&mut self, mut rate: impl FnMut(Kind, Slot) -> Option<f64>) {
        let at = self.turn;
        self.turn = (at + 1) % HEAPS;
        if std::mem::replace(&mut self.seen[at], self.moves[0]) == self.moves[0] {
            return;
        }
        for kind in [Kind::Fold, Kind::Unfold] {
            let mut entries = std::mem::take(&mut self.line(kind).heaps[at]).into_vec();
            entries.retain_mut(|entry| {
                if !self.is_valid(entry.slot, entry.ticket) {
                    return false;
                }
                if !self.is_current(entry) {
                    let Some(urgency) = rate(kind, entry.slot) else {
                        self.take(entry.slot);
                        return false;
                    };
                    entry.urgency = urgency.max(0.0).to_bits();
                    entry.ticket = self.give_ticket(entry.slot);
                }
                true
            });
            self.line(kind).heaps[at] = BinaryHeap::from(entries);
        }
    }

    /// Takes out every change, in no order, and calls `f` with each.
    pub fn drain(&mut self, mut f: impl FnMut(Kind, Slot)) {
        for kind in [Kind::Fold, Kind::Unfold] {
            while let Some((slot, _)) = self.next_coming(kind) {
                f(kind, slot);
            }
            for at in 0..HEAPS {
                while let Some(entry) = self.line(kind).heaps[at].pop() {
                    if self.is_valid(entry.slot, entry.ticket) {
                        self.take(entry.slot);
                        f(kind, entry.slot);
                    }
                }
            }
        }
    }

    /// Calls `f` with every change that waits.
    pub(crate) fn for_each(&self, mut f: impl FnMut(Kind, Slot)) {
        for (kind, line) in [(Kind::Fold, &self.folds), (Kind::Unfold, &self.unfolds)] {
            let on_heaps = line.heaps.iter().flatten().map(|entry| (entry.slot, entry.ticket));
            let all = on_heaps.chain(line.coming.iter().copied());
            all.filter(|&(slot, ticket)| self.is_valid(slot, ticket)).for_each(|(slot, _)| f(kind, slot));
        }
    }

    /// Checks that every slot with a ticket has an entry, and the count.
    ///
    /// # Panics
    /// If not.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        let mut entries = 0;
        self.for_each(|_, _| entries += 1);
        let tickets = self.tickets.iter().filter(|&&ticket| ticket != 0).count();
        assert_eq!((tickets, entries), (self.len, self.len), "tickets of carried changes, and entries");
    }
}
