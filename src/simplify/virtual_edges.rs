//! Edges that are not in the mesh, between near vertices of different components.
//!
//! Garland & Heckbert (1997) contract such pairs too, to join what the input left separate: a city of thousands of
//! blocks would else end in thousands of roots. Pairs are sought in a uniform grid, again and again as vertices grow
//! fewer and farther apart, with cells that grow with them.

use glam::Vec3;
use vertex_tree::NONE;

use super::surface::Surface;

/// Each vertex is paired with the nearest vertices of this many other components, as far as they are in its own or a
/// neighbouring cell.
const PARTNERS: usize = 3;
/// Of a crowded cell no more vertices are looked at.
const MOST_IN_CELL: usize = 256;

/// The pairs, and for each vertex its partners.
#[derive(Debug, Default)]
pub(super) struct VirtualEdges {
    /// Lower vertex first, ascending, none twice.
    pairs: Vec<[u32; 2]>,
    /// Every pair both ways, by the first vertex.
    both_ways: Vec<[u32; 2]>,
    /// Where the partners of a vertex start in `both_ways`; empty while there are no pairs.
    start: Vec<u32>,
}

impl VirtualEdges {
    /// The partners of `v`.
    pub fn partners(&self, v: u32) -> impl Iterator<Item = u32> + '_ {
        let range = match self.start.get(v as usize..=v as usize + 1) {
            Some(&[start, end]) => start as usize..end as usize,
            _ => 0..0,
        };
        self.both_ways[range].iter().map(|pair| pair[1])
    }

    /// Follows vertices that have merged to where they are now.
    pub fn follow(&mut self, merged_into: &[u32]) {
        if self.pairs.is_empty() {
            return;
        }
        for v in self.pairs.as_flattened_mut() {
            while merged_into[*v as usize] != NONE {
                *v = merged_into[*v as usize];
            }
        }
        self.index(merged_into.len());
    }

    fn index(&mut self, vertices: usize) {
        self.pairs.retain_mut(|pair| {
            pair.sort_unstable();
            pair[0] != pair[1]
        });
        self.pairs.sort_unstable();
        self.pairs.dedup();
        self.both_ways.clear();
        self.both_ways.extend(self.pairs.iter().flat_map(|&[v, w]| [[v, w], [w, v]]));
        self.both_ways.sort_unstable();
        self.start.clear();
        self.start.resize(vertices + 1, 0);
        for pair in &self.both_ways {
            self.start[pair[0] as usize + 1] += 1;
        }
        for v in 0..vertices {
            self.start[v + 1] += self.start[v];
        }
    }

    /// Adds pairs among `vertices` that are at most as far apart as neighbouring cells of size `cell` allow.
    pub fn search(&mut self, surface: &Surface, vertices: &[u32], cell: f32) {
        let component = components(surface);
        let grid = Grid::new(&surface.positions, vertices, cell);
        for &v in vertices {
            let mut nearest: Vec<(f32, u32)> = Vec::with_capacity(PARTNERS + 1);
            grid.for_each_near(surface.position(v), |w| {
                if component[w as usize] == component[v as usize] {
                    return;
                }
                let distance = surface.position(v).distance_squared(surface.position(w));
                if nearest.len() == PARTNERS && nearest[PARTNERS - 1] <= (distance, w) {
                    return;
                }
                // One partner for each component: the nearest.
                if let Some(other) =
                    nearest.iter_mut().find(|n| component[n.1 as usize] == component[w as usize])
                {
                    if (distance, w) < *other {
                        *other = (distance, w);
                    }
                } else {
                    nearest.push((distance, w));
                }
                nearest.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                nearest.truncate(PARTNERS);
            });
            self.pairs.extend(nearest.into_iter().map(|(_, w)| [v, w]));
        }
        self.index(surface.positions.len());
    }
}

/// For each vertex, a vertex that stands for the component in which triangles join it with others.
fn components(surface: &Surface) -> Vec<u32> {
    let mut leader: Vec<u32> = (0..surface.positions.len() as u32).collect();
    fn find(leader: &mut [u32], mut v: u32) -> u32 {
        while leader[v as usize] != v {
            // Path halving keeps the chains short.
            leader[v as usize] = leader[leader[v as usize] as usize];
            v = leader[v as usize];
        }
        v
    }
    for t in &surface.triangles {
        let a = find(&mut leader, t.corners[0]);
        for corner in &t.corners[1..] {
            let b = find(&mut leader, *corner);
            leader[b as usize] = a;
        }
    }
    (0..leader.len() as u32).map(|v| find(&mut leader, v)).collect()
}

/// Vertices sorted by the cell of a uniform grid in which they lie.
struct Grid {
    low: Vec3,
    cell: f32,
    /// Cell and vertex, ascending.
    entries: Vec<([u32; 3], u32)>,
}

impl Grid {
    fn new(positions: &[Vec3], vertices: &[u32], cell: f32) -> Grid {
        let low = vertices.iter().fold(Vec3::INFINITY, |low, &v| low.min(positions[v as usize]));
        let mut grid = Grid { low, cell, entries: Vec::new() };
        let mut entries: Vec<_> =
            vertices.iter().map(|&v| (grid.cell_of(positions[v as usize]), v)).collect();
        entries.sort_unstable();
        grid.entries = entries;
        grid
    }

    /// Cells are numbered from 1, so that each has a lower neighbour.
    fn cell_of(&self, p: Vec3) -> [u32; 3] {
        ((p - self.low) / self.cell).to_array().map(|x| (x.min(1e9) as u32) + 1)
    }

    fn for_each_near(&self, p: Vec3, mut visit: impl FnMut(u32)) {
        let [x, y, z] = self.cell_of(p);
        for x in x - 1..=x + 1 {
            for y in y - 1..=y + 1 {
                // Three cells in a row of the sorted list.
                let (first, end) = ([x, y, z - 1], [x, y, z + 1]);
                let from = self.entries.partition_point(|entry| entry.0 < first);
                let near = self.entries[from..].iter().take_while(|entry| entry.0 <= end);
                near.take(3 * MOST_IN_CELL).for_each(|entry| visit(entry.1));
            }
        }
    }
}
