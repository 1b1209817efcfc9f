//! Which vertex shows a leaf, for the leaves that are shown.

use vertex_tree::{NONE, prefetch};

/// A hash table from leaves to vertices, by open addressing with linear probing.
///
/// An array over all leaves would be simpler, and slower: the leaves that are shown are few and far apart, each look-up
/// would be in a page of memory of its own, and translating its address costs more than the look-up.
#[derive(Clone, Debug)]
pub(crate) struct LeafMap {
    /// Leaf and vertex; the leaf [`NONE`] where there is no entry. A power of two of them, at most a quarter in use, so that a
    /// search mostly ends where it begins.
    entries: Vec<[u32; 2]>,
    len: usize,
}

impl LeafMap {
    pub fn new() -> Self {
        Self { entries: vec![[NONE; 2]; 64], len: 0 }
    }

    /// Where the search for a leaf begins: the upper bits of a product with 2^32 over the golden ratio (Knuth, The Art
    /// of Computer Programming 3, section 6.4).
    #[inline(always)]
    fn home(&self, leaf: u32) -> usize {
        let shift = 32 - self.entries.len().trailing_zeros();
        (leaf.wrapping_mul(0x9e37_79b9) >> shift) as usize
    }

    /// The place of a leaf, or the free one where the search for it ends.
    #[inline(always)]
    fn find(&self, leaf: u32) -> usize {
        let mut at = self.home(leaf);
        while self.entries[at][0] != leaf && self.entries[at][0] != NONE {
            at = (at + 1) & (self.entries.len() - 1);
        }
        at
    }

    #[inline(always)]
    pub fn prefetch(&self, leaf: u32) {
        prefetch(&self.entries, self.home(leaf));
    }

    /// The vertex of a leaf; [`NONE`] if it is not shown.
    #[inline(always)]
    pub fn get(&self, leaf: u32) -> u32 {
        self.entries[self.find(leaf)][1]
    }

    /// How many leaves are shown.
    pub fn len(&self) -> usize {
        self.len
    }

    /// A leaf is shown at a vertex. Returns whether it was not shown before; if it was, nothing changes.
    #[inline(always)]
    pub fn insert(&mut self, leaf: u32, vertex: u32) -> bool {
        if 4 * (self.len + 1) > self.entries.len() {
            self.grow();
        }
        let at = self.find(leaf);
        let is_new = self.entries[at][0] == NONE;
        if is_new {
            self.len += 1;
            self.entries[at] = [leaf, vertex];
        }
        is_new
    }

    #[inline(always)]
    pub fn remove(&mut self, leaf: u32) {
        let mask = self.entries.len() - 1;
        let mut gap = self.find(leaf);
        if self.entries[gap][0] == NONE {
            return;
        }
        self.len -= 1;
        // Entries behind the gap close up, but for those that are not further from their homes than the gap is.
        let mut at = gap;
        loop {
            at = (at + 1) & mask;
            let entry = self.entries[at];
            if entry[0] == NONE {
                break;
            }
            let from_home = at.wrapping_sub(self.home(entry[0])) & mask;
            if from_home >= at.wrapping_sub(gap) & mask {
                self.entries[gap] = entry;
                gap = at;
            }
        }
        self.entries[gap] = [NONE; 2];
    }

    #[cold]
    fn grow(&mut self) {
        let larger = vec![[NONE; 2]; 2 * self.entries.len()];
        let entries = std::mem::replace(&mut self.entries, larger);
        for [leaf, vertex] in entries.into_iter().filter(|entry| entry[0] != NONE) {
            let at = self.find(leaf);
            self.entries[at] = [leaf, vertex];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;
    use std::collections::BTreeMap;

    #[test]
    fn agrees_with_an_ordered_map() {
        for range in [40, 1000, 1 << 31] {
            let (mut map, mut model) = (LeafMap::new(), BTreeMap::new());
            let mut random = Pcg64::seed_from_u64(1);
            for step in 0..20_000_u32 {
                let leaf = random.random_range(0..range);
                if random.random() {
                    map.remove(leaf);
                    model.remove(&leaf);
                } else {
                    assert_eq!(map.insert(leaf, step), !model.contains_key(&leaf));
                    model.entry(leaf).or_insert(step);
                }
                let probe = random.random_range(0..range);
                assert_eq!(map.get(probe), model.get(&probe).copied().unwrap_or(NONE));
                assert_eq!(map.len, model.len());
            }
            for (&leaf, &vertex) in &model {
                assert_eq!(map.get(leaf), vertex);
            }
        }
    }
}
