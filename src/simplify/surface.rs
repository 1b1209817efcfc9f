//! The mesh while it is being simplified: the triangles that are left and the stars of the vertices.

use glam::Vec3;
use vertex_tree::NONE;

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

impl Triangle {
    pub fn is_alive(&self) -> bool {
        self.corners[0] != NONE
    }
}

/// Triangles, and for each vertex those around it. The stars are brought up to date between rounds: during a round
/// they still name triangles that have vanished, and lack those that a vertex has gained.
#[derive(Debug, Default)]
pub(super) struct Surface {
    pub positions: Vec<Vec3>,
    pub triangles: Vec<Triangle>,
    /// The vertices that are left, ascending.
    pub live: Vec<u32>,
    pub removed: Vec<bool>,
    star_start: Vec<u32>,
    star_length: Vec<u32>,
    incident: Vec<u32>,
}

/// A triangle seen from one of its corners: the other two corners in its orientation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spoke {
    pub triangle: u32,
    pub next: u32,
    pub last: u32,
}

impl Surface {
    /// `triangles` must have three different corners each.
    pub fn new(positions: Vec<Vec3>, corners: &[[u32; 3]]) -> Surface {
        let count = positions.len();
        let triangles: Vec<Triangle> =
            corners.iter().map(|&corners| Triangle { corners, creator: NONE, samples: NONE }).collect();
        let mut surface = Surface {
            positions,
            triangles,
            live: (0..count as u32).collect(),
            removed: vec![false; count],
            star_start: vec![0; count],
            star_length: vec![0; count],
            incident: Vec::new(),
        };
        surface.rebuild_stars();
        surface
    }

    /// Drops what has vanished and finds the stars anew, by counting.
    pub fn rebuild_stars(&mut self) {
        self.triangles.retain(Triangle::is_alive);
        let removed = &self.removed;
        self.live.retain(|&v| !removed[v as usize]);
        for &v in &self.live {
            self.star_length[v as usize] = 0;
        }
        for t in &self.triangles {
            for v in t.corners {
                self.star_length[v as usize] += 1;
            }
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
    }

    /// The triangles around `v` when the stars were last rebuilt.
    pub fn star(&self, v: u32) -> &[u32] {
        let start = self.star_start[v as usize] as usize;
        &self.incident[start..start + self.star_length[v as usize] as usize]
    }

    /// Those of them that are still there and still around `v`.
    pub fn spokes(&self, v: u32) -> impl Iterator<Item = Spoke> + '_ {
        self.star(v).iter().filter_map(move |&triangle| {
            let [a, b, c] = self.triangles[triangle as usize].corners;
            // A vanished triangle has no vertices, whatever its other two corners say.
            if a == v {
                Some(Spoke { triangle, next: b, last: c })
            } else if a == NONE {
                None
            } else if b == v {
                Some(Spoke { triangle, next: c, last: a })
            } else if c == v {
                Some(Spoke { triangle, next: a, last: b })
            } else {
                None
            }
        })
    }

    /// Whether the triangles around `v` close up: each neighbour comes next in one of them and last in another. A
    /// vertex of a few dozen triangles or more is not looked at, and the answer is no.
    pub fn is_surrounded(&self, v: u32) -> bool {
        const MOST: usize = 24;
        let (mut next, mut last) = ([0; MOST], [0; MOST]);
        let count = self.star(v).len();
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

    /// Finds the neighbours of `v`, and the number of triangles at the edge to each.
    pub fn neighbours(&self, v: u32, marks: &mut Marks, neighbours: &mut Vec<(u32, u32)>) {
        neighbours.clear();
        marks.clear();
        for spoke in self.spokes(v) {
            for w in [spoke.next, spoke.last] {
                match marks.get(w) {
                    Some(i) => neighbours[i as usize].1 += 1,
                    None => {
                        marks.set(w, neighbours.len() as u32);
                        neighbours.push((w, 1));
                    }
                }
            }
        }
    }

    pub fn position(&self, v: u32) -> Vec3 {
        self.positions[v as usize]
    }

    /// Normal of the triangle `a b c`, as long as twice its area.
    pub fn normal(&self, a: u32, b: u32, c: u32) -> Vec3 {
        let a = self.position(a);
        (self.position(b) - a).cross(self.position(c) - a)
    }
}

/// A number for each vertex that is forgotten all at once.
#[derive(Debug)]
pub(super) struct Marks {
    /// The generation in which the mark was set, and its value.
    entries: Vec<(u32, u32)>,
    generation: u32,
}

impl Marks {
    pub fn new(count: usize) -> Marks {
        Marks { entries: vec![(0, 0); count], generation: 0 }
    }

    pub fn clear(&mut self) {
        if self.generation == u32::MAX {
            self.entries.fill((0, 0));
            self.generation = 0;
        }
        self.generation += 1;
    }

    pub fn get(&self, v: u32) -> Option<u32> {
        let (generation, value) = self.entries[v as usize];
        (generation == self.generation).then_some(value)
    }

    pub fn set(&mut self, v: u32, value: u32) {
        self.entries[v as usize] = (self.generation, value);
    }
}
