//! Which nodes stay in memory: the four modes of the paper's section 5, the layers of section 4.3, and a fifth mode.
//!
//! The cut of a multi-triangulation is a set of arcs, those whose upper node is active and whose lower one is not. A node
//! is *in the cut* while it is the upper or the lower node of one of them.
//!
//! For the caching mode, a partition keeps two tuples of a frame and a layer. `T_min` has the least layer among the nodes
//! of arcs that came into the cut from above (a node was unfolded), `T_max` the largest among those of arcs that came from
//! below (a node was folded). A node that is not in the cut is kept if the cut is in its partition and has moved towards
//! it:
//!
//! ```text
//! (f_min = f  and  l_n > l_min)  or  (f_max = f  and  l_n < l_max).
//! ```
//!
//! The paper's equation 2 takes a minimum for `T_max`, and the second half of its equation 3 keeps nodes below `l_max`;
//! its text and its figure 3 say what is written here. It leaves open what becomes of the layers of arcs that stay in the
//! cut, for which only the frames are set to the current one:
//!
//! * The frames are the current one wherever the partition has a node in the cut and the tuple has ever been set. A count
//!   of nodes in the cut takes the place of a walk through the cut in every frame.
//! * If layers were taken from new arcs alone, nodes just below older arcs would go; if they were added up, nodes that the
//!   cut has long passed would stay, against the paper's figure 3. Here they are the least and the largest layer of the
//!   partition's nodes in the cut, looked up when something in the partition has changed.
//!
//! Layers are a poor sign of what lies below the cut: a node is on a small layer if it has a short path from the source,
//! wherever the cut is. Whether it has been unfolded is known, and says it exactly: [`CacheMode::PStatus`].

/// What is read at once, and what is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum CacheMode {
    /// No partitions, no caching: nodes are read one by one, and let go when they are not in the cut.
    NpNc,
    /// Partitions, no caching: nodes are read partition by partition, and let go when they are not in the cut.
    PNc,
    /// Partitions, conservative caching: nodes are let go when no node of their partition is in the cut.
    PCc,
    /// Partitions, caching by layers, as above.
    #[default]
    PC,
    /// Partitions, caching by status, not in the paper: while the cut is in the partition, its folded nodes are kept if it
    /// has ever come down there, and its active ones if it has ever come up. Fewer reads than by layers.
    PStatus,
}

impl CacheMode {
    /// All of them, those of the paper first and in its order.
    pub const ALL: [Self; 5] = [Self::NpNc, Self::PNc, Self::PCc, Self::PC, Self::PStatus];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NpNc => "np-nc",
            Self::PNc => "p-nc",
            Self::PCc => "p-cc",
            Self::PC => "p-c",
            Self::PStatus => "p-status",
        }
    }

    /// Whether whole partitions are read.
    #[must_use]
    pub fn reads_partitions(self) -> bool {
        self != Self::NpNc
    }
}

/// What is known of a partition.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PartitionState {
    /// Nodes in the cut.
    pub in_cut: u32,
    /// Nodes in memory.
    pub resident: u32,
    /// Whether something has changed since its nodes were last looked through.
    pub is_dirty: bool,
    /// Whether arcs have come into the cut from above, and from below, since the partition was loaded.
    pub came_down: bool,
    pub came_up: bool,
}

/// What the modes ask about a node that is not in the cut.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passed {
    pub layer: u32,
    pub is_active: bool,
}

impl PartitionState {
    /// No node of the partition is left in memory: what comes next starts anew.
    pub fn forget(&mut self) {
        (self.came_down, self.came_up) = (false, false);
    }

    /// Whether a node that is not in the cut is kept; `cut` are the least and the largest layer of those that are.
    pub fn keeps(&self, mode: CacheMode, cut: [u32; 2], node: Passed) -> bool {
        let by = |down: bool, up: bool| self.in_cut > 0 && (self.came_down && down || self.came_up && up);
        match mode {
            CacheMode::NpNc | CacheMode::PNc => false,
            CacheMode::PCc => self.in_cut > 0,
            CacheMode::PC => by(node.layer > cut[0], node.layer < cut[1]),
            CacheMode::PStatus => by(!node.is_active, node.is_active),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(partition: &PartitionState, mode: CacheMode, cut: [u32; 2]) -> Vec<u32> {
        // Active nodes lie above the middle of the cut.
        let node = |layer| Passed { layer, is_active: 2 * layer < cut[0] + cut[1] };
        (3..8).filter(|&layer| partition.keeps(mode, cut, node(layer))).collect()
    }

    /// The paper's figure 3: a partition of layers 3 to 7 is loaded when the cut comes down to layers 3 and 4; then the cut
    /// moves on to layers 5 and 6.
    #[test]
    fn the_cut_comes_down() {
        let mut partition = PartitionState { in_cut: 2, resident: 5, ..PartitionState::default() };
        assert_eq!(kept(&partition, CacheMode::PC, [3, 4]), [0; 0], "nothing is known yet");
        partition.came_down = true;
        assert_eq!(kept(&partition, CacheMode::PC, [3, 4]), [4, 5, 6, 7]);
        assert_eq!(kept(&partition, CacheMode::PC, [5, 6]), [6, 7]);
        assert_eq!(kept(&partition, CacheMode::PStatus, [5, 6]), [6, 7]);
        assert_eq!(kept(&partition, CacheMode::PCc, [5, 6]), [3, 4, 5, 6, 7]);
        partition.in_cut = 0;
        for mode in CacheMode::ALL {
            assert_eq!(kept(&partition, mode, [5, 6]), [0; 0], "the cut has gone elsewhere");
        }
    }

    #[test]
    fn the_cut_comes_up() {
        let partition = PartitionState { in_cut: 1, resident: 5, came_up: true, ..PartitionState::default() };
        let kept = |mode| kept(&partition, mode, [5, 6]);
        assert_eq!(kept(CacheMode::PC), [3, 4, 5], "a maximum, not a minimum, and what is above it");
        assert_eq!(kept(CacheMode::PStatus), [3, 4, 5]);
        assert_eq!(kept(CacheMode::PNc), [0; 0]);
    }
}
