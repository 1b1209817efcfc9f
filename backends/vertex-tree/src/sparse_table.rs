//! What is known of a few among many nodes.

#[derive(Clone, Debug)]
struct Piece<T, const N: usize> {
    values: [T; N],
    /// How many are not blank.
    used: u32,
}

/// A value for every node below a limit, of which most are blank: the default of `T`.
///
/// Nodes that are visited together have numbers that are close ([`NodeId`](crate::NodeId)), and few of all are in play, or
/// in memory. So the table is in pieces, and there are only those with a value that is not blank: 8 bytes for every 256 nodes,
/// and 256 values a piece, or as many as `N` says.
#[derive(Clone, Debug)]
pub struct SparseTable<T, const N: usize = 256> {
    pieces: Vec<Option<Box<Piece<T, N>>>>,
    /// A piece that was let go of: nodes at its edge come and go.
    spare: Option<Box<Piece<T, N>>>,
}

impl<T, const N: usize> Default for SparseTable<T, N> {
    fn default() -> Self {
        Self { pieces: Vec::new(), spare: None }
    }
}

impl<T: Copy + Default + PartialEq, const N: usize> SparseTable<T, N> {
    /// For nodes below a limit, all of them blank.
    #[must_use]
    pub fn new(limit: u32) -> Self {
        let mut pieces = Vec::new();
        pieces.resize_with((limit as usize).div_ceil(N), || None);
        Self { pieces, spare: None }
    }

    /// The value of a node below the limit.
    ///
    /// # Panics
    /// If it is not, or not even near.
    #[inline(always)]
    #[must_use]
    pub fn get(&self, node: u32) -> T {
        match &self.pieces[node as usize / N] {
            Some(piece) => piece.values[node as usize % N],
            None => T::default(),
        }
    }

    /// Another value for a node; what it was.
    ///
    /// # Panics
    /// As [`get`](Self::get).
    #[inline(always)]
    pub fn set(&mut self, node: u32, value: T) -> T {
        let blank = T::default();
        let place = &mut self.pieces[node as usize / N];
        if place.is_none() && value == blank {
            return blank;
        }
        let piece = place.get_or_insert_with(|| {
            self.spare.take().unwrap_or_else(|| Box::new(Piece { values: [T::default(); N], used: 0 }))
        });
        let before = std::mem::replace(&mut piece.values[node as usize % N], value);
        piece.used += u32::from(value != blank);
        piece.used -= u32::from(before != blank);
        if piece.used == 0 {
            self.spare = place.take();
        }
        before
    }

    /// Starts to read the value of a node into the cache.
    #[inline]
    pub fn prefetch(&self, node: u32) {
        if let Some(Some(piece)) = self.pieces.get(node as usize / N) {
            crate::prefetch(&piece.values, node as usize % N);
        }
    }

    /// How many values are not blank.
    #[must_use]
    pub fn used(&self) -> usize {
        self.pieces.iter().flatten().map(|piece| piece.used as usize).sum()
    }

    /// The nodes whose values are not blank, in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = (u32, T)> {
        let pieces = self.pieces.iter().enumerate().filter_map(|(at, piece)| Some((at, piece.as_ref()?)));
        pieces
            .flat_map(|(at, piece)| (at * N..).map(|node| node as u32).zip(piece.values))
            .filter(|&(_, value)| value != T::default())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn agrees_with_an_ordered_map() {
        let limit = 1000;
        let (mut table, mut model) = (SparseTable::<u32>::new(limit), BTreeMap::new());
        let mut random = Pcg64::seed_from_u64(1);
        for step in 1..20_000_u32 {
            // Now here, now there, so that pieces come and go.
            let around = 300 * (step / 1000 % 3);
            let node = around + random.random_range(0..300);
            if let Some(before) = model.remove(&node) {
                assert_eq!(table.set(node, 0), before);
            } else if model.len() < 3 || random.random() {
                assert_eq!(table.set(node, step), 0);
                model.insert(node, step);
            }
            let probe = random.random_range(0..limit);
            assert_eq!(table.get(probe), model.get(&probe).copied().unwrap_or(0));
        }
        assert_eq!(table.used(), model.len());
        assert!(table.iter().eq(model.iter().map(|(&node, &value)| (node, value))));
        let pieces = |table: &SparseTable<u32>| table.pieces.iter().flatten().count();
        assert!(pieces(&table) <= 4 && pieces(&table) > 0);
        model.keys().for_each(|&node| _ = table.set(node, 0));
        assert_eq!(pieces(&table), 0);
    }
}
