//! The store: a thread that reads, or a store on virtual time.
//!
//! A [`Reader`] has a queue of requests, the most urgent first: changes that were refused, then what is foreseen, by the
//! frame in which it will be needed. A thread takes them from there, reads, checks and unpacks, and sends what it found to
//! the tree that asked. Trees own everything else: nothing is shared but the queue, a channel for the answers, and the open
//! file, which does not change. So frames never wait: the lock of the queue is never held while reading, and a tree looks
//! for answers without blocking. What is under way is limited by the memory that a tree must reserve first. A tree that
//! goes away takes its requests back, and the thread ends when the last handle of its reader is gone. Nobody waits for
//! that: a read that hangs keeps nobody from dropping a tree.
//!
//! On virtual time there is no thread. The same queue is served by [`Line`](vertex_tree::simulated::Line) when a tree lets
//! time pass. Trees that share a reader share its line and its clock: each of them says how much time has passed, and the
//! one that is ahead counts.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, Sender, unbounded};
use vertex_tree::simulated::{self, Reads, Simulated};

use super::error::MtError;
use crate::file::MtFile;
use crate::record::Record;

/// A request to read nodes with consecutive numbers.
#[derive(Debug)]
struct Request {
    file: Arc<MtFile>,
    nodes: Range<u32>,
    answer: Sender<Answer>,
    tree: Arc<TreeState>,
}

/// What the store knows of a tree.
#[derive(Debug, Default)]
struct TreeState {
    is_gone: AtomicBool,
    frame: AtomicU64,
}

/// What came of it.
#[derive(Debug)]
pub(crate) struct Answer {
    pub nodes: Range<u32>,
    pub records: Result<Vec<Result<Record, MtError>>, MtError>,
    /// The tree's frame when the read was started.
    pub started: u64,
}

impl Request {
    fn frame(&self) -> u64 {
        self.tree.frame.load(Ordering::Relaxed)
    }

    fn serve(self, started: u64) {
        if !self.tree.is_gone.load(Ordering::Relaxed) {
            let records = self.file.read(self.nodes.clone());
            // A tree that has gone away meanwhile does not want to know.
            let _ = self.answer.send(Answer { nodes: self.nodes, records, started });
        }
    }
}

/// The place of a request in the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Ticket {
    urgency: u64,
    order: u64,
}

/// The urgency of what a refused change needs. What is foreseen has the number of a frame, which is more.
pub(crate) const NOW: u64 = 0;

#[derive(Debug, Default)]
struct Queue {
    requests: BTreeMap<Ticket, Request>,
    asked: u64,
    is_closed: bool,
    /// The thread has ended, whatever the reason.
    is_lost: bool,
    /// Where time is virtual.
    clock: Option<Clock>,
}

#[derive(Debug)]
struct Clock {
    line: simulated::Line<(Request, u64)>,
    /// How much time has passed, without what was waited for.
    passed: Duration,
}

struct Waiting<'a>(&'a mut BTreeMap<Ticket, Request>);

impl Reads for Waiting<'_> {
    type Read = (Request, u64);

    fn start(&mut self) -> Option<(Self::Read, u64)> {
        let (_, request) = self.0.pop_first()?;
        let (started, bytes) = (request.frame(), request.file.bytes(request.nodes.clone()));
        Some(((request, started), bytes))
    }

    fn end(&mut self, (request, started): Self::Read) {
        request.serve(started);
    }
}

#[derive(Debug, Default)]
struct Shared {
    queue: Mutex<Queue>,
    wake: Condvar,
}

impl Shared {
    fn queue(&self) -> MutexGuard<'_, Queue> {
        // A queue is whole between any two operations on it.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The thread: until the queue is closed.
    fn run(&self) {
        loop {
            let mut queue = self.queue();
            let request = loop {
                if queue.is_closed {
                    return;
                }
                if let Some((_, request)) = queue.requests.pop_first() {
                    break request;
                }
                queue = self.wake.wait(queue).unwrap_or_else(PoisonError::into_inner);
            };
            drop(queue);
            let started = request.frame();
            request.serve(started);
        }
    }
}

/// Says that the thread has ended.
struct Ending(Arc<Shared>);

impl Drop for Ending {
    fn drop(&mut self) {
        self.0.queue().is_lost = true;
    }
}

/// Closes the queue when the last handle is gone.
#[derive(Debug)]
struct Handle(Arc<Shared>);

impl Drop for Handle {
    fn drop(&mut self) {
        self.0.queue().is_closed = true;
        self.0.wake.notify_all();
    }
}

/// Reads for any number of trees, what is most urgent first.
#[derive(Clone, Debug)]
pub struct Reader(Arc<Handle>);

impl Reader {
    /// Starts a thread that reads.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn new() -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let ending = Ending(shared.clone());
        std::thread::Builder::new().name("mt-partition reader".to_owned()).spawn(move || ending.0.run())?;
        Ok(Self(Arc::new(Handle(shared))))
    }

    /// A store on virtual time, without a thread: reads are made while a tree lets time
    /// [`pass`](vertex_tree::Hierarchy::pass), in the thread that calls it.
    #[must_use]
    pub fn simulated(store: Simulated) -> Self {
        let clock = Some(Clock { line: simulated::Line::new(store), passed: Duration::ZERO });
        let queue = Mutex::new(Queue { clock, ..Queue::default() });
        Self(Arc::new(Handle(Arc::new(Shared { queue, wake: Condvar::new() }))))
    }
}

/// A tree's end of its reader.
#[derive(Debug)]
pub(crate) struct Line {
    reader: Reader,
    file: Arc<MtFile>,
    answer: Sender<Answer>,
    answers: Receiver<Answer>,
    tree: Arc<TreeState>,
    under_way: usize,
    /// How much time has passed for this tree.
    passed: Duration,
}

impl Line {
    pub fn new(reader: Reader, file: Arc<MtFile>) -> Self {
        let (answer, answers) = unbounded();
        Self { reader, file, answer, answers, tree: Arc::default(), under_way: 0, passed: Duration::ZERO }
    }

    fn shared(&self) -> &Shared {
        &self.reader.0.0
    }

    /// Says which frame the tree is in.
    pub fn set_frame(&self, frame: u64) {
        self.tree.frame.store(frame, Ordering::Relaxed);
    }

    /// Asks for nodes. `None` if nobody will answer.
    pub fn ask(&mut self, nodes: Range<u32>, urgency: u64) -> Option<Ticket> {
        let request =
            Request { file: self.file.clone(), nodes, answer: self.answer.clone(), tree: self.tree.clone() };
        let mut queue = self.shared().queue();
        if queue.is_lost {
            return None;
        }
        queue.asked += 1;
        let ticket = Ticket { urgency, order: queue.asked };
        queue.requests.insert(ticket, request);
        drop(queue);
        self.shared().wake.notify_one();
        self.under_way += 1;
        Some(ticket)
    }

    /// Gives a request another urgency, if it still waits in the queue.
    pub fn rank(&self, ticket: &mut Ticket, urgency: u64) {
        if ticket.urgency == urgency {
            return;
        }
        let mut queue = self.shared().queue();
        if let Some(request) = queue.requests.remove(ticket) {
            ticket.urgency = urgency;
            queue.requests.insert(*ticket, request);
        }
    }

    /// Takes back a request, if it still waits in the queue, and says whether it did.
    pub fn withdraw(&mut self, ticket: Ticket) -> bool {
        let is_withdrawn = self.shared().queue().requests.remove(&ticket).is_some();
        self.under_way -= usize::from(is_withdrawn);
        is_withdrawn
    }

    /// How many of this tree's requests wait for their turn: those of refused changes, and those that are foreseen.
    pub fn waiting(&self) -> [usize; 2] {
        let mut counts = [0; 2];
        for (ticket, request) in &self.shared().queue().requests {
            if Arc::ptr_eq(&request.tree, &self.tree) {
                counts[usize::from(ticket.urgency != NOW)] += 1;
            }
        }
        counts
    }

    /// An answer that has come.
    pub fn take(&mut self) -> Option<Answer> {
        let answer = self.answers.try_recv().ok()?;
        self.under_way -= 1;
        Some(answer)
    }

    /// Lets time pass, where it is virtual.
    pub fn pass(&mut self, time: Duration) {
        self.passed += time;
        let mut queue = self.shared().queue();
        let Queue { requests, clock: Some(clock), .. } = &mut *queue else { return };
        if let Some(time) = self.passed.checked_sub(clock.passed) {
            clock.line.pass(time, &mut Waiting(requests));
            clock.passed = self.passed;
        }
    }

    /// Waits for all that has been asked for: in virtual time where that is what there is. Returns how long that took.
    pub fn settle(&mut self, f: impl FnMut(Answer)) -> Duration {
        let virtually = match &mut *self.shared().queue() {
            Queue { requests, clock: Some(clock), .. } => Some(clock.line.settle(&mut Waiting(requests))),
            _ => None,
        };
        let start = Instant::now();
        self.take_all(f);
        virtually.unwrap_or_else(|| start.elapsed())
    }

    fn take_all(&mut self, mut f: impl FnMut(Answer)) {
        while self.under_way > 0 {
            // This end keeps a sender itself, so the channel can not be closed; a thread that has ended never answers.
            match self.answers.recv_timeout(Duration::from_millis(100)) {
                Ok(answer) => f(answer),
                Err(_) if self.shared().queue().is_lost && self.answers.is_empty() => {
                    self.under_way = 0;
                    return;
                }
                Err(_) => continue,
            }
            self.under_way -= 1;
        }
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.tree.is_gone.store(true, Ordering::Relaxed);
        let tree = &self.tree;
        self.shared().queue().requests.retain(|_, request| !Arc::ptr_eq(&request.tree, tree));
    }
}
