//! For every vertex, the cheapest edge along which it could be removed.
//!
//! The key of the half-edge collapse `v -> u` is the mean squared distance of `u` from the planes that `v` stands
//! for, plus a little of the squared length of the edge. The second term decides where the first is zero, on plane
//! ground and among doubled vertices: short edges first keeps triangles well-shaped and trees shallow.
//!
//! Cheap keys are kept from round to round, and found anew only where a star has changed. Whether a collapse is legal
//! costs more and is asked when its turn comes: most candidates are overtaken by a change nearby before that.

use glam::Vec3;
use vertex_tree::NONE;

use super::quadric::Quadric;
use super::surface::{Marks, Surface};

/// Part of the squared length of the edge that is added to the squared distance.
const LENGTH_TERM: f32 = 1e-4;

/// What is known of a vertex's candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// The star has changed: to be found anew.
    Outdated,
    /// The cheapest edge, legal or not.
    Cheapest,
    /// The cheapest edge that was legal when last asked.
    Legal,
    /// No legal edge when last asked.
    Nothing,
}

/// The candidate of each vertex.
#[derive(Debug)]
pub(super) struct Candidates {
    pub key: Vec<f32>,
    pub target: Vec<u32>,
    pub state: Vec<State>,
    /// Whether the vertex touches an edge that does not join exactly two triangles. Only removed vertices can rely on
    /// it: for others it may say so until their candidate is found anew.
    pub special: Vec<bool>,
    /// The neighbours of one vertex, and the number of triangles at the edge to each.
    neighbours: Vec<(u32, u32)>,
    /// Edges of one vertex and their keys.
    edges: Vec<(f32, u32)>,
}

impl Candidates {
    pub fn new(special: Vec<bool>) -> Candidates {
        let count = special.len();
        Candidates {
            key: vec![0.0; count],
            target: vec![NONE; count],
            state: vec![State::Outdated; count],
            special,
            neighbours: Vec::new(),
            edges: Vec::new(),
        }
    }

    /// Finds the edges along which `v` may be removed as far as `v`'s own star can say, with their keys.
    fn find_edges(&mut self, v: u32, surface: &Surface, quadrics: &[Quadric], marks: &mut Marks) {
        surface.neighbours(v, marks, &mut self.neighbours);
        // A vertex on a boundary, or on a seam where more than two triangles meet, stays on it.
        let special = self.neighbours.iter().any(|&(_, triangles)| triangles != 2);
        self.special[v as usize] = special;
        let position = surface.position(v);
        self.edges.clear();
        for &(u, triangles) in &self.neighbours {
            if !special || triangles != 2 {
                let d = surface.position(u) - position;
                self.edges.push((edge_key(&quadrics[v as usize], d), u));
            }
        }
    }

    /// Finds the cheapest edge of `v`.
    pub fn refresh(&mut self, v: u32, surface: &Surface, quadrics: &[Quadric], marks: &mut Marks) {
        if self.special[v as usize] {
            self.find_edges(v, surface, quadrics, marks);
            let cheapest = self.edges.iter().copied().min_by(order);
            self.set(v, cheapest, State::Cheapest);
            return;
        }
        // The triangles close up around `v`, so every neighbour comes next in one of them. Where orientations
        // disagree one may be missed here.
        let (position, quadric) = (surface.position(v), &quadrics[v as usize]);
        let (mut key, mut target) = (f32::INFINITY, NONE);
        for spoke in surface.spokes(v) {
            let candidate = edge_key(quadric, surface.position(spoke.next) - position);
            if candidate < key || (candidate == key && spoke.next < target) {
                (key, target) = (candidate, spoke.next);
            }
        }
        let candidate = (target != NONE).then_some((key, target));
        self.set(v, candidate, State::Cheapest);
    }

    /// Finds the cheapest edge of `v` that is legal.
    pub fn refresh_legal(
        &mut self,
        v: u32,
        surface: &Surface,
        quadrics: &[Quadric],
        marks: &mut Marks,
        mut is_legal: impl FnMut(u32, &mut Marks) -> bool,
    ) {
        self.find_edges(v, surface, quadrics, marks);
        self.edges.sort_unstable_by(order);
        let legal = self.edges.iter().copied().find(|&(_, u)| is_legal(u, marks));
        self.set(v, legal, State::Legal);
    }

    fn set(&mut self, v: u32, candidate: Option<(f32, u32)>, state: State) {
        let (key, target, state) = match candidate {
            Some((key, target)) => (key, target, state),
            None => (f32::INFINITY, NONE, State::Nothing),
        };
        self.key[v as usize] = key;
        self.target[v as usize] = target;
        self.state[v as usize] = state;
    }
}

fn edge_key(quadric: &Quadric, d: Vec3) -> f32 {
    quadric.error(d) + LENGTH_TERM * d.length_squared()
}

/// Ascending keys, ties by vertex number.
fn order(a: &(f32, u32), b: &(f32, u32)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))
}
