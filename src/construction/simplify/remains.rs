//! Why what is left at the end can not be simplified further.

use vertex_tree::NONE;

use super::legality::{Obstacle, obstacle};
use super::marks::Marks;
use super::surface::{Spoke, Surface};

/// What holds the base mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Remains {
    /// Components of the base mesh, each of which keeps some triangles; 0 where nobody has counted, as it does not fit in
    /// memory.
    pub components: usize,
    /// Vertices that no edge leads away from without a change of topology.
    pub held_by_topology: usize,
    /// Others that can not go without turning a triangle over.
    pub held_by_orientation: usize,
}

impl Remains {
    /// Looks at the vertices `live[range]`.
    pub(super) fn look_at(&mut self, range: std::ops::Range<usize>, surface: &Surface, marks: &mut Marks) {
        let (mut neighbours, mut star) = (Vec::new(), Vec::<Spoke>::new());
        for &v in &surface.live[range] {
            star.clear();
            star.extend(surface.spokes(v));
            if star.is_empty() {
                continue;
            }
            surface.neighbours(v, marks, &mut neighbours);
            let is_bound = neighbours.iter().any(|n| n.triangles != 2);
            let mut edges = neighbours.iter().filter(|n| !is_bound || n.triangles != 2);
            // Of a hub not all edges are tried.
            let turned = edges
                .by_ref()
                .take(MOST_EDGES)
                .any(|n| obstacle(v, n.vertex, &star, true, surface, marks) == Some(Obstacle::Orientation));
            self.held_by_orientation += usize::from(turned);
            self.held_by_topology += usize::from(!turned);
        }
    }

    /// Counts the components of all that is left.
    pub(super) fn count_components(&mut self, surface: &Surface) {
        let leader = surface.components();
        let there = surface.triangles.iter().filter(|t| t.corners[0] != NONE);
        let mut leaders: Vec<u32> = there.map(|t| leader[t.corners[0] as usize]).collect();
        leaders.sort_unstable();
        leaders.dedup();
        self.components = leaders.len();
    }
}

/// Edges of a vertex that are tried.
const MOST_EDGES: usize = 64;
