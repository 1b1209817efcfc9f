//! The star of each displayed vertex: which corners of displayed triangles are there.
//!
//! Most vertices have about six. A star of up to 14 lies in one cache line; a larger one moves to a list of its own.

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

/// Corners that fit beside the rest of a star's cache line.
const NEAR: usize = 14;

#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
struct Star {
    /// The leaf whose vertex is shown here; [`NONE`] in a hole.
    leaf: u32,
    /// How many corners are in `near`, or [`FAR`] where they are in the list of which `near[0]` is the number.
    count: u32,
    near: [Corner; NEAR],
}

const FAR: u32 = u32::MAX;

/// The stars of all displayed vertices, by the vertex's slot.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stars {
    stars: Vec<Star>,
    holes: Vec<u32>,
    far: Vec<Vec<Corner>>,
    unused_far: Vec<u32>,
}

impl Stars {
    /// A vertex appears; returns its slot. Slots are used again last in, first out.
    #[inline]
    pub fn add(&mut self, leaf: u32) -> u32 {
        match self.holes.pop() {
            Some(slot) => {
                let star = &mut self.stars[slot as usize];
                star.leaf = leaf;
                star.count = 0;
                slot
            }
            None => {
                self.stars.push(Star { leaf, count: 0, near: [NONE; NEAR] });
                self.stars.len() as u32 - 1
            }
        }
    }

    /// A vertex disappears. No corner is left there.
    #[inline]
    pub fn remove(&mut self, slot: u32) {
        debug_assert!(self.corners(slot).is_empty());
        let star = &mut self.stars[slot as usize];
        star.leaf = NONE;
        if star.count == FAR {
            self.unused_far.push(star.near[0]);
            star.count = 0;
        }
        self.holes.push(slot);
    }

    /// The leaf that is shown in a slot; [`NONE`] in a hole.
    #[inline(always)]
    pub fn leaf(&self, slot: u32) -> u32 {
        self.stars[slot as usize].leaf
    }

    #[inline(always)]
    pub fn prefetch(&self, slot: u32) {
        prefetch(&self.stars, slot as usize);
    }

    #[inline(always)]
    pub fn corners(&self, slot: u32) -> &[Corner] {
        let star = &self.stars[slot as usize];
        if star.count == FAR {
            &self.far[star.near[0] as usize]
        } else {
            // The bound is never reached, and spares a panic.
            &star.near[..(star.count as usize).min(NEAR)]
        }
    }

    #[inline(always)]
    pub fn push(&mut self, slot: u32, corner: Corner) {
        let star = &mut self.stars[slot as usize];
        match star.near.get_mut(star.count as usize) {
            Some(place) => {
                *place = corner;
                star.count += 1;
            }
            None => self.push_far(slot, corner),
        }
    }

    #[cold]
    fn push_far(&mut self, slot: u32, corner: Corner) {
        let star = &mut self.stars[slot as usize];
        if star.count != FAR {
            let number = self.unused_far.pop().unwrap_or_else(|| {
                self.far.push(Vec::with_capacity(4 * NEAR));
                self.far.len() as u32 - 1
            });
            let far = &mut self.far[number as usize];
            far.clear();
            far.extend_from_slice(&star.near);
            star.count = FAR;
            star.near[0] = number;
        }
        self.far[star.near[0] as usize].push(corner);
    }

    /// Replaces a corner that is in the star by another.
    pub fn replace(&mut self, slot: u32, corner: Corner, by: Corner) {
        let star = &mut self.stars[slot as usize];
        let corners = match star.count {
            FAR => &mut self.far[star.near[0] as usize][..],
            count => &mut star.near[..(count as usize).min(NEAR)],
        };
        if let Some(place) = corners.iter_mut().find(|place| **place == corner) {
            *place = by;
        }
    }

    /// Takes a corner out of a star; the last one takes its place.
    #[inline(always)]
    pub fn take(&mut self, slot: u32, corner: Corner) {
        let star = &mut self.stars[slot as usize];
        if star.count == FAR {
            let far = &mut self.far[star.near[0] as usize];
            if let Some(at) = far.iter().position(|&c| c == corner) {
                far.swap_remove(at);
            }
            return;
        }
        // All places are compared, also unused ones: where a loop would end can not be predicted.
        let mut found = 0;
        for (at, &c) in star.near.iter().enumerate() {
            found |= u32::from(c == corner) << at;
        }
        let used = (1 << star.count) - 1;
        if found & used != 0 {
            star.count -= 1;
            star.near[found.trailing_zeros() as usize % NEAR] = star.near[star.count as usize % NEAR];
        }
    }

    /// Moves the corners for which `moves` says so from one star to another, which is empty.
    #[inline(always)]
    pub fn split(&mut self, from: u32, to: u32, mut moves: impl FnMut(Corner) -> bool) {
        let star = &mut self.stars[from as usize];
        if star.count == FAR {
            return self.split_far(from, to, moves);
        }
        let (corners, count) = (star.near, (star.count as usize).min(NEAR));
        // Both lists are written whether a corner goes there or not: only their lengths depend on it.
        let (mut stay, mut go, mut gone) = (0, 0, [NONE; NEAR]);
        for &corner in &corners[..count] {
            let moves = usize::from(moves(corner));
            star.near[stay % NEAR] = corner;
            gone[go % NEAR] = corner;
            go += moves;
            stay += 1 - moves;
        }
        star.count = stay as u32;
        let star = &mut self.stars[to as usize];
        star.near = gone;
        star.count = go as u32;
    }

    #[cold]
    fn split_far(&mut self, from: u32, to: u32, mut moves: impl FnMut(Corner) -> bool) {
        let number = self.stars[from as usize].near[0] as usize;
        let mut at = 0;
        while let Some(&corner) = self.far[number].get(at) {
            if moves(corner) {
                self.far[number].swap_remove(at);
                self.push(to, corner);
            } else {
                at += 1;
            }
        }
    }

    /// Takes the last corner out of a star.
    #[inline(always)]
    pub fn pop(&mut self, slot: u32) -> Option<Corner> {
        let star = &mut self.stars[slot as usize];
        if star.count == FAR {
            return self.far[star.near[0] as usize].pop();
        }
        star.count = star.count.checked_sub(1)?;
        Some(star.near[star.count as usize % NEAR])
    }
}
