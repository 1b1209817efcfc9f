//! Asking for blocks, and taking them into the directory when they have come.

use std::ops::Range;
use std::time::Instant;

use vertex_tree::{NONE, NodeId, TreeError};

use crate::block::{Block, resident_bytes};
use crate::error::XfmError;
use crate::loader::{Answer, Run, read_run};
use crate::paging::{ATTEMPTS, Paging, Pending};
use crate::removal::NOW;

impl Paging {
    /// Asks for blocks that a change of `node` takes, at most two. Says whether they are loaded, which they may be at
    /// once only where loading blocks.
    pub fn demand(&mut self, blocks: Range<u32>, node: NodeId) -> bool {
        let (mut missing, mut waits) = (Run { first: 0, count: 0 }, false);
        for number in blocks.clone() {
            if self.block(number).is_some() {
                self.use_block(number);
            } else if let Some(pending) = self.pending.get_mut(&number) {
                waits = true;
                pending.waiting.push(node);
                if std::mem::take(&mut pending.is_ahead)
                    && let Some(loader) = &mut self.loader
                {
                    loader.hurry(number);
                }
            } else {
                missing = match missing.count {
                    0 => Run { first: number, count: 1 },
                    count => Run { first: missing.first, count: count + 1 },
                };
            }
        }
        if waits {
            self.wait(node, blocks.clone());
        }
        if missing.count == 0 {
            return !waits;
        }
        if !self.make_room(self.bytes_of(missing), NOW) {
            self.counts.refused += 1;
            self.stats.no_room += 1;
            self.waiting.again.push(node);
            return false;
        }
        let is_there = self.ask(missing, Some(node));
        if !is_there && self.loader.is_some() {
            self.wait(node, blocks);
        }
        is_there && !waits
    }

    /// Bytes of memory that blocks take.
    pub fn bytes_of(&self, run: Run) -> u64 {
        run.numbers().map(|b| resident_bytes(self.file.nodes_in(b))).sum()
    }

    /// Asks for a run, for which there is room: for a node, or ahead of time. Where loading blocks, says whether all of it
    /// is there.
    pub fn ask(&mut self, run: Run, node: Option<NodeId>) -> bool {
        self.reserved += self.bytes_of(run);
        self.counts.peak_bytes = self.counts.peak_bytes.max(self.bytes + self.reserved);
        for number in run.numbers() {
            let waiting = node.into_iter().collect();
            self.pending.insert(number, Pending { waiting, is_ahead: node.is_none() });
        }
        if let Some(loader) = &mut self.loader {
            loader.ask(run, node.is_some());
            return false;
        }
        let start = Instant::now();
        let mut buffer = std::mem::take(&mut self.buffer);
        let answer = read_run(&self.file, run, self.frame, &mut buffer);
        self.buffer = buffer;
        // What asked goes on at once, or is refused and asks again in the next frame.
        let mut arrived = Vec::new();
        self.integrate(answer, &mut arrived);
        if run.numbers().any(|number| self.block(number).is_none()) {
            self.waiting.again.append(&mut arrived);
        }
        self.counts.blocked += start.elapsed();
        run.numbers().all(|number| self.block(number).is_some())
    }

    /// Takes a run into the directory.
    pub fn integrate(&mut self, answer: Answer, arrived: &mut Vec<NodeId>) {
        let Answer { run, frame, bytes, blocks } = answer;
        self.reserved -= self.bytes_of(run);
        self.store.arrived(self.frame - frame);
        let mut is_ahead = true;
        for number in run.numbers() {
            let Some(pending) = self.pending.remove(&number) else { continue };
            is_ahead &= pending.is_ahead;
            pending.waiting.iter().for_each(|&node| self.stop_waiting(node));
            arrived.extend(pending.waiting);
        }
        let is_read = u64::from(blocks.is_ok());
        self.stats.reads += is_read;
        self.stats.ahead += is_read * u64::from(is_ahead);
        self.stats.read_bytes += bytes;
        let outcomes: Vec<Result<Block, XfmError>> = match blocks {
            Ok(blocks) => blocks,
            // One failed read is one fault, whatever it was to bring.
            Err(error) => return self.failed(run.first, error, is_ahead),
        };
        for (number, outcome) in run.numbers().zip(outcomes) {
            match outcome.and_then(|block| self.check_links(&block).map(|()| block)) {
                Ok(mut block) => {
                    // A read that came ahead of time is used when its first block is.
                    block.is_unused = is_ahead && number == run.first;
                    self.counts.ahead += u64::from(is_ahead);
                    self.insert(block);
                }
                Err(error) => self.failed(number, error, is_ahead),
            }
        }
    }

    /// Whether a block and its loaded neighbours agree about who is above whom.
    fn check_links(&self, block: &Block) -> Result<(), XfmError> {
        let levels = self.file.levels();
        let number = block.number;
        let root = levels.node(number, 0);
        let listed = self.file.roots().binary_search_by_key(&root, |&(root, _)| root).ok();
        if listed.is_some() != (block.parent == NONE) {
            return Err(self.file.damaged(number, "it is a root's and not in the root list, or the reverse"));
        }
        if listed.is_some_and(|i| self.file.roots()[i].1 != block.nodes[0].stored.bounds()) {
            return Err(self.file.damaged(number, "the root list has another sphere"));
        }
        if block.parent != NONE
            && let Some(above) = self.child_blocks(NodeId(block.parent))
            && (!above.contains(&number) || self.node(NodeId(block.parent)).is_none())
        {
            return Err(self.file.damaged(number, "its parent does not know it"));
        }
        let below = (0..levels.fan_out()).filter_map(|place| Some((place, block.child_block(place)?)));
        for (place, child) in below {
            let parent = levels.node(number, levels.lowest() + place / 2);
            if self.block(child).is_some_and(|child| child.parent != parent.0) {
                return Err(self.file.damaged(number, "a child block does not know it"));
            }
        }
        Ok(())
    }

    /// Reading a block has failed. That it was only foreseen is no error of the tree: it is left alone until it is missed.
    fn failed(&mut self, number: u32, error: XfmError, is_ahead: bool) {
        self.stats.faults += 1;
        let failures = self.failures.entry(number).or_default();
        *failures += u32::from(!is_ahead);
        if *failures >= ATTEMPTS {
            self.failures.remove(&number);
            self.error = Some(error);
        }
    }
}

/// An error of the file as one of the tree.
pub(crate) fn tree_error(error: XfmError) -> TreeError {
    match error {
        XfmError::Read { file, offset, length, source } => {
            TreeError::Read { file, offset, length: length as usize, source }
        }
        XfmError::Block { file, offset, reason, .. } | XfmError::Node { file, offset, reason, .. } => {
            TreeError::Damaged { file, offset, reason }
        }
        other => TreeError::Damaged { file: other.to_string(), offset: 0, reason: "see the name" },
    }
}
