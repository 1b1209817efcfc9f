//! Where nodes are in a file: which partition they are in, and how long their records are. It is there for all nodes while the
//! file is open, so it is small: about 2.1 bytes a node, and 12 a partition.

use std::ops::Range;

use rustc_hash::FxHashMap;

/// Nodes for which one of them says in which partition it is.
const STRIDE: u32 = 32;

/// Stands for a length that has its place among the long ones.
const LONG: u16 = u16::MAX;

/// The partitions of a file and the records of their nodes, one behind the other.
pub(crate) struct Layout {
    /// First node of each partition, and one entry more: the number of nodes.
    first: Vec<u32>,
    /// Where the records of each partition start.
    starts: Vec<u64>,
    /// Where the last record ends.
    end: u64,
    /// The partition of every [`STRIDE`]th node.
    near: Vec<u32>,
    /// Bytes of each node's record.
    lengths: Vec<u16>,
    long: FxHashMap<u32, u32>,
}

impl Layout {
    /// Partitions by their first nodes, ascending from 0, with the number of nodes behind them; the length of each node's record,
    /// of which the first starts at an offset. At most 2^32 lengths below 2^32, on top of a source that is shorter than the
    /// file: nothing overflows.
    pub fn new(first: Vec<u32>, at: u64, lengths: impl Iterator<Item = u32>) -> Self {
        let nodes = first.last().copied().unwrap_or(0);
        let mut layout = Self {
            starts: Vec::with_capacity(first.len() - 1),
            end: at,
            near: Vec::with_capacity(nodes.div_ceil(STRIDE) as usize),
            lengths: Vec::with_capacity(nodes as usize),
            long: FxHashMap::default(),
            first,
        };
        for (node, length) in (0..nodes).zip(lengths) {
            if layout.first[layout.starts.len()] == node {
                layout.starts.push(layout.end);
            }
            if node % STRIDE == 0 {
                layout.near.push(layout.starts.len() as u32 - 1);
            }
            layout.end += u64::from(length);
            let short = u16::try_from(length).ok().filter(|&short| short != LONG);
            layout.lengths.push(short.unwrap_or(LONG));
            if short.is_none() {
                layout.long.insert(node, length);
            }
        }
        layout
    }

    /// How many partitions there are.
    pub fn partitions(&self) -> u32 {
        self.starts.len() as u32
    }

    /// The nodes of a partition.
    pub fn nodes_of(&self, partition: u32) -> Range<u32> {
        self.first[partition as usize]..self.first[partition as usize + 1]
    }

    /// The partition that a node is in: not far from that of one a little before it.
    #[inline]
    pub fn partition_of(&self, node: u32) -> u32 {
        let near = self.near[(node / STRIDE) as usize];
        (near..)
            .zip(&self.first[near as usize + 1..])
            .find(|&(_, &next)| node < next)
            .map_or(near, |(p, _)| p)
    }

    /// Bytes of a node's record.
    #[inline]
    pub fn length(&self, node: u32) -> u64 {
        match self.lengths[node as usize] {
            LONG => self.long.get(&node).copied().unwrap_or(0).into(),
            short => short.into(),
        }
    }

    /// Bytes of the records of nodes with consecutive numbers.
    pub fn bytes(&self, nodes: Range<u32>) -> u64 {
        nodes.map(|node| self.length(node)).sum()
    }

    /// Where a node's record starts.
    pub fn offset(&self, node: u32) -> u64 {
        let partition = self.partition_of(node);
        self.starts[partition as usize] + self.bytes(self.first[partition as usize]..node)
    }

    /// Where the last record ends.
    pub fn end(&self) -> u64 {
        self.end
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn agrees_with_tables_of_all_nodes() {
        let mut random = Pcg64::seed_from_u64(1);
        for most in [1_u32, 3, 40, 200] {
            let mut first = vec![0_u32];
            let mut partition_of = Vec::new();
            for partition in 0..300 {
                let nodes = random.random_range(1..=most);
                partition_of.extend(std::iter::repeat_n(partition, nodes as usize));
                first.push(first[partition as usize] + nodes);
            }
            let length = |random: &mut Pcg64| match random.random_range(0..8) {
                0 => [u32::from(LONG) - 1, LONG.into(), u32::from(LONG) + 1, u32::MAX]
                    [random.random_range(0..4)],
                _ => random.random_range(1..1000),
            };
            let lengths: Vec<u32> = partition_of.iter().map(|_| length(&mut random)).collect();
            let layout = Layout::new(first.clone(), 77, lengths.iter().copied());
            assert_eq!(layout.partitions(), 300);
            let mut at = 77;
            for (node, (&partition, &length)) in (0..).zip(partition_of.iter().zip(&lengths)) {
                assert_eq!(layout.partition_of(node), partition);
                assert!(layout.nodes_of(partition).contains(&node));
                assert_eq!((layout.offset(node), layout.length(node)), (at, length.into()));
                at += u64::from(length);
            }
            assert_eq!(layout.end(), at);
            assert_eq!(layout.bytes(0..first[300]), at - 77);
        }
    }

    #[test]
    fn no_nodes() {
        let layout = Layout::new(vec![0], 5, std::iter::empty());
        assert_eq!((layout.partitions(), layout.end(), layout.bytes(0..0)), (0, 5, 0));
    }
}
