//! Who reads: a thread, or on virtual time whoever lets time pass.
//!
//! What has to hold, in every interleaving (the tests of [`requests`](crate::Requests) have a model checker try them):
//!
//! 1. A request is answered once, taken back, or dropped with its tree, and only one of these. It is in the queue, in the hands of
//!    who reads, or in the tree's channel, and moves from one to the next under the lock or by ownership.
//! 2. Nobody sleeps forever. The thread sleeps only while it sees, under the lock, no request and no end; asking and closing
//!    change that under the lock and wake it afterwards. A tree sleeps only in [`Requests::settle`](crate::Requests::settle),
//!    while a request of its own is in the queue or being read: an answer comes, whatever the source does, unless it never
//!    returns.

use std::sync::{Arc, PoisonError};
use std::time::Duration;

use crate::pages::Pages;
use crate::queue::{Queue, Started};
use crate::simulated::{Line, Reads, Simulated};
use crate::sync::{Condvar, Mutex, MutexGuard, thread};

/// A store on virtual time. Its trees share its line and its clock: each of them says how much time has passed, and the
/// one that is ahead counts.
struct Clock<P: Pages> {
    line: Line<Started<P>>,
    /// How much time has passed, without what was waited for.
    passed: Duration,
    buffer: Vec<u8>,
}

/// What the trees and the thread of a store share.
pub(crate) struct State<P: Pages> {
    pub queue: Queue<P>,
    is_closed: bool,
    clock: Option<Clock<P>>,
}

/// The queue as a line on virtual time sees it.
struct Waiting<'a, P: Pages> {
    queue: &'a mut Queue<P>,
    buffer: &'a mut Vec<u8>,
}

impl<P: Pages> Reads for Waiting<'_, P> {
    type Read = Started<P>;

    fn start(&mut self) -> Option<(Started<P>, u64)> {
        let started = self.queue.start()?;
        let bytes = started.bytes();
        Some((started, bytes))
    }

    fn end(&mut self, started: Started<P>) {
        started.serve(self.buffer);
    }
}

impl<P: Pages> State<P> {
    /// Lets virtual time pass, for a tree for which so much has passed in all. Real time does so by itself.
    pub fn pass(&mut self, passed: Duration) {
        let Self { queue, clock: Some(Clock { line, passed: before, buffer }), .. } = self else { return };
        if let Some(time) = passed.checked_sub(*before) {
            line.pass(time, &mut Waiting { queue, buffer });
            *before = passed;
        }
    }

    /// Lets virtual time pass until nothing is left to be read, and returns how long that took; `None` if a thread reads.
    pub fn settle(&mut self) -> Option<Duration> {
        let Self { queue, clock, .. } = self;
        let Clock { line, buffer, .. } = clock.as_mut()?;
        Some(line.settle(&mut Waiting { queue, buffer }))
    }
}

struct Shared<P: Pages> {
    state: Mutex<State<P>>,
    wake: Condvar,
}

impl<P: Pages> Shared<P> {
    fn new(clock: Option<Clock<P>>) -> Arc<Self> {
        let state = State { queue: Queue::default(), is_closed: false, clock };
        Arc::new(Self { state: Mutex::new(state), wake: Condvar::new() })
    }

    fn lock(&self) -> MutexGuard<'_, State<P>> {
        // A queue is whole between any two operations on it.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next request; waits for it. `None` if the store is closed.
    fn next(&self) -> Option<Started<P>> {
        let mut state = self.lock();
        while !state.is_closed {
            if let Some(started) = state.queue.start() {
                return Some(started);
            }
            state = self.wake.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        None
    }

    /// The thread: until the store is closed.
    fn run(&self) {
        let mut buffer = Vec::new();
        while let Some(started) = self.next() {
            started.serve(&mut buffer);
        }
    }
}

/// The thread that reads could not be started.
#[derive(Debug, thiserror::Error)]
#[error("no thread for reading: {0}")]
pub struct ThreadError(std::io::Error);

/// Closes the store when the last handle is gone.
struct Handle<P: Pages>(Arc<Shared<P>>);

impl<P: Pages> Drop for Handle<P> {
    fn drop(&mut self) {
        self.0.lock().is_closed = true;
        self.0.wake.notify_all();
    }
}

/// Reads for any number of trees, what is most urgent first. A handle: clones are of the same store.
pub struct Store<P: Pages>(Arc<Handle<P>>);

impl<P: Pages> Clone for Store<P> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<P: Pages> std::fmt::Debug for Store<P> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Store").finish_non_exhaustive()
    }
}

impl<P: Pages> Store<P> {
    /// Starts a thread that reads.
    ///
    /// # Errors
    /// If there is none to be had.
    pub fn new() -> Result<Self, ThreadError> {
        let shared = Shared::new(None);
        let its = shared.clone();
        let thread = thread::Builder::new().name("page store".to_owned());
        thread.spawn(move || its.run()).map_err(ThreadError)?;
        Ok(Self(Arc::new(Handle(shared))))
    }

    /// A store on virtual time, without a thread: reads are made while a tree lets time [`pass`](crate::Requests::pass), in the
    /// thread that calls it.
    #[must_use]
    pub fn simulated(store: Simulated) -> Self {
        let clock = Clock { line: Line::new(store), passed: Duration::ZERO, buffer: Vec::new() };
        Self(Arc::new(Handle(Shared::new(Some(clock)))))
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, State<P>> {
        self.0.0.lock()
    }

    /// There is something to read.
    pub(crate) fn wake(&self) {
        self.0.0.wake.notify_one();
    }
}
