//! The mesh while it is being simplified: the triangles that are left and the stars of the vertices.

use glam::{DVec3, Vec3};
use rustc_hash::FxHashMap;
use vertex_tree::NONE;

use super::marks::Marks;
use super::quadric::Quadric;
use super::virtual_edges::VirtualEdges;

/// A triangle that has not vanished yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    /// The vertices at which its corners now stand, all different; `NONE` at the first once it has vanished.
    pub corners: [u32; 3],
    /// The collapse that last moved a corner of it, or `NONE`.
    pub creator: u32,
    /// The first of the removed vertices that are sample points of it, or `NONE`.
    pub samples: u32,
}

/// A triangle seen from one of its corners: the other two in its orientation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spoke {
    pub triangle: u32,
    pub next: u32,
    pub last: u32,
}

/// A vertex that shares triangles with another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Neighbour {
    pub vertex: u32,
    /// Triangles at the edge between the two.
    pub triangles: u32,
    /// Of these, those in which it comes next to the other in their orientation.
    pub nexts: u32,
}

impl Neighbour {
    /// Whether the edge joins two triangles of the same orientation.
    pub fn is_regular(&self) -> bool {
        self.triangles == 2 && self.nexts == 1
    }
}

impl Spoke {
    /// Whether `v` is one of the other two corners.
    pub fn touches(&self, v: u32) -> bool {
        self.next == v || self.last == v
    }
}

/// A vertex with so many triangles is a hub.
const HUB: u32 = 64;

/// Vertices, triangles, and for each vertex the triangles around it. The stars are brought up to date between rounds:
/// during a round they still name triangles that have vanished, and lack those that a vertex has gained.
#[derive(Debug)]
pub(super) struct Surface {
    /// In object units.
    pub positions: Vec<Vec3>,
    /// Length of a unit of the simplification in object units: a power of two, about as long as most edges.
    pub unit: f64,
    /// Its reciprocal.
    pub per_unit: f32,
    pub quadrics: Vec<Quadric>,
    /// Whether the vertex touches an edge that does not join exactly two triangles of the same orientation. Of vertices near
    /// a recent change it may say so falsely.
    pub special: Vec<bool>,
    /// Whether a virtual edge has been collapsed at the vertex, or at one that merged into it.
    pub joined: Vec<bool>,
    /// The vertex that has taken the place of a removed one, or `NONE`.
    pub merged_into: Vec<u32>,
    pub triangles: Vec<Triangle>,
    /// The vertices that are left, ascending, without those that never had a triangle.
    pub live: Vec<u32>,
    /// Triangles that have not vanished.
    pub live_triangles: usize,
    pub virtual_edges: VirtualEdges,
    /// For each triangle, its number in the whole construction, where only some are here, in any order.
    pub triangle_ids: Option<Vec<u32>>,
    /// Whether the vertex has gained triangles in this round, which its star does not name yet.
    pub gained: Vec<bool>,
    /// Of hubs, how many of the triangles that their stars name have vanished.
    lost: FxHashMap<u32, u32>,
    star_start: Vec<u32>,
    star_length: Vec<u32>,
    incident: Vec<u32>,
}

impl Surface {
    /// `triangles` must have three different corners each.
    pub fn new(positions: Vec<Vec3>, triangles: &[[u32; 3]], unit: f64) -> Surface {
        let count = positions.len();
        let mut has_triangle = vec![false; count];
        for &v in triangles.iter().flatten() {
            has_triangle[v as usize] = true;
        }
        let triangle = |&corners| Triangle { corners, creator: NONE, samples: NONE };
        let mut surface = Surface {
            positions,
            unit,
            per_unit: (1.0 / unit) as f32,
            quadrics: vec![Quadric::default(); count],
            special: vec![false; count],
            joined: vec![false; count],
            merged_into: vec![NONE; count],
            triangles: triangles.iter().map(triangle).collect(),
            live: (0..count as u32).filter(|&v| has_triangle[v as usize]).collect(),
            live_triangles: triangles.len(),
            virtual_edges: VirtualEdges::default(),
            triangle_ids: None,
            gained: vec![false; count],
            lost: FxHashMap::default(),
            star_start: vec![0; count],
            star_length: vec![0; count],
            incident: Vec::new(),
        };
        surface.rebuild_stars();
        surface
    }

    /// A part of a larger mesh: its first `vertices` positions are vertices, the others sample points. `special` says
    /// for all of them whether they are. `ids` are the numbers of the triangles in the whole mesh, which has
    /// `live_triangles`.
    pub fn part(
        vertices: usize,
        positions: Vec<Vec3>,
        special: Vec<bool>,
        triangles: Vec<Triangle>,
        ids: Vec<u32>,
        live_triangles: usize,
        unit: f64,
    ) -> Surface {
        let mut surface = Surface {
            positions,
            unit,
            per_unit: (1.0 / unit) as f32,
            quadrics: vec![Quadric::default(); vertices],
            special,
            joined: vec![false; vertices],
            merged_into: vec![NONE; vertices],
            triangles,
            live: (0..vertices as u32).collect(),
            live_triangles,
            virtual_edges: VirtualEdges::default(),
            triangle_ids: Some(ids),
            gained: vec![false; vertices],
            lost: FxHashMap::default(),
            star_start: vec![0; vertices],
            star_length: vec![0; vertices],
            incident: Vec::new(),
        };
        surface.rebuild_stars();
        surface
    }

    /// Drops what has vanished and finds the stars anew, by counting.
    pub fn rebuild_stars(&mut self) {
        if let Some(ids) = &mut self.triangle_ids {
            let mut there = self.triangles.iter().map(|t| t.corners[0] != NONE);
            ids.retain(|_| there.next().unwrap_or(false));
        }
        self.triangles.retain(|t| t.corners[0] != NONE);
        self.live.retain(|&v| self.merged_into[v as usize] == NONE);
        for &v in &self.live {
            self.star_length[v as usize] = 0;
            self.gained[v as usize] = false;
        }
        for v in self.triangles.iter().flat_map(|t| t.corners) {
            self.star_length[v as usize] += 1;
        }
        let mut start = 0;
        for &v in &self.live {
            self.star_start[v as usize] = start;
            start += self.star_length[v as usize];
            self.star_length[v as usize] = 0;
        }
        self.incident.resize(start as usize, 0);
        for (t, triangle) in (0..).zip(&self.triangles) {
            for v in triangle.corners {
                let length = &mut self.star_length[v as usize];
                self.incident[(self.star_start[v as usize] + *length) as usize] = t;
                *length += 1;
            }
        }
        if let Some(ids) = &self.triangle_ids {
            for &v in &self.live {
                let start = self.star_start[v as usize] as usize;
                let star = &mut self.incident[start..start + self.star_length[v as usize] as usize];
                star.sort_unstable_by_key(|&t| ids[t as usize]);
            }
        }
        self.lost.clear();
        self.virtual_edges.follow(&self.merged_into);
    }

    /// Leaves those triangles of the star of `v` out of it that `is_hidden` names, until the stars are rebuilt.
    pub fn hide(&mut self, v: u32, is_hidden: impl Fn(&Triangle) -> bool) {
        let start = self.star_start[v as usize] as usize;
        let mut kept = 0;
        for i in 0..self.star_length[v as usize] as usize {
            let t = self.incident[start + i];
            if !is_hidden(&self.triangles[t as usize]) {
                self.incident[start + kept] = t;
                kept += 1;
            }
        }
        self.star_length[v as usize] = kept as u32;
    }

    /// The triangles that were around `v` when the stars were last rebuilt, and still are.
    pub fn spokes(&self, v: u32) -> impl Iterator<Item = Spoke> + '_ {
        let start = self.star_start[v as usize] as usize;
        let star = &self.incident[start..start + self.star_length[v as usize] as usize];
        star.iter().filter_map(move |&triangle| self.spoke(v, triangle))
    }

    /// A triangle as seen from `v`, if it is still there and around it.
    fn spoke(&self, v: u32, triangle: u32) -> Option<Spoke> {
        let corners = self.triangles[triangle as usize].corners;
        // At which corner `v` stands is as good as random: better looked up than branched upon.
        let corner = usize::from(corners[1] == v) + 2 * usize::from(corners[2] == v);
        let is_there = (corners[0] != NONE) & (corners[corner] == v);
        let (next, last) = (corners[(corner + 1) % 3], corners[(corner + 2) % 3]);
        is_there.then_some(Spoke { triangle, next, last })
    }

    /// Finds the neighbours of `v`.
    pub fn neighbours(&self, v: u32, marks: &mut Marks, neighbours: &mut Vec<Neighbour>) {
        neighbours.clear();
        marks.clear();
        for spoke in self.spokes(v) {
            for (vertex, nexts) in [(spoke.next, 1), (spoke.last, 0)] {
                match marks.get(vertex) {
                    Some(i) => {
                        let neighbour = &mut neighbours[i as usize];
                        neighbour.triangles += 1;
                        neighbour.nexts += nexts;
                    }
                    None => {
                        marks.set(vertex, neighbours.len() as u32);
                        neighbours.push(Neighbour { vertex, triangles: 1, nexts });
                    }
                }
            }
        }
    }

    /// Triangles that join two vertices: found in the smaller of the two stars, if it is known wholly.
    pub fn triangles_between(&self, a: u32, b: u32) -> impl Iterator<Item = Spoke> + '_ {
        let order = |v: u32| (self.gained[v as usize], self.star_length[v as usize]);
        let (from, to) = if order(a) <= order(b) { (a, b) } else { (b, a) };
        self.spokes(from).filter(move |s| s.touches(to))
    }

    /// Whether `v` has so many triangles, without those gained in this round, that no work may be done for each of them
    /// whenever one vanishes.
    pub fn is_hub(&self, v: u32) -> bool {
        self.star_length[v as usize] >= HUB && self.spokes(v).take(HUB as usize).count() == HUB as usize
    }

    /// Triangles that the star of `v` names, whether they are still there or not: how long it takes to go through it.
    pub fn star_length(&self, v: u32) -> usize {
        self.star_length[v as usize] as usize
    }

    /// Notes that a triangle around `v` has vanished. What hubs have lost is left out of their stars before it gets long, so
    /// that to pass over it costs no more than the square root of their number.
    pub fn lose(&mut self, v: u32) {
        let length = self.star_length[v as usize];
        if length >= HUB {
            let lost = self.lost.entry(v).or_insert(0);
            *lost += 1;
            if *lost >= HUB.max(length.isqrt()) {
                *lost = 0;
                self.hide(v, |t| !t.corners.contains(&v) || t.corners[0] == NONE);
            }
        }
    }

    /// Of the star of `v`, the triangles that come right before and behind a triangle in its order, as many on either side.
    /// Neighbours in this order are near each other: triangles are sorted in space.
    pub fn spokes_beside(&self, v: u32, triangle: u32, on_either_side: usize) -> Vec<Spoke> {
        let start = self.star_start[v as usize] as usize;
        let star = &self.incident[start..start + self.star_length[v as usize] as usize];
        let id = |t: u32| self.triangle_ids.as_ref().map_or(t, |ids| ids[t as usize]);
        let middle = star.partition_point(|&t| id(t) < id(triangle));
        let before = star[..middle].iter().rev().filter_map(|&t| self.spoke(v, t)).take(on_either_side);
        let behind = star[middle..].iter().filter(|&&t| t != triangle);
        let behind = behind.filter_map(|&t| self.spoke(v, t)).take(on_either_side);
        before.chain(behind).collect()
    }

    /// Whether the triangles around `v` close up: each neighbour comes next in one of them and last in another. A
    /// vertex of more than a few dozen triangles is not looked at, and the answer is no.
    pub fn is_surrounded(&self, v: u32) -> bool {
        const MOST: usize = 24;
        let (mut next, mut last) = ([0; MOST], [0; MOST]);
        let count = self.star_length[v as usize] as usize;
        if count > MOST {
            return false;
        }
        for (i, spoke) in self.spokes(v).enumerate() {
            (next[i], last[i]) = (spoke.next, spoke.last);
        }
        let occurrences = |list: &[u32], w: u32| list.iter().filter(|&&x| x == w).count();
        next[..count]
            .iter()
            .all(|&w| occurrences(&last[..count], w) == 1 && occurrences(&next[..count], w) == 1)
    }

    /// For each vertex, a vertex that stands for the component in which triangles join it with others.
    pub fn components(&self) -> Vec<u32> {
        fn find(leader: &mut [u32], mut v: u32) -> u32 {
            while leader[v as usize] != v {
                // Path halving keeps the chains short.
                leader[v as usize] = leader[leader[v as usize] as usize];
                v = leader[v as usize];
            }
            v
        }
        let mut leader: Vec<u32> = (0..self.positions.len() as u32).collect();
        for t in self.triangles.iter().filter(|t| t.corners[0] != NONE) {
            let a = find(&mut leader, t.corners[0]);
            for corner in &t.corners[1..] {
                let b = find(&mut leader, *corner);
                leader[b as usize] = a;
            }
        }
        (0..leader.len() as u32).map(|v| find(&mut leader, v)).collect()
    }

    pub fn position(&self, v: u32) -> Vec3 {
        self.positions[v as usize]
    }

    /// Normal of the triangle `a b c`, as long as twice its area. In double precision the differences of positions are exact
    /// unless one is 2^29 times the other.
    pub fn normal(&self, a: u32, b: u32, c: u32) -> DVec3 {
        let [a, b, c] = [a, b, c].map(|v| self.position(v).as_dvec3());
        (b - a).cross(c - a)
    }
}
