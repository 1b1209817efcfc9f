//! The I/O thread: reads and inflates blocks while frames go on.
//!
//! A tree that loads in the background owns one thread. It takes requests, those that a frame has missed before those
//! that are only ahead of time, reads from the file's source, and leaves blocks for the tree to take at the start of a frame.
//! Everything else belongs to the tree's own thread. The two share one lock, which is never held during a read.

use std::collections::VecDeque;
use std::sync::Arc;
use std::thread::JoinHandle;

use parking_lot::{Condvar, Mutex};

use crate::block::Block;
use crate::error::XfmError;
use crate::file::XfmFile;

/// Consecutive blocks to be read with one read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    pub first: u32,
    pub count: u32,
}

/// What became of a run.
pub(crate) struct Answer {
    pub run: Run,
    /// Bytes read, 0 if reading failed.
    pub bytes: u64,
    /// Of each block; or one error for all.
    pub blocks: Result<Vec<Result<Block, XfmError>>, XfmError>,
}

/// Reads a run with one read and inflates its blocks.
pub(crate) fn read_run(file: &XfmFile, run: Run, buffer: &mut Vec<u8>) -> Answer {
    let (offset, _) = file.place(run.first);
    let (last, length) = file.place(run.first + run.count - 1);
    let length = last + length - offset;
    buffer.resize(length as usize, 0);
    let blocks = match file.source().read_at(offset, buffer) {
        Err(source) => Err(XfmError::Read { file: file.name().to_owned(), offset, length, source }),
        Ok(()) => Ok((run.first..run.first + run.count)
            .map(|block| {
                let (start, length) = file.place(block);
                let start = (start - offset) as usize;
                let bytes = &buffer[start..start + length as usize];
                Block::decode(file.header(), block, bytes).map_err(|reason| file.damaged(block, reason))
            })
            .collect()),
    };
    Answer { run, bytes: if blocks.is_ok() { length } else { 0 }, blocks }
}

#[derive(Default)]
struct Queue {
    urgent: VecDeque<Run>,
    ahead: VecDeque<Run>,
    done: Vec<Answer>,
    is_reading: bool,
    is_closed: bool,
}

struct Shared {
    queue: Mutex<Queue>,
    /// There is something to do, or nothing ever will be.
    work: Condvar,
    /// All that was asked for is done.
    rest: Condvar,
}

/// The I/O thread of a tree.
pub(crate) struct Loader {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Loader {
    /// Starts the thread.
    pub fn start(file: Arc<XfmFile>) -> std::io::Result<Self> {
        let queue = Mutex::new(Queue::default());
        let shared = Arc::new(Shared { queue, work: Condvar::new(), rest: Condvar::new() });
        let its = shared.clone();
        let builder = std::thread::Builder::new().name("detail-block-io".to_owned());
        let thread = builder.spawn(move || work(&file, &its))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Asks for a run.
    pub fn ask(&self, run: Run, is_urgent: bool) {
        let mut queue = self.shared.queue.lock();
        if is_urgent {
            queue.urgent.push_back(run);
        } else {
            queue.ahead.push_back(run);
        }
        self.shared.work.notify_one();
    }

    /// Says that a run asked for ahead of time is missed now.
    pub fn hurry(&self, block: u32) {
        let mut queue = self.shared.queue.lock();
        let holds = |run: &Run| (run.first..run.first + run.count).contains(&block);
        if let Some(at) = queue.ahead.iter().position(holds)
            && let Some(run) = queue.ahead.remove(at)
        {
            queue.urgent.push_back(run);
        }
    }

    /// Takes what has been read.
    pub fn take(&self, answers: &mut Vec<Answer>) {
        answers.append(&mut self.shared.queue.lock().done);
    }

    /// Waits until everything asked for has been read or has failed.
    pub fn settle(&self) {
        let mut queue = self.shared.queue.lock();
        while queue.is_reading || !queue.urgent.is_empty() || !queue.ahead.is_empty() {
            self.shared.rest.wait(&mut queue);
        }
    }
}

impl Drop for Loader {
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
        let Some(run) = queue.urgent.pop_front().or_else(|| queue.ahead.pop_front()) else {
            shared.rest.notify_all();
            shared.work.wait(&mut queue);
            continue;
        };
        queue.is_reading = true;
        drop(queue);
        let answer = read_run(file, run, &mut buffer);
        queue = shared.queue.lock();
        queue.is_reading = false;
        queue.done.push(answer);
    }
    shared.rest.notify_all();
}
