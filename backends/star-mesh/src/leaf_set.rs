//! A set of leaf numbers that answers "the largest member that is not above x" in a few words.

use vertex_tree::prefetch;

/// A set of numbers below a fixed limit: a tree of 64-way bit masks.
///
/// The front's vertices are kept in one: numbered depth-first, the vertex that stands for a leaf is the nearest one
/// at or below it.
#[derive(Clone, Debug)]
pub(crate) struct LeafSet {
    /// All levels, the lowest first. It has a bit a number; above it, bit `i` of a level says whether word `i` of the one
    /// below is not 0. The highest level is one word.
    words: Vec<u64>,
    /// Where each level starts.
    starts: [usize; LEVELS],
    levels: usize,
}

/// Enough for all `u32`.
const LEVELS: usize = 6;

impl LeafSet {
    pub fn new(limit: usize) -> Self {
        let (mut starts, mut levels) = ([0; LEVELS], 0);
        let (mut length, mut words) = (0, limit);
        loop {
            words = words.div_ceil(64).max(1);
            starts[levels] = length;
            levels += 1;
            length += words;
            if words == 1 {
                return Self { words: vec![0; length], starts, levels };
            }
        }
    }

    /// Starts to read the lowest word that a look-up will read.
    #[inline(always)]
    pub fn prefetch(&self, number: u32) {
        prefetch(&self.words, number as usize / 64);
    }

    /// How many members there are.
    pub fn count(&self) -> usize {
        let end = self.starts.get(1).copied().filter(|_| self.levels > 1).unwrap_or(self.words.len());
        self.words[..end].iter().map(|word| word.count_ones() as usize).sum()
    }

    #[inline]
    pub fn insert(&mut self, number: u32) {
        let mut at = number as usize;
        for &start in &self.starts[..self.levels] {
            let word = &mut self.words[start + at / 64];
            let was = *word;
            *word |= 1 << (at % 64);
            if was != 0 {
                break;
            }
            at /= 64;
        }
    }

    #[inline]
    pub fn remove(&mut self, number: u32) {
        let mut at = number as usize;
        for &start in &self.starts[..self.levels] {
            let word = &mut self.words[start + at / 64];
            *word &= !(1 << (at % 64));
            if *word != 0 {
                break;
            }
            at /= 64;
        }
    }

    /// The largest member that is not above `number`, if there is one.
    #[inline]
    pub fn at_or_below(&self, number: u32) -> Option<u32> {
        let mut at = number as usize;
        // On the lowest level `at` itself counts; above, only words below the one already searched do.
        let mut masked = self.words[at / 64] & (u64::MAX >> (63 - at % 64));
        let mut level = 0;
        while masked == 0 {
            at /= 64;
            level += 1;
            if level == self.levels {
                return None;
            }
            masked = self.words[self.starts[level] + at / 64] & ((1 << (at % 64)) - 1);
        }
        let last = |word: u64| 63 - word.leading_zeros() as usize;
        let mut found = at / 64 * 64 + last(masked);
        while level > 0 {
            level -= 1;
            found = found * 64 + last(self.words[self.starts[level] + found]);
        }
        Some(found as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;
    use std::collections::BTreeSet;

    #[test]
    fn agrees_with_an_ordered_set() {
        for limit in [1, 63, 64, 65, 4096, 4097, 300_000] {
            let mut set = LeafSet::new(limit);
            let mut model = BTreeSet::new();
            let mut random = Pcg64::seed_from_u64(1);
            for _ in 0..3000 {
                let number = random.random_range(0..limit as u32);
                if random.random_ratio(1, 4) {
                    set.remove(number);
                    model.remove(&number);
                } else {
                    set.insert(number);
                    model.insert(number);
                }
                let probe = random.random_range(0..limit as u32);
                assert_eq!(set.at_or_below(probe), model.range(..=probe).next_back().copied());
            }
        }
    }
}
