//! Rounds of independent collapses.
//!
//! One collapse after the other from a heap gives chains of dependent collapses along each row of a regular grid.
//! Instead, the cheapest candidates of a round are tried in ascending order, and one that touches what another has
//! changed in the same round waits for the next. No node of a round depends on another of the same round, so the
//! tree, and the graph of dependencies, are no deeper than there are rounds.

use glam::Vec3;
use vertex_tree::NONE;

use super::candidates::{Candidates, State};
use super::legality::{keeps_orientation, keeps_topology};
use super::nodes::{Nodes, round_up};
use super::quadric::Quadric;
use super::samples::Samples;
use super::surface::{Marks, Spoke, Surface};
use crate::progress::Progress;

/// The part of the candidates that a round takes up.
const SHARE: f64 = 0.5;

/// Everything that changes while a mesh is being simplified.
#[derive(Debug)]
pub(super) struct Builder {
    pub surface: Surface,
    pub quadrics: Vec<Quadric>,
    pub candidates: Candidates,
    pub samples: Samples,
    pub nodes: Nodes,
    pub marks: Marks,
    /// Number of the first node of the current round.
    pub first_of_round: u32,
    pub rounds: u32,
    pub inversions: u32,
    pub highest_key: f32,
    pub share: f64,
    star: Vec<Spoke>,
}

impl Builder {
    pub fn new(surface: Surface, quadrics: Vec<Quadric>, nodes: Nodes) -> Builder {
        let count = surface.positions.len();
        Builder {
            surface,
            quadrics,
            candidates: Candidates::new(count),
            samples: Samples::new(count),
            nodes,
            marks: Marks::new(count),
            first_of_round: 0,
            rounds: 0,
            inversions: 0,
            highest_key: 0.0,
            share: std::env::var("SHARE").ok().and_then(|s| s.parse().ok()).unwrap_or(SHARE),
            star: Vec::new(),
        }
    }

    /// Collapses until nothing legal is left.
    pub fn run(&mut self, progress: Progress) {
        let all = self.surface.live.len() as u64;
        let mut order: Vec<u64> = Vec::new();
        let mut last_chance = false;
        loop {
            progress(all - self.surface.live.len() as u64, all);
            self.refresh_candidates(last_chance);
            // Keys are not negative, so their bits sort as they do; ties go by vertex number.
            order.clear();
            for &v in &self.surface.live {
                if self.candidates.state[v as usize] != State::Nothing {
                    order.push(u64::from(self.candidates.key[v as usize].to_bits()) << 32 | u64::from(v));
                }
            }
            if order.is_empty() {
                if last_chance {
                    return;
                }
                last_chance = true;
                continue;
            }
            last_chance = false;
            let take = ((order.len() as f64 * self.share) as usize).max(order.len().min(16));
            if take < order.len() {
                order.select_nth_unstable(take);
                order.truncate(take);
            }
            order.sort_unstable();
            self.first_of_round = self.nodes.next();
            for &entry in &order {
                self.attempt(entry as u32);
            }
            if self.nodes.next() > self.first_of_round {
                self.rounds += 1;
                self.surface.rebuild_stars();
            }
        }
    }

    fn refresh_candidates(&mut self, also_hopeless: bool) {
        for &v in &self.surface.live {
            match self.candidates.state[v as usize] {
                State::Outdated => {
                    self.candidates.refresh(v, &self.surface, &self.quadrics, &mut self.marks);
                }
                State::Nothing if also_hopeless => find_legal(
                    v,
                    &mut self.candidates,
                    &self.surface,
                    &self.quadrics,
                    &mut self.marks,
                    &mut self.star,
                ),
                _ => {}
            }
        }
    }

    fn is_of_round(&self, node: u32) -> bool {
        node != NONE && node >= self.first_of_round
    }

    /// Makes the collapse of `v`'s candidate if nothing near has changed in this round and it is legal.
    fn attempt(&mut self, v: u32) {
        let u = self.candidates.target[v as usize];
        if self.is_of_round(self.nodes.top[v as usize]) || self.is_of_round(self.nodes.top[u as usize]) {
            return;
        }
        for &t in self.surface.star(v) {
            let t = &self.surface.triangles[t as usize];
            if !t.is_alive() || self.is_of_round(t.creator) {
                return;
            }
        }
        self.star.clear();
        self.star.extend(self.surface.spokes(v));
        if !is_legal(v, u, &self.star, &self.surface, &mut self.marks) {
            find_legal(
                v,
                &mut self.candidates,
                &self.surface,
                &self.quadrics,
                &mut self.marks,
                &mut self.star,
            );
            return;
        }
        self.collapse(v, u);
    }

    /// Merges `v` into `u`. `self.star` is the star of `v`.
    fn collapse(&mut self, v: u32, u: u32) {
        let error = self.measure(v, u);
        let (from, to) = (self.surface.position(v), self.surface.position(u));
        let node = self.nodes.next();
        let triangles = &self.surface.triangles;
        self.nodes.add(
            [v, u],
            [from.as_dvec3(), to.as_dvec3()],
            self.star.iter().map(|s| triangles[s.triangle as usize].creator),
            round_up(f64::from(error)),
        );
        let key = self.candidates.key[v as usize];
        if key < self.highest_key {
            self.inversions += 1;
        }
        self.highest_key = self.highest_key.max(key);

        for spoke in &self.star {
            self.candidates.state[spoke.next as usize] = State::Outdated;
            self.candidates.state[spoke.last as usize] = State::Outdated;
            let t = &mut self.surface.triangles[spoke.triangle as usize];
            t.samples = NONE;
            if spoke.next == u || spoke.last == u {
                t.corners[0] = NONE;
            } else {
                t.creator = node;
                t.corners = [u, spoke.next, spoke.last];
            }
        }
        self.candidates.state[u as usize] = State::Outdated;
        self.surface.removed[v as usize] = true;
        let triangles = &mut self.surface.triangles;
        self.samples.finish(|t, list| triangles[t as usize].samples = list);
        let carried = self.quadrics[v as usize];
        self.quadrics[u as usize].absorb(&carried, to - from);
    }

    /// Distance of the sample points around `v`, and `v` itself, from what takes the place of its star.
    fn measure(&mut self, v: u32, u: u32) -> f32 {
        let surface = &self.surface;
        let special = &self.candidates.special;
        let samples = &mut self.samples;
        let to = surface.position(u);
        samples.begin();
        for s in &self.star {
            if s.next != u && s.last != u {
                samples.add_face(s.triangle, to, surface.position(s.next), surface.position(s.last));
            }
        }
        let alone = !samples.has_faces();
        if alone {
            for s in surface.spokes(u).filter(|s| s.next != v && s.last != v) {
                samples.add_face(s.triangle, to, surface.position(s.next), surface.position(s.last));
            }
        }
        if special[v as usize] {
            add_special_edges(u, &self.star, surface, special, samples, &mut self.marks);
        }
        samples.place(v, &surface.positions, special, to);
        for s in &self.star {
            let list = surface.triangles[s.triangle as usize].samples;
            samples.place_list(list, &surface.positions, special, to);
        }
        if alone {
            for s in surface.spokes(u).filter(|s| s.next != v && s.last != v) {
                let list = surface.triangles[s.triangle as usize].samples;
                samples.place_list(list, &surface.positions, special, to);
            }
        }
        samples.error()
    }
}

/// Adds the special edges that remain around a special vertex, whose star is given, once it has merged into `u`.
fn add_special_edges(
    u: u32,
    star: &[Spoke],
    surface: &Surface,
    special: &[bool],
    samples: &mut Samples,
    marks: &mut Marks,
) {
    // The edges from `v` itself go to `u` now.
    marks.clear();
    for s in star {
        for w in [s.next, s.last] {
            marks.set(w, marks.get(w).unwrap_or(0) + 1);
        }
    }
    let to: Vec3 = surface.position(u);
    let mut face = 0;
    for s in star {
        if s.next == u || s.last == u {
            continue;
        }
        for w in [s.next, s.last] {
            if marks.get(w) != Some(2) {
                samples.add_edge(face, to, surface.position(w));
            }
        }
        let (a, b) = (s.next, s.last);
        if special[a as usize] && special[b as usize] {
            let triangles = surface.spokes(a).filter(|s| s.next == b || s.last == b).count();
            if triangles != 2 {
                samples.add_edge(face, surface.position(a), surface.position(b));
            }
        }
        face += 1;
    }
}

fn is_legal(v: u32, u: u32, star: &[Spoke], surface: &Surface, marks: &mut Marks) -> bool {
    keeps_orientation(v, u, star, surface) && keeps_topology(v, u, star, surface, marks)
}

fn find_legal(
    v: u32,
    candidates: &mut Candidates,
    surface: &Surface,
    quadrics: &[Quadric],
    marks: &mut Marks,
    star: &mut Vec<Spoke>,
) {
    star.clear();
    star.extend(surface.spokes(v));
    candidates.refresh_legal(v, surface, quadrics, marks, |u, marks| is_legal(v, u, star, surface, marks));
}
