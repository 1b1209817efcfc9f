//! Edges that are not in the mesh, between near vertices of different components.
//!
//! Garland & Heckbert (1997) contract such pairs too, to join what the input left separate: a city of thousands of
//! blocks would else end in thousands of roots. Pairs are sought in a uniform grid, again and again as vertices grow
//! fewer and farther apart, with cells that grow with them.

use std::cmp::Ordering;

use glam::Vec3;
use vertex_tree::NONE;

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

    /// Adds pairs among `vertices` that are at most as far apart as neighbouring cells of size `cell` allow. `component` says
    /// of all vertices which one they are in.
    pub fn search(&mut self, positions: &[Vec3], component: &[u32], vertices: &[u32], cell: f32) {
        let position = |v: u32| positions[v as usize];
        let grid = Grid::new(positions, vertices, cell);
        for &v in vertices {
            let mut nearest: Vec<Partner> = Vec::with_capacity(PARTNERS + 1);
            grid.for_each_near(position(v), v, |w| {
                if component[w as usize] == component[v as usize] {
                    return;
                }
                let partner = Partner {
                    distance: position(v).distance_squared(position(w)),
                    apart: w.abs_diff(v),
                    vertex: w,
                };
                if nearest.len() == PARTNERS && !partner.is_nearer(&nearest[PARTNERS - 1]) {
                    return;
                }
                // One partner for each component: the nearest.
                let same = |n: &&mut Partner| component[n.vertex as usize] == component[w as usize];
                match nearest.iter_mut().find(same) {
                    Some(other) if partner.is_nearer(other) => *other = partner,
                    Some(_) => {}
                    None => nearest.push(partner),
                }
                nearest.sort_unstable_by(Partner::order);
                nearest.truncate(PARTNERS);
            });
            self.pairs.extend(nearest.into_iter().map(|n| [v, n.vertex]));
        }
        self.index(positions.len());
    }
}

/// A vertex that may be paired with another.
struct Partner {
    /// Squared.
    distance: f32,
    /// The difference of their numbers. Of thousands at one place, all would else be paired with the first, and only one of
    /// them could merge with it in a round.
    apart: u32,
    vertex: u32,
}

impl Partner {
    fn order(&self, other: &Self) -> Ordering {
        let by_distance = self.distance.total_cmp(&other.distance);
        by_distance.then(self.apart.cmp(&other.apart)).then(self.vertex.cmp(&other.vertex))
    }

    fn is_nearer(&self, other: &Self) -> bool {
        self.order(other) == Ordering::Less
    }
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

    /// Visits vertices in the cell of `v`, which is at `p`, and in the cells around it: of crowded ones not all.
    fn for_each_near(&self, p: Vec3, v: u32, mut visit: impl FnMut(u32)) {
        const MOST: usize = 3 * MOST_IN_CELL;
        let own = self.cell_of(p);
        let [x, y, z] = own;
        for x in x - 1..=x + 1 {
            for y in y - 1..=y + 1 {
                // Three cells in a row of the sorted list.
                let (first, end) = ([x, y, z - 1], [x, y, z + 1]);
                let mut from = self.entries.partition_point(|entry| entry.0 < first);
                if [x, y] == own[..2] && self.entries.get(from + MOST).is_some_and(|entry| entry.0 <= end) {
                    // Those whose numbers are close to that of `v`.
                    let place = self.entries.partition_point(|&entry| entry < (own, v));
                    from = from.max(place.saturating_sub(MOST / 2));
                }
                let near = self.entries[from..].iter().take_while(|entry| entry.0 <= end);
                near.take(MOST).for_each(|entry| visit(entry.1));
            }
        }
    }
}
