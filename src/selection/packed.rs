//! Bounds of many nodes, packed for vector code: blocks of parallel arrays.

use vertex_tree::Bounds;

/// Nodes in a block: vector code works on all of them at once.
pub(crate) const LANES: usize = 16;

/// Bounds of [`LANES`] nodes, one array a member.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(crate) struct Block {
    pub x: [f32; LANES],
    pub y: [f32; LANES],
    pub z: [f32; LANES],
    pub radius: [f32; LANES],
    pub eps: [f32; LANES],
    /// Node numbers, with whatever else the owner keeps in the bits that they leave.
    pub tag: [u32; LANES],
}

impl Block {
    pub const EMPTY: Self = Self {
        x: [0.0; LANES],
        y: [0.0; LANES],
        z: [0.0; LANES],
        radius: [0.0; LANES],
        eps: [0.0; LANES],
        tag: [0; LANES],
    };

    #[inline(always)]
    pub fn set(&mut self, lane: usize, bounds: &Bounds, tag: u32) {
        let lane = lane % LANES;
        [self.x[lane], self.y[lane], self.z[lane]] = bounds.center;
        self.radius[lane] = bounds.radius;
        self.eps[lane] = bounds.eps;
        self.tag[lane] = tag;
    }

    #[inline(always)]
    pub fn bounds(&self, lane: usize) -> Bounds {
        let lane = lane % LANES;
        Bounds {
            center: [self.x[lane], self.y[lane], self.z[lane]],
            radius: self.radius[lane],
            eps: self.eps[lane],
        }
    }
}

/// A growing array of bounds and tags, in blocks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packed {
    blocks: Vec<Block>,
    len: usize,
}

impl Packed {
    #[inline]
    pub fn len(&self) -> usize {
        self.len
    }

    #[inline]
    pub fn push(&mut self, bounds: &Bounds, tag: u32) {
        if self.len.is_multiple_of(LANES) {
            self.blocks.push(Block::EMPTY);
        }
        if let Some(block) = self.blocks.last_mut() {
            block.set(self.len, bounds, tag);
        }
        self.len += 1;
    }

    /// Removes an entry; the last one takes its place. Returns that one's tag, if it was not the same.
    #[inline]
    pub fn swap_remove(&mut self, at: usize) -> Option<u32> {
        let last = self.len.checked_sub(1)?;
        let (bounds, tag) =
            (self.blocks[last / LANES].bounds(last), self.blocks[last / LANES].tag[last % LANES]);
        if last.is_multiple_of(LANES) {
            self.blocks.pop();
        }
        self.len = last;
        if at == last {
            return None;
        }
        self.blocks[at / LANES].set(at, &bounds, tag);
        Some(tag)
    }

    /// The blocks, each with how many of its entries are in use: all, but for the last.
    #[inline]
    pub fn blocks(&self) -> impl Iterator<Item = (&Block, usize)> {
        self.blocks.iter().enumerate().map(|(i, block)| (block, self.used(i)))
    }

    /// How many blocks there are.
    #[inline]
    pub fn count(&self) -> usize {
        self.blocks.len()
    }

    /// One of the blocks, and how many of its entries are in use.
    #[inline]
    pub fn block(&self, at: usize) -> Option<(&Block, usize)> {
        self.blocks.get(at).map(|block| (block, self.used(at)))
    }

    #[inline]
    fn used(&self, at: usize) -> usize {
        (self.len - at * LANES).min(LANES)
    }
}
