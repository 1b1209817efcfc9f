//! The command board between navigation and I/O (El-Sana & Chiang 2000, section 3.3.4).
//!
//! Navigation posts commands and collects what has been done; the I/O thread takes commands, urgent ones first, and
//! reads. The board's queues are the only state that both touch, and one lock guards all of them. It is never held while
//! reading, so navigation never waits for the disk.
//!
//! In the paper the place holders, the hash table and the free list are shared as well, under a second lock, and much
//! care goes into not reusing a place holder that is being navigated. Here they belong to navigation alone. A place
//! holder that is to be filled travels with its command, and comes back with what was read: while I/O has it, navigation
//! does not, by ownership.
//!
//! What has to hold, in every interleaving:
//!
//! 1. A command that is posted is done, taken back, or dropped with the board; never two of these, and its place holder
//!    is lost in none of the first two. [`Waiting`] moves each command from one queue to the next under the lock.
//! 2. Nobody sleeps forever. I/O sleeps only while it sees, under the lock, no command and no stop; posting and stopping
//!    change that under the lock and wake it afterwards. Navigation sleeps only in [`Board::settle`], while commands wait or
//!    one is being read; finishing changes that under the lock and wakes it afterwards. A read that never returns
//!    keeps `settle` waiting, and nothing else: whoever drops the tree does not wait for the thread.
//!
//! The tests below have shuttle try the interleavings.

#[cfg(test)]
use shuttle::sync::{Condvar, Mutex, MutexGuard};
use std::sync::PoisonError;
#[cfg(not(test))]
use std::sync::{Condvar, Mutex, MutexGuard};

use crate::error::MetaNodeError;
use crate::page::Layout;
use crate::waiting::{Command, Done, Waiting};

#[derive(Default)]
struct State {
    waiting: Waiting,
    reading: bool,
    stopped: bool,
}

#[derive(Default)]
pub(crate) struct Board {
    state: Mutex<State>,
    posted: Condvar,
    finished: Condvar,
}

impl Board {
    fn lock(&self) -> MutexGuard<'_, State> {
        // Nothing panics while it holds the lock, and queues are whole at every moment.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Navigation: posts commands, in order, and says which of those that wait have become urgent.
    pub fn post(&self, commands: &mut Vec<Command>, promoted: &mut Vec<u32>) {
        if commands.is_empty() && promoted.is_empty() {
            return;
        }
        self.lock().waiting.post(commands, promoted);
        self.posted.notify_one();
    }

    /// Navigation: takes back the last of the commands that wait and are not urgent, or else, if it must be, of those that
    /// are.
    pub fn take_back(&self, even_urgent: bool) -> Option<Command> {
        self.lock().waiting.take_back(even_urgent)
    }

    /// Navigation: takes back the command for a page, if it waits and is urgent.
    pub fn take_back_urgent(&self, page: u32) -> Option<Command> {
        self.lock().waiting.take_back_urgent(page)
    }

    /// Navigation: takes back all commands that wait and are not urgent.
    pub fn take_back_ahead(&self, commands: &mut Vec<Command>) {
        self.lock().waiting.take_back_ahead(commands);
    }

    /// Navigation: takes what has been done, in a frame.
    pub fn collect(&self, done: &mut Vec<Done>, frame: u64) {
        self.lock().waiting.collect(done, frame);
    }

    /// Navigation: how many commands wait, urgent ones and others.
    pub fn waiting(&self) -> [usize; 2] {
        self.lock().waiting.lengths()
    }

    /// Navigation: waits until no command waits and none is being carried out.
    pub fn settle(&self) {
        let mut state = self.lock();
        while !(state.waiting.is_empty() && !state.reading || state.stopped) {
            state = self.finished.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Navigation: no command is wanted any more.
    pub fn stop(&self) {
        let mut state = self.lock();
        state.stopped = true;
        state.waiting.clear();
        drop(state);
        self.posted.notify_all();
        self.finished.notify_all();
    }

    /// I/O: waits for the next command; `None` after [`stop`](Self::stop).
    fn next(&self) -> Option<Command> {
        let mut state = self.lock();
        loop {
            if state.stopped {
                return None;
            }
            if let Some(command) = state.waiting.next() {
                state.reading = true;
                return Some(command);
            }
            state = self.posted.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }

    fn finish(&self, done: Done) {
        {
            let mut state = self.lock();
            state.waiting.finish(done);
            state.reading = false;
        }
        self.finished.notify_all();
    }

    /// I/O: carries out commands with `read` until it is stopped.
    pub fn serve(&self, mut read: impl FnMut(u32, &mut [u32]) -> Result<Layout, MetaNodeError>) {
        while let Some(mut command) = self.next() {
            let result = read(command.page, &mut command.words);
            self.finish(Done { command, result });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shuttle::sync::Arc;
    use shuttle::thread;

    fn command(page: u32, urgent: bool) -> Command {
        Command { page, holder: page, words: vec![0; 1].into(), urgent, started: 0 }
    }

    fn start(board: &Arc<Board>) -> thread::JoinHandle<()> {
        let board = board.clone();
        thread::spawn(move || {
            board.serve(|page, words| {
                thread::yield_now();
                words[0] = page;
                Ok(Layout::default())
            });
        })
    }

    /// Posts, promotes, takes back and settles as navigation does; every place holder must come back once, filled.
    fn navigate(board: &Arc<Board>) {
        let (mut done, mut back) = (Vec::new(), Vec::new());
        board.post(&mut vec![command(0, false), command(1, false), command(2, false)], &mut Vec::new());
        board.post(&mut vec![command(3, true)], &mut vec![1]);
        board.collect(&mut done, 1);
        // All that waits and is not urgent, in another order.
        let mut again = Vec::new();
        board.take_back_ahead(&mut again);
        again.reverse();
        board.post(&mut again, &mut Vec::new());
        back.extend(board.take_back_urgent(3));
        back.extend(board.take_back(false));
        back.extend(board.take_back(true));
        board.post(&mut vec![command(4, true)], &mut vec![2, 7]);
        board.settle();
        assert!(board.take_back(true).is_none(), "nothing waits after settling");
        board.collect(&mut done, 1);
        assert!(done.iter().all(|done| done.command.words[..] == [done.command.page]), "{done:?}");
        let mut pages: Vec<u32> =
            done.iter().map(|done| done.command.page).chain(back.iter().map(|c| c.page)).collect();
        pages.sort_unstable();
        assert_eq!(pages, [0, 1, 2, 3, 4]);
    }

    fn navigate_and_stop() {
        let board = Arc::new(Board::default());
        let io = start(&board);
        navigate(&board);
        board.stop();
        io.join().unwrap();
    }

    #[test]
    fn every_place_holder_comes_back_once() {
        shuttle::check_random(navigate_and_stop, 6_000);
        shuttle::check_pct(navigate_and_stop, 6_000, 4);
    }

    /// All interleavings of a smaller walk, one after the other.
    #[test]
    fn nobody_sleeps_forever() {
        let stops_in_flight = || {
            let board = Arc::new(Board::default());
            let io = start(&board);
            board.post(&mut vec![command(0, false), command(1, true)], &mut vec![0]);
            board.stop();
            io.join().unwrap();
        };
        shuttle::check_dfs(stops_in_flight, None);
        let settles = || {
            let board = Arc::new(Board::default());
            let io = start(&board);
            board.post(&mut vec![command(0, false)], &mut Vec::new());
            board.settle();
            board.stop();
            io.join().unwrap();
        };
        shuttle::check_dfs(settles, None);
    }

    /// The last owner goes while commands wait and one is being read.
    #[test]
    fn stopping_in_flight_ends_the_thread() {
        let walk = || {
            let board = Arc::new(Board::default());
            let io = start(&board);
            board.post(&mut (0..4).map(|page| command(page, page % 2 == 0)).collect(), &mut vec![1]);
            let mut done = Vec::new();
            board.collect(&mut done, 1);
            board.stop();
            board.settle();
            io.join().unwrap();
        };
        shuttle::check_random(walk, 6_000);
    }
}
