//! Fills triangles and draws lines, in horizontal bands that are independent of each other.
//!
//! By hand: the same input has to give the same bits, and these depend on the order of every operation.

use super::image::Image;
use super::projection::{Corner, Projection, SAMPLES};
use rayon::prelude::*;

/// Rows of pixels in a band.
const BAND: u32 = 16;
/// The background, at the top and at the bottom.
const SKY: [Colour; 2] = [Colour::new(0xfd, 0xfd, 0xfd), Colour::new(0xe9, 0xed, 0xf2)];
/// Wires darken the surface down to this colour.
const WIRE: Colour = Colour::new(0x25, 0x30, 0x40);
/// How far a wire reaches to either side of an edge, in samples.
const WIRE_REACH: f64 = 0.9;
/// Opacity of the wires of a triangle so low that they would cover it, and of one high enough to show them.
const WIRE_OPACITY: [f64; 2] = [0.10, 0.62];
/// The heights of such triangles, in samples.
const WIRE_HEIGHTS: [f64; 2] = [4.0, 26.0];
/// Half the width of a line, in samples.
const LINE_REACH: f64 = 1.7;
/// Opacity of a line where it is behind a surface.
const HIDDEN_LINE: f32 = 0.22;
/// Lines that lie in a surface count as in front of it.
const LINE_BIAS: f64 = 1.002;

/// An opaque colour. Light is added up in squares of sRGB values: close to linear light, and the square root back is
/// exact on every machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Colour([f32; 3]);

impl Colour {
    pub(super) const fn new(red: u8, green: u8, blue: u8) -> Self {
        const fn square(v: u8) -> f32 {
            let v = v as f32 / 255.0;
            v * v
        }
        Self([square(red), square(green), square(blue)])
    }

    fn scaled(self, factor: f32) -> Self {
        Self(self.0.map(|v| v * factor))
    }

    fn mixed(self, other: Self, share: f32) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + (other.0[i] - self.0[i]) * share))
    }
}

/// An opaque triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    pub(super) corners: [Corner; 3],
    /// At each corner.
    pub(super) brightness: [f32; 3],
    pub(super) colour: Colour,
    /// Whether the edge opposite to each corner is to be drawn as a wire.
    pub(super) wired: [bool; 3],
}

/// A translucent triangle, hidden by facets in front of it. All veils over a sample should have one colour: they are
/// not sorted by depth.
pub(super) struct Veil {
    pub(super) corners: [Corner; 3],
    pub(super) colour: Colour,
    pub(super) opacity: f32,
}

/// A straight line, faint where it is hidden.
pub(super) struct Line {
    pub(super) ends: [Corner; 2],
    pub(super) colour: Colour,
}

/// All that is in a picture.
pub(super) struct Scene {
    pub(super) facets: Vec<Facet>,
    pub(super) veils: Vec<Veil>,
    pub(super) lines: Vec<Line>,
    pub(super) wires: bool,
}

impl Scene {
    pub(super) fn draw(&self, projection: &Projection) -> Image {
        let (width, height) = (projection.width, projection.height);
        let bands = height.div_ceil(BAND);
        let mut facets_of_band = vec![Vec::new(); bands as usize];
        let band_at = |y: f64| (y / f64::from(BAND * SAMPLES)).clamp(0.0, f64::from(bands - 1)) as usize;
        for (number, facet) in (0u32..).zip(&self.facets) {
            let (top, bottom) = extent(facet.corners.map(|c| c.y));
            for band in &mut facets_of_band[band_at(top)..=band_at(bottom)] {
                band.push(number);
            }
        }
        let rows = facets_of_band.into_par_iter().zip(0..bands).map(|(facets, band)| {
            let mut band = Band::new(width, height, band * BAND);
            for facet in facets {
                band.fill_facet(&self.facets[facet as usize], self.wires);
            }
            for veil in &self.veils {
                band.fill_veil(veil);
            }
            for line in &self.lines {
                band.draw_line(line);
            }
            band.resolve()
        });
        Image { width, height, rgb: rows.collect::<Vec<_>>().concat() }
    }
}

/// Colour and depth of the samples of a few rows.
struct Band {
    /// In samples.
    width: usize,
    /// The first row, in samples from the top of the picture.
    top: usize,
    rows: usize,
    colours: Vec<Colour>,
    inverse_depths: Vec<f32>,
}

impl Band {
    /// The rows of pixels from `top` on, with nothing drawn yet.
    fn new(width: u32, height: u32, top: u32) -> Self {
        let samples = |pixels: u32| (pixels * SAMPLES) as usize;
        let (width, rows) = (samples(width), samples(BAND.min(height - top)));
        let (top, height) = (samples(top), samples(height));
        let sky = |row: usize| SKY[0].mixed(SKY[1], (top + row) as f32 / height as f32);
        let colours = (0..rows).flat_map(|row| std::iter::repeat_n(sky(row), width)).collect();
        Self { width, top, rows, colours, inverse_depths: vec![0.0; rows * width] }
    }

    fn fill_facet(&mut self, facet: &Facet, wires: bool) {
        let Some(edges) = Edges::new(&facet.corners) else { return };
        let wired = facet.wired.map(|wired| wired && wires);
        let wire_opacity = edges.wire_opacity();
        let [i0, i1, i2] = facet.corners.map(|c| c.inverse_depth);
        let [b0, b1, b2] = facet.brightness;
        self.for_each_sample(&edges, |colour, inverse_depth, [w0, w1, w2]| {
            let sample_depth = (i0 * w0 + i1 * w1 + i2 * w2) as f32;
            if sample_depth <= *inverse_depth {
                return;
            }
            *inverse_depth = sample_depth;
            *colour = facet.colour.scaled(b0 * w0 as f32 + b1 * w1 as f32 + b2 * w2 as f32);
            let heights = edges.heights;
            let mut nearest = f64::INFINITY;
            for (distance, wired) in
                [w0 * heights[0], w1 * heights[1], w2 * heights[2]].into_iter().zip(wired)
            {
                if wired && distance < nearest {
                    nearest = distance;
                }
            }
            let coverage = (WIRE_REACH + 0.5 - nearest).clamp(0.0, 1.0);
            if coverage > 0.0 {
                *colour = colour.mixed(WIRE, (coverage * wire_opacity) as f32);
            }
        });
    }

    fn fill_veil(&mut self, veil: &Veil) {
        let Some(edges) = Edges::new(&veil.corners) else { return };
        let [i0, i1, i2] = veil.corners.map(|c| c.inverse_depth);
        self.for_each_sample(&edges, |colour, inverse_depth, [w0, w1, w2]| {
            if (i0 * w0 + i1 * w1 + i2 * w2) as f32 > *inverse_depth {
                *colour = colour.mixed(veil.colour, veil.opacity);
            }
        });
    }

    /// Calls `fill` with colour, inverse depth and barycentric coordinates of each sample in a triangle. Samples on
    /// an edge are in the triangles on both sides.
    fn for_each_sample(&mut self, edges: &Edges, mut fill: impl FnMut(&mut Colour, &mut f32, [f64; 3])) {
        for y in self.rows_between(edges.top, edges.bottom) {
            let row = (y - self.top) * self.width;
            let Some((start, values)) = edges.row(y, self.width) else { continue };
            let mut values = values;
            let colours = &mut self.colours[row..][start.clone()];
            let inverse_depths = &mut self.inverse_depths[row..][start];
            for (colour, inverse_depth) in colours.iter_mut().zip(inverse_depths) {
                if values[0] >= 0.0 && values[1] >= 0.0 && values[2] >= 0.0 {
                    fill(colour, inverse_depth, values.map(|v| v * edges.inverse_area));
                }
                for (value, slope) in values.iter_mut().zip(edges.slopes) {
                    *value += slope.0;
                }
            }
        }
    }

    fn draw_line(&mut self, line: &Line) {
        let [from, to] = line.ends;
        let (dx, dy) = (to.x - from.x, to.y - from.y);
        let length_squared = dx * dx + dy * dy;
        let reach = LINE_REACH + 0.5;
        let (top, bottom) = extent([from.y, to.y]);
        for y in self.rows_between(top - reach, bottom + reach) {
            let center_y = y as f64 + 0.5;
            // Where along the line, from 0 to 1, it is close enough to this row.
            let along = |y: f64| if dy == 0.0 { 0.0 } else { ((y - from.y) / dy).clamp(0.0, 1.0) };
            let ends =
                if dy == 0.0 { [0.0, 1.0] } else { [along(center_y - reach), along(center_y + reach)] };
            let (left, right) = extent(ends.map(|t| from.x + dx * t));
            for x in samples_between(left - reach, right + reach, self.width) {
                let center_x = x as f64 + 0.5;
                let t = ((center_x - from.x) * dx + (center_y - from.y) * dy) / length_squared;
                let t = if length_squared > 0.0 { t.clamp(0.0, 1.0) } else { 0.0 };
                let distance = (center_x - from.x - dx * t).hypot(center_y - from.y - dy * t);
                let coverage = (reach - distance).clamp(0.0, 1.0) as f32;
                let inverse_depth = from.inverse_depth + (to.inverse_depth - from.inverse_depth) * t;
                let sample = (y - self.top) * self.width + x;
                let hidden = inverse_depth * LINE_BIAS < f64::from(self.inverse_depths[sample]);
                let opacity = coverage * if hidden { HIDDEN_LINE } else { 1.0 };
                self.colours[sample] = self.colours[sample].mixed(line.colour, opacity);
            }
        }
    }

    /// The rows of this band, in samples from the top of the picture, whose centres lie between two heights.
    fn rows_between(&self, top: f64, bottom: f64) -> std::ops::Range<usize> {
        let rows = samples_between(top - self.top as f64, bottom - self.top as f64, self.rows);
        rows.start + self.top..rows.end + self.top
    }

    /// Averages the samples of each pixel.
    fn resolve(&self) -> Vec<u8> {
        let side = SAMPLES as usize;
        let mut rgb = Vec::with_capacity(3 * self.colours.len() / (side * side));
        for rows in self.colours.chunks_exact(side * self.width) {
            for x in (0..self.width).step_by(side) {
                let mut sum = [0.0; 3];
                for row in rows.chunks_exact(self.width) {
                    for colour in &row[x..x + side] {
                        for (sum, value) in sum.iter_mut().zip(colour.0) {
                            *sum += value;
                        }
                    }
                }
                rgb.extend(sum.map(|v| (255.0 * (v / (side * side) as f32).sqrt()).round() as u8));
            }
        }
        rgb
    }
}

/// The edge functions of a triangle: for each corner one that is 0 on the opposite edge, and twice the area (in
/// square samples) at the corner.
struct Edges {
    top: f64,
    bottom: f64,
    left: f64,
    right: f64,
    /// A point on each edge.
    origins: [Corner; 3],
    /// Change of each function from a sample to the next one to the right, and to the next below.
    slopes: [(f64, f64); 3],
    inverse_area: f64,
    /// Height of each corner over its edge, in samples.
    heights: [f64; 3],
}

impl Edges {
    /// Of a triangle of either orientation; `None` if it has no area.
    fn new(corners: &[Corner; 3]) -> Option<Self> {
        let [a, b, c] = *corners;
        let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if area == 0.0 {
            return None;
        }
        let opposite = [(b, c), (c, a), (a, b)];
        let slopes =
            opposite.map(|(from, to)| ((from.y - to.y) * area.signum(), (to.x - from.x) * area.signum()));
        let (top, bottom) = extent(corners.map(|c| c.y));
        let (left, right) = extent(corners.map(|c| c.x));
        Some(Self {
            top,
            bottom,
            left,
            right,
            origins: opposite.map(|(from, _)| from),
            slopes,
            inverse_area: 1.0 / area.abs(),
            heights: slopes.map(|(dx, dy)| area.abs() / dx.hypot(dy)),
        })
    }

    /// The samples of row `y` that may be in the triangle, and the functions at the first of them.
    fn row(&self, y: usize, width: usize) -> Option<(std::ops::Range<usize>, [f64; 3])> {
        let center_y = y as f64 + 0.5;
        let at = |i: usize, x: f64| {
            (x - self.origins[i].x) * self.slopes[i].0 + (center_y - self.origins[i].y) * self.slopes[i].1
        };
        let (mut left, mut right) = (self.left, self.right);
        for i in 0..3 {
            // Where the function is 0 in this row; one sample more, as the quotient is rounded.
            let (dx, zero) = (self.slopes[i].0, -at(i, 0.0) / self.slopes[i].0);
            if dx > 0.0 {
                left = left.max(zero - 1.0);
            } else if dx < 0.0 {
                right = right.min(zero + 1.0);
            }
        }
        let samples = samples_between(left, right, width);
        let first = samples.start as f64 + 0.5;
        (!samples.is_empty()).then(|| (samples, [0, 1, 2].map(|i| at(i, first))))
    }

    /// Wires that would cover a low triangle are faint.
    fn wire_opacity(&self) -> f64 {
        let height = self.heights[0].min(self.heights[1]).min(self.heights[2]);
        let share = ((height - WIRE_HEIGHTS[0]) / (WIRE_HEIGHTS[1] - WIRE_HEIGHTS[0])).clamp(0.0, 1.0);
        WIRE_OPACITY[0] + (WIRE_OPACITY[1] - WIRE_OPACITY[0]) * share
    }
}

/// The samples, out of `count` whose centres are at 0.5, 1.5, …, that lie between two places.
fn samples_between(from: f64, to: f64, count: usize) -> std::ops::Range<usize> {
    // The conversion makes 0 of negative numbers and of those that are none.
    let start = ((from - 0.5).ceil() as usize).min(count);
    let end = (to + 0.5).floor() as usize;
    start..end.clamp(start, count)
}

fn extent<const N: usize>(values: [f64; N]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &v| (lo.min(v), hi.max(v)))
}
