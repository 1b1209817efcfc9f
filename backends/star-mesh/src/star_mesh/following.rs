//! How the mesh follows changes of status: all those of a frame together.
//!
//! A change reads some thirty cache lines in a chain four references long, few of which are near. One after the other, with
//! the engine's own work between, each would wait for each. Here a change passes through steps, eight changes at a time,
//! each step starting to read what the one before has pointed at, so that the misses of thirty-two overlap; and the code is
//! a loop of its own that stays in the nearest cache.
//!
//! What a step finds out may no longer be true when the change's turn comes, as those before it have been made meanwhile.
//! So that is checked, or only used to start reading.

use vertex_tree::{MeshSink, NONE, prefetch};

use super::StarMesh;
use super::change::Change;
use crate::leaf_triangle::LeafTriangle;

/// Changes that take a step together.
const TOGETHER: usize = 8;

/// Steps before a change is made.
const STEPS: usize = 4;

/// Changes that wait at most: a first frame may make millions, and what waits should stay in a near cache.
const MOST: usize = 1024;

impl StarMesh {
    /// A node has been unfolded: of two `leaves`, the vertex of the second comes back, at `position` in object space, beside that
    /// of the first, and with it the triangles `brought`. The mesh follows at the next [`update`](Self::update), or when many
    /// changes wait.
    #[inline]
    pub fn split<M: MeshSink>(
        &mut self,
        leaves: [u32; 2],
        position: [f32; 3],
        brought: impl IntoIterator<Item = LeafTriangle>,
        mesh: &mut M,
    ) {
        let start = self.coming.len() as u32;
        self.coming.extend(brought);
        let brought = [start, self.coming.len() as u32];
        self.note(Change::new(leaves, Some(position), brought), mesh);
    }

    /// A node has been folded: the inverse of [`split`](Self::split).
    #[inline]
    pub fn merge<M: MeshSink>(&mut self, leaves: [u32; 2], mesh: &mut M) {
        self.note(Change::new(leaves, None, [0; 2]), mesh);
    }

    #[inline(always)]
    fn note<M: MeshSink>(&mut self, change: Change, mesh: &mut M) {
        self.changes.push(change);
        if self.changes.len() == MOST {
            self.update(mesh);
        }
    }

    /// Follows the changes since the last call, in their order, and reports what they change.
    pub fn update<M: MeshSink>(&mut self, mesh: &mut M) {
        if self.changes.is_empty() {
            return;
        }
        let mut changes = std::mem::take(&mut self.changes);
        let coming = std::mem::take(&mut self.coming);
        let count = changes.len();
        for start in (0..count + STEPS * TOGETHER).step_by(TOGETHER) {
            // Those that take a step while those of step 0 start at `start`.
            let of_step = |step: usize| {
                let end = (start + TOGETHER).saturating_sub(step * TOGETHER).min(count);
                start.saturating_sub(step * TOGETHER).min(count)..end
            };
            for change in &changes[of_step(0)] {
                change.leaves.iter().for_each(|&leaf| self.vertex_of_leaf.prefetch(leaf));
                self.shown.prefetch(change.leaves[1]);
            }
            for change in &mut changes[of_step(1)] {
                change.vertices = change.leaves.map(|leaf| self.vertex_of_leaf.get(leaf));
                change.vertices.iter().for_each(|&vertex| self.stars.prefetch(vertex));
                for triangle in change.brought(&coming) {
                    self.shown.prefetch(triangle.far_leaf());
                }
            }
            for change in &mut changes[of_step(2)] {
                let splits = change.position.is_some();
                let star = change.vertices[usize::from(!splits)];
                for corner in self.stars.first(star) {
                    prefetch(&self.triangles, corner.triangle() as usize);
                    mesh.prefetch(corner.triangle());
                }
                let brought = change.brought(&coming);
                for (far, triangle) in change.far.iter_mut().zip(brought) {
                    *far = self.shown.at_or_below(triangle.far_leaf()).unwrap_or(NONE);
                    self.vertex_of_leaf.prefetch(*far);
                }
            }
            for change in &changes[of_step(3)] {
                if change.position.is_some() {
                    for far in change.far {
                        self.stars.prefetch(self.vertex_of_leaf.get(far));
                    }
                } else {
                    for &triangle in self.stars.brought(change.vertices[1]) {
                        let vertices = self.triangles[triangle as usize].vertices;
                        vertices.into_iter().for_each(|vertex| self.stars.prefetch(vertex));
                    }
                }
            }
            for change in &changes[of_step(STEPS)] {
                self.make(change, change.brought(&coming), mesh);
            }
        }
        (self.changes, self.coming) = (changes, coming);
        self.changes.clear();
        self.coming.clear();
    }

    #[inline(always)]
    fn make<M: MeshSink>(&mut self, change: &Change, brought: &[LeafTriangle], mesh: &mut M) {
        let &Change { leaves, position, vertices, .. } = change;
        // A vertex may have come since, or gone and come back in another slot.
        let vertex = |side: usize| match vertices[side] {
            vertex if self.stars.shows(vertex, leaves[side]) => vertex,
            _ => self.vertex_of_leaf.get(leaves[side]),
        };
        let kept = vertex(0);
        match position {
            Some(position) if kept != NONE => self.split_vertex(kept, leaves[1], position, brought, mesh),
            None if kept != NONE => self.merge_vertex(kept, vertex(1), leaves[1], mesh),
            _ => self.note_misfit(leaves[1]),
        }
    }
}
