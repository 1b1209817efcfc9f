//! What a simplification says of itself.

use std::time::Duration;

use container::Georeference;

use super::remains::Remains;

/// A round of independent collapses, which is a pass where the mesh is larger than memory.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Round {
    /// The largest key that was taken up.
    pub limit: f32,
    /// Collapses made, and the keys of the first and of the last of them.
    pub collapses: usize,
    /// See [`collapses`](Self::collapses).
    pub keys: [f32; 2],
}

impl Round {
    /// Puts a collapse behind the others.
    pub(super) fn push(&mut self, key: f32) {
        if self.collapses == 0 {
            self.keys[0] = key;
        }
        self.keys[1] = key;
        self.collapses += 1;
    }
}

/// What a simplification did.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// Triangles of the input.
    pub triangles: usize,
    /// Collapses made.
    pub collapses: usize,
    /// Rounds of independent collapses, in order.
    pub rounds: Vec<Round>,
    /// Collapses that depend on another of their round: those at vertices with very many triangles, of which a round may take
    /// away more than one.
    pub followers: usize,
    /// Rounds in all, with those in which candidates were found illegal or dearer than they seemed, and none was collapsed.
    pub attempted_rounds: usize,
    /// Roots of the forest.
    pub roots: usize,
    /// Depth of the forest.
    pub tree_depth: u32,
    /// Length of the longest chain of nodes each of which must be folded before the next.
    pub dependency_depth: u32,
    /// Triangles of the base mesh.
    pub base_triangles: usize,
    /// Why these are not simplified further.
    pub remains: Remains,
    /// The largest error of a node, in object units.
    pub largest_eps: f32,
    /// Collapses whose key was less than that of an earlier one.
    pub inversions: usize,
    /// Parts of the mesh that have been loaded, one after the other, and the vertices in them; 0 if the mesh was in memory
    /// from the beginning.
    pub windows: u64,
    /// See [`windows`](Self::windows).
    pub loaded: u64,
    /// Where the mesh lies in the world.
    pub georeference: Georeference,
    /// Time to prepare: renumbering, quadrics.
    pub preparation: Duration,
    /// Time of the rounds.
    pub simplification: Duration,
    /// Time to make the log and to check it.
    pub conclusion: Duration,
}
