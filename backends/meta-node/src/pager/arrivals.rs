//! What has been read, or could not be.

use vertex_tree::Prefetch;

use super::{Holder, LONGEST_REST, Pager};
use crate::error::MetaNodeError;
use crate::page::Layout;
use crate::waiting::{Command, Done};

impl Pager {
    /// Starts a frame: takes what has arrived.
    pub fn begin_frame(&mut self) {
        self.frame += 1;
        let came = self.take_arrivals();
        self.foresight.next_frame(came, self.store.waiting().iter().sum());
        self.shrink();
    }

    /// Takes what has arrived, and says how much that is.
    pub(super) fn take_arrivals(&mut self) -> usize {
        let mut done = std::mem::take(&mut self.done);
        self.store.collect(&mut done, self.frame);
        let count = done.len();
        for Done { command, result } in done.drain(..) {
            match result {
                Ok(layout) => self.arrive(command, layout),
                Err(fault) => self.fail(&command, fault),
            }
        }
        self.done = done;
        count
    }

    fn arrive(&mut self, command: Command, layout: Layout) {
        let Command { page, holder, words, urgent, started } = command;
        self.failures.remove(&page);
        self.news.push(page);
        self.foresight.arrived(self.frame - started);
        // One that a change has asked for while it was being read is not marked as urgent itself.
        let demanded = urgent || self.holders[holder as usize].demanded;
        self.stats.reads += 1;
        self.stats.read_bytes += 4 * self.file.page_words(page) as u64;
        self.stats.ahead += u64::from(!demanded);
        self.table[page as usize] = holder;
        self.under_way -= self.place_words(words.len());
        self.resident += 1;
        let touched = if demanded { self.frame } else { 0 };
        self.holders[holder as usize] =
            Holder { words, page, layout, touched, ahead: !demanded, ..Holder::default() };
        self.classify(page);
        if self.usage[page as usize] > 0 {
            self.count_around(holder, true);
        }
    }

    fn fail(&mut self, command: &Command, fault: MetaNodeError) {
        let page = command.page;
        self.stats.faults += 1;
        self.last_fault = Some(fault);
        self.release(command);
        // Asked for again, but not in every frame forever.
        let failure = self.failures.entry(page).or_default();
        failure.until = self.frame + (1 << failure.times.min(63)).min(LONGEST_REST) - 1;
        failure.times += 1;
        if self.how == Prefetch::Paper {
            self.give_up(page);
        }
    }
}
