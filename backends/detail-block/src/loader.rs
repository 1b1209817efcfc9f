//! What reads blocks while frames go on: an I/O thread, or a line on virtual time.
//!
//! Both take requests from a [`Queue`], those that a frame has missed before those that are only foreseen, read from the
//! file's source, and leave blocks for the tree to take at the start of a frame. Everything else belongs to the tree's
//! own thread.
//!
//! * A tree that loads in the background owns one thread. The two share one lock, which is never held during a read.
//! * On virtual time there is no thread: whoever lets time pass reads and inflates what has ended by then.

use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex};
use vertex_tree::simulated::{Line, Reads, Simulated};

use crate::block::Block;
use crate::error::XfmError;
use crate::file::XfmFile;

/// Consecutive blocks to be read with one read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub first: u32,
    pub count: u32,
}

impl Run {
    pub fn numbers(self) -> std::ops::Range<u32> {
        self.first..self.first + self.count
    }

    /// Where it is in the file, and how many bytes it has there.
    fn place(self, file: &XfmFile) -> (u64, u64) {
        let (offset, _) = file.place(self.first);
        let (last, length) = file.place(self.first + self.count - 1);
        (offset, last + length - offset)
    }
}

/// A run that is being read, and the frame in which that began.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reading {
    run: Run,
    frame: u64,
}

/// What became of a run.
pub(crate) struct Answer {
    pub run: Run,
    /// See [`Reading`].
    pub frame: u64,
    /// Bytes read, 0 if reading failed.
    pub bytes: u64,
    /// Of each block; or one error for all.
    pub blocks: Result<Vec<Result<Block, XfmError>>, XfmError>,
}

/// Reads a run with one read and inflates its blocks.
pub(crate) fn read_run(file: &XfmFile, run: Run, frame: u64, buffer: &mut Vec<u8>) -> Answer {
    let (offset, length) = run.place(file);
    buffer.resize(length as usize, 0);
    let blocks = match file.source().read_at(offset, buffer) {
        Err(source) => Err(XfmError::Read { file: file.name().to_owned(), offset, length, source }),
        Ok(()) => Ok(run
            .numbers()
            .map(|block| {
                let (start, length) = file.place(block);
                let start = (start - offset) as usize;
                let bytes = &buffer[start..start + length as usize];
                Block::decode(file.header(), block, bytes).map_err(|reason| file.damaged(block, reason))
            })
            .collect()),
    };
    Answer { run, frame, bytes: if blocks.is_ok() { length } else { 0 }, blocks }
}

/// What is wanted and has not been started, and what has been read.
#[derive(Default)]
struct Queue {
    urgent: VecDeque<Run>,
    ahead: VecDeque<Run>,
    done: Vec<Answer>,
    /// The tree's frame.
    frame: u64,
    is_reading: bool,
    is_closed: bool,
}

impl Queue {
    fn next(&mut self) -> Option<Reading> {
        let run = self.urgent.pop_front().or_else(|| self.ahead.pop_front())?;
        Some(Reading { run, frame: self.frame })
    }

    fn take_back(&mut self, block: u32, may: impl FnOnce(Run) -> bool) -> Option<Run> {
        let at = self.urgent.iter().position(|run| run.numbers().contains(&block))?;
        if may(self.urgent[at]) { self.urgent.remove(at) } else { None }
    }

    fn hurry(&mut self, block: u32) {
        if let Some(at) = self.ahead.iter().position(|run| run.numbers().contains(&block))
            && let Some(run) = self.ahead.remove(at)
        {
            self.urgent.push_back(run);
        }
    }
}

struct Shared {
    queue: Mutex<Queue>,
    /// There is something to do, or nothing ever will be.
    work: Condvar,
    /// All that was asked for is done.
    rest: Condvar,
}

/// What a line on virtual time reads.
pub(crate) struct OnLine {
    file: Arc<XfmFile>,
    queue: Queue,
    buffer: Vec<u8>,
}

impl Reads for OnLine {
    type Read = Reading;

    fn start(&mut self) -> Option<(Reading, u64)> {
        let reading = self.queue.next()?;
        Some((reading, reading.run.place(&self.file).1))
    }

    fn end(&mut self, Reading { run, frame }: Reading) {
        self.queue.done.push(read_run(&self.file, run, frame, &mut self.buffer));
    }
}

/// What reads for a tree.
pub(crate) enum Loader {
    Thread(Thread),
    Line(Box<(Line<Reading>, OnLine)>),
}

impl Loader {
    /// Starts a thread.
    pub fn thread(file: Arc<XfmFile>) -> std::io::Result<Self> {
        Ok(Self::Thread(Thread::start(file)?))
    }

    /// A store on virtual time.
    pub fn simulated(file: Arc<XfmFile>, store: Simulated) -> Self {
        let on_line = OnLine { file, queue: Queue::default(), buffer: Vec::new() };
        Self::Line(Box::new((Line::new(store), on_line)))
    }

    /// Requests that wait for their turn: those that were missed, and those that are only foreseen.
    pub fn waiting(&self) -> [usize; 2] {
        let lengths = |queue: &Queue| [queue.urgent.len(), queue.ahead.len()];
        match self {
            Self::Thread(thread) => lengths(&thread.shared.queue.lock()),
            Self::Line(line) => lengths(&line.1.queue),
        }
    }

    fn with_queue<R>(&mut self, f: impl FnOnce(&mut Queue) -> R) -> R {
        match self {
            Self::Thread(thread) => f(&mut thread.shared.queue.lock()),
            Self::Line(line) => f(&mut line.1.queue),
        }
    }

    /// Asks for a run.
    pub fn ask(&mut self, run: Run, is_urgent: bool) {
        self.with_queue(|queue| {
            if is_urgent {
                queue.urgent.push_back(run);
            } else {
                queue.ahead.push_back(run);
            }
        });
        if let Self::Thread(thread) = self {
            thread.shared.work.notify_one();
        }
    }

    /// Says that a run asked for ahead of time is missed now.
    pub fn hurry(&mut self, block: u32) {
        self.with_queue(|queue| queue.hurry(block));
    }

    /// Takes back what was asked for ahead of time, was not missed since and has not been started.
    pub fn withdraw(&mut self, runs: &mut Vec<Run>) {
        self.with_queue(|queue| runs.extend(queue.ahead.drain(..)));
    }

    /// Takes back the request for a block that was missed, if `may` says so of its run and it has not been started.
    pub fn take_back(&mut self, block: u32, may: impl FnOnce(Run) -> bool) -> Option<Run> {
        self.with_queue(|queue| queue.take_back(block, may))
    }

    /// A frame begins: takes what has been read.
    pub fn take(&mut self, frame: u64, answers: &mut Vec<Answer>) {
        self.with_queue(|queue| {
            queue.frame = frame;
            answers.append(&mut queue.done);
        });
    }

    /// Lets time pass, if it is virtual.
    pub fn pass(&mut self, time: Duration) {
        if let Self::Line(line) = self {
            let (line, reads) = &mut **line;
            line.pass(time, reads);
        }
    }

    /// Waits until everything asked for has been read or has failed. Returns how long that took.
    pub fn settle(&mut self) -> Duration {
        match self {
            Self::Thread(thread) => {
                let start = Instant::now();
                thread.settle();
                start.elapsed()
            }
            Self::Line(line) => {
                let (line, reads) = &mut **line;
                line.settle(reads)
            }
        }
    }
}

/// The I/O thread of a tree.
pub(crate) struct Thread {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Thread {
    fn start(file: Arc<XfmFile>) -> std::io::Result<Self> {
        let queue = Mutex::new(Queue::default());
        let shared = Arc::new(Shared { queue, work: Condvar::new(), rest: Condvar::new() });
        let its = shared.clone();
        let builder = std::thread::Builder::new().name("detail-block-io".to_owned());
        let thread = builder.spawn(move || work(&file, &its))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    fn settle(&self) {
        let mut queue = self.shared.queue.lock();
        while queue.is_reading || !queue.urgent.is_empty() || !queue.ahead.is_empty() {
            self.shared.rest.wait(&mut queue);
        }
    }
}

impl Drop for Thread {
    fn drop(&mut self) {
        self.shared.queue.lock().is_closed = true;
        self.shared.work.notify_one();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported by itself.
            let _ = thread.join();
        }
    }
}

fn work(file: &XfmFile, shared: &Shared) {
    let mut buffer = Vec::new();
    let mut queue = shared.queue.lock();
    while !queue.is_closed {
        let Some(Reading { run, frame }) = queue.next() else {
            shared.rest.notify_all();
            shared.work.wait(&mut queue);
            continue;
        };
        queue.is_reading = true;
        drop(queue);
        let answer = read_run(file, run, frame, &mut buffer);
        queue = shared.queue.lock();
        queue.is_reading = false;
        queue.done.push(answer);
    }
    shared.rest.notify_all();
}
