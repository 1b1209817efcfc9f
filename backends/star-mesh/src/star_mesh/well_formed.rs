//! Whether a mesh is what it should be.

use vertex_tree::NONE;

use super::StarMesh;

impl StarMesh {
    /// Checks that every displayed triangle has three corners, each shown at the vertex that stands for its leaf and in the
    /// star of that vertex, and no star has another; that triangles are listed where they go with a vertex, once; and that
    /// counts and the slots to use again agree. It takes time with what is displayed: for tests, after a frame.
    ///
    /// # Panics
    /// At the first thing that is wrong.
    #[track_caller]
    pub fn assert_well_formed(&self) {
        assert_eq!(self.changes.len(), 0, "changes that the mesh has not followed");
        assert_eq!(self.misfit, None, "a change that did not fit");
        self.stars.assert_well_formed();
        let mut shown = 0;
        for (vertex, leaf) in self.stars.leaves() {
            assert_eq!(self.vertex_of_leaf.get(leaf), vertex, "leaf {leaf} is shown at vertex {vertex}");
            assert_eq!(self.shown.at_or_below(leaf), Some(leaf), "leaf {leaf} is shown at vertex {vertex}");
            shown += 1;
        }
        assert_eq!(self.vertex_of_leaf.len(), shown, "leaves that are shown at a vertex");
        assert_eq!(self.shown.count(), shown, "leaves that are shown");
        self.assert_triangles();
        self.assert_holes();
    }

    #[track_caller]
    fn assert_triangles(&self) {
        let (mut displayed, mut owned, mut seen) = (0, 0, vec![[false; 3]; self.triangles.len()]);
        for (slot, triangle) in (0..).zip(&self.triangles).filter(|(_, triangle)| triangle.number != NONE) {
            displayed += 1;
            let [a, b, c] = triangle.vertices;
            assert!(a != b && b != c && c != a, "triangle {slot} has corners {:?}", triangle.vertices);
            for (vertex, leaf) in triangle.vertices.into_iter().zip(triangle.leaves) {
                assert_eq!(self.vertex_at(leaf), vertex, "triangle {slot}: where leaf {leaf} is shown");
            }
            if triangle.owner != NONE {
                owned += 1;
                let brought = self.stars.brought(triangle.owner).iter();
                let times = brought.filter(|&&brought| brought == slot).count();
                assert_eq!(times, 1, "triangle {slot} goes with vertex {}", triangle.owner);
            }
        }
        let (mut corners, mut brought) = (0, 0);
        for (vertex, _) in self.stars.leaves() {
            for corner in self.stars.corners(vertex) {
                let (slot, index) = (corner.triangle() as usize, corner.index());
                let there = self.triangles.get(slot).and_then(|triangle| triangle.vertices.get(index));
                assert_eq!(there, Some(&vertex), "corner {index} of triangle {slot}");
                let twice = std::mem::replace(&mut seen[slot][index], true);
                assert!(!twice, "corner {index} of triangle {slot} is in a star twice");
                corners += 1;
            }
            brought += self.stars.brought(vertex).len();
        }
        assert_eq!(displayed, self.displayed, "triangles displayed");
        assert_eq!(corners, 3 * displayed, "corners in all stars");
        assert_eq!(brought, owned, "triangles that go with a vertex");
    }

    #[track_caller]
    fn assert_holes(&self) {
        let mut listed = vec![false; self.triangles.len()];
        // Those beyond the last slot have been given up.
        for &hole in self.holes.iter().filter(|&&hole| (hole as usize) < self.triangles.len()) {
            let twice = std::mem::replace(&mut listed[hole as usize], true);
            assert!(!twice, "hole {hole} is listed twice");
        }
        for (slot, (triangle, listed)) in self.triangles.iter().zip(listed).enumerate() {
            assert_eq!(triangle.number == NONE, listed, "slot {slot} is listed as a hole if it is one");
        }
    }
}
