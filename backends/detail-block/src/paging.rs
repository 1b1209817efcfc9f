//! Which blocks are in memory: the directory, loading, the two quotas and removal (section 4 of the paper).
//!
//! The directory holds a number for each block, of where it is among the loaded ones. A block is a candidate for removal
//! when none of its nodes is active and the sibling of its root is folded too; then it is stamped with the frame and put
//! at the end of a queue. Whether it still is a candidate is looked at when it comes to the front of the queue.
//!
//! * Beyond the **soft quota**, candidates are removed at the end of each frame, the least recently used first, once they
//!   have been candidates for some frames, and only if the node above is folded: what hangs below an active node may be
//!   unfolded next, and the paper's update loop (Figure 8) would load it again at once.
//! * The **hard quota** is never exceeded: a block is only asked for if it fits, with all that are under way; candidates
//!   that this frame has not used make room, and if that is not enough, the block is missed. (Setting a quota below what
//!   the front itself occupies is the exception: nothing is loaded then until the front has folded to below it.)
//!
//! Blocks of active nodes are never removed, so whatever is active can be asked about. A root of a block that is in play
//! but removed leaves behind its sphere, error and parent: a [`Stub`].

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rustc_hash::FxHashMap;
use slab::Slab;
use vertex_tree::{Bounds, NONE, NodeId, PageStats, TreeError};

use crate::block::{Block, Node, resident_bytes};
use crate::error::XfmError;
use crate::file::XfmFile;
use crate::loader::{Answer, Loader, Run, read_run};
use crate::settings::Settings;

/// How many times in a row reading a block may fail before that is an error of the tree.
pub const ATTEMPTS: u32 = 16;

/// A block that is read again within so many frames of its removal counts as removed too soon.
pub const SOON: u64 = 60;

/// What a removed block's root in play is still asked about.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stub {
    pub bounds: Bounds,
    pub parent: u32,
}

/// What paging has done since the tree was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PagingCounts {
    /// Blocks loaded.
    pub loads: u64,
    /// Of these, how many were loaded ahead of time.
    pub ahead: u64,
    /// Blocks removed.
    pub removals: u64,
    /// Blocks loaded again within [`SOON`] frames of their removal.
    pub soon_again: u64,
    /// Requests refused because of the hard quota.
    pub refused: u64,
    /// The most bytes of blocks there ever were, with those under way.
    pub peak_bytes: u64,
    /// How long frames have waited for blocks: where loading blocks only.
    pub blocked: Duration,
}

struct Pending {
    waiting: Vec<NodeId>,
    is_ahead: bool,
}

pub(crate) struct Paging {
    pub file: Arc<XfmFile>,
    pub directory: Vec<u32>,
    pub loaded: Slab<Block>,
    pub bytes: u64,
    /// Bytes of blocks under way.
    pub reserved: u64,
    /// Out of play, and in play; each with its stamp, ascending.
    pub candidates: [VecDeque<(u64, u32)>; 2],
    pub stubs: FxHashMap<u32, Stub>,
    pending: FxHashMap<u32, Pending>,
    failures: FxHashMap<u32, u32>,
    pub removed_at: FxHashMap<u32, u64>,
    pub removed: VecDeque<(u64, u32)>,
    loader: Option<Loader>,
    pub soft: u64,
    pub hard: u64,
    pub grace: u64,
    pub frame: u64,
    pub stats: PageStats,
    pub counts: PagingCounts,
    answers: Vec<Answer>,
    buffer: Vec<u8>,
    error: Option<XfmError>,
}

impl Paging {
    pub fn new(file: Arc<XfmFile>, loader: Option<Loader>, settings: &Settings) -> Self {
        Self {
            directory: vec![NONE; file.header().blocks as usize],
            file,
            loaded: Slab::new(),
            bytes: 0,
            reserved: 0,
            candidates: Default::default(),
            stubs: FxHashMap::default(),
            pending: FxHashMap::default(),
            failures: FxHashMap::default(),
            removed_at: FxHashMap::default(),
            removed: VecDeque::new(),
            loader,
            soft: settings.soft_quota,
            hard: settings.hard_quota,
            grace: settings.grace.into(),
            frame: 0,
            stats: PageStats::default(),
            counts: PagingCounts::default(),
            answers: Vec::new(),
            buffer: Vec::new(),
            error: None,
        }
    }

    /// A block, if it is loaded.
    #[inline(always)]
    pub fn block(&self, number: u32) -> Option<&Block> {
        match *self.directory.get(number as usize)? {
            NONE => None,
            slot => Some(&self.loaded[slot as usize]),
        }
    }

    #[inline(always)]
    pub fn block_mut(&mut self, number: u32) -> Option<&mut Block> {
        match *self.directory.get(number as usize)? {
            NONE => None,
            slot => Some(&mut self.loaded[slot as usize]),
        }
    }

    pub fn blocks(&self) -> impl Iterator<Item = &Block> {
        self.loaded.iter().map(|(_, block)| block)
    }

    /// A node, if its block is loaded and it is there.
    #[inline(always)]
    pub fn node(&self, node: NodeId) -> Option<&Node> {
        let levels = self.file.levels();
        let block = self.block(levels.block(node))?;
        Some(&block.nodes[block.index_of(levels.offset(node))?])
    }

    #[inline(always)]
    pub fn node_mut(&mut self, node: NodeId) -> Option<&mut Node> {
        let levels = self.file.levels();
        let block = self.block_mut(levels.block(node))?;
        let index = block.index_of(levels.offset(node))?;
        Some(&mut block.nodes[index])
    }

    #[inline(always)]
    pub fn is_active(&self, node: NodeId) -> bool {
        self.node(node).is_some_and(Node::is_active)
    }

    pub fn stub(&self, block: u32) -> Option<&Stub> {
        self.stubs.get(&block)
    }

    /// The child blocks of a node of the lowest level, empty for any other; `None` if its own block is not loaded.
    #[inline]
    pub fn child_blocks(&self, node: NodeId) -> Option<Range<u32>> {
        let levels = self.file.levels();
        let block = self.block(levels.block(node))?;
        let Some(i) = levels.offset(node).checked_sub(levels.lowest()) else { return Some(0..0) };
        let [left, right] = [block.child_block(2 * i), block.child_block(2 * i + 1)];
        Some(match (left, right) {
            (Some(first), Some(_)) => first..first + 2,
            (Some(only), None) | (None, Some(only)) => only..only + 1,
            (None, None) => 0..0,
        })
    }

    /// Marks a block as used in this frame.
    #[inline(always)]
    pub fn use_block(&mut self, number: u32) {
        let frame = self.frame;
        if let Some(block) = self.block_mut(number) {
            block.used = frame;
        }
    }

    /// Asks for blocks that a change of `node` takes, at most two. Says whether they are loaded, which they may be at
    /// once only where loading blocks.
    pub fn demand(&mut self, blocks: Range<u32>, node: NodeId) -> bool {
        let (mut missing, mut waits) = (Run { first: 0, count: 0 }, false);
        for number in blocks {
            if self.block(number).is_some() {
                self.use_block(number);
            } else if let Some(pending) = self.pending.get_mut(&number) {
                waits = true;
                if !pending.waiting.contains(&node) {
                    pending.waiting.push(node);
                }
                if std::mem::take(&mut pending.is_ahead)
                    && let Some(loader) = &self.loader
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
        if missing.count == 0 {
            return !waits;
        }
        if !self.make_room(self.bytes_of(missing)) {
            self.counts.refused += 1;
            return false;
        }
        self.ask(missing, Some(node)) && !waits
    }

    /// Asks for blocks ahead of time if the quotas leave room.
    pub fn ask_ahead(&mut self, blocks: Range<u32>) {
        for number in blocks {
            let run = Run { first: number, count: 1 };
            let room = self.bytes + self.reserved + self.bytes_of(run) <= self.soft.min(self.hard);
            if room
                && self.loader.is_some()
                && self.block(number).is_none()
                && !self.pending.contains_key(&number)
            {
                self.ask(run, None);
            }
        }
    }

    fn bytes_of(&self, run: Run) -> u64 {
        (run.first..run.first + run.count).map(|b| resident_bytes(self.file.nodes_in(b))).sum()
    }

    /// Asks for a run. Where loading blocks, says whether all of it is there.
    fn ask(&mut self, run: Run, node: Option<NodeId>) -> bool {
        self.reserved += self.bytes_of(run);
        self.counts.peak_bytes = self.counts.peak_bytes.max(self.bytes + self.reserved);
        for number in run.first..run.first + run.count {
            let waiting = node.into_iter().collect();
            self.pending.insert(number, Pending { waiting, is_ahead: node.is_none() });
            self.counts.ahead += u64::from(node.is_none());
        }
        if let Some(loader) = &self.loader {
            loader.ask(run, node.is_some());
            return false;
        }
        let start = Instant::now();
        let mut buffer = std::mem::take(&mut self.buffer);
        let answer = read_run(&self.file, run, &mut buffer);
        self.buffer = buffer;
        // Nobody waits: what asked goes on at once, or is refused and asks again.
        self.integrate(answer, &mut Vec::new());
        self.counts.blocked += start.elapsed();
        (run.first..run.first + run.count).all(|number| self.block(number).is_some())
    }

    /// Takes a run into the directory.
    fn integrate(&mut self, Answer { run, bytes, blocks }: Answer, arrived: &mut Vec<NodeId>) {
        self.reserved -= self.bytes_of(run);
        self.stats.reads += u64::from(blocks.is_ok());
        self.stats.read_bytes += bytes;
        let numbers = run.first..run.first + run.count;
        let outcomes: Vec<Result<Block, XfmError>> = match blocks {
            Ok(blocks) => blocks,
            Err(error) => {
                // One failed read is one fault, whatever it was to bring.
                self.failed(run.first, error);
                for number in numbers {
                    arrived.extend(self.pending.remove(&number).into_iter().flat_map(|p| p.waiting));
                }
                return;
            }
        };
        for (number, outcome) in numbers.zip(outcomes) {
            arrived.extend(self.pending.remove(&number).into_iter().flat_map(|p| p.waiting));
            match outcome.and_then(|block| self.check_links(&block).map(|()| block)) {
                Ok(block) => self.insert(block),
                Err(error) => self.failed(number, error),
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

    fn failed(&mut self, number: u32, error: XfmError) {
        self.stats.faults += 1;
        let failures = self.failures.entry(number).or_default();
        *failures += 1;
        if *failures >= ATTEMPTS {
            self.failures.remove(&number);
            self.error = Some(error);
        }
    }

    fn insert(&mut self, mut block: Block) {
        let number = block.number;
        self.failures.remove(&number);
        self.stubs.remove(&number);
        block.used = self.frame;
        self.bytes += resident_bytes(block.nodes.len() as u32);
        self.directory[number as usize] = self.loaded.insert(block) as u32;
        self.counts.loads += 1;
        if self.removed_at.get(&number).is_some_and(|&at| self.frame - at <= SOON) {
            self.counts.soon_again += 1;
        }
        self.may_go(number);
    }

    pub fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        self.frame += 1;
        if let Some(loader) = &self.loader {
            let mut answers = std::mem::take(&mut self.answers);
            loader.take(&mut answers);
            for answer in answers.drain(..) {
                self.integrate(answer, arrived);
            }
            self.answers = answers;
        }
        self.take_error()
    }

    pub fn take_error(&mut self) -> Result<(), TreeError> {
        self.error.take().map_or(Ok(()), |error| Err(tree_error(error)))
    }

    /// Waits for all that is under way. It is taken at the start of the next frame.
    pub fn settle(&self) {
        if let Some(loader) = &self.loader {
            loader.settle();
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
