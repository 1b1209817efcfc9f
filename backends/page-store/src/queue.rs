//! Requests that have not been started, the most urgent first.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::pages::Pages;
use crate::sync::{AtomicBool, AtomicU64, AtomicUsize, Ordering, Sender};

/// The urgency of what a refused change waits for. What is only foreseen has more: the number of a frame, or any other.
pub const NOW: u64 = 0;

/// What the store knows of a tree. Each number is right by itself, and nothing is published through them: relaxed order will do.
pub(crate) struct Client<P: Pages> {
    pub pages: Arc<P>,
    /// Where its answers go.
    pub answers: Sender<Answer<P>>,
    is_gone: AtomicBool,
    /// The frame that it is in.
    frame: AtomicU64,
    /// Its requests in the queue: those that are wanted now, and others. Written under the lock of the queue.
    waiting: [AtomicUsize; 2],
}

impl<P: Pages> Client<P> {
    pub fn new(pages: Arc<P>, answers: Sender<Answer<P>>) -> Arc<Self> {
        let (is_gone, frame, waiting) = Default::default();
        Arc::new(Self { pages, answers, is_gone, frame, waiting })
    }

    pub fn is_gone(&self) -> bool {
        self.is_gone.load(Ordering::Relaxed)
    }

    pub fn go(&self) {
        self.is_gone.store(true, Ordering::Relaxed);
    }

    pub fn set_frame(&self, frame: u64) {
        self.frame.store(frame, Ordering::Relaxed);
    }

    pub fn waiting(&self) -> [usize; 2] {
        [0, 1].map(|kind| self.waiting[kind].load(Ordering::Relaxed))
    }

    fn count(&self, place: Place, by: isize) {
        let count = &self.waiting[usize::from(place.urgency != NOW)];
        count.store(count.load(Ordering::Relaxed).wrapping_add_signed(by), Ordering::Relaxed);
    }
}

/// What has come of a request.
pub(crate) struct Answer<P: Pages> {
    pub id: u64,
    /// The tree's frame when the read was started.
    pub started: u64,
    pub content: Result<P::Content, P::Error>,
}

/// A request that waits.
pub(crate) struct Request<P: Pages> {
    pub id: u64,
    pub read: P::Read,
    pub tree: Arc<Client<P>>,
}

/// A request that has been started.
pub(crate) struct Started<P: Pages> {
    request: Request<P>,
    frame: u64,
}

impl<P: Pages> Started<P> {
    pub fn bytes(&self) -> u64 {
        self.request.tree.pages.bytes(&self.request.read)
    }

    /// Reads, unless the tree is gone, and answers.
    pub fn serve(self, buffer: &mut Vec<u8>) {
        let Request { id, read, tree } = self.request;
        if tree.is_gone() {
            return;
        }
        let pages = &tree.pages;
        let reading = std::panic::AssertUnwindSafe(|| pages.read(&read, buffer));
        let content = std::panic::catch_unwind(reading).unwrap_or_else(|_| Err(pages.panicked(&read)));
        // A tree that has gone away meanwhile does not want to know.
        let _ = tree.answers.send(Answer { id, started: self.frame, content });
    }
}

/// Where a request stands: by urgency, and among those as urgent in the order of asking.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Place {
    pub urgency: u64,
    order: u64,
}

/// The requests of all trees of a store.
pub(crate) struct Queue<P: Pages> {
    requests: BTreeMap<Place, Request<P>>,
    asked: u64,
}

impl<P: Pages> Default for Queue<P> {
    fn default() -> Self {
        Self { requests: BTreeMap::new(), asked: 0 }
    }
}

impl<P: Pages> Queue<P> {
    /// Puts a request behind all that are as urgent.
    pub fn push(&mut self, urgency: u64, request: Request<P>) -> Place {
        self.asked += 1;
        let place = Place { urgency, order: self.asked };
        request.tree.count(place, 1);
        self.requests.insert(place, request);
        place
    }

    /// Takes a request out, if it still waits.
    pub fn remove(&mut self, place: Place) -> Option<Request<P>> {
        let request = self.requests.remove(&place)?;
        request.tree.count(place, -1);
        Some(request)
    }

    /// Gives a request another urgency, if it still waits. It stays before those that have been asked for later and are as urgent.
    pub fn rank(&mut self, place: Place, urgency: u64) -> Place {
        let Some(request) = self.remove(place) else { return place };
        let place = Place { urgency, ..place };
        request.tree.count(place, 1);
        self.requests.insert(place, request);
        place
    }

    /// Puts a request that still waits behind all that is wanted now.
    pub fn hurry(&mut self, place: Place) -> Place {
        match self.remove(place) {
            Some(request) => self.push(NOW, request),
            None => place,
        }
    }

    /// Takes the request to be served next.
    pub fn start(&mut self) -> Option<Started<P>> {
        let (place, request) = self.requests.pop_first()?;
        request.tree.count(place, -1);
        let frame = request.tree.frame.load(Ordering::Relaxed);
        Some(Started { request, frame })
    }

    /// The last request of a tree, if it is not wanted now or `even_now`.
    pub fn last_of(&self, tree: &Arc<Client<P>>, even_now: bool) -> Option<Place> {
        let may = |&(place, request): &(&Place, &Request<P>)| {
            Arc::ptr_eq(&request.tree, tree) && (even_now || place.urgency != NOW)
        };
        self.requests.iter().rev().find(may).map(|(&place, _)| place)
    }

    /// Takes out all requests of a tree that are not wanted now, in order.
    pub fn remove_ahead(&mut self, tree: &Arc<Client<P>>, mut f: impl FnMut(Request<P>)) {
        let ahead = Place { urgency: NOW + 1, order: 0 };
        let is_its =
            |(&place, request): (&Place, &Request<P>)| Arc::ptr_eq(&request.tree, tree).then_some(place);
        let places: Vec<Place> = self.requests.range(ahead..).filter_map(is_its).collect();
        for place in places {
            self.remove(place).into_iter().for_each(&mut f);
        }
    }

    /// Drops all requests of a tree.
    pub fn forget(&mut self, tree: &Arc<Client<P>>) {
        self.requests.retain(|_, request| !Arc::ptr_eq(&request.tree, tree));
    }
}
