//! How far a displayed mesh is from the original on the screen, in pixels, measured both ways.
//!
//! As Metro does (Cignoni, Rocchini & Scopigno 1998), by sampling one surface and looking for the nearest point of
//! the other; but a distance counts by its size in the image, and only what is in view counts. A distance `s` at the
//! place `x`, seen from the eye `e` in an image of `lines` lines, is
//!
//! ```text
//! pixels = s / (tan(fov_y / 2) * |x - e|) * lines / 2
//! ```
//!
//! * *forward*: from the original vertices in view to the nearest displayed triangle: what is missing or misplaced;
//! * *reverse*: from samples of the displayed triangles to the nearest original triangle: what should not be there.
//!
//! A view-dependent mesh is coarse outside the view, and a coarse triangle may reach into it. Where the displayed
//! triangle (forward the nearest, reverse the sampled one) leaves the view, the sample belongs to the *border* and is
//! counted apart. Nothing is hidden by anything else: occluded surfaces count like visible ones.

mod in_view;
mod sample;

use rayon::prelude::*;
use std::borrow::Cow;

use collapse_log::Mesh;
use glam::DVec3;

use crate::experiment::bvh::Bvh;
use in_view::{CHUNK, Seen, View, corners, count_in_view};
use sample::Sampler;
use selection::view::Camera;

/// The near plane, as a fraction of the original's extent.
const NEAR: f64 = 1e-6;

/// How far a displayed mesh is from the original, in the image of one camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    /// Height of the image for which pixels are counted.
    pub lines: u32,
    /// Displayed triangles.
    pub triangles: usize,
    /// Displayed triangles of which any part is in view.
    pub triangles_in_view: usize,
    /// Triangles in view whose normal makes more than 90 degrees with that of the original where it is nearest to
    /// their centroid.
    pub flipped_triangles: usize,
    /// Triangles in view that have no area and thus no normal.
    pub degenerate_triangles: usize,
    /// From the original vertices in view to the displayed mesh.
    pub forward: Direction,
    /// From the displayed triangles in view to the original mesh.
    pub reverse: Direction,
}

/// The figures of one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Direction {
    /// Samples for which the displayed triangle is wholly in view.
    pub inner: Figures,
    /// Samples for which it reaches out of the view.
    pub border: Figures,
}

/// The distribution of a distance. All 0 where there are no samples; infinite where there is nothing to be near to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Figures {
    /// Number of samples.
    pub count: usize,
    /// Half of the samples are at most this far off, in pixels.
    pub median: f64,
    /// 99 % of the samples are at most this far off, in pixels.
    pub p99: f64,
    /// The largest distance, in pixels.
    pub max: f64,
    /// The sample that is so far off, in world coordinates.
    pub max_at: Option<[f64; 3]>,
}

impl Figures {
    /// The first of several largest samples is reported.
    fn new(samples: &[(f64, DVec3)]) -> Self {
        let Some(&first) = samples.first() else { return Self::default() };
        let (max, max_at) = samples.iter().fold(first, |max, &s| if s.0 > max.0 { s } else { max });
        let mut pixels: Vec<f64> = samples.iter().map(|s| s.0).collect();
        let mut quantile = |percent: usize| {
            let rank = (pixels.len() * percent).div_ceil(100) - 1;
            *pixels.select_nth_unstable_by(rank, f64::total_cmp).1
        };
        Self {
            count: samples.len(),
            median: quantile(50),
            p99: quantile(99),
            max,
            max_at: Some(max_at.to_array()),
        }
    }
}

/// The original, made ready for many measurements.
#[derive(Clone, Debug)]
pub struct Reference<'a> {
    mesh: &'a Mesh,
    bvh: Bvh,
    extent: f64,
}

/// Measures a single frame; for several, keep a [`Reference`].
#[must_use]
pub fn deviation(displayed: &Mesh, original: &Mesh, camera: &Camera, lines: u32) -> Deviation {
    Reference::new(original).deviation(displayed, camera, lines)
}

impl<'a> Reference<'a> {
    /// Builds a search structure over the triangles of the original.
    #[must_use]
    pub fn new(original: &'a Mesh) -> Self {
        Self { mesh: original, bvh: Bvh::new(original), extent: original.extent() }
    }

    /// Measures how far `displayed` is from the original, in an image of `lines` lines.
    #[must_use]
    pub fn deviation(&self, displayed: &Mesh, camera: &Camera, lines: u32) -> Deviation {
        let origin = self.mesh.georeference.origin;
        let displayed = &*self.beside(displayed);
        let view = View::new(&camera.about(origin), lines, NEAR * self.extent);
        let seen = view.all_seen(displayed);
        let mut deviation = Deviation {
            lines,
            triangles: displayed.triangles.len(),
            triangles_in_view: count_in_view(&seen),
            flipped_triangles: 0,
            degenerate_triangles: 0,
            forward: self.forward(displayed, &seen, &view),
            reverse: Direction::default(),
        };
        self.reverse(displayed, &seen, &view, &mut deviation);
        let Deviation { forward, reverse, .. } = &mut deviation;
        for figures in [&mut forward.inner, &mut forward.border, &mut reverse.inner, &mut reverse.border] {
            for (x, origin) in figures.max_at.iter_mut().flatten().zip(origin) {
                *x += origin;
            }
        }
        deviation
    }

    /// A mesh about the origin of the original.
    fn beside<'m>(&self, displayed: &'m Mesh) -> Cow<'m, Mesh> {
        let (to, from) = (&self.mesh.georeference, &displayed.georeference);
        if to.origin == from.origin {
            return Cow::Borrowed(displayed);
        }
        let positions = displayed.positions.iter().map(|&p| to.local(from.world(p)).map(|x| x as f32));
        Cow::Owned(Mesh {
            positions: positions.collect(),
            triangles: displayed.triangles.clone(),
            georeference: to.clone(),
        })
    }

    /// How many triangles of a mesh have any part in view.
    #[must_use]
    pub fn triangles_in_view(&self, displayed: &Mesh, camera: &Camera) -> usize {
        let camera = camera.about(self.mesh.georeference.origin);
        count_in_view(&View::new(&camera, 1, NEAR * self.extent).all_seen(&self.beside(displayed)))
    }

    fn forward(&self, displayed: &Mesh, seen: &[Seen], view: &View) -> Direction {
        let bvh = Bvh::new(displayed);
        let positions = &self.mesh.positions;
        let chunks = positions.par_chunks(CHUNK).map(|positions| {
            let mut samples = Samples::default();
            for position in positions {
                let point = DVec3::from(position.map(f64::from));
                if view.frustum.contains(point) {
                    let nearest = bvh.nearest(point, f64::INFINITY);
                    let distance = nearest.map_or(f64::INFINITY, |nearest| nearest.distance);
                    let inner = nearest.is_some_and(|n| seen[n.triangle as usize] == Seen::Everything);
                    samples.push(inner, view.pixels(distance, point), point);
                }
            }
            samples
        });
        Samples::figures(chunks.collect())
    }

    fn reverse(&self, displayed: &Mesh, seen: &[Seen], view: &View, deviation: &mut Deviation) {
        let sampler = Sampler::new(displayed, seen, view);
        let chunks = (0..displayed.triangles.len()).into_par_iter().chunks(CHUNK).map(|range| {
            let mut samples = Samples::default();
            let mut facing = Facing::default();
            for triangle in range {
                if seen[triangle] == Seen::Nothing {
                    continue;
                }
                let inner = seen[triangle] == Seen::Everything;
                let corners = corners(displayed, triangle);
                let mut measure = |point: DVec3| {
                    let nearest = self.bvh.nearest(point, f64::INFINITY);
                    if view.frustum.contains(point) {
                        let distance = nearest.map_or(f64::INFINITY, |nearest| nearest.distance);
                        samples.push(inner, view.pixels(distance, point), point);
                    }
                    nearest
                };
                // The centroid serves two ends: it is always looked up, and counts as a sample if it is in view.
                let below = measure((corners[0] + corners[1] + corners[2]) / 3.0);
                facing.count(normal(corners), below.map(|n| normal(self.corners(n.triangle))));
                sampler.for_each_further(triangle, |point| {
                    measure(point);
                });
            }
            (samples, facing)
        });
        let (samples, facings): (Vec<_>, Vec<_>) = chunks.unzip();
        deviation.reverse = Samples::figures(samples);
        deviation.flipped_triangles = facings.iter().map(|facing| facing.flipped).sum();
        deviation.degenerate_triangles = facings.iter().map(|facing| facing.degenerate).sum();
    }

    fn corners(&self, triangle: u32) -> [DVec3; 3] {
        corners(self.mesh, triangle as usize)
    }
}

/// Measured distances in pixels, and where.
#[derive(Default)]
struct Samples {
    inner: Vec<(f64, DVec3)>,
    border: Vec<(f64, DVec3)>,
}

impl Samples {
    fn push(&mut self, inner: bool, pixels: f64, at: DVec3) {
        let samples = if inner { &mut self.inner } else { &mut self.border };
        samples.push((pixels, at));
    }

    fn figures(chunks: Vec<Self>) -> Direction {
        let (inner, border): (Vec<_>, Vec<_>) = chunks.into_iter().map(|s| (s.inner, s.border)).unzip();
        Direction { inner: Figures::new(&inner.concat()), border: Figures::new(&border.concat()) }
    }
}

#[derive(Default)]
struct Facing {
    flipped: usize,
    degenerate: usize,
}

impl Facing {
    /// Compares two normals of any length; the original's may be missing, or zero, where nothing can be said.
    fn count(&mut self, displayed: DVec3, original: Option<DVec3>) {
        if displayed == DVec3::ZERO {
            self.degenerate += 1;
        } else if original.is_some_and(|original| displayed.dot(original) < 0.0) {
            self.flipped += 1;
        }
    }
}

/// Of twice the triangle's area in length.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

impl std::fmt::Display for Deviation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        writeln!(
            f,
            "{} triangles displayed, {} in view, {} of these flipped, {} without area; pixels of {} lines:",
            self.triangles,
            self.triangles_in_view,
            self.flipped_triangles,
            self.degenerate_triangles,
            self.lines
        )?;
        writeln!(f, "{:40} {:>9} {:>9} {:>9} {:>9}", "", "samples", "median", "99 %", "largest")?;
        for (name, figures) in [
            ("original to displayed", &self.forward.inner),
            ("displayed to original", &self.reverse.inner),
            ("original to displayed, at the border", &self.forward.border),
            ("displayed to original, at the border", &self.reverse.border),
        ] {
            writeln!(
                f,
                "{name:40} {:>9} {:>9.3} {:>9.3} {:>9.3}",
                figures.count, figures.median, figures.p99, figures.max
            )?;
        }
        Ok(())
    }
}

#[cfg(feature = "cli")]
impl Deviation {
    /// The figures as a JSON object with the names of the fields.
    #[must_use]
    pub fn to_json(&self) -> serde_json::Value {
        let figures = |f: &Figures| {
            serde_json::json!({
                "count": f.count,
                "median_pixels": f.median,
                "p99_pixels": f.p99,
                "max_pixels": f.max,
                "max_at": f.max_at,
            })
        };
        let direction =
            |d: &Direction| serde_json::json!({ "inner": figures(&d.inner), "border": figures(&d.border) });
        serde_json::json!({
            "lines": self.lines,
            "triangles": self.triangles,
            "triangles_in_view": self.triangles_in_view,
            "flipped_triangles": self.flipped_triangles,
            "degenerate_triangles": self.degenerate_triangles,
            "forward": direction(&self.forward),
            "reverse": direction(&self.reverse),
        })
    }
}

#[cfg(test)]
mod tests;
