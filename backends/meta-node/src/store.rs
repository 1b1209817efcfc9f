//! Who carries out commands: the I/O thread over the command board, or, on virtual time, whoever plays the clock.

use std::sync::Arc;
use std::time::{Duration, Instant};

use vertex_tree::simulated::{Line, Reads};

use crate::board::Board;
use crate::error::MetaNodeError;
use crate::file::MetaNodeFile;
use crate::page::Layout;
use crate::settings::Io;
use crate::waiting::{Command, Done, Waiting};

/// The navigation's side of I/O.
pub(crate) enum Store {
    Thread(Arc<Board>),
    Simulated(Box<Virtual>),
}

/// A store on virtual time: no thread, everything here belongs to the navigation.
pub(crate) struct Virtual {
    line: Line<Command>,
    pages: Pages,
}

struct Pages {
    file: Arc<MetaNodeFile>,
    waiting: Waiting,
}

impl Reads for Pages {
    type Read = Command;

    fn start(&mut self) -> Option<(Command, u64)> {
        let command = self.waiting.next()?;
        let bytes = 4 * self.file.page_words(command.page) as u64;
        Some((command, bytes))
    }

    fn end(&mut self, mut command: Command) {
        let result = read(&self.file, command.page, &mut command.words);
        self.waiting.finish(Done { command, result });
    }
}

/// Reads a page. A source is other people's code: a panic there is a fault like any other.
fn read(file: &MetaNodeFile, page: u32, words: &mut [u32]) -> Result<Layout, MetaNodeError> {
    let read = std::panic::AssertUnwindSafe(|| file.read_page(page, words));
    std::panic::catch_unwind(read).unwrap_or_else(|_| {
        Err(MetaNodeError::Page {
            file: file.name().to_owned(),
            page,
            offset: file.page_offset(page),
            reason: "the store panicked",
        })
    })
}

impl Store {
    /// Starts the thread, if there is to be one.
    pub fn new(file: &Arc<MetaNodeFile>, io: Io) -> Result<Self, MetaNodeError> {
        let file = file.clone();
        let store = match io {
            Io::Simulated(store) => {
                let pages = Pages { file, waiting: Waiting::default() };
                return Ok(Self::Simulated(Box::new(Virtual { line: Line::new(store), pages })));
            }
            Io::Thread => Arc::new(Board::default()),
        };
        let board = store.clone();
        std::thread::Builder::new()
            .name("meta-node I/O".to_owned())
            .spawn(move || board.serve(|page, words: &mut [u32]| read(&file, page, words)))
            .map_err(MetaNodeError::Thread)?;
        Ok(Self::Thread(store))
    }

    pub fn post(&mut self, commands: &mut Vec<Command>, promoted: &mut Vec<u32>) {
        match self {
            Self::Thread(board) => board.post(commands, promoted),
            Self::Simulated(store) => store.pages.waiting.post(commands, promoted),
        }
    }

    pub fn take_back(&mut self, even_urgent: bool) -> Option<Command> {
        match self {
            Self::Thread(board) => board.take_back(even_urgent),
            Self::Simulated(store) => store.pages.waiting.take_back(even_urgent),
        }
    }

    pub fn take_back_urgent(&mut self, page: u32) -> Option<Command> {
        match self {
            Self::Thread(board) => board.take_back_urgent(page),
            Self::Simulated(store) => store.pages.waiting.take_back_urgent(page),
        }
    }

    pub fn take_back_ahead(&mut self, commands: &mut Vec<Command>) {
        match self {
            Self::Thread(board) => board.take_back_ahead(commands),
            Self::Simulated(store) => store.pages.waiting.take_back_ahead(commands),
        }
    }

    pub fn collect(&mut self, done: &mut Vec<Done>, frame: u64) {
        match self {
            Self::Thread(board) => board.collect(done, frame),
            Self::Simulated(store) => store.pages.waiting.collect(done, frame),
        }
    }

    /// How many commands wait, urgent ones and others.
    pub fn waiting(&self) -> [usize; 2] {
        match self {
            Self::Thread(board) => board.waiting(),
            Self::Simulated(store) => store.pages.waiting.lengths(),
        }
    }

    /// Waits until no command waits and none is being carried out; on virtual time, lets that pass. Returns how long that
    /// took.
    pub fn settle(&mut self) -> Duration {
        match self {
            Self::Thread(board) => {
                let start = Instant::now();
                board.settle();
                start.elapsed()
            }
            Self::Simulated(store) => store.line.settle(&mut store.pages),
        }
    }

    /// Lets virtual time pass. Real time does so by itself.
    pub fn pass(&mut self, time: Duration) {
        if let Self::Simulated(store) = self {
            store.line.pass(time, &mut store.pages);
        }
    }
}

impl Drop for Store {
    /// The thread ends after the read that it is at. Nobody waits for that.
    fn drop(&mut self) {
        if let Self::Thread(board) = self {
            board.stop();
        }
    }
}
