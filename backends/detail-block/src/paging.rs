//! Which blocks are in memory: the directory, loading, the two quotas and removal (section 4 of the paper).
//!
//! The directory holds a number for each block, of where it is among the loaded ones. A block is a candidate for removal
//! when none of its nodes is active and the sibling of its root is folded too; then it is stamped with the frame and put
//! at the end of a queue. Whether it still is a candidate is looked at when it comes to the front of the queue.
//!
//! * Beyond the **soft quota**, candidates are removed at the end of each frame, the least recently used first, once they
//!   have been candidates for some frames and are not expected back (see [`returns`](crate::returns)), and only if the
//!   node above is folded: what hangs below an active node may be unfolded next, and the paper's update loop (Figure 8)
//!   would load it again at once.
//! * The **hard quota** is never exceeded: a block is only asked for if it fits, with all that are under way; candidates
//!   that no change has lately used make room, and if that is not enough, the block is missed. (Setting a quota below what
//!   the front itself occupies is the exception: nothing is loaded then until the front has folded to below it.)
//!
//! As printed, the traversal loads the child blocks that it comes upon "and continues": the frame waits for the disk. Here a
//! change that wants a block is refused, and the block is asked for, so that no frame waits; that is the only difference between
//! the paper's scheme and [`Prefetch::Paper`](vertex_tree::Prefetch::Paper). Whoever wants it as printed waits for
//! [`settle`](vertex_tree::Hierarchy::settle) and asks again, as foldfront's `Settled` does (`--prefetch blocking`);
//! [`Io::Blocking`](crate::Io::Blocking) reads within the change itself.
//!
//! Blocks of active nodes are never removed, so whatever is active can be asked about. A root of a block that is in play
//! but removed leaves behind its sphere, error and parent: a [`Stub`].

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use rustc_hash::FxHashMap;
use slab::Slab;
use vertex_tree::{Bounds, LookAhead, NONE, NodeId, PageStats, TreeError};

use crate::block::{Block, Node, resident_bytes};
use crate::error::XfmError;
use crate::file::XfmFile;
use crate::foresight::Foresight;
use crate::loader::{Answer, Loader};
use crate::requests::tree_error;
use crate::returns::Returns;
use crate::settings::Settings;
use crate::waiting::Waiting;

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
    /// Of these, how many no change had missed: they were loaded ahead of time.
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

/// A block that has been asked for.
pub(crate) struct Pending {
    pub waiting: Vec<NodeId>,
    /// Whether no change has missed it.
    pub is_ahead: bool,
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
    pub pending: FxHashMap<u32, Pending>,
    pub waiting: Waiting,
    pub failures: FxHashMap<u32, u32>,
    /// When blocks were removed lately, and had left play.
    pub removed_at: FxHashMap<u32, (u64, u64)>,
    pub removed: VecDeque<(u64, u32)>,
    /// `None` where loading blocks.
    pub loader: Option<Loader>,
    pub foresight: Foresight,
    /// What is known of the store.
    pub store: LookAhead,
    pub returns: Returns,
    pub soft: u64,
    pub hard: u64,
    pub grace: u64,
    pub frame: u64,
    pub stats: PageStats,
    pub counts: PagingCounts,
    answers: Vec<Answer>,
    pub buffer: Vec<u8>,
    pub error: Option<XfmError>,
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
            waiting: Waiting::default(),
            failures: FxHashMap::default(),
            removed_at: FxHashMap::default(),
            removed: VecDeque::new(),
            loader,
            foresight: Foresight::default(),
            store: LookAhead::default(),
            returns: Returns::default(),
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
            let left = std::mem::take(&mut block.left);
            if std::mem::take(&mut block.is_unused) {
                self.stats.ahead_used += 1;
            }
            if left != 0 {
                self.returns.back(left);
            }
        }
    }

    pub fn insert(&mut self, mut block: Block) {
        let number = block.number;
        self.failures.remove(&number);
        self.stubs.remove(&number);
        block.used = self.frame;
        self.bytes += resident_bytes(block.nodes.len() as u32);
        self.directory[number as usize] = self.loaded.insert(block) as u32;
        self.counts.loads += 1;
        if let Some(&(at, left)) = self.removed_at.get(&number)
            && self.frame - at <= SOON
        {
            self.counts.soon_again += 1;
            self.returns.back(left);
        }
        self.may_go(number);
    }

    pub fn begin_frame(&mut self, arrived: &mut Vec<NodeId>) -> Result<(), TreeError> {
        self.frame += 1;
        arrived.append(&mut self.waiting.again);
        if let Some(loader) = &mut self.loader {
            let mut answers = std::mem::take(&mut self.answers);
            loader.take(self.frame, &mut answers);
            self.store.begin_frame(answers.len(), loader.waiting().iter().sum());
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

    /// Waits for all that is under way. It is taken at the start of the next frame. Returns how long that took.
    pub fn settle(&mut self) -> Duration {
        self.loader.as_mut().map_or(Duration::ZERO, Loader::settle)
    }

    /// Lets time pass, if it is virtual.
    pub fn pass(&mut self, time: Duration) {
        if let Some(loader) = &mut self.loader {
            loader.pass(time);
        }
    }
}
