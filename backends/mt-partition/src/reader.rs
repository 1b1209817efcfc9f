//! The thread that reads.
//!
//! A [`Reader`] owns one thread, which takes requests from a channel, reads, checks and unpacks, and sends what it found
//! to the tree that asked. Trees own everything else: nothing is shared but the channels, the open file, which does not
//! change, and a flag by which a tree that goes away takes back its requests. So frames never wait: a tree sends without
//! blocking (the channels have no limit; what is under way is limited by the memory that a tree must reserve first), and
//! looks for answers without blocking. The thread ends when the last handle of its reader is gone. Nobody waits for that:
//! a read that hangs keeps nobody from dropping a tree.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crossbeam_channel::{Receiver, Sender, unbounded};

use crate::MtError;
use crate::file::MtFile;
use crate::record::Record;

/// A request to read nodes with consecutive numbers.
struct Request {
    file: Arc<MtFile>,
    nodes: Range<u32>,
    answer: Sender<Answer>,
    cancelled: Arc<AtomicBool>,
}

/// What came of it.
#[derive(Debug)]
pub(crate) struct Answer {
    pub nodes: Range<u32>,
    pub records: Result<Vec<Result<Record, MtError>>, MtError>,
}

/// A thread that reads for any number of trees, in the order in which they ask.
#[derive(Clone, Debug)]
pub struct Reader {
    requests: Sender<Request>,
}

impl Reader {
    /// Starts the thread.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn new() -> std::io::Result<Self> {
        let (requests, inbox) = unbounded::<Request>();
        std::thread::Builder::new().name("mt-partition reader".to_owned()).spawn(move || {
            for request in &inbox {
                if request.cancelled.load(Ordering::Relaxed) {
                    continue;
                }
                let records = request.file.read(request.nodes.clone());
                // A tree that has gone away meanwhile does not want to know.
                let _ = request.answer.send(Answer { nodes: request.nodes, records });
            }
        })?;
        Ok(Self { requests })
    }
}

/// A tree's end of its reader.
#[derive(Debug)]
pub(crate) struct Line {
    reader: Reader,
    file: Arc<MtFile>,
    answer: Sender<Answer>,
    answers: Receiver<Answer>,
    cancelled: Arc<AtomicBool>,
    under_way: usize,
}

impl Line {
    pub fn new(reader: Reader, file: Arc<MtFile>) -> Self {
        let (answer, answers) = unbounded();
        Self { reader, file, answer, answers, cancelled: Arc::default(), under_way: 0 }
    }

    /// Asks for nodes. Says whether somebody will answer.
    pub fn ask(&mut self, nodes: Range<u32>) -> bool {
        let request = Request {
            file: self.file.clone(),
            nodes,
            answer: self.answer.clone(),
            cancelled: self.cancelled.clone(),
        };
        let sent = self.reader.requests.send(request).is_ok();
        self.under_way += usize::from(sent);
        sent
    }

    /// An answer that has come.
    pub fn take(&mut self) -> Option<Answer> {
        let answer = self.answers.try_recv().ok()?;
        self.under_way -= 1;
        Some(answer)
    }

    /// Waits for an answer, if one is due.
    pub fn wait(&mut self) -> Option<Answer> {
        if self.under_way == 0 {
            return None;
        }
        // This end keeps a sender itself, so the channel can not be closed; a thread that died would never answer.
        loop {
            if let Ok(answer) = self.answers.recv_timeout(std::time::Duration::from_millis(100)) {
                self.under_way -= 1;
                return Some(answer);
            }
            if self.reader.requests.is_empty() && self.is_orphaned() {
                self.under_way = 0;
                return None;
            }
        }
    }

    /// Whether the thread is gone: then it has dropped its end of the requests.
    fn is_orphaned(&self) -> bool {
        let probe = Request {
            file: self.file.clone(),
            nodes: 0..0,
            answer: self.answer.clone(),
            cancelled: Arc::new(AtomicBool::new(true)),
        };
        self.reader.requests.send(probe).is_err()
    }
}

impl Drop for Line {
    fn drop(&mut self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }
}
