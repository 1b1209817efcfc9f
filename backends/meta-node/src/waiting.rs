//! Commands in the order in which they are to be carried out, and what has come of them.

use std::collections::VecDeque;

use crate::error::MetaNodeError;
use crate::page::Layout;

/// "Read this page into this place holder."
#[derive(Debug)]
pub(crate) struct Command {
    pub page: u32,
    pub holder: u32,
    /// The memory of the place holder.
    pub words: Box<[u32]>,
    /// A change has been refused for want of the page.
    pub urgent: bool,
    /// The frame in which reading began.
    pub started: u64,
}

/// A command that has been carried out.
#[derive(Debug)]
pub(crate) struct Done {
    pub command: Command,
    pub result: Result<Layout, MetaNodeError>,
}

/// Urgent commands come first, and each kind in the order in which it was posted.
#[derive(Default)]
pub(crate) struct Waiting {
    urgent: VecDeque<Command>,
    ahead: VecDeque<Command>,
    done: Vec<Done>,
    /// The navigation's frame.
    frame: u64,
}

impl Waiting {
    /// Adds commands, in order, and makes those urgent that wait and have become so.
    pub fn post(&mut self, commands: &mut Vec<Command>, promoted: &mut Vec<u32>) {
        for page in promoted.drain(..) {
            if let Some(at) = self.ahead.iter().position(|command| command.page == page)
                && let Some(mut command) = self.ahead.remove(at)
            {
                command.urgent = true;
                self.urgent.push_back(command);
            }
        }
        for command in commands.drain(..) {
            let queue = if command.urgent { &mut self.urgent } else { &mut self.ahead };
            queue.push_back(command);
        }
    }

    /// Takes back the last of the commands that are not urgent, or else, if it must be, of those that are.
    pub fn take_back(&mut self, even_urgent: bool) -> Option<Command> {
        let ahead = self.ahead.pop_back();
        ahead.or_else(|| if even_urgent { self.urgent.pop_back() } else { None })
    }

    /// Takes back the command for a page, if it is urgent.
    pub fn take_back_urgent(&mut self, page: u32) -> Option<Command> {
        let at = self.urgent.iter().position(|command| command.page == page)?;
        self.urgent.remove(at)
    }

    /// Takes back all commands that are not urgent.
    pub fn take_back_ahead(&mut self, commands: &mut Vec<Command>) {
        commands.extend(self.ahead.drain(..));
    }

    /// The command to carry out next.
    pub fn next(&mut self) -> Option<Command> {
        let mut command = self.urgent.pop_front().or_else(|| self.ahead.pop_front())?;
        command.started = self.frame;
        Some(command)
    }

    /// How many commands wait, urgent ones and others.
    pub fn lengths(&self) -> [usize; 2] {
        [self.urgent.len(), self.ahead.len()]
    }

    /// A command has been carried out.
    pub fn finish(&mut self, done: Done) {
        self.done.push(done);
    }

    /// Takes what has been done, in a frame.
    pub fn collect(&mut self, done: &mut Vec<Done>, frame: u64) {
        self.frame = frame;
        done.append(&mut self.done);
    }

    /// Whether no command waits.
    pub fn is_empty(&self) -> bool {
        self.urgent.is_empty() && self.ahead.is_empty()
    }

    /// Drops the commands that wait.
    pub fn clear(&mut self) {
        self.urgent.clear();
        self.ahead.clear();
    }
}
