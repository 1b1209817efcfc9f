//! The star of each displayed vertex: which corners of displayed triangles are there.
//!
//! Most vertices have about six. The corners of a star of up to 14 lie in one cache line and their leaves in the next; a
//! larger one moves to lists of its own. With the leaves at hand, a split finds the corners that move by comparing all
//! of them at once, without a look at the triangles and without a branch that can not be predicted.

use crate::{NONE, prefetch};

/// Corner `c` of the triangle in slot `t` is numbered `4 t + c`: the triangle is found by a shift.
pub(crate) type Corner = u32;

#[inline(always)]
pub(crate) fn corner(triangle: u32, index: usize) -> Corner {
    triangle << 2 | index as u32
}

#[inline(always)]
pub(crate) fn triangle_of(corner: Corner) -> (usize, usize) {
    ((corner >> 2) as usize, (corner & 3) as usize)
}

/// Corners that fit into a star's first cache line.
const NEAR: usize = 14;
/// Words of a cache line. A power of two, so that a remainder is a mask, which spares a panic.
const LINE: usize = 16;

#[derive(Clone, Copy, Debug)]
#[repr(C, align(128))]
struct Star {
    /// Corners in the first [`NEAR`] words. Then [`COUNT`], how many they are, or [`FAR`] where they are in the lists of
    /// which the first word is the number; and [`LEAF`], the leaf whose vertex is shown here, [`NONE`] in a hole.
    line: [u32; LINE],
    /// For each corner, the leaf that it belongs to.
    leaves: [u32; LINE],
}

const COUNT: usize = NEAR;
const LEAF: usize = NEAR + 1;

impl Star {
    fn new(leaf: u32) -> Self {
        let mut star = Self { line: [NONE; LINE], leaves: [NONE; LINE] };
        star.line[COUNT] = 0;
        star.line[LEAF] = leaf;
        star
    }

    #[inline(always)]
    fn count(&self) -> u32 {
        self.line[COUNT]
    }

    #[inline(always)]
    fn is_far(&self) -> bool {
        self.count() == FAR
    }

    /// The corner at a place, with the leaf that it belongs to.
    #[inline(always)]
    fn get(&self, at: u32) -> (Corner, u32) {
        (self.line[at as usize % LINE], self.leaves[at as usize % LINE])
    }

    #[inline(always)]
    fn set(&mut self, at: u32, (corner, leaf): (Corner, u32)) {
        self.line[at as usize % LINE] = corner;
        self.leaves[at as usize % LINE] = leaf;
    }

    /// A bit for each corner that is there.
    #[inline(always)]
    fn used(&self) -> u32 {
        (1 << self.count().min(NEAR as u32)) - 1
    }

    /// A bit for each corner whose leaf is `first` or comes after it.
    #[inline(always)]
    fn from(&self, first: u32) -> u32 {
        mask(&self.leaves, |leaf| leaf >= first) & self.used()
    }
}

const FAR: u32 = u32::MAX;

/// A star that is too large for its cache lines.
#[derive(Clone, Debug, Default)]
struct Far {
    corners: Vec<Corner>,
    leaves: Vec<u32>,
}

impl Far {
    fn swap_remove(&mut self, at: usize) -> (Corner, u32) {
        (self.corners.swap_remove(at), self.leaves.swap_remove(at))
    }
}

/// The stars of all displayed vertices, by the vertex's slot.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stars {
    stars: Vec<Star>,
    holes: Vec<u32>,
    far: Vec<Far>,
    unused_far: Vec<u32>,
}

impl Stars {
    /// A vertex appears; returns its slot. Slots are used again last in, first out.
    #[inline]
    pub fn add(&mut self, leaf: u32) -> u32 {
        match self.holes.pop() {
            Some(slot) => {
                let star = &mut self.stars[slot as usize];
                star.line[LEAF] = leaf;
                star.line[COUNT] = 0;
                slot
            }
            None => {
                self.stars.push(Star::new(leaf));
                self.stars.len() as u32 - 1
            }
        }
    }

    /// A vertex disappears. No corner is left there.
    #[inline]
    pub fn remove(&mut self, slot: u32) {
        debug_assert!(self.corners(slot).is_empty());
        let star = &mut self.stars[slot as usize];
        star.line[LEAF] = NONE;
        if star.is_far() {
            self.unused_far.push(star.line[0]);
            star.line[COUNT] = 0;
        }
        self.holes.push(slot);
    }

    /// The leaf that is shown in a slot; [`NONE`] in a hole.
    #[inline(always)]
    pub fn leaf(&self, slot: u32) -> u32 {
        self.stars[slot as usize].line[LEAF]
    }

    /// Starts to read a star into the cache. Where corners come or leave one by one, their leaves are not read, only
    /// written; where the star is split or dissolved, they are.
    #[inline(always)]
    pub fn prefetch(&self, slot: u32, with_leaves: bool) {
        prefetch(&self.stars, slot as usize);
        if with_leaves && let Some(star) = self.stars.get(slot as usize) {
            prefetch(&star.leaves, 0);
        }
    }

    #[inline(always)]
    pub fn corners(&self, slot: u32) -> &[Corner] {
        let star = &self.stars[slot as usize];
        if star.is_far() {
            &self.far[star.line[0] as usize].corners
        } else {
            // The bound is never reached, and spares a panic.
            &star.line[..(star.count() as usize).min(NEAR)]
        }
    }

    /// Calls `f` with the corners that a [`split`](Self::split) would move, and where they are many, with all.
    #[inline(always)]
    pub fn for_each_moving(&self, slot: u32, first: u32, mut f: impl FnMut(Corner)) {
        let star = &self.stars[slot as usize];
        if star.is_far() {
            return self.corners(slot).iter().for_each(|&corner| f(corner));
        }
        for_each_bit(star.from(first), |at| f(star.get(at).0));
    }

    #[inline(always)]
    pub fn push(&mut self, slot: u32, corner: Corner, leaf: u32) {
        let star = &mut self.stars[slot as usize];
        let count = star.count();
        if count < NEAR as u32 {
            star.set(count, (corner, leaf));
            star.line[COUNT] = count + 1;
        } else {
            self.push_far(slot, corner, leaf);
        }
    }

    #[cold]
    fn push_far(&mut self, slot: u32, corner: Corner, leaf: u32) {
        let star = &mut self.stars[slot as usize];
        if !star.is_far() {
            let number = self.unused_far.pop().unwrap_or_else(|| {
                let (corners, leaves) = (Vec::with_capacity(4 * NEAR), Vec::with_capacity(4 * NEAR));
                self.far.push(Far { corners, leaves });
                self.far.len() as u32 - 1
            });
            let far = &mut self.far[number as usize];
            far.corners.clear();
            far.corners.extend_from_slice(&star.line[..NEAR]);
            far.leaves.clear();
            far.leaves.extend_from_slice(&star.leaves[..NEAR]);
            star.line[COUNT] = FAR;
            star.line[0] = number;
        }
        let far = &mut self.far[star.line[0] as usize];
        far.corners.push(corner);
        far.leaves.push(leaf);
    }

    /// Replaces a corner that is in the star by another of the same leaf.
    pub fn replace(&mut self, slot: u32, corner: Corner, by: Corner) {
        let star = &mut self.stars[slot as usize];
        let corners = match star.count() {
            FAR => &mut self.far[star.line[0] as usize].corners[..],
            count => &mut star.line[..(count as usize).min(NEAR)],
        };
        if let Some(place) = corners.iter_mut().find(|place| **place == corner) {
            *place = by;
        }
    }

    /// Takes a corner out of a star; the last one takes its place.
    #[inline(always)]
    pub fn take(&mut self, slot: u32, corner: Corner) {
        let star = &mut self.stars[slot as usize];
        if star.is_far() {
            let far = &mut self.far[star.line[0] as usize];
            if let Some(at) = far.corners.iter().position(|&c| c == corner) {
                far.swap_remove(at);
            }
            return;
        }
        // All places are compared, also unused ones: where a loop would end can not be predicted.
        let found = mask(&star.line, |c| c == corner) & star.used();
        if found != 0 {
            star.line[COUNT] -= 1;
            star.set(found.trailing_zeros(), star.get(star.count()));
        }
    }

    /// Moves the corners of leaves from `first` on to another star, which is empty, and calls `moved` with each.
    #[inline(always)]
    pub fn split(&mut self, from: u32, to: u32, first: u32, mut moved: impl FnMut(Corner)) {
        let old = self.stars[from as usize];
        if old.is_far() {
            return self.split_far(from, to, first, moved);
        }
        let go = old.from(first);
        let star = &mut self.stars[to as usize];
        let mut count = 0;
        for_each_bit(go, |at| {
            star.set(count, old.get(at));
            count += 1;
            moved(old.get(at).0);
        });
        star.line[COUNT] = count;
        let star = &mut self.stars[from as usize];
        let mut count = 0;
        for_each_bit(old.used() & !go, |at| {
            star.set(count, old.get(at));
            count += 1;
        });
        star.line[COUNT] = count;
    }

    #[cold]
    fn split_far(&mut self, from: u32, to: u32, first: u32, mut moved: impl FnMut(Corner)) {
        let number = self.stars[from as usize].line[0] as usize;
        let mut at = 0;
        while let Some(&leaf) = self.far[number].leaves.get(at) {
            if leaf >= first {
                let (corner, leaf) = self.far[number].swap_remove(at);
                self.push(to, corner, leaf);
                moved(corner);
            } else {
                at += 1;
            }
        }
    }

    /// Takes the last corner out of a star, with the leaf that it belongs to.
    #[inline(always)]
    pub fn pop(&mut self, slot: u32) -> Option<(Corner, u32)> {
        let star = &mut self.stars[slot as usize];
        if star.is_far() {
            let far = &mut self.far[star.line[0] as usize];
            return Some((far.corners.pop()?, far.leaves.pop()?));
        }
        star.line[COUNT] = star.count().checked_sub(1)?;
        Some(star.get(star.count()))
    }
}

/// A bit for each of the first [`NEAR`] entries, whether `is` holds for it.
#[inline(always)]
fn mask(entries: &[u32; LINE], is: impl Fn(u32) -> bool) -> u32 {
    entries[..NEAR].iter().enumerate().fold(0, |mask, (at, &entry)| mask | u32::from(is(entry)) << at)
}

#[inline(always)]
fn for_each_bit(mut bits: u32, mut f: impl FnMut(u32)) {
    while bits != 0 {
        f(bits.trailing_zeros());
        bits &= bits - 1;
    }
}
