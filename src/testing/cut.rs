//! The displayed mesh of a cut, by brute force from the collapse log.
//!
//! Nothing here is incremental: every call replays the whole log. It is what the meshes of all backends are compared
//! with, and how a mesh at one error everywhere is had without a camera.

use collapse_log::{CollapseLog, Forest, Mesh};
use vertex_tree::NONE;

/// What a set of active nodes shows, in the numbering of the input mesh.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Displayed {
    /// For each input vertex, the input vertex at whose place it is shown.
    pub shown_at: Vec<u32>,
    /// The input triangles whose corners are shown at three different vertices, in ascending order.
    pub triangles: Vec<u32>,
}

impl Displayed {
    /// Replays the collapses that are folded: the collapses `n` with `!active[n]`, `active` closed upwards along
    /// the tree. The log must be one that [`CollapseLog::forest`] accepts, with a flag for each of its collapses.
    #[must_use]
    pub fn new(log: &CollapseLog, active: &[bool]) -> Self {
        assert_eq!(active.len(), log.collapses.len(), "one flag for each collapse");
        let mut shown_at: Vec<u32> = (0u32..).take(log.mesh.positions.len()).collect();
        // From the last collapse to the first: by then it is known where the kept vertex itself is shown, since
        // only a later collapse can have removed it.
        for (collapse, _) in log.collapses.iter().zip(active).rev().filter(|&(_, &active)| !active) {
            shown_at[collapse.removed as usize] = shown_at[collapse.kept as usize];
        }
        let triangles = (0u32..)
            .zip(&log.mesh.triangles)
            .filter(|(_, corners)| {
                let [a, b, c] = corners.map(|v| shown_at[v as usize]);
                a != b && b != c && c != a
            })
            .map(|(triangle, _)| triangle)
            .collect();
        Self { shown_at, triangles }
    }

    /// The displayed triangles over all vertices of the input mesh, used or not.
    #[must_use]
    pub fn mesh(&self, input: &Mesh) -> Mesh {
        Mesh {
            positions: input.positions.clone(),
            triangles: self.corners(input).collect(),
            georeference: input.georeference.clone(),
        }
    }

    /// The displayed triangles over the vertices that they use, numbered in the order of the input.
    #[must_use]
    pub fn compact_mesh(&self, input: &Mesh) -> Mesh {
        let mut number = vec![NONE; input.positions.len()];
        for v in self.corners(input).flatten() {
            number[v as usize] = 0;
        }
        let mut positions = Vec::new();
        for (number, position) in number.iter_mut().zip(&input.positions) {
            if *number != NONE {
                *number = positions.len() as u32;
                positions.push(*position);
            }
        }
        let triangles = self.corners(input).map(|corners| corners.map(|v| number[v as usize])).collect();
        Mesh { positions, triangles, georeference: input.georeference.clone() }
    }

    fn corners<'a>(&'a self, input: &'a Mesh) -> impl Iterator<Item = [u32; 3]> + 'a {
        self.triangles
            .iter()
            .map(|&triangle| input.triangles[triangle as usize].map(|v| self.shown_at[v as usize]))
    }
}

/// Activates all ancestors of active nodes.
pub fn close_upwards(forest: &Forest, active: &mut [bool]) {
    // Parents have larger numbers than their children: one pass carries a flag all the way up.
    for (n, &parent) in forest.parent.iter().enumerate() {
        if active[n] && parent != NONE {
            active[parent as usize] = true;
        }
    }
}

/// The cut that unfolds whatever has an error above `eps`, in object units, and the ancestors of that. The errors of
/// a log are nested in general, so that the ancestors add nothing.
#[must_use]
pub fn uniform_cut(log: &CollapseLog, forest: &Forest, eps: f32) -> Vec<bool> {
    let mut active: Vec<bool> = log.collapses.iter().map(|c| c.bounds.eps > eps).collect();
    close_upwards(forest, &mut active);
    active
}

#[cfg(test)]
mod tests {
    use super::*;
    use collapse_log::Collapse;
    use vertex_tree::Bounds;

    /// A strip of four triangles; the collapses are 1 into 0 (node 0), 5 into 4 (node 1), 0 into 3 (node 2).
    ///
    /// ```text
    ///   3 --- 4 --- 5              2
    ///   | 1 / | 3 / |             / \
    ///   |  /  |  /  |            0   3
    ///   | / 0 | / 2 |           / \       1
    ///   0 --- 1 --- 2          0   1     / \
    ///                                   4   5
    /// ```
    fn strip() -> CollapseLog {
        let positions = (0..6).map(|v| [(v % 3) as f32, (v / 3) as f32, 0.0]).collect();
        let triangles = vec![[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]];
        let collapses = [(1, 0, 0.1), (5, 4, 0.3), (0, 3, 0.2)]
            .map(|(removed, kept, eps)| Collapse {
                removed,
                kept,
                bounds: Bounds { center: [0.0; 3], radius: 3.0, eps },
            })
            .to_vec();
        CollapseLog { mesh: Mesh { positions, triangles, ..Mesh::default() }, collapses }
    }

    #[test]
    fn unfolded_wholly_the_input_is_shown() {
        let log = strip();
        let displayed = Displayed::new(&log, &[true; 3]);
        assert_eq!(displayed.shown_at, [0, 1, 2, 3, 4, 5]);
        assert_eq!(displayed.mesh(&log.mesh), log.mesh);
        assert_eq!(displayed.compact_mesh(&log.mesh), log.mesh);
    }

    /// Everything folded, 1 follows 0 to 3 and 5 sits at 4: of the four triangles, 2 alone is left.
    ///
    /// ```text
    ///   3 --- 4
    ///     \   |
    ///       \ |
    ///         2
    /// ```
    #[test]
    fn folded_wholly_a_vertex_follows_all_its_merges() {
        let log = strip();
        let displayed = Displayed::new(&log, &[false; 3]);
        assert_eq!(displayed.shown_at, [3, 3, 2, 3, 4, 4]);
        assert_eq!(displayed.triangles, [2]);
        assert_eq!(displayed.mesh(&log.mesh).triangles, [[3, 2, 4]]);
        let compact = displayed.compact_mesh(&log.mesh);
        assert_eq!(compact.positions, [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
        assert_eq!(compact.triangles, [[1, 0, 2]]);
    }

    #[test]
    fn a_folded_node_below_an_active_one_stops_at_its_own_vertex() {
        let displayed = Displayed::new(&strip(), &[false, false, true]);
        assert_eq!(displayed.shown_at, [0, 0, 2, 3, 4, 4]);
        assert_eq!(displayed.triangles, [1, 2]);
    }

    #[test]
    fn a_uniform_cut_holds_the_ancestors_of_what_it_needs() {
        let mut log = strip();
        let forest = log.forest().unwrap();
        assert_eq!(uniform_cut(&log, &forest, 0.25), [false, true, false]);
        assert_eq!(uniform_cut(&log, &forest, 0.15), [false, true, true]);
        assert_eq!(uniform_cut(&log, &forest, 0.3), [false; 3], "an error at the limit is within it");
        log.collapses[0].bounds.eps = 0.9;
        assert_eq!(uniform_cut(&log, &forest, 0.5), [true, false, true], "node 2 comes with its child");
    }
}
