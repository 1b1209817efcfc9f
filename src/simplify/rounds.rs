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
const BLOCK: usize = 4096;

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
    pub fn new(surface: Surface, quadrics: Vec<Quadric>, special: Vec<bool>, nodes: Nodes, marks: Marks) -> Builder {
        let count = surface.positions.len();
        Builder {
            surface,
            quadrics,
            candidates: Candidates::new(special),
            samples: Samples::new(count),
            nodes,
            marks,
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
            let Some(limit) = self.key_limit(&mut order) else {
                if last_chance {
                    return;
                }
                last_chance = true;
                continue;
            };
            last_chance = false;
            self.first_of_round = self.nodes.next();
            for block in 0..self.surface.live.len().div_ceil(BLOCK) {
                let range = block * BLOCK..self.surface.live.len().min((block + 1) * BLOCK);
                order.clear();
                for &v in &self.surface.live[range] {
                    let key = self.candidates.key[v as usize];
                    if self.candidates.state[v as usize] != State::Nothing && key <= limit {
                        order.push(u64::from(key.to_bits()) << 32 | u64::from(v));
                    }
                }
                order.sort_unstable();
                for &entry in &order {
                    self.attempt(entry as u32);
                }
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

    /// The key up to which candidates are taken up in this round.
    fn key_limit(&self, keys: &mut Vec<u64>) -> Option<f32> {
        keys.clear();
        // Keys are not negative, so their bits sort as they do.
        keys.extend(self.surface.live.iter().filter(|&&v| self.candidates.state[v as usize] != State::Nothing).map(|&v| u64::from(self.candidates.key[v as usize].to_bits())));
        let take = ((keys.len() as f64 * self.share) as usize).max(keys.len().min(16)).checked_sub(1)?;
        let (_, &mut limit, _) = keys.select_nth_unstable(take);
        Some(f32::from_bits(limit as u32))
    }

    fn is_of_round(&self, node: u32) -> bool {
        node != NONE && node >= self.first_of_round
    }

    /// Makes the collapse of `v`'s candidate if nothing near has changed in this round and it is legal.
    fn attempt(&mut self, v: u32) {
        let u = self.candidates.target[v as usize];
        // Whatever has changed around `v` in this round has left its mark there.
        if self.candidates.state[v as usize] == State::Outdated || self.is_of_round(self.nodes.top[u as usize]) {
            return;
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

        let was_special = self.candidates.special[v as usize];
        for spoke in &self.star {
            for w in [spoke.next, spoke.last] {
                self.candidates.state[w as usize] = State::Outdated;
                self.candidates.special[w as usize] |= was_special;
            }
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
        let from = surface.position(v);
        // The other way round, vertices alone say little: a new edge can pass far from the edges that it crosses, where
        // neither has a vertex. The middles of the new edges stand for those.
        samples.begin_reverse();
        for s in &self.star {
            samples.add_old_face(from, surface.position(s.next), surface.position(s.last));
        }
        for s in &self.star {
            if s.next != u && s.last != u {
                // Its other edge from `u` is the next triangle's, or was there before.
                samples.place_reverse((to + surface.position(s.next)) * 0.5);
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
