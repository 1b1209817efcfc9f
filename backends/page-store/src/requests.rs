//! A tree's end of a store: what it has asked for, and what has come of that.

use std::sync::Arc;
use std::time::{Duration, Instant};

use rustc_hash::FxHashMap;
use vertex_tree::PageStats;

use crate::look_ahead::LookAhead;
use crate::pages::Pages;
use crate::queue::{Answer, Client, NOW, Place, Request};
use crate::store::Store;
use crate::sync::{Receiver, unbounded};

#[cfg(test)]
mod tests;

/// A request of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ticket(u64);

/// A request that has come to its end.
#[derive(Debug)]
pub struct Arrival<P: Pages> {
    /// As asked for.
    pub read: P::Read,
    /// Whether a change has been refused for want of it: if not, it came ahead of time.
    pub is_demanded: bool,
    /// What it has brought, or why it has not.
    pub content: Result<P::Content, P::Error>,
}

/// What is known of a request that no frame has taken the answer of.
struct UnderWay<R> {
    read: R,
    place: Place,
    is_demanded: bool,
    is_answered: bool,
}

/// What a tree has asked for. Belongs to the thread of the tree; nothing here waits but [`settle`](Self::settle).
pub struct Requests<P: Pages> {
    store: Store<P>,
    tree: Arc<Client<P>>,
    receiver: Receiver<Answer<P>>,
    asked: u64,
    under_way: FxHashMap<u64, UnderWay<P::Read>>,
    /// Answers that no frame has taken.
    answers: Vec<Answer<P>>,
    /// How much virtual time has passed for this tree.
    passed: Duration,
    frame: u64,
    look_ahead: LookAhead,
    stats: PageStats,
}

impl<P: Pages> Requests<P> {
    /// A tree over some pages that has asked for nothing yet.
    #[must_use]
    pub fn new(store: Store<P>, pages: Arc<P>) -> Self {
        let (sender, receiver) = unbounded();
        Self {
            store,
            tree: Client::new(pages, sender),
            receiver,
            asked: 0,
            under_way: FxHashMap::default(),
            answers: Vec::new(),
            passed: Duration::ZERO,
            frame: 0,
            look_ahead: LookAhead::default(),
            stats: PageStats::default(),
        }
    }

    /// Asks for something: what is wanted [`NOW`] is read first, then what has a smaller urgency, and what is as urgent in the
    /// order of asking.
    pub fn ask(&mut self, read: P::Read, urgency: u64) -> Ticket {
        self.asked += 1;
        let id = self.asked;
        let request = Request { id, read: read.clone(), tree: self.tree.clone() };
        let place = self.store.lock().queue.push(urgency, request);
        self.store.wake();
        self.under_way.insert(id, UnderWay { read, place, is_demanded: urgency == NOW, is_answered: false });
        Ticket(id)
    }

    /// A change is refused for want of what was asked for, perhaps ahead of time. If it has not been started, it is wanted
    /// [`NOW`], behind what has been before.
    pub fn demand(&mut self, ticket: Ticket) {
        if let Some(request) = self.under_way.get_mut(&ticket.0)
            && !std::mem::replace(&mut request.is_demanded, true)
            && request.place.urgency != NOW
        {
            request.place = self.store.lock().queue.hurry(request.place);
        }
    }

    /// Gives a request another urgency, if it has not been started. It stays before those that have been asked for later and are as urgent.
    pub fn rank(&mut self, ticket: Ticket, urgency: u64) {
        if let Some(request) = self.under_way.get_mut(&ticket.0)
            && request.place.urgency != urgency
        {
            request.place = self.store.lock().queue.rank(request.place, urgency);
        }
    }

    /// Takes a request back, if it has not been started, and says whether it has.
    pub fn withdraw(&mut self, ticket: Ticket) -> bool {
        let Some(request) = self.under_way.get(&ticket.0) else { return false };
        let is_withdrawn = self.store.lock().queue.remove(request.place).is_some();
        if is_withdrawn {
            self.under_way.remove(&ticket.0);
        }
        is_withdrawn
    }

    /// Takes back the request that would be served last, of those that have not been started: only one that is not wanted now, or
    /// if there is none and it must be, one that is.
    pub fn withdraw_last(&mut self, even_now: bool) -> Option<P::Read> {
        let mut state = self.store.lock();
        let place = state.queue.last_of(&self.tree, even_now)?;
        let request = state.queue.remove(place)?;
        self.under_way.remove(&request.id);
        Some(request.read)
    }

    /// Takes back all that has not been started and is not wanted now, in the order in which it would have been served.
    pub fn withdraw_ahead(&mut self, withdrawn: &mut Vec<P::Read>) {
        let Self { store, tree, under_way, .. } = self;
        if tree.waiting()[1] == 0 {
            return;
        }
        store.lock().queue.remove_ahead(tree, |request| {
            under_way.remove(&request.id);
            withdrawn.push(request.read);
        });
    }

    /// How many requests have not been started: those that are wanted now, and others.
    #[must_use]
    pub fn waiting(&self) -> [usize; 2] {
        self.tree.waiting()
    }

    /// A frame of the tree begins: appends what has come since the last one.
    pub fn begin_frame(&mut self, frame: u64, arrivals: &mut Vec<Arrival<P>>) {
        self.frame = frame;
        self.tree.set_frame(frame);
        self.receive();
        let waiting = self.waiting().iter().sum();
        self.look_ahead.begin_frame(self.answers.len(), waiting);
        self.take(arrivals);
    }

    /// Appends what has come meanwhile, within a frame.
    pub fn take(&mut self, arrivals: &mut Vec<Arrival<P>>) {
        self.receive();
        for Answer { id, started, content } in self.answers.drain(..) {
            let Some(UnderWay { read, is_demanded, .. }) = self.under_way.remove(&id) else { continue };
            if content.is_ok() {
                self.look_ahead.arrived(self.frame.saturating_sub(started));
                self.stats.reads += 1;
                self.stats.read_bytes += self.tree.pages.bytes(&read);
                self.stats.ahead += u64::from(!is_demanded);
            } else {
                self.stats.faults += 1;
            }
            arrivals.push(Arrival { read, is_demanded, content });
        }
    }

    /// Takes answers out of the channel.
    fn receive(&mut self) {
        while let Ok(answer) = self.receiver.try_recv() {
            self.note(answer);
        }
    }

    /// An answer that nobody waits for, as one that has come before, is dropped.
    fn note(&mut self, answer: Answer<P>) {
        if let Some(request) = self.under_way.get_mut(&answer.id)
            && !std::mem::replace(&mut request.is_answered, true)
        {
            self.answers.push(answer);
        }
    }

    /// Waits until everything that was asked for has been read or has failed: it is taken with the next frame. Returns how long
    /// that took, by the clock of the store.
    pub fn settle(&mut self) -> Duration {
        let start = Instant::now();
        let virtually = self.store.lock().settle();
        while self.answers.len() < self.under_way.len() {
            // The tree keeps a sender, so the channel is never closed.
            let Ok(answer) = self.receiver.recv() else { break };
            self.note(answer);
        }
        virtually.unwrap_or_else(|| start.elapsed())
    }

    /// Lets time pass, where it is virtual.
    pub fn pass(&mut self, time: Duration) {
        self.passed += time;
        self.store.lock().pass(self.passed);
    }

    /// For how many frames ahead it is worth to know what will be needed, at least `least`; 0 for not at all.
    #[must_use]
    pub fn look_ahead(&self, least: u32) -> u32 {
        let [missed, _] = self.waiting();
        self.look_ahead.frames(missed, least)
    }

    /// What has been read and has failed since the last call.
    pub fn take_stats(&mut self) -> PageStats {
        std::mem::take(&mut self.stats)
    }
}

impl<P: Pages> Drop for Requests<P> {
    fn drop(&mut self) {
        self.tree.go();
        self.store.lock().queue.forget(&self.tree);
    }
}

impl<P: Pages> std::fmt::Debug for Requests<P> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Requests").field("under_way", &self.under_way.len()).finish_non_exhaustive()
    }
}
