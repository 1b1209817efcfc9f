//! A building as a closed solid: walls cut in bays and storeys, a floor and a roof.

use collapse_log::Mesh;
use glam::{DVec2, DVec3};

use super::height_field::HeightField;

/// A roof, with its rise above the eaves in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Roof {
    /// To a point over the middle of the footprint; flat when `rise` is 0.
    Pyramid { rise: f64 },
    /// Over a footprint of four corners: a ridge from the middle of side 1 to that of side 3, drawn in at each end by
    /// `hip` of its length, 0 for upright gables, less than a half.
    Ridged { rise: f64, hip: f64 },
}

/// A building on a convex footprint, counter-clockwise, side 0 along the street.
#[derive(Clone, Debug)]
pub(crate) struct Building {
    pub footprint: Vec<DVec2>,
    /// Absolute heights of the floor and of the eaves.
    pub base: f64,
    pub eave: f64,
    pub storeys: u32,
    pub roof: Roof,
}

/// Metres by which windows lie behind the wall, where the tessellation is fine enough to show them.
const WINDOW: f64 = 0.25;
/// Walls are cut into bays about this wide, in metres.
const BAY: f64 = 26.0;

impl Building {
    /// Whether the footprint is convex, counter-clockwise and large enough to be a house.
    pub(crate) fn is_sound(&self) -> bool {
        let corners = &self.footprint;
        let n = corners.len();
        let convex = (0..n).all(|i| {
            let (a, b, c) = (corners[i], corners[(i + 1) % n], corners[(i + 2) % n]);
            (b - a).perp_dot(c - b) > 0.0 && a.distance(b) > 4.0
        });
        let area: f64 = (0..n).map(|i| corners[i].perp_dot(corners[(i + 1) % n])).sum();
        n >= 3 && convex && 0.5 * area > 30.0
    }

    /// Height of the roof over a point, or `None` beside the building.
    pub(crate) fn height(&self, p: DVec2) -> Option<f64> {
        let n = self.footprint.len();
        let centre = self.centre();
        // Distance from each side, as part of what the middle of the footprint has, or of both sides together.
        let inside = |i: usize, q: DVec2| {
            let (a, b) = (self.footprint[i], self.footprint[(i + 1) % n]);
            (b - a).perp_dot(q - a) / (b - a).length()
        };
        if (0..n).any(|i| inside(i, p) < 0.0) {
            return None;
        }
        Some(match self.roof {
            Roof::Pyramid { rise } => {
                self.eave + rise * (0..n).map(|i| inside(i, p) / inside(i, centre)).fold(1.0, f64::min)
            }
            Roof::Ridged { rise, hip } => {
                let part = |i: usize, j: usize| inside(i, p) / (inside(i, p) + inside(j, p)).max(1e-9);
                let (across, along) = (part(0, 2), part(1, 3));
                let slope = 2.0 * across.min(1.0 - across);
                let end = if hip > 0.0 { along.min(1.0 - along) / hip } else { 1.0 };
                self.eave + rise * slope.min(end)
            }
        })
    }

    /// Lifts the samples of a height field below the roof up to it; `(column, row)` looks `beside` its place.
    pub(crate) fn raise(&self, field: &mut HeightField, beside: impl Fn(usize, usize) -> DVec2) {
        let (low, high) =
            self.footprint.iter().fold((DVec2::MAX, DVec2::MIN), |(low, high), &p| (low.min(p), high.max(p)));
        for row in field.span(1, low.y - 1.0, high.y + 1.0) {
            for column in field.span(0, low.x - 1.0, high.x + 1.0) {
                let p = field.sample(column, row).truncate() + beside(column, row);
                if let Some(height) = self.height(p) {
                    field.raise_to(column, row, height);
                }
            }
        }
    }

    fn centre(&self) -> DVec2 {
        self.footprint.iter().sum::<DVec2>() / self.footprint.len() as f64
    }

    /// Appends the solid, each bay and storey cut in `scale` x `scale`. Bays of opposite sides are as many, so that
    /// eaves and ridge share their vertices and the solid is closed.
    pub(crate) fn append(&self, scale: usize, mesh: &mut Mesh) {
        let sides = self.footprint.len();
        let length = |i: usize| self.footprint[i].distance(self.footprint[(i + 1) % sides]);
        let bays = |i: usize| (length(i).max(length((i + 2) % sides)) / BAY).floor().max(1.0) as usize;
        let cuts: Vec<usize> = (0..sides).map(|i| scale * if sides == 4 { bays(i) } else { 1 }).collect();
        let levels = self.storeys as usize * scale;
        let rings: Vec<Vec<u32>> = (0..=levels).map(|level| self.ring(level, scale, &cuts, mesh)).collect();
        for pair in rings.windows(2) {
            strip(&pair[0], &pair[1], true, mesh);
        }
        let floor = push(mesh, self.centre().extend(self.base));
        fan(floor, &rings[0], true, false, mesh);
        self.roof(&rings[levels], &cuts, scale, mesh);
    }

    /// The vertices around the building at one level, from corner 0 on.
    fn ring(&self, level: usize, scale: usize, cuts: &[usize], mesh: &mut Mesh) -> Vec<u32> {
        let sides = self.footprint.len();
        let height =
            self.base + (self.eave - self.base) * level as f64 / (self.storeys as usize * scale) as f64;
        let mut ring = Vec::with_capacity(cuts.iter().sum());
        for side in 0..sides {
            let (a, b) = (self.footprint[side], self.footprint[(side + 1) % sides]);
            let inward = (b - a).perp() / a.distance(b);
            for step in 0..cuts[side] {
                let window = in_window(step % scale, scale) && in_window(level % scale, scale);
                let depth = if window { WINDOW } else { 0.0 };
                let p = a.lerp(b, step as f64 / cuts[side] as f64) + inward * depth;
                ring.push(push(mesh, p.extend(height)));
            }
        }
        ring
    }

    fn roof(&self, eaves: &[u32], cuts: &[usize], scale: usize, mesh: &mut Mesh) {
        match self.roof {
            Roof::Pyramid { rise } => {
                let apex = self.centre().extend(self.eave + rise);
                let mut ring = eaves.to_vec();
                for row in 1..scale {
                    let upper: Vec<u32> = eaves.iter().map(|&v| between(mesh, v, apex, row, scale)).collect();
                    strip(&ring, &upper, true, mesh);
                    ring = upper;
                }
                let apex = push(mesh, apex);
                fan(apex, &ring, true, true, mesh);
            }
            Roof::Ridged { rise, hip } => {
                let [a, b, c, d] = [0, 1, 2, 3].map(|i| self.footprint[i].extend(self.eave + rise));
                let (right, left) = (b.midpoint(c), d.midpoint(a));
                let (from, to) = (left.lerp(right, hip), right.lerp(left, hip));
                let corner: Vec<usize> = (0..=4).map(|i| cuts[..i].iter().sum()).collect();
                let front = &eaves[..=corner[1]];
                let mut back: Vec<u32> = eaves[corner[2]..=corner[3]].to_vec();
                back.reverse();
                let ridge: Vec<u32> =
                    (0..front.len()).map(|i| push(mesh, from.lerp(to, i as f64 / cuts[0] as f64))).collect();
                let front_rows = slope(front, &ridge, scale, mesh, true);
                let back_rows = slope(&back, &ridge, scale, mesh, false);
                // Gables (or hips) close the ends between the first and the last vertices of all rows.
                let last = front.len() - 1;
                let mut right_eave = eaves[corner[1]..=corner[2]].to_vec();
                let mut left_eave = eaves[corner[3]..].to_vec();
                left_eave.push(eaves[0]);
                gable(&mut right_eave, &front_rows, &back_rows, last, mesh);
                gable(&mut left_eave, &back_rows, &front_rows, 0, mesh);
            }
        }
    }
}

/// Rows of vertices from the eaves to the ridge, both included, and the triangles between them.
fn slope(eaves: &[u32], ridge: &[u32], rows: usize, mesh: &mut Mesh, is_front: bool) -> Vec<Vec<u32>> {
    let mut all = vec![eaves.to_vec()];
    for row in 1..rows {
        let inner = eaves.iter().zip(ridge).map(|(&low, &high)| {
            let top = position(mesh, high);
            between(mesh, low, top, row, rows)
        });
        let inner = inner.collect();
        all.push(inner);
    }
    all.push(ridge.to_vec());
    for pair in all.windows(2) {
        if is_front { strip(&pair[0], &pair[1], false, mesh) } else { strip(&pair[1], &pair[0], false, mesh) }
    }
    all
}

/// Closes the triangle over one short side of a ridged roof: `eave` runs from the foot of the `first` slope to that of
/// the `second`; column `column` of both slopes' rows are its other two edges.
fn gable(eave: &mut [u32], first: &[Vec<u32>], second: &[Vec<u32>], column: usize, mesh: &mut Mesh) {
    let rows = first.len() - 1;
    let mut lower = eave.to_vec();
    for row in 1..rows {
        let (a, b) = (first[row][column], second[row][column]);
        let (from, to) = (position(mesh, a), position(mesh, b));
        let steps = lower.len() - 1;
        let mut upper = vec![a];
        upper.extend((1..steps).map(|i| push(mesh, from.lerp(to, i as f64 / steps as f64))));
        upper.push(b);
        strip(&lower, &upper, false, mesh);
        lower = upper;
    }
    fan(first[rows][column], &lower, false, true, mesh);
}

/// Whether step `i` of `scale` within a bay or a storey belongs to the window.
fn in_window(i: usize, scale: usize) -> bool {
    10 * i >= 4 * scale && 10 * i <= 8 * scale
}

fn push(mesh: &mut Mesh, p: DVec3) -> u32 {
    mesh.positions.push(p.as_vec3().to_array());
    (mesh.positions.len() - 1) as u32
}

fn position(mesh: &Mesh, vertex: u32) -> DVec3 {
    DVec3::from_array(mesh.positions[vertex as usize].map(f64::from))
}

fn between(mesh: &mut Mesh, low: u32, high: DVec3, row: usize, rows: usize) -> u32 {
    let low = position(mesh, low);
    push(mesh, low.lerp(high, row as f64 / rows as f64))
}

/// Triangles between two chains of vertices, the upper one to the left of the lower one's sense.
fn strip(lower: &[u32], upper: &[u32], closed: bool, mesh: &mut Mesh) {
    let n = lower.len();
    for i in 0..if closed { n } else { n - 1 } {
        let (a, b, c, d) = (lower[i], lower[(i + 1) % n], upper[(i + 1) % n], upper[i]);
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
}

/// Triangles between a chain and a point: to its left when `up`, else seen from the other side.
fn fan(apex: u32, chain: &[u32], closed: bool, up: bool, mesh: &mut Mesh) {
    let n = chain.len();
    for i in 0..if closed { n } else { n - 1 } {
        let (a, b) = (chain[i], chain[(i + 1) % n]);
        mesh.triangles.push(if up { [a, b, apex] } else { [b, a, apex] });
    }
}
