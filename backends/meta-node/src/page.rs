//! A page: one or several blocks of the tree, their links to the blocks below, and their triangles.
//!
//! Everything is in words of 32 bits, little-endian in the file; so a page is used in its place holder as it was read.
//!
//! ```text
//! word    field
//!    0    CRC-32 of the words from 1 on
//!    1    number of the page
//!    2    page above, 2^32 - 1 for a root page
//!    3    N, nodes
//!    4    B, blocks
//!    5    K, links: nodes of other pages that are children of nodes here
//!    6    T, triangles
//!    7    first page below
//!    8    how many pages are below; their numbers follow each other
//!    9    14 N  nodes, by slot: each block in preorder, with the blocks that are joined to it
//!         2 B   blocks: number of the node above the topmost one, and that node's number in the log; both
//!               2^32 - 1 for a root
//!         7 K   links: number of the node, its number in the log, centre, radius, error
//!         3 T   the local triangle list: three leaves each, in the order of the nodes that bring them; first the one that
//!               is not below the node, then the others in their sense of rotation
//! ```
//!
//! A node:
//!
//! ```text
//! word    field
//!    0    centre, 3 f32
//!    3    radius, f32
//!    4    error, f32
//!    5    place of the removed vertex, 3 f32
//!    8    leaf of the kept vertex: the first one below the node
//!    9    leaf of the removed vertex
//!   10    number in the collapse log
//!   11    children: that of the kept vertex in the low half, the other in the high half; each a slot of this page,
//!         2^15 + the number of a link, or 2^16 - 1 for a leaf of the forest
//!   12    the slot of the parent, or 2^15 + the number of the block of which this node is the topmost
//!   13    the triangles up to that of the next node: where they end in the local list
//! ```
//!
//! El-Sana & Chiang store the list of permanent adjacent triangles with each vertex, and in the block once what several
//! of its vertices share. A triangle that appears with a split is adjacent to both of the new vertices; here it belongs
//! to the node that splits, and is stored once in the whole file. Coordinates are stored for the leaves of a block
//! alone, as there: one a node, its removed vertex. The kept one has come from above.

use vertex_tree::{Bounds, NodeId, prefetch};

/// Words before the nodes.
pub(crate) const HEADER_WORDS: usize = 9;
pub(crate) const NODE_WORDS: usize = 14;
const BLOCK_WORDS: usize = 2;
const LINK_WORDS: usize = 7;
pub(crate) const TRIANGLE_WORDS: usize = 3;
/// More levels would overflow the 15 bits of slots and links.
pub(crate) const MOST_LEVELS: u32 = 12;

/// Child of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Child {
    Leaf,
    Slot(u32),
    Link(u32),
}

impl Child {
    pub fn encode(self) -> u32 {
        match self {
            Self::Leaf => 0xFFFF,
            Self::Slot(slot) => slot,
            Self::Link(link) => 0x8000 | link,
        }
    }

    #[inline(always)]
    fn decode(half: u32) -> Self {
        match half & 0xFFFF {
            0xFFFF => Self::Leaf,
            link if link & 0x8000 != 0 => Self::Link(link & 0x7FFF),
            slot => Self::Slot(slot),
        }
    }
}

/// Words that a block adds to a page.
pub(crate) fn block_words(nodes: usize, links: usize, triangles: usize) -> usize {
    NODE_WORDS * nodes + BLOCK_WORDS + LINK_WORDS * links + TRIANGLE_WORDS * triangles
}

/// Words that are saved where a block is joined to the one above: its link, and its place among the blocks.
pub(crate) const JOINED_WORDS: usize = BLOCK_WORDS + LINK_WORDS;

/// Where the parts of a page are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Layout {
    pub nodes: u32,
    pub blocks_at: u32,
    pub links_at: u32,
    pub triangles_at: u32,
    pub parent: u32,
    pub first_child: u32,
    pub children: u32,
}

/// What holds for every page of a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    pub pages: u32,
    pub root_pages: u32,
    pub slot_bits: u32,
    pub leaves: u32,
    pub collapses: u32,
}

/// A page in its place holder.
#[derive(Clone, Copy)]
pub(crate) struct Page<'a> {
    pub words: &'a [u32],
    pub layout: &'a Layout,
}

impl<'a> Page<'a> {
    #[inline(always)]
    pub fn node(self, slot: u32) -> Node<'a> {
        let at = HEADER_WORDS + NODE_WORDS * slot as usize;
        Node { words: &self.words[at..at + NODE_WORDS] }
    }

    /// Starts to read the node in a slot into the cache, and what follows it.
    #[inline(always)]
    pub fn prefetch(self, slot: u32) {
        let at = HEADER_WORDS + NODE_WORDS * slot as usize;
        prefetch(self.words, at - 1);
        prefetch(self.words, at + NODE_WORDS - 1);
    }

    /// Starts to read what is known of the children of the node in a slot.
    #[inline(always)]
    pub fn prefetch_children(self, slot: u32) {
        if slot >= self.layout.nodes {
            return;
        }
        for child in self.node(slot).children() {
            let (at, words) = match child {
                Child::Leaf => continue,
                Child::Slot(child) => (HEADER_WORDS + NODE_WORDS * child as usize, 5),
                Child::Link(link) => (self.layout.links_at as usize + LINK_WORDS * link as usize, LINK_WORDS),
            };
            prefetch(self.words, at);
            prefetch(self.words, at + words - 1);
        }
    }

    /// Starts to read the triangles that the node in a slot brings.
    #[inline(always)]
    pub fn prefetch_brought(self, slot: u32) {
        if slot < self.layout.nodes {
            let (start, _) = self.brought_range(slot);
            prefetch(self.words, self.layout.triangles_at as usize + TRIANGLE_WORDS * start as usize);
        }
    }

    /// The node above a block's topmost one, and its number in the log.
    #[inline]
    pub fn above(self, block: u32) -> (u32, u32) {
        let at = self.layout.blocks_at as usize + BLOCK_WORDS * block as usize;
        (self.words[at], self.words[at + 1])
    }

    #[inline]
    pub fn link(self, link: u32) -> Link {
        let at = self.layout.links_at as usize + LINK_WORDS * link as usize;
        let words = &self.words[at..at + LINK_WORDS];
        Link { node: NodeId(words[0]), log_number: words[1], bounds: bounds(&words[2..]) }
    }

    pub fn blocks(self) -> u32 {
        (self.layout.links_at - self.layout.blocks_at) / BLOCK_WORDS as u32
    }

    pub fn links(self) -> u32 {
        (self.layout.triangles_at - self.layout.links_at) / LINK_WORDS as u32
    }

    /// The triangles that the node in a slot brings.
    #[inline]
    pub fn brought(self, slot: u32) -> impl ExactSizeIterator<Item = [u32; 3]> + 'a {
        let (start, end) = self.brought_range(slot);
        let at = self.layout.triangles_at as usize;
        let words = &self.words[at + TRIANGLE_WORDS * start as usize..at + TRIANGLE_WORDS * end as usize];
        words.chunks_exact(TRIANGLE_WORDS).map(|t| [t[0], t[1], t[2]])
    }

    #[inline(always)]
    pub fn brought_range(self, slot: u32) -> (u32, u32) {
        let start = if slot == 0 { 0 } else { self.node(slot - 1).triangles_end() };
        (start, self.node(slot).triangles_end())
    }
}

/// A node on a page.
#[derive(Clone, Copy)]
pub(crate) struct Node<'a> {
    words: &'a [u32],
}

impl Node<'_> {
    #[inline(always)]
    pub fn bounds(self) -> Bounds {
        bounds(self.words)
    }
    #[inline(always)]
    pub fn position(self) -> [f32; 3] {
        [5, 6, 7].map(|at| f32::from_bits(self.words[at]))
    }
    /// The leaves of the kept and of the removed vertex.
    #[inline(always)]
    pub fn leaves(self) -> [u32; 2] {
        [self.words[8], self.words[9]]
    }
    #[inline(always)]
    pub fn log_number(self) -> u32 {
        self.words[10]
    }
    #[inline(always)]
    pub fn children(self) -> [Child; 2] {
        let halves = self.words[11];
        [Child::decode(halves), Child::decode(halves >> 16)]
    }
    /// The slot of the parent, or the number of the block.
    #[inline(always)]
    pub fn parent(self) -> Result<u32, u32> {
        let parent = self.words[12];
        if parent & 0x8000 == 0 { Ok(parent) } else { Err(parent & 0x7FFF) }
    }
    #[inline(always)]
    pub fn triangles_end(self) -> u32 {
        self.words[13]
    }
}

/// A node of another page, as it is known here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Link {
    pub node: NodeId,
    pub log_number: u32,
    pub bounds: Bounds,
}

#[inline(always)]
fn bounds(words: &[u32]) -> Bounds {
    let f = |at: usize| f32::from_bits(words[at]);
    Bounds { center: [f(0), f(1), f(2)], radius: f(3), eps: f(4) }
}

pub(crate) fn bounds_words(b: &Bounds) -> [u32; 5] {
    let [x, y, z] = b.center;
    [x, y, z, b.radius, b.eps].map(f32::to_bits)
}

/// The checksum that a page should carry.
pub(crate) fn checksum(words: &[u32]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    if cfg!(target_endian = "little") {
        hasher.update(bytemuck::cast_slice(&words[1..]));
    } else {
        words[1..].iter().for_each(|word| hasher.update(&word.to_le_bytes()));
    }
    hasher.finalize()
}

/// Where the parts of a page are, if they add up to its length.
pub(crate) fn layout(words: &[u32]) -> Option<Layout> {
    let part = |start: u32, count: u32, each: usize| start.checked_add(count.checked_mul(each as u32)?);
    let blocks_at = part(HEADER_WORDS as u32, words[3], NODE_WORDS)?;
    let links_at = part(blocks_at, words[4], BLOCK_WORDS)?;
    let triangles_at = part(links_at, words[5], LINK_WORDS)?;
    let end = part(triangles_at, words[6], TRIANGLE_WORDS)?;
    (end as usize == words.len()).then_some(Layout {
        nodes: words[3],
        blocks_at,
        links_at,
        triangles_at,
        parent: words[2],
        first_child: words[7],
        children: words[8],
    })
}
