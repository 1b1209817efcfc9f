//! For every vertex, the cheapest edge along which it could be removed.
//!
//! The key of the half-edge collapse `v -> u` is the mean squared distance of `u` from the planes that `v` stands
//! for, plus a little of the squared length of the edge. The second term decides where the first is zero, on plane
//! ground and among doubled vertices: short edges first keeps triangles well-shaped and trees shallow.
//!
//! Keys are kept from round to round, and brought up to date when a vertex is visited, if its star has changed in the
//! round before: what one block of vertices does never waits for what others will do. Whether a collapse is legal costs more to say, and is asked when its turn comes:
//! most candidates are overtaken by a change nearby before that.

use glam::Vec3;
use vertex_tree::NONE;

use super::key_counts::KeyCounts;
use super::marks::Marks;
use super::quadric::Quadric;
use super::surface::{Neighbour, Surface};

/// Part of the squared length of an edge that is added to the squared distance.
const LENGTH_TERM: f32 = 1e-4;

/// Whether a round has an even or an odd number. Every vertex that is left is visited in every round, so this tells
/// the current round from the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Parity {
    Even,
    Odd,
}

impl Parity {
    pub fn other(self) -> Parity {
        if self == Parity::Even { Parity::Odd } else { Parity::Even }
    }
}

/// What is known of a vertex's candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum State {
    /// The star has changed in the round: to be found anew when the vertex is visited in the next.
    Outdated(Parity),
    /// The star has changed in the round, but the cheapest edge is known.
    Updated(Parity),
    /// The cheapest edge, legal or not.
    Cheapest,
    /// The cheapest edge that was legal when last asked.
    Legal,
    /// No edge is legal, so the shortest is taken all the same.
    Forced,
    /// No edge is legal.
    Nothing,
}

/// The candidate of each vertex.
#[derive(Debug)]
pub(super) struct Candidates {
    pub key: Vec<f32>,
    pub target: Vec<u32>,
    pub state: Vec<State>,
    /// That of the current round.
    pub parity: Parity,
    /// Whether anything has become known in the round that was not before.
    pub changed: bool,
    edges: Edges,
}

/// The edges of one vertex along which it may be removed.
#[derive(Debug, Default)]
pub(super) struct Edges {
    neighbours: Vec<Neighbour>,
    /// With their keys.
    list: Vec<(f32, u32)>,
}

/// The cheapest edge of a vertex, as far as its own star can say, and whether it is [special](Surface::special).
pub(super) type Cheapest = (Option<(f32, u32)>, bool);

/// Triangles that may be looked at to find a legal edge of one vertex: of one with thousands not all edges are tried, but the
/// cheapest, and again when it has lost some.
const MOST_LOOKED_AT: usize = 1 << 16;

impl Candidates {
    pub fn new(count: usize) -> Candidates {
        Candidates {
            key: vec![0.0; count],
            target: vec![NONE; count],
            state: vec![State::Outdated(Parity::Odd); count],
            parity: Parity::Even,
            changed: false,
            edges: Edges::default(),
        }
    }

    /// Brings the candidate of `v` up to date with what changed before the current round.
    pub fn visit(&mut self, v: u32, surface: &mut Surface, marks: &mut Marks) {
        match self.state[v as usize] {
            State::Outdated(parity) if parity != self.parity => self.refresh(v, surface, marks),
            State::Updated(parity) if parity != self.parity => {
                self.state[v as usize] = State::Cheapest;
                self.changed = true;
            }
            _ => {}
        }
    }

    /// That of `v` is not there any more: it is found anew in the next round.
    pub fn forget(&mut self, v: u32) {
        self.state[v as usize] = State::Outdated(self.parity);
        self.changed = true;
    }

    /// There is no edge along which `v` could be removed, as far as is known now.
    pub fn give_up(&mut self, v: u32) {
        self.state[v as usize] = State::Nothing;
        self.changed = true;
    }

    /// Finds the cheapest edge of `v`.
    pub fn refresh(&mut self, v: u32, surface: &mut Surface, marks: &mut Marks) {
        let cheapest = self.edges.cheapest(v, surface, marks);
        self.take(v, cheapest, surface);
    }

    /// Takes what has been found for `v`.
    pub fn take(&mut self, v: u32, (cheapest, special): Cheapest, surface: &mut Surface) {
        surface.special[v as usize] = special;
        self.set(v, cheapest, State::Cheapest);
    }

    /// Finds the cheapest edge of `v` that is legal. If none is and `force` is set, takes the shortest.
    pub fn refresh_legal(
        &mut self,
        v: u32,
        surface: &mut Surface,
        marks: &mut Marks,
        force: bool,
        mut is_legal: impl FnMut(u32, &Surface, &mut Marks) -> bool,
    ) {
        surface.special[v as usize] = self.edges.find(v, surface, marks);
        let Edges { neighbours, list } = &mut self.edges;
        list.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let most = MOST_LOOKED_AT / surface.star_length(v).max(1);
        let legal = list.iter().copied().take(most.max(4)).find(|&(_, u)| is_legal(u, surface, marks));
        if legal.is_some() || !force {
            self.set(v, legal, State::Legal);
            return;
        }
        let neighbours = neighbours.iter().map(|n| n.vertex);
        let shortest = neighbours
            .chain(surface.virtual_edges.partners(v))
            .map(|u| (way(v, u, surface).length_squared().min(f32::MAX), u))
            .reduce(cheaper);
        self.set(v, shortest, State::Forced);
    }

    /// Brings the candidate of `w` up to date after its neighbour `lost` has merged into `gained`.
    pub fn neighbour_merged(&mut self, w: u32, lost: u32, gained: u32, surface: &Surface) {
        let i = w as usize;
        let known = matches!(self.state[i], State::Cheapest | State::Updated(_));
        if !known || surface.special[i] || self.target[i] == lost {
            self.state[i] = State::Outdated(self.parity);
            return;
        }
        // The other edges of `w` are what they were.
        let key = edge_key(&surface.quadrics[i], way(w, gained, surface));
        (self.key[i], self.target[i]) = cheaper((self.key[i], self.target[i]), (key, gained));
        self.state[i] = State::Updated(self.parity);
    }

    /// Counts the key of `v`, as it was when it was last looked at.
    pub fn count(&self, v: u32, counts: &mut KeyCounts) {
        if self.state[v as usize] != State::Nothing {
            counts.add(self.key[v as usize]);
        }
    }

    fn set(&mut self, v: u32, candidate: Option<(f32, u32)>, state: State) {
        let i = v as usize;
        (self.key[i], self.target[i]) = candidate.unwrap_or((f32::INFINITY, NONE));
        self.state[i] = if candidate.is_some() { state } else { State::Nothing };
        self.changed = true;
    }
}

impl Edges {
    /// Finds the cheapest edge of `v`.
    pub fn cheapest(&mut self, v: u32, surface: &Surface, marks: &mut Marks) -> Cheapest {
        if surface.special[v as usize] {
            let special = self.find(v, surface, marks);
            return (self.list.iter().copied().reduce(cheaper), special);
        }
        // Triangles close up around `v`, so every neighbour comes next in one of them.
        let quadric = &surface.quadrics[v as usize];
        let neighbours = surface.spokes(v).map(|s| (edge_key(quadric, way(v, s.next, surface)), s.next));
        let partners = surface.virtual_edges.partners(v);
        let partners = partners.map(|w| (virtual_key(quadric, way(v, w, surface)), w));
        (neighbours.chain(partners).reduce(cheaper), false)
    }

    /// Finds all edges along which `v` may be removed as far as its own star can say, and whether it is special.
    fn find(&mut self, v: u32, surface: &Surface, marks: &mut Marks) -> bool {
        let Self { neighbours, list } = self;
        surface.neighbours(v, marks, neighbours);
        // A vertex on a boundary, or on a seam where more than two triangles meet, stays on it.
        let is_bound = neighbours.iter().any(|n| n.triangles != 2);
        let quadric = &surface.quadrics[v as usize];
        list.clear();
        for n in &*neighbours {
            if !is_bound || n.triangles != 2 || surface.joined[v as usize] {
                list.push((edge_key(quadric, way(v, n.vertex, surface)), n.vertex));
            }
        }
        for w in surface.virtual_edges.partners(v) {
            list.push((virtual_key(quadric, way(v, w, surface)), w));
        }
        neighbours.iter().any(|n| !n.is_regular())
    }
}

/// Vector from one vertex to another, in units of the simplification.
fn way(from: u32, to: u32, surface: &Surface) -> Vec3 {
    (surface.position(to) - surface.position(from)) * surface.per_unit
}

/// Keys are finite; infinity stands for no edge.
fn edge_key(quadric: &Quadric, d: Vec3) -> f32 {
    (quadric.error(d) + LENGTH_TERM * d.length_squared()).min(f32::MAX)
}

/// Joining what is apart shows surface where there was none: the distance itself is an error.
fn virtual_key(quadric: &Quadric, d: Vec3) -> f32 {
    (quadric.error(d) + d.length_squared()).min(f32::MAX)
}

/// The edge with the lower key, or with the lower vertex number if keys are equal.
fn cheaper(a: (f32, u32), b: (f32, u32)) -> (f32, u32) {
    if b.0 < a.0 || (b.0 == a.0 && b.1 < a.1) { b } else { a }
}
