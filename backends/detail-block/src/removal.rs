//! Removal of blocks: candidates, the queue of them, and what has been removed (section 4.2 of the paper).
//!
//! A block is a candidate for removal when none of its nodes is active and the sibling of its root is folded too; then it is
//! stamped with the frame and put at the end of a queue. Whether it still is a candidate is looked at when it comes to the front
//! of the queue.

use std::collections::VecDeque;

use rustc_hash::FxHashMap;
use vertex_tree::NodeId;

use crate::blocks::Blocks;
use crate::foresight::Foresight;
use crate::returns::{Returns, SOON};
use crate::waiting::Waiting;

/// What a change has missed is needed in so many frames.
pub(crate) const NOW: u32 = 0;

/// Which blocks go, and when.
pub(crate) struct Removal {
    /// Out of play, and in play; each with its stamp, ascending.
    candidates: [VecDeque<(u64, u32)>; 2],
    returns: Returns,
    /// When blocks were removed lately, and had left play.
    removed_at: FxHashMap<u32, (u64, u64)>,
    removed: VecDeque<(u64, u32)>,
    /// Frames for which a candidate stays beyond the soft quota.
    grace: u64,
    frame: u64,
}

/// What keeps a block that nothing in it does.
#[derive(Clone, Copy)]
pub(crate) struct Keepers<'a> {
    pub waiting: &'a Waiting,
    pub foresight: &'a Foresight,
    /// Used since this frame.
    pub since: u64,
}

impl Keepers<'_> {
    /// Whether no change has made use of a block lately, and none that waits has before.
    fn leave(&self, blocks: &Blocks, number: u32) -> bool {
        blocks.block(number).is_some_and(|block| block.used < self.since) && !self.waiting.pins(number)
    }
}

impl Removal {
    pub fn new(grace: u64) -> Self {
        Self {
            candidates: Default::default(),
            returns: Returns::default(),
            removed_at: FxHashMap::default(),
            removed: VecDeque::new(),
            grace,
            frame: 0,
        }
    }

    pub fn begin_frame(&mut self, frame: u64) {
        self.frame = frame;
    }

    /// A block may have become a candidate for removal.
    pub fn may_go(&mut self, number: u32, blocks: &mut Blocks) {
        if !blocks.is_candidate(number) {
            return;
        }
        let (frame, in_play) = (self.frame, blocks.is_in_play(number));
        if let Some(block) = blocks.block_mut(number) {
            block.stamp = frame;
            if !in_play && block.left == 0 {
                block.left = frame;
                self.returns.left(frame);
            }
        }
        self.candidates[usize::from(in_play)].push_back((frame, number));
    }

    /// A block that left play in a frame, if it did, is in use again.
    pub fn back(&mut self, left: u64) {
        if left != 0 {
            self.returns.back(left);
        }
    }

    /// A block has come. Says whether it was removed too soon.
    pub fn came(&mut self, number: u32) -> bool {
        let removed = self.removed_at.get(&number).filter(|&&(at, _)| self.frame - at <= SOON);
        let Some(&(_, left)) = removed else { return false };
        self.returns.back(left);
        true
    }

    /// Of the candidates that are out of play, or of those in play, the one that was used least recently, taken out of its
    /// queue, if nothing has used it lately or will as far as can be foreseen.
    fn next(&mut self, in_play: bool, keepers: Keepers, blocks: &mut Blocks) -> Option<u32> {
        let which = usize::from(in_play);
        while let Some(&(stamp, number)) = self.candidates[which].front() {
            let is_current = blocks.block(number).is_some_and(|block| block.stamp == stamp);
            // Stamps ascend: those behind are no older.
            if is_current && stamp >= keepers.since {
                return None;
            }
            self.candidates[which].pop_front();
            if !is_current || !blocks.is_candidate(number) {
                continue;
            }
            if keepers.leave(blocks, number)
                && blocks.is_in_play(number) == in_play
                && !keepers.foresight.holds(number)
            {
                return Some(number);
            }
            self.may_go(number, blocks);
        }
        None
    }

    /// A candidate beyond the soft quota: one out of play, once it has been a candidate for some frames and is not expected
    /// back soon. Those behind it left later.
    pub fn beyond_soft(&mut self, mut keepers: Keepers, blocks: &mut Blocks) -> Option<u32> {
        let expects = |returns: &Returns, &(stamp, number): &(u64, u32)| {
            let next = blocks.block(number).filter(|block| block.stamp == stamp && block.left != 0);
            next.is_some_and(|block| returns.expects(block.left, self.frame, self.grace))
        };
        if self.candidates[0].front().is_some_and(|next| expects(&self.returns, next)) {
            return None;
        }
        keepers.since = self.frame.saturating_sub(self.grace);
        self.next(false, keepers, blocks)
    }

    /// A candidate that nobody foresees: one in play if there is no other.
    pub fn unforeseen(&mut self, keepers: Keepers, blocks: &mut Blocks) -> Option<u32> {
        self.next(false, keepers, blocks).or_else(|| self.next(true, keepers, blocks))
    }

    /// Whether a block that was foreseen, and is not any more, may go.
    pub fn may_take(number: u32, keepers: Keepers, blocks: &Blocks) -> bool {
        keepers.leave(blocks, number) && blocks.is_candidate(number)
    }

    /// Removes a block.
    pub fn remove(&mut self, number: u32, blocks: &mut Blocks) {
        let block = blocks.remove(number);
        self.removed_at.insert(number, (self.frame, block.left));
        self.removed.push_back((self.frame, number));
    }

    /// A node has been folded: its children are not in play any more.
    pub fn leave_play(&mut self, node: NodeId, blocks: &mut Blocks) {
        for number in blocks.child_blocks(node).unwrap_or_default() {
            blocks.stubs.remove(&number);
            self.may_go(number, blocks);
        }
    }

    /// A frame ends: what was removed long ago is forgotten.
    pub fn end_frame(&mut self) {
        self.returns.end_frame(self.frame, self.grace);
        while let Some(&(at, number)) = self.removed.front()
            && at + SOON < self.frame
        {
            self.removed.pop_front();
            if self.removed_at.get(&number).is_some_and(|&(last, _)| last == at) {
                self.removed_at.remove(&number);
            }
        }
    }
}
