//! Which nodes share a page.
//!
//! As in El-Sana & Chiang (2000), section 3.2, every subtree of `L` levels is a block, from the roots down. Trees of
//! real meshes are ragged, and most blocks are small fragments at their lower ends. So blocks that hang below the same
//! page go into one page while they fit; the roots of the trees hang below nothing and are packed likewise. Where room is
//! left after that, blocks are continued downwards: the blocks below those of the page are joined to them, as long as they
//! fit, those of the largest error first, since they are needed first. Such a page takes the part of the paper's meta-node:
//! it is what is read, kept in a place holder and counted.
//!
//! The pages below a page have consecutive numbers, and larger ones than it; root pages come first.

use std::collections::BinaryHeap;

use vertex_tree::{NONE, NodeId};

use crate::arrange::Arrangement;
use crate::page;

/// Nodes on one page, in the order of their slots: blocks one after the other, each in preorder.
#[derive(Clone, Debug)]
pub(crate) struct PageNodes {
    /// Its blocks are `blocks[blocks.start..blocks.end]` of the blocking.
    pub blocks: std::ops::Range<usize>,
    /// The page above; [`NONE`] for a root page.
    pub parent: u32,
    /// The pages below.
    pub children: std::ops::Range<u32>,
}

/// How nodes lie on pages.
pub(crate) struct Blocking {
    pub levels: u32,
    /// A node's number is its page, shifted by so much, and its slot there.
    pub slot_bits: u32,
    /// Topmost nodes of blocks, page by page.
    pub blocks: Vec<u32>,
    pub pages: Vec<PageNodes>,
    pub root_pages: u32,
    /// The number of each node in the file.
    pub number: Vec<NodeId>,
    /// The topmost nodes of blocks that have been joined to the block above.
    joined: Vec<bool>,
}

/// What a block asks of a page.
#[derive(Clone, Copy, Debug, Default)]
struct Size {
    nodes: usize,
    words: usize,
}

impl Size {
    fn and(self, other: Self) -> Self {
        Self { nodes: self.nodes + other.nodes, words: self.words + other.words }
    }
}

/// The nodes of a block in preorder, and the topmost nodes of the blocks below it in order. A block that is joined to the
/// one above counts as a part of it.
fn walk_block(
    arrangement: &Arrangement,
    top: u32,
    levels: u32,
    is_joined: impl Fn(u32) -> bool,
    mut node: impl FnMut(u32),
    mut below: impl FnMut(u32),
) {
    let mut stack = vec![(top, 0)];
    while let Some((n, mut depth)) = stack.pop() {
        if depth == levels {
            if !is_joined(n) {
                below(n);
                continue;
            }
            depth = 0;
        }
        node(n);
        let [kept, removed] = arrangement.children(n);
        stack.extend([removed, kept].into_iter().filter(|&c| c != NONE).map(|c| (c, depth + 1)));
    }
}

fn size(arrangement: &Arrangement, top: u32, levels: u32) -> Size {
    let (mut nodes, mut links, mut triangles) = (0, 0, 0);
    let count = |n: u32| {
        nodes += 1;
        triangles += arrangement.node(n).brought.len();
    };
    walk_block(arrangement, top, levels, |_| false, count, |_| links += 1);
    Size { nodes, words: page::block_words(nodes, links, triangles) }
}

/// The largest size, in nodes and in words, that a block of so many levels has anywhere.
fn largest(arrangement: &Arrangement, levels: u32) -> Size {
    let mut largest = Size::default();
    let mut tops = arrangement.roots.clone();
    while let Some(top) = tops.pop() {
        let size = size(arrangement, top, levels);
        largest.nodes = largest.nodes.max(size.nodes);
        largest.words = largest.words.max(size.words);
        walk_block(arrangement, top, levels, |_| false, |_| (), |below| tops.push(below));
    }
    largest
}

/// The most levels with which every block fits a page of so many bytes; at least one.
pub(crate) fn levels_for(arrangement: &Arrangement, page_bytes: u32) -> u32 {
    let room = page_bytes as usize / 4;
    let fits = |levels: u32| largest(arrangement, levels).words + page::HEADER_WORDS <= room;
    (2..=page::MOST_LEVELS).take_while(|&levels| fits(levels)).last().unwrap_or(1)
}

impl Blocking {
    /// Blocks of `levels` levels on pages of about `page_bytes`; larger ones where a single block is larger.
    pub fn new(arrangement: &Arrangement, levels: u32, page_bytes: u32) -> Self {
        // Slots enough for the largest block, and for as many of the smallest nodes as a page can hold.
        let most =
            largest(arrangement, levels).nodes.max(page_bytes as usize / 4 / page::block_words(1, 0, 0));
        let slot_bits = most.max(1).next_power_of_two().trailing_zeros().min(page::MOST_LEVELS);
        let mut blocking = Self {
            levels,
            slot_bits,
            blocks: Vec::new(),
            pages: Vec::new(),
            root_pages: 0,
            number: vec![NodeId(NONE); arrangement.nodes as usize],
            joined: vec![false; arrangement.nodes as usize],
        };
        let room = Size { nodes: 1 << slot_bits, words: page_bytes as usize / 4 };
        blocking.pack(arrangement, &arrangement.roots, NONE, room);
        blocking.root_pages = blocking.pages.len() as u32;
        // Depth-first over pages, so that what is near in the tree is near in the file.
        let mut stack: Vec<u32> = (0..blocking.root_pages).rev().collect();
        let mut below = Vec::new();
        while let Some(page) = stack.pop() {
            below.clear();
            let mut slot = 0;
            for at in blocking.pages[page as usize].blocks.clone() {
                let (number, joined) = (&mut blocking.number, &blocking.joined);
                let give = |n: u32| {
                    number[n as usize] = NodeId(page << slot_bits | slot);
                    slot += 1;
                };
                let is_joined = |n: u32| joined[n as usize];
                let top = blocking.blocks[at];
                walk_block(arrangement, top, levels, is_joined, give, |top| below.push(top));
            }
            let first = blocking.pages.len() as u32;
            blocking.pack(arrangement, &below, page, room);
            let children = first..blocking.pages.len() as u32;
            stack.extend(children.clone().rev());
            blocking.pages[page as usize].children = children;
        }
        blocking
    }

    /// The nodes of a block, with what has been joined to it, in preorder.
    pub fn walk(&self, arrangement: &Arrangement, top: u32, node: impl FnMut(u32)) {
        walk_block(arrangement, top, self.levels, |n| self.joined[n as usize], node, |_| ());
    }

    /// Makes pages of blocks, given by their topmost nodes: each goes to the first page, of those begun here, that has room
    /// for it. Blocks stay in order on their page.
    fn pack(&mut self, arrangement: &Arrangement, tops: &[u32], parent: u32, room: Size) {
        let mut begun: Vec<(Size, Vec<u32>)> = Vec::new();
        // Only the last few are tried: packing stays linear. Roots keep their order.
        let (mut open, tried) = (0, if parent == NONE { 1 } else { TRIED });
        for &top in tops {
            let size = size(arrangement, top, self.levels);
            let fits = |used: &Size| {
                let both = used.and(size);
                both.nodes <= room.nodes && both.words + page::HEADER_WORDS <= room.words
            };
            open = open.max(begun.len().saturating_sub(tried));
            match begun[open..].iter_mut().find(|(used, _)| fits(used)) {
                Some((used, blocks)) => {
                    *used = used.and(size);
                    blocks.push(top);
                }
                None => begun.push((size, vec![top])),
            }
        }
        for (used, blocks) in begun {
            self.join(arrangement, used, &blocks, room);
            let start = self.blocks.len();
            self.blocks.extend(blocks);
            self.pages.push(PageNodes { blocks: start..self.blocks.len(), parent, children: 0..0 });
        }
    }

    /// Joins what is below some blocks to them while there is room on their page.
    fn join(&mut self, arrangement: &Arrangement, mut used: Size, tops: &[u32], room: Size) {
        // What is not negative is in the order of its bits.
        let key = |top: u32| (arrangement.node(top).bounds.eps.to_bits(), top);
        let mut below = BinaryHeap::new();
        let add = |below: &mut BinaryHeap<(u32, u32)>, top: u32| {
            walk_block(arrangement, top, self.levels, |_| false, |_| (), |top| below.push(key(top)));
        };
        tops.iter().for_each(|&top| add(&mut below, top));
        // However many blocks there are below: a page takes a few, and building stays linear.
        let mut tried = 0;
        while let Some((_, top)) = below.pop().filter(|_| tried < TRIED) {
            let size = size(arrangement, top, self.levels);
            let both = used.and(Size { words: size.words.saturating_sub(page::JOINED_WORDS), ..size });
            if both.nodes <= room.nodes && both.words + page::HEADER_WORDS <= room.words {
                used = both;
                self.joined[top as usize] = true;
                add(&mut below, top);
            } else {
                tried += 1;
            }
        }
    }
}

/// Pages that are tried for a block before another is begun, and blocks that are tried for a page before it is full.
const TRIED: usize = 8;
