//! Where displayed triangles are sampled.

use rayon::prelude::*;
use std::collections::VecDeque;

use collapse_log::Mesh;
use glam::DVec3;

use super::in_view::{CHUNK, Seen, View, corners};
use crate::experiment::frustum::Clipped;

/// The densest spacing tried, in pixels.
const FINEST_SPACING: f64 = 2.0;
/// The coarsest spacing tried; a mesh that is too large even then gets more samples than [`MOST_SAMPLES`].
const COARSEST_SPACING: f64 = 256.0;
/// The spacing is enlarged until there are at most this many samples.
const MOST_SAMPLES: usize = 1_000_000;
/// A triangle gets at most this many samples, or one that touches the eye would get them without end.
const MOST_IN_A_TRIANGLE: usize = 4096;

/// Chooses the samples of the triangles in view: centroids (left to the caller), vertices once each, and points
/// inside and on the edges, by bisecting what is longer than the spacing. Only what a triangle shows within the
/// frustum is bisected. The samples depend on nothing but the meshes and the view.
pub(super) struct Sampler<'a> {
    displayed: &'a Mesh,
    seen: &'a [Seen],
    view: &'a View,
    /// In pixels. The distance to the other mesh changes by at most the way from one sample to the next, so this
    /// bounds what may be overlooked.
    spacing: f64,
    /// For each vertex, the first triangle in view that uses it: the one with which it is sampled.
    first_use: Vec<usize>,
}

impl<'a> Sampler<'a> {
    pub(super) fn new(displayed: &'a Mesh, seen: &'a [Seen], view: &'a View) -> Self {
        let mut first_use = vec![usize::MAX; displayed.positions.len()];
        for (triangle, corners) in displayed.triangles.iter().enumerate() {
            if seen[triangle] != Seen::Nothing {
                for &v in corners {
                    let first = &mut first_use[v as usize];
                    *first = triangle.min(*first);
                }
            }
        }
        let mut sampler = Self { displayed, seen, view, spacing: FINEST_SPACING, first_use };
        while sampler.spacing < COARSEST_SPACING && sampler.count() > MOST_SAMPLES {
            sampler.spacing *= 1.5;
        }
        sampler
    }

    fn count(&self) -> usize {
        let count_in = |triangle| {
            let mut count = 0;
            self.for_each_further(triangle, |_| count += 1);
            count
        };
        (0..self.seen.len()).into_par_iter().with_min_len(CHUNK).map(count_in).sum()
    }

    /// Calls `sample` for the points of a triangle, all but its centroid.
    pub(super) fn for_each_further(&self, triangle: usize, mut sample: impl FnMut(DVec3)) {
        if self.seen[triangle] == Seen::Nothing {
            return;
        }
        let corners = corners(self.displayed, triangle);
        let numbers = self.displayed.triangles[triangle];
        let mut left = MOST_IN_A_TRIANGLE;
        match self.view.frustum.clip(corners) {
            Clipped::Partly(polygon) => {
                let at = |w: &DVec3| corners[0] * w.x + corners[1] * w.y + corners[2] * w.z;
                let polygon: Vec<DVec3> = polygon.corners().iter().map(at).collect();
                for pair in polygon[1..].windows(2) {
                    let part = [polygon[0], pair[0], pair[1]];
                    sample((part[0] + part[1] + part[2]) / 3.0);
                    self.bisect(part, &mut left, &mut sample);
                }
            }
            _ => self.bisect(corners, &mut left, &mut sample),
        }
        for (number, corner) in numbers.into_iter().zip(corners) {
            if self.first_use[number as usize] == triangle && self.view.frustum.contains(corner) {
                sample(corner);
            }
        }
    }

    /// Samples the midpoint of the longest edge, then those of the halves' longest edges, until none is longer than
    /// the spacing; and the centroids of what is left. At most `left` pieces are looked at, which is counted down.
    fn bisect(&self, whole: [DVec3; 3], left: &mut usize, sample: &mut impl FnMut(DVec3)) {
        if self.longest_edge(whole).0 <= self.spacing {
            return;
        }
        // First in, first out: where the samples run out, they are spread evenly.
        let mut queue = VecDeque::from([whole]);
        while let Some(piece) = queue.pop_front() {
            if *left == 0 {
                return;
            }
            *left -= 1;
            let (pixels, [a, b, c]) = self.longest_edge(piece);
            if pixels > self.spacing {
                let middle = 0.5 * (a + b);
                sample(middle);
                queue.push_back([a, middle, c]);
                queue.push_back([middle, b, c]);
            } else {
                sample((a + b + c) / 3.0);
            }
        }
    }

    /// Pixels of the edge that is longest in the image, and the corners turned so that it comes first.
    fn longest_edge(&self, [a, b, c]: [DVec3; 3]) -> (f64, [DVec3; 3]) {
        let pixels = |from: DVec3, to: DVec3| {
            let length = from.distance(to);
            self.view.pixels(length, from).max(self.view.pixels(length, to))
        };
        let turned = [(pixels(a, b), [a, b, c]), (pixels(b, c), [b, c, a]), (pixels(c, a), [c, a, b])];
        turned.into_iter().fold(turned[0], |longest, edge| if edge.0 > longest.0 { edge } else { longest })
    }
}
