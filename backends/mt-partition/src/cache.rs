//! Which nodes stay in memory: the four modes of the paper's section 5, and the layers of section 4.3.
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
//! its text and its figure 3 say what is written here. It also sets the frames of the tuples to the current one wherever
//! an arc stays in the cut. In other words `f_min = f` and `f_max = f` wherever the partition has any node in the cut, and
//! the tuple has ever been set: so a count of nodes in the cut takes the place of a walk through the cut in every frame,
//! and the frame is kept for the minimum and the maximum alone: those of the last frame that brought arcs.

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
}

impl CacheMode {
    /// All of them, in the order of the paper.
    pub const ALL: [Self; 4] = [Self::NpNc, Self::PNc, Self::PCc, Self::PC];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::NpNc => "np-nc",
            Self::PNc => "p-nc",
            Self::PCc => "p-cc",
            Self::PC => "p-c",
        }
    }

    /// Whether whole partitions are read.
    #[must_use]
    pub fn reads_partitions(self) -> bool {
        self != Self::NpNc
    }
}

/// The layer of one of the two tuples, and the frame in which it was found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Tuple {
    /// 0 where the tuple has not been set.
    frame: u64,
    layer: u32,
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
    min: Tuple,
    max: Tuple,
}

impl PartitionState {
    /// A node of layer `layer` has an arc that came into the cut from above.
    pub fn came_down(&mut self, frame: u64, layer: u32) {
        let least = if self.min.frame == frame { self.min.layer.min(layer) } else { layer };
        self.min = Tuple { frame, layer: least };
    }

    /// A node of layer `layer` has an arc that came into the cut from below.
    pub fn came_up(&mut self, frame: u64, layer: u32) {
        let largest = if self.max.frame == frame { self.max.layer.max(layer) } else { layer };
        self.max = Tuple { frame, layer: largest };
    }

    /// No node of the partition is left in memory: what comes next starts anew.
    pub fn forget(&mut self) {
        (self.min, self.max) = Default::default();
    }

    /// Whether a node that is not in the cut is kept.
    pub fn keeps(&self, mode: CacheMode, layer: u32) -> bool {
        let is_set = |tuple: Tuple| tuple.frame > 0;
        match mode {
            CacheMode::NpNc | CacheMode::PNc => false,
            CacheMode::PCc => self.in_cut > 0,
            CacheMode::PC => {
                self.in_cut > 0
                    && (is_set(self.min) && layer > self.min.layer
                        || is_set(self.max) && layer < self.max.layer)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The paper's figure 3: a partition of layers 3 to 7 is loaded when the cut comes down to layers 3 and 4; then the cut
    /// moves on to layers 5 and 6.
    #[test]
    fn the_cut_comes_down() {
        let mut partition = PartitionState { in_cut: 2, resident: 5, ..PartitionState::default() };
        let kept =
            |p: &PartitionState| (3..8).filter(|&layer| p.keeps(CacheMode::PC, layer)).collect::<Vec<u32>>();
        assert_eq!(kept(&partition), [0; 0], "nothing is known yet");
        partition.came_down(1, 4);
        partition.came_down(1, 3);
        assert_eq!(kept(&partition), [4, 5, 6, 7]);
        partition.came_down(2, 6);
        partition.came_down(2, 5);
        assert_eq!(kept(&partition), [6, 7]);
        partition.in_cut = 0;
        assert_eq!(kept(&partition), [0; 0], "the cut has gone elsewhere");
    }

    #[test]
    fn the_cut_comes_up() {
        let mut partition = PartitionState { in_cut: 1, ..PartitionState::default() };
        partition.came_up(4, 5);
        partition.came_up(4, 6);
        let kept = |mode| (3..8).filter(|&layer| partition.keeps(mode, layer)).collect::<Vec<u32>>();
        assert_eq!(kept(CacheMode::PC), [3, 4, 5], "a maximum, not a minimum, and what is above it");
        assert_eq!(kept(CacheMode::PCc), [3, 4, 5, 6, 7]);
        assert_eq!(kept(CacheMode::PNc), [0; 0]);
    }
}
