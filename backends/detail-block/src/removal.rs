//! Removal of blocks: candidates, the queue of them, and the two quotas (section 4.2 of the paper).

use vertex_tree::{NONE, NodeId, PageStats};

use crate::block::resident_bytes;
use crate::paging::{Paging, SOON, Stub};

/// What a change has missed is needed in so many frames.
pub(crate) const NOW: u32 = 0;

impl Paging {
    /// A block may have become a candidate for removal.
    pub fn may_go(&mut self, number: u32) {
        if self.is_candidate(number) {
            let frame = self.frame;
            let in_play = self.is_in_play(number);
            let mut leaves = false;
            if let Some(block) = self.block_mut(number) {
                block.stamp = frame;
                leaves = !in_play && block.left == 0;
                if leaves {
                    block.left = frame;
                }
            }
            if leaves {
                self.returns.left(frame);
            }
            self.candidates[usize::from(in_play)].push_back((frame, number));
        }
    }

    /// The block of the sibling of a block's root, if there is one and the block above is loaded.
    pub fn sibling(&self, number: u32) -> Option<u32> {
        let parent = self.block(number)?.parent;
        if parent == NONE {
            return None;
        }
        self.child_blocks(NodeId(parent))?.find(|&other| other != number)
    }

    fn is_candidate(&self, number: u32) -> bool {
        let is_folded = |number| self.block(number).is_none_or(|block| block.active == 0);
        self.block(number).is_some() && is_folded(number) && self.sibling(number).is_none_or(is_folded)
    }

    /// Whether the root of a block hangs below an active node: it may be unfolded next.
    fn is_in_play(&self, number: u32) -> bool {
        let parent = self.block(number).map_or(NONE, |block| block.parent);
        parent != NONE && self.is_active(NodeId(parent))
    }

    /// Whether no change has made use of a block since a frame, and none that waits has before.
    fn is_unused(&self, number: u32, since: u64) -> bool {
        self.block(number).is_some_and(|block| block.used < since) && !self.waiting.pins(number)
    }

    /// Of the candidates that are out of play, or of those in play, the one that was used least recently, taken out of its
    /// queue, if nothing has used it since a frame or will as far as can be foreseen.
    fn next_candidate(&mut self, in_play: bool, unused_since: u64) -> Option<u32> {
        let which = usize::from(in_play);
        while let Some(&(stamp, number)) = self.candidates[which].front() {
            let is_current = self.block(number).is_some_and(|block| block.stamp == stamp);
            // Stamps ascend: those behind are no older.
            if is_current && stamp >= unused_since {
                return None;
            }
            self.candidates[which].pop_front();
            if !is_current || !self.is_candidate(number) {
                continue;
            }
            if self.is_unused(number, unused_since)
                && self.is_in_play(number) == in_play
                && !self.foresight.holds(number)
            {
                return Some(number);
            }
            self.may_go(number);
        }
        None
    }

    /// Whether the candidate whose turn it is beyond the soft quota is expected back soon. Those behind it left later.
    fn expects_next(&self) -> bool {
        let Some(&(stamp, number)) = self.candidates[0].front() else { return false };
        let next = self.block(number).filter(|block| block.stamp == stamp && block.left != 0);
        next.is_some_and(|block| self.returns.expects(block.left, self.frame, self.grace))
    }

    /// A candidate to make room below the hard quota for what is needed in so many frames: one in play if there is no
    /// other, and one that is foreseen if there is none of those either.
    fn any_candidate(&mut self, unused_since: u64, due: u32) -> Option<u32> {
        let unforeseen = self.next_candidate(false, unused_since);
        if let Some(number) = unforeseen.or_else(|| self.next_candidate(true, unused_since)) {
            return Some(number);
        }
        while let Some(number) = self.foresight.farthest(due) {
            if self.is_unused(number, unused_since) && self.is_candidate(number) {
                return Some(number);
            }
        }
        None
    }

    fn remove(&mut self, number: u32) {
        let slot = std::mem::replace(&mut self.directory[number as usize], NONE);
        let block = self.loaded.remove(slot as usize);
        self.bytes -= resident_bytes(block.nodes.len() as u32);
        if block.parent != NONE && self.is_active(NodeId(block.parent)) {
            let stub = Stub { bounds: block.nodes[0].stored.bounds(), parent: block.parent };
            self.stubs.insert(number, stub);
        }
        self.counts.removals += 1;
        self.removed_at.insert(number, (self.frame, block.left));
        self.removed.push_back((self.frame, number));
    }

    /// A node has been folded: its children are not in play any more.
    pub fn leave_play(&mut self, node: NodeId) {
        for number in self.child_blocks(node).unwrap_or_default() {
            self.stubs.remove(&number);
            self.may_go(number);
        }
    }

    /// Makes room below the hard quota for so many bytes, which are needed in so many frames.
    ///
    /// What a change has made use of in the last frame stays, and what one that waits is going to make use of, so that what
    /// has come for it is still there when the rest does. With a camera at rest a block that
    /// has come for a change is thus not removed for another, and as every change that is made lets the front sink,
    /// loading comes to an end, whatever the quota.
    pub fn make_room(&mut self, bytes: u64, due: u32) -> bool {
        let fits = |paging: &Self| (paging.bytes + paging.reserved).saturating_add(bytes) <= paging.hard;
        while !fits(self) {
            // What has not been started takes no room from what is missed.
            if due == NOW && self.withdraw() {
                continue;
            }
            match self.any_candidate(self.frame.saturating_sub(1), due) {
                Some(number) => self.remove(number),
                None => return false,
            }
        }
        true
    }

    /// Removes candidates beyond the quotas.
    pub fn end_frame(&mut self) -> PageStats {
        while self.bytes + self.reserved > self.hard
            && let Some(number) = self.any_candidate(self.frame, NOW)
        {
            self.remove(number);
        }
        while self.bytes > self.soft && !self.expects_next() {
            let Some(number) = self.next_candidate(false, self.frame.saturating_sub(self.grace)) else {
                break;
            };
            self.remove(number);
        }
        self.returns.end_frame(self.frame, self.grace);
        while let Some(&(at, number)) = self.removed.front()
            && at + SOON < self.frame
        {
            self.removed.pop_front();
            if self.removed_at.get(&number).is_some_and(|&(last, _)| last == at) {
                self.removed_at.remove(&number);
            }
        }
        let resident_bytes = self.bytes + self.file.fixed_bytes() + 4 * self.directory.len() as u64;
        PageStats { resident_bytes, ..std::mem::take(&mut self.stats) }
    }
}
