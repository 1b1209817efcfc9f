//! Rounds of independent collapses.
//!
//! One collapse after the other from a heap gives long chains of dependent collapses, along each row of a regular
//! grid for instance. Instead, a round takes up the cheaper half of the candidates, and of those that touch each other
//! only one. No node of a round depends on another of the same round, so the tree, and the graph of dependencies, are
//! no deeper than there are rounds: about 80 for a million triangles.
//!
//! The key of a candidate is only a forecast of the error. When its turn comes the error is measured, and if it turns
//! out to be more than this round's limit, the candidate waits with the measured key. A node that has a large error
//! early spoils all that depend on it: taking the forecast for granted costs a third more triangles at equal error.
//!
//! A round goes through the mesh block by block, in ascending order of keys inside each; in which order, `order` says.
//! Blocks are as large as the caches, and borders between them are few. The result is sorted by key afterwards: collapses
//! of a round may be put in any order.

use rayon::prelude::*;
use std::ops::Range;

use glam::Vec3;
use vertex_tree::NONE;

use super::candidates::{Candidates, Edges, State};
use super::key_counts::KeyCounts;
use super::legality::obstacle;
use super::marks::Marks;
use super::nodes::{Nodes, round_up};
use super::order::{self, PIECES};
use super::remains::Remains;
use super::samples::Samples;
use super::stall::Stall;
use super::surface::{Spoke, Surface};

/// Vertices that a thread prepares at once.
pub(super) const AT_ONCE: usize = 1 << 15;

/// How a measured distance counts against keys that are not measured: with this times its square. Keys are mean squared
/// distances, less than the square of the largest. With 1, only the worst surprises are put off, at the cost of 7 %
/// more measurements, and cuts of scans have 15 % fewer triangles than without measuring first; with 2 it is 50 % and
/// 25 %, with 4 150 % and 26 %.
const MEASURED_WEIGHT: f64 = 2.0;

/// In stars of no more triangles than this, to compare all with all is the fastest.
const FEW: usize = 16;

/// Triangles that stand in at most where nothing takes the place of a star, and how many on either side of the star's own
/// place in the order of a hub's triangles.
const MOST_OTHERS: usize = 256;
const BESIDE: usize = 4;

/// Everything that changes while a mesh is being simplified.
#[derive(Debug)]
pub(super) struct Builder {
    pub surface: Surface,
    pub nodes: Nodes,
    pub candidates: Candidates,
    pub samples: Samples,
    pub marks: Marks,
    /// Vertices whose stars or samples have changed, if somebody wants to know.
    pub touched: Option<Vec<u32>>,
    /// The candidates of a block in the order in which they come up.
    order: Vec<u64>,
    /// The star of the vertex in question.
    star: Vec<Spoke>,
    /// For each triangle of it, where the other two corners are for [`measure`](Self::measure).
    ring: Vec<[Vec3; 2]>,
    /// Vertices that lose a triangle and get none of the new ones.
    bereaved: Vec<u32>,
    /// Triangles that stand in where nothing takes the place of the star.
    others: Vec<u32>,
    /// Whether to join components.
    merge: bool,
    /// Whether a candidate that comes up in vain is given up.
    pub gives_up: bool,
    /// Whether triangles may turn by nearly a right angle, as there is no other way left.
    pub leans: bool,
}

impl Builder {
    pub fn new(surface: Surface, nodes: Nodes, marks: Marks, merge: bool) -> Builder {
        let (points, count) = (surface.positions.len(), surface.merged_into.len());
        Builder {
            surface,
            nodes,
            candidates: Candidates::new(count),
            samples: Samples::new(points),
            marks,
            touched: None,
            order: Vec::new(),
            star: Vec::new(),
            ring: Vec::new(),
            bereaved: Vec::new(),
            others: Vec::new(),
            merge,
            gives_up: false,
            leans: false,
        }
    }

    /// Finds every vertex's first candidate.
    pub fn begin(&mut self) {
        let surface = &self.surface;
        let first = surface.live.par_chunks(AT_ONCE).map(|live| {
            let (mut edges, mut marks) = (Edges::default(), Marks::new(surface.merged_into.len()));
            let cheapest = |&v: &u32| edges.cheapest(v, surface, &mut marks);
            live.iter().map(cheapest).collect::<Vec<_>>()
        });
        for (i, first) in first.collect::<Vec<_>>().into_iter().flatten().enumerate() {
            self.candidates.take(self.surface.live[i], first, &mut self.surface);
        }
    }

    /// Collapses until nothing legal is left. At the start `all` vertices had a triangle; numbers are below `numbers`, and
    /// `number` says which one each vertex has. `after_round` is called with the nodes of each round and the key up to
    /// which candidates were taken up. Returns the number of rounds, with those without a collapse; `stall` is what is known
    /// of rounds before.
    ///
    /// This ends. A round with a collapse leaves a vertex less. Of the rounds between two collapses, at most
    /// [`MOST_IDLE`](super::stall::MOST_IDLE) go by until each gives up the candidates that come up in vain, one at least,
    /// as the limit is the key of one; a candidate that is given up is no candidate any more until the next collapse or until
    /// the hopeless are looked at again, which happens once; the reach is doubled up to a limit; and triangles are allowed to
    /// turn further once.
    pub fn run<E>(
        &mut self,
        mut stall: Stall,
        all: usize,
        numbers: u32,
        number: impl Fn(u32) -> u32,
        mut after_round: impl FnMut(&Builder, Range<u32>, f32) -> Result<(), E>,
    ) -> Result<usize, E> {
        // How many vertices there were when virtual edges were last sought, and how far beyond their usual distance.
        let (mut sought_among, mut reach) = (usize::MAX, 1.0);
        let mut rounds = 0;
        loop {
            if self.merge && self.surface.live.len() <= sought_among / 2 {
                sought_among = self.surface.live.len();
                self.seek_virtual_edges(reach, 0..self.surface.live.len());
            }
            if let Some(limit) = self.key_limit() {
                let first = self.nodes.next();
                self.gives_up = stall.gives_up();
                self.candidates.changed = false;
                self.run_round(limit, all, numbers, &number);
                rounds += 1;
                let collapses = self.nodes.next() - first;
                stall.end_round(collapses as usize, self.candidates.changed);
                if collapses > 0 {
                    self.surface.rebuild_stars();
                    after_round(self, first..self.nodes.next(), limit)?;
                }
            } else if stall.takes_hopeless() {
                self.retry_hopeless(0..self.surface.live.len());
            } else if self.merge && reach < FARTHEST_REACH {
                reach *= 2.0;
                self.seek_virtual_edges(reach, 0..self.surface.live.len());
            } else if !self.leans {
                self.leans = true;
                self.retry_hopeless(0..self.surface.live.len());
            } else {
                return Ok(rounds);
            }
        }
    }

    /// Why what is left is left.
    pub fn remains(&mut self) -> Remains {
        let mut remains = Remains::default();
        remains.look_at(0..self.surface.live.len(), &self.surface, &mut self.marks);
        remains.count_components(&self.surface);
        remains
    }

    /// A round; see [`run`](Self::run). Stars have to be rebuilt afterwards if there are new nodes.
    fn run_round(&mut self, limit: f32, all: usize, numbers: u32, number: impl Fn(u32) -> u32) {
        self.nodes.first_of_round = self.nodes.next_id;
        let shift = order::span(all, self.surface.live.len()).ilog2();
        let piece = |v: u32| number(v) >> shift;
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        for triangle in &self.surface.triangles {
            let [a, b, c] = triangle.corners.map(piece);
            for pair in [[a, b], [b, c], [c, a]] {
                if pair[0] != pair[1] && pairs.last() != Some(&pair) {
                    pairs.push(pair);
                }
            }
        }
        let pieces = numbers.saturating_sub(1) >> shift;
        let borders = order::borders(pieces + 1, |pair| pairs.iter().for_each(|&[a, b]| pair(a, b)));
        drop(pairs);
        let all_live = self.surface.live.len();
        for are_on_borders in [false, true] {
            let mut start = 0;
            while start < all_live {
                let block = |i: usize| piece(self.surface.live[i]) / PIECES;
                let this = block(start);
                let end = (start..all_live).find(|&i| block(i) != this).unwrap_or(all_live);
                if borders[this as usize] == are_on_borders {
                    self.run_block(limit, start..end);
                }
                start = end;
            }
        }
        self.candidates.parity = self.candidates.parity.other();
    }

    /// The part of a round in which the vertices `live[range]` come up, which are one block.
    pub fn run_block(&mut self, limit: f32, range: Range<usize>) {
        self.order.clear();
        for i in range {
            let v = self.surface.live[i];
            self.candidates.visit(v, &mut self.surface, &mut self.marks);
            let key = self.candidates.key[v as usize];
            if self.candidates.state[v as usize] != State::Nothing && key <= limit {
                // Keys are not negative, so their bits sort as they do; ties go by vertex number.
                self.order.push(u64::from(key.to_bits()) << 32 | u64::from(v));
            }
        }
        self.order.sort_unstable();
        for i in 0..self.order.len() {
            let v = self.order[i] as u32;
            let made = self.nodes.next();
            self.attempt(v, limit);
            if self.gives_up && self.nodes.next() == made {
                self.candidates.give_up(v);
            }
        }
    }

    fn key_limit(&self) -> Option<f32> {
        let mut counts = KeyCounts::default();
        for &v in &self.surface.live {
            self.candidates.count(v, &mut counts);
        }
        counts.limit()
    }

    /// Looks again at vertices without a legal edge: what forbade it may have gone, though their own star is the same.
    pub fn retry_hopeless(&mut self, range: Range<usize>) {
        for i in range {
            let v = self.surface.live[i];
            if self.candidates.state[v as usize] == State::Nothing {
                self.find_legal(v);
            }
        }
    }

    fn find_legal(&mut self, v: u32) {
        self.star.clear();
        self.star.extend(self.surface.spokes(v));
        let (star, leans) = (&self.star, self.leans);
        self.candidates.refresh_legal(
            v,
            &mut self.surface,
            &mut self.marks,
            self.merge,
            |u, surface, marks| obstacle(v, u, star, leans, surface, marks).is_none(),
        );
    }

    /// Makes the collapse of `v`'s candidate if nothing near has changed in this round, and it is legal.
    fn attempt(&mut self, v: u32, limit: f32) {
        let state = self.candidates.state[v as usize];
        if matches!(state, State::Outdated(_) | State::Updated(_) | State::Nothing) {
            return;
        }
        let u = self.candidates.target[v as usize];
        if self.nodes.is_new(self.nodes.top[u as usize]) && !self.may_follow(u) {
            return;
        }
        self.star.clear();
        self.star.extend(self.surface.spokes(v));
        let joined = self.star.iter().any(|s| s.touches(u));
        if !joined && !self.surface.virtual_edges.partners(v).any(|w| w == u) {
            // The edge has gone with its last triangle.
            self.candidates.forget(v);
            return;
        }
        if state == State::Forced {
            // Something must remain to be seen.
            if self.star.iter().all(|s| s.touches(u)) && self.star.len() == self.surface.live_triangles {
                self.candidates.give_up(v);
                return;
            }
        } else if obstacle(v, u, &self.star, self.leans, &self.surface, &mut self.marks).is_some() {
            self.find_legal(v);
            return;
        }
        self.find_bereaved(u);
        let changed = |w: &u32| self.nodes.is_new(self.nodes.trace[*w as usize]);
        if self.bereaved.iter().any(|w| changed(w) && !self.may_follow(*w)) {
            return;
        }
        let error = self.measure(v, u);
        if !self.star.is_empty() && self.samples.nothing_new() {
            // Where components are joined, the last triangles of one could go, with nothing near to take their place.
            self.candidates.give_up(v);
            return;
        }
        let of_unit = error / self.surface.unit;
        let key = (MEASURED_WEIGHT * of_unit * of_unit).min(f64::from(f32::MAX)) as f32;
        let key = key.max(self.candidates.key[v as usize]);
        self.candidates.changed |= key != self.candidates.key[v as usize];
        self.candidates.key[v as usize] = key;
        if key > limit {
            if state == State::Cheapest {
                self.candidates.state[v as usize] = State::Legal;
                self.candidates.changed = true;
            }
            return;
        }
        self.collapse(v, u, joined, error);
    }

    /// Whether another collapse may change the star of `v` in a round in which one has: where `v` is a hub that has only lost
    /// triangles. Else thousands of triangles at one vertex would take as many rounds. What its star names is still there,
    /// or known to have vanished.
    fn may_follow(&self, v: u32) -> bool {
        self.surface.is_hub(v) && !self.surface.gained[v as usize]
    }

    /// Finds the corners of triangles of `self.star` that vanish at the merge into `u` which are in none that remains.
    fn find_bereaved(&mut self, u: u32) {
        self.bereaved.clear();
        if self.star.len() <= FEW {
            for s in self.star.iter().filter(|s| s.touches(u)) {
                let apex = if s.next == u { s.last } else { s.next };
                if !self.star.iter().any(|s| s.touches(apex) && !s.touches(u)) {
                    self.bereaved.push(apex);
                }
            }
            return;
        }
        self.marks.clear();
        for w in self.star.iter().filter(|s| !s.touches(u)).flat_map(|s| [s.next, s.last]) {
            self.marks.set(w, 0);
        }
        for s in self.star.iter().filter(|s| s.touches(u)) {
            let apex = if s.next == u { s.last } else { s.next };
            if self.marks.get(apex).is_none() {
                self.bereaved.push(apex);
            }
        }
    }

    /// Merges `v`, whose star is in `self.star`, into `u`, which has just been measured. `joined` says whether triangles join
    /// the two.
    fn collapse(&mut self, v: u32, u: u32, joined: bool, error: f64) {
        let surface = &mut self.surface;
        let (from, to) = (surface.position(v), surface.position(u));
        let node = self.nodes.next();
        let creators = self.star.iter().map(|s| surface.triangles[s.triangle as usize].creator);
        let key = self.candidates.key[v as usize];
        let positions = [from.as_dvec3(), to.as_dvec3()];
        let eps = round_up(error);
        if !self.nodes.add([v, u], positions, creators, &self.bereaved, eps, key) {
            self.candidates.give_up(v);
            return;
        }

        surface.gained[u as usize] |= self.star.iter().any(|s| !s.touches(u));
        // Where all is regular, a legal collapse keeps it so.
        let regular =
            joined && !surface.special[v as usize] && self.candidates.state[v as usize] != State::Forced;
        surface.special[u as usize] |= !regular;
        surface.joined[u as usize] |= surface.joined[v as usize] || !joined;
        let updated = State::Updated(self.candidates.parity);
        if let Some(touched) = &mut self.touched {
            touched.extend([v, u]);
            touched.extend(self.star.iter().flat_map(|s| [s.next, s.last]));
            touched.extend(self.others.iter().flat_map(|&t| surface.triangles[t as usize].corners));
        }
        for spoke in &self.star {
            let triangle = &mut surface.triangles[spoke.triangle as usize];
            triangle.samples = NONE;
            if spoke.touches(u) {
                triangle.corners[0] = NONE;
                surface.live_triangles -= 1;
                surface.lose(spoke.next);
                surface.lose(spoke.last);
            } else {
                triangle.creator = node;
                triangle.corners = [u, spoke.next, spoke.last];
            }
            for w in [spoke.next, spoke.last] {
                surface.special[w as usize] |= !regular;
                // Most neighbours come along twice.
                if w == spoke.next || self.candidates.state[w as usize] != updated {
                    self.candidates.neighbour_merged(w, v, u, surface);
                }
            }
        }
        for w in surface.virtual_edges.partners(v).chain([u]) {
            self.candidates.state[w as usize] = State::Outdated(self.candidates.parity);
        }
        surface.merged_into[v as usize] = u;
        self.samples.finish(|t, list| surface.triangles[t as usize].samples = list);
        let carried = surface.quadrics[v as usize];
        surface.quadrics[u as usize].absorb(&carried, (to - from) * surface.per_unit);
    }

    /// Measures how far what is shown moves from the input when `v`, whose star is in `self.star`, merges into `u`: in object
    /// units.
    fn measure(&mut self, v: u32, u: u32) -> f64 {
        let (surface, samples) = (&self.surface, &mut self.samples);
        // A vertex that has lost its triangles shows nothing; when it lost them, that was measured.
        if self.star.is_empty() {
            samples.begin(surface.position(v), 0.0);
            return 0.0;
        }
        let (from, to) = (surface.position(v), surface.position(u));
        self.ring.clear();
        let mut reach = (to - from).abs();
        for s in &self.star {
            let [next, last] = [s.next, s.last].map(|w| surface.position(w) - from);
            reach = reach.max(next.abs()).max(last.abs());
            self.ring.push([next, last]);
        }
        samples.begin(from, reach.max_element());
        let u_there = samples.local(to);
        for (s, ring) in self.star.iter().zip(&mut self.ring) {
            let [next, last] = ring.map(|way| samples.shortened(way));
            *ring = [next, last];
            samples.add_old([Vec3::ZERO, next, last]);
            if !s.touches(u) {
                samples.add_new(s.triangle, [u_there, next, last]);
            }
        }
        // Where nothing takes the place of the star, what remains nearby has to stand in.
        self.others.clear();
        if samples.nothing_new() {
            let joined = [u].into_iter().chain(surface.virtual_edges.partners(v));
            for w in joined.chain(surface.virtual_edges.partners(u)).filter(|&w| w != v) {
                let mut add = |s: Spoke| {
                    if self.others.len() < MOST_OTHERS && !s.touches(v) && !self.others.contains(&s.triangle)
                    {
                        self.others.push(s.triangle);
                        let corners = [w, s.next, s.last].map(|x| samples.local(surface.position(x)));
                        samples.add_new(s.triangle, corners);
                    }
                };
                match self.star.first() {
                    // Of a hub only what is beside: the distance to these is no less than that to all.
                    Some(own) if surface.is_hub(w) => {
                        surface.spokes_beside(w, own.triangle, BESIDE).into_iter().for_each(&mut add);
                    }
                    _ => surface.spokes(w).for_each(&mut add),
                }
            }
        }
        if surface.special[v as usize] {
            add_special_edges(u, &self.star, surface, samples, &mut self.marks);
        }
        samples.prepare();
        samples.place(v, &surface.positions, &surface.special, to, None);
        if self.star.iter().all(|s| s.touches(u)) {
            for w in self.star.iter().flat_map(|s| [s.next, s.last]) {
                if surface.spokes(w).all(|s| s.touches(v)) {
                    samples.measure_lost(surface.position(w), to);
                }
            }
        }
        let mut place_list = |t: u32, beside: usize| {
            let list = surface.triangles[t as usize].samples;
            samples.place_list(list, &surface.positions, &surface.special, to, beside);
        };
        let mut remaining = 0;
        for s in &self.star {
            place_list(s.triangle, remaining);
            remaining += usize::from(!s.touches(u));
        }
        self.others.iter().for_each(|&t| place_list(t, 0));
        for (i, (_, &[next, last])) in
            self.star.iter().zip(&self.ring).enumerate().filter(|(_, (s, _))| !s.touches(u))
        {
            // The triangle's other edge from `u` is the next one's, or was there before.
            samples.measure_reverse(&[u_there, next], i);
            if self.merge {
                // Joined walls can close a yard whose rim they do not leave.
                samples.measure_reverse(&[u_there, next, last], i);
            }
        }
        samples.error()
    }

    /// Finds pairs for virtual edges among the vertices `live[range]`, as far apart as vertices are on average on a plane,
    /// times `reach`.
    fn seek_virtual_edges(&mut self, reach: f32, range: Range<usize>) {
        let surface = &mut self.surface;
        let vertices = surface.live[range].to_vec();
        let positions = || vertices.iter().map(|&v| surface.position(v));
        let low = positions().fold(glam::Vec3::INFINITY, glam::Vec3::min);
        let high = positions().fold(glam::Vec3::NEG_INFINITY, glam::Vec3::max);
        let mut sides = (high - low).to_array();
        sides.sort_by(|a, b| b.total_cmp(a));
        let count = vertices.len() as f32;
        let spacing = (sides[0] / count).max((sides[0] * sides[1] / count).sqrt());
        let cell = if spacing > 0.0 { 2.0 * spacing * reach } else { 1.0 };
        let mut edges = std::mem::take(&mut surface.virtual_edges);
        edges.search(&surface.positions, &surface.components(), &vertices, cell);
        surface.virtual_edges = edges;
        for v in vertices {
            if surface.virtual_edges.partners(v).next().is_some() {
                self.candidates.state[v as usize] = State::Outdated(self.candidates.parity.other());
            }
        }
    }
}

/// Times the average distance of vertices: beyond this, no pair is left to be found.
const FARTHEST_REACH: f32 = 1e6;

/// Adds the special edges that remain around a special vertex, whose star is given, once it has merged into `u`.
fn add_special_edges(u: u32, star: &[Spoke], surface: &Surface, samples: &mut Samples, marks: &mut Marks) {
    marks.clear();
    for w in star.iter().flat_map(|s| [s.next, s.last]) {
        marks.set(w, marks.get(w).unwrap_or(0) + 1);
    }
    let to = surface.position(u);
    for (face, s) in (0..).zip(star.iter().filter(|s| !s.touches(u))) {
        // Edges from the vertex itself go to `u` now.
        for w in [s.next, s.last].into_iter().filter(|&w| marks.get(w) != Some(2)) {
            samples.add_special_edge(face, [to, surface.position(w)]);
        }
        if surface.special[s.next as usize] && surface.special[s.last as usize] {
            // Whether there are two is told sooner from the star of one that is no hub.
            let (a, b) = if surface.is_hub(s.next) { (s.last, s.next) } else { (s.next, s.last) };
            if surface.spokes(a).filter(|t| t.touches(b)).take(3).count() != 2 {
                samples.add_special_edge(face, [s.next, s.last].map(|w| surface.position(w)));
            }
        }
    }
}
