//! `scene:alps`: 52 km of alpine relief.
//!
//! A mountain range lifted by a noisy uplift and worn down by rivers until the two nearly balance: the stream power
//! law with the implicit solution of Braun & Willett (2013), "A very efficient O(n), implicit and parallel method to
//! solve the stream power equation", used for terrain synthesis as by Cordonnier et al. (2016), "Large scale terrain
//! generation from tectonic uplift and fluvial erosion". Ridged noise (Musgrave 1994) seeds the ridges and gives the
//! rock its roughness. Valley floors are levelled by height above the nearest river, as gravel and lakes do.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::height_field::HeightField;
use super::noise::{fractal, gradient, mix_linear, ridged, smooth_step, white};
use construction::progress::Progress;

const SEED: u64 = 0xa195_0001;
/// Cells along a side at scale 1: 512 x 512 x 2 = 524,288 triangles, the count of the terrain in Zach & Karner (2003).
const CELLS: usize = 512;
/// Metres between samples at scale 1: with the relief below, the bounding box has the diagonal 73,704.
const SPACING: f64 = 101.682;
const LOWEST: f64 = 460.0;
const HIGHEST: f64 = 3840.0;
/// Cells simulated around the scene, so that rivers leave it in valleys and not over a cliff.
const MARGIN: usize = 64;
/// (how many times coarser than the scene, steps of erosion): large valleys first, cheaply.
const STAGES: [(usize, usize); 3] = [(4, 120), (2, 36), (1, 9)];

/// Heights at `scale` times the samples a side. Every sample of scale 1 is also a sample of each larger scale.
pub(crate) fn heights(scale: usize, progress: Progress) -> HeightField {
    let base = eroded(progress);
    let origin = [-0.5 * CELLS as f64 * SPACING; 2];
    HeightField::from_fn(CELLS * scale + 1, SPACING / scale as f64, origin, |column, row| {
        detailed(&base, column as f64 / scale as f64, row as f64 / scale as f64)
    })
}

/// Catmull-Rom surface through the samples of scale 1, roughened by noise that vanishes at those samples.
fn detailed(base: &[f64], x: f64, y: f64) -> f64 {
    let (column, row) = (x.floor(), y.floor());
    let (u, v) = (x - column, y - row);
    let last = CELLS as i64;
    let at = |i: i64, j: i64| {
        base[(row as i64 + j).clamp(0, last) as usize * (CELLS + 1)
            + (column as i64 + i).clamp(0, last) as usize]
    };
    let along_x = |j: i64| catmull_rom(at(-1, j), at(0, j), at(1, j), at(2, j), u);
    let smooth = catmull_rom(along_x(-1), along_x(0), along_x(1), along_x(2), v);
    let steepness = ((at(1, 0) - at(0, 0)).abs() + (at(0, 1) - at(0, 0)).abs()) / SPACING;
    let rough = 14.0 * smooth_step(0.05, 1.2, steepness);
    let detail = (0..4).map(|octave| {
        let frequency = f64::from(1 << octave);
        gradient(SEED + 40 + octave, x * frequency, y * frequency) / frequency
    });
    smooth + rough * detail.sum::<f64>()
}

fn catmull_rom(a: f64, b: f64, c: f64, d: f64, t: f64) -> f64 {
    let slope_b = 0.5 * (c - a);
    let slope_c = 0.5 * (d - b);
    b + t
        * (slope_b + t * (3.0 * (c - b) - 2.0 * slope_b - slope_c + t * (2.0 * (b - c) + slope_b + slope_c)))
}

/// The samples of scale 1, from [`LOWEST`] to [`HIGHEST`].
fn eroded(progress: Progress) -> Vec<f64> {
    let work: u64 = STAGES.iter().map(|&(coarser, steps)| (steps * 16 / (coarser * coarser)) as u64).sum();
    let mut done = 0;
    let mut land = Landscape::seeded(STAGES[0].0);
    for (coarser, steps) in STAGES {
        while land.coarser > coarser {
            land = land.refined();
        }
        let mut rivers = land.rivers();
        for step in 0..steps {
            // Rivers seldom move: looking for them is the slow part, so every third step must do.
            if step % 3 == 2 {
                rivers = land.rivers();
            }
            land.erode(&rivers);
            land.creep();
            done += 16 / (coarser * coarser) as u64;
            progress(done.min(work), work);
        }
    }
    let rivers = land.rivers();
    land.level_valleys(&rivers);
    land.roughen();
    let (low, high) = land.scene().fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(h), high.max(h)));
    land.scene().map(|h| LOWEST + (HIGHEST - LOWEST) * ((h - low) / (high - low))).collect()
}

/// Heights of scene and margin, in metres above the foreland, never negative.
struct Landscape {
    coarser: usize,
    side: usize,
    /// Metres between samples.
    spacing: f64,
    heights: Vec<f64>,
}

/// Where water runs: every cell towards the border of the grid.
struct Rivers {
    /// Cells such that each comes after the one it drains to.
    downstream_first: Vec<u32>,
    /// The neighbour that a cell drains to; itself on the border.
    receiver: Vec<u32>,
    /// Square metres that drain through each cell.
    area: Vec<f64>,
}

impl Landscape {
    fn seeded(coarser: usize) -> Self {
        let side = (CELLS + 2 * MARGIN) / coarser + 1;
        let mut land =
            Self { coarser, side, spacing: SPACING * coarser as f64, heights: vec![0.0; side * side] };
        for cell in 0..side * side {
            let (x, y) = land.kilometres(cell);
            land.heights[cell] = 500.0 * uplift(x, y) + 250.0 * ridged(SEED, x / 14.0, y / 14.0, 6);
        }
        land
    }

    /// Position of a cell in kilometres from the corner of the simulated square.
    fn kilometres(&self, cell: usize) -> (f64, f64) {
        let scale = self.spacing / 1000.0;
        ((cell % self.side) as f64 * scale, (cell / self.side) as f64 * scale)
    }

    fn on_border(&self, cell: usize) -> bool {
        let (column, row) = (cell % self.side, cell / self.side);
        column == 0 || row == 0 || column == self.side - 1 || row == self.side - 1
    }

    /// Twice the samples a side, with a little noise between the old ones for new brooks to start from.
    fn refined(&self) -> Self {
        let side = 2 * self.side - 1;
        let mut finer = Self {
            coarser: self.coarser / 2,
            side,
            spacing: self.spacing / 2.0,
            heights: vec![0.0; side * side],
        };
        for row in 0..side {
            for column in 0..side {
                let at = |dx: usize, dy: usize| self.heights[(row / 2 + dy) * self.side + column / 2 + dx];
                let (odd_x, odd_y) = (column % 2, row % 2);
                let mean = (at(0, 0) + at(odd_x, 0) + at(0, odd_y) + at(odd_x, odd_y)) / 4.0;
                let noise = gradient(SEED + 20, column as f64 * 0.5, row as f64 * 0.5);
                finer.heights[row * side + column] = (mean + 0.25 * finer.spacing * noise).max(0.0);
            }
        }
        finer
    }

    /// Priority flood (Barnes et al. 2014): cells are taken from the border inwards, lowest first, so that every
    /// hollow overflows at its lowest rim. A cell drains to its steepest neighbour among those taken before it.
    fn rivers(&self) -> Rivers {
        let cells = self.side * self.side;
        let mut rivers = Rivers {
            downstream_first: Vec::with_capacity(cells),
            receiver: (0..cells as u32).collect(),
            area: vec![self.spacing * self.spacing; cells],
        };
        // Heights are never negative, so their bit patterns sort as they do.
        let mut flood = BinaryHeap::with_capacity(cells);
        let mut reached = vec![false; cells];
        let mut taken = vec![false; cells];
        for cell in (0..cells).filter(|&cell| self.on_border(cell)) {
            reached[cell] = true;
            flood.push(Reverse((self.heights[cell].to_bits(), cell as u32)));
        }
        while let Some(Reverse((level, cell))) = flood.pop() {
            let here = cell as usize;
            let mut steepest = 0.0;
            taken[here] = true;
            rivers.downstream_first.push(cell);
            if self.on_border(here) {
                for (next, _) in self.neighbours(here).filter(|&(next, _)| !self.on_border(next)) {
                    if !reached[next] {
                        reached[next] = true;
                        rivers.receiver[next] = cell;
                        flood.push(Reverse((level.max(self.heights[next].to_bits()), next as u32)));
                    }
                }
                continue;
            }
            for (next, distance) in self.neighbours(here) {
                if taken[next] {
                    // The grid knows eight directions; chance among nearly equal ones lets brooks run in between.
                    let chance = 1.0 + 0.45 * white(SEED + 15, next as i64, here as i64);
                    let slope = chance * (self.heights[here] - self.heights[next]) / distance;
                    if slope > steepest {
                        steepest = slope;
                        rivers.receiver[here] = next as u32;
                    }
                } else if !reached[next] {
                    reached[next] = true;
                    rivers.receiver[next] = cell;
                    flood.push(Reverse((level.max(self.heights[next].to_bits()), next as u32)));
                }
            }
        }
        for &cell in rivers.downstream_first.iter().rev() {
            let (cell, receiver) = (cell as usize, rivers.receiver[cell as usize] as usize);
            if receiver != cell {
                rivers.area[receiver] += rivers.area[cell];
            }
        }
        rivers
    }

    /// The up to eight neighbours of a cell and their distances in metres.
    fn neighbours(&self, cell: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (column, row) = ((cell % self.side) as i64, (cell / self.side) as i64);
        let last = self.side as i64 - 1;
        const AROUND: [(i64, i64); 8] =
            [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        AROUND.iter().filter_map(move |&(dx, dy)| {
            let (x, y) = (column + dx, row + dy);
            let inside = (0..=last).contains(&x) && (0..=last).contains(&y);
            let distance =
                if dx != 0 && dy != 0 { self.spacing * std::f64::consts::SQRT_2 } else { self.spacing };
            inside.then_some(((y * (last + 1) + x) as usize, distance))
        })
    }

    /// One step of uplift and erosion.
    ///
    /// dh/dt = u - k sqrt(A) (h - h_r) / s, for a cell that drains area A to its receiver r at distance s. Implicit in
    /// time and solved from the outlets upstream, where h_r is already known: with f = k sqrt(A) dt / s,
    /// h' = (h + u dt + f h_r') / (1 + f). Rock steeper than it can stand falls at once.
    fn erode(&mut self, rivers: &Rivers) {
        const UPLIFT: f64 = 30.0;
        const ERODIBILITY: f64 = 0.16;
        for &cell in &rivers.downstream_first {
            let (cell, receiver) = (cell as usize, rivers.receiver[cell as usize] as usize);
            if cell == receiver {
                continue;
            }
            let (x, y) = self.kilometres(cell);
            let straight = cell.abs_diff(receiver) == 1 || cell.abs_diff(receiver) == self.side;
            let distance = if straight { self.spacing } else { self.spacing * std::f64::consts::SQRT_2 };
            let hardness = 1.0 + 0.5 * gradient(SEED + 30, x / 5.0, y / 5.0);
            let wear = ERODIBILITY / hardness * rivers.area[cell].sqrt() / distance;
            let below = self.heights[receiver];
            let worn = (self.heights[cell] + UPLIFT * uplift(x, y) + wear * below) / (1.0 + wear);
            self.heights[cell] = worn.min(below + 0.75 * hardness * distance).max(0.0);
        }
    }

    /// Soil and scree creep downhill: one explicit step of diffusion, which rounds spurs too small for a brook.
    fn creep(&mut self) {
        const RATE: f64 = 0.12;
        let old = self.heights.clone();
        for row in 1..self.side - 1 {
            for column in 1..self.side - 1 {
                let cell = row * self.side + column;
                let around = old[cell - 1] + old[cell + 1] + old[cell - self.side] + old[cell + self.side];
                self.heights[cell] = old[cell] + RATE * (around - 4.0 * old[cell]);
            }
        }
    }

    /// Gravel fills valleys: the height above the river that a cell drains to, a, becomes
    /// a^3 / (a^2 + depth^2), nearly 0 close to the river's level and nearly unchanged high above it. Large rivers have filled deeper.
    fn level_valleys(&mut self, rivers: &Rivers) {
        const RIVER: f64 = 6.0e6;
        let mut river_level = vec![0.0; self.heights.len()];
        let mut river_area = vec![0.0; self.heights.len()];
        for &cell in &rivers.downstream_first {
            let (cell, receiver) = (cell as usize, rivers.receiver[cell as usize] as usize);
            let is_river = rivers.area[cell] > RIVER || cell == receiver;
            river_level[cell] = if is_river { self.heights[cell] } else { river_level[receiver] };
            river_area[cell] = if is_river { rivers.area[cell] } else { river_area[receiver] };
        }
        for cell in 0..self.heights.len() {
            let above = (self.heights[cell] - river_level[cell]).max(0.0);
            let depth = (0.03 * river_area[cell].sqrt()).min(190.0);
            self.heights[cell] = river_level[cell] + above * above * above / (above * above + depth * depth);
        }
    }

    /// Crags on some mountains and not on others, none on valley floors.
    fn roughen(&mut self) {
        let slopes: Vec<f64> = (0..self.heights.len())
            .map(|cell| {
                let drop = |(next, distance): (usize, f64)| {
                    (self.heights[cell] - self.heights[next]).abs() / distance
                };
                self.neighbours(cell).map(drop).sum::<f64>() / 8.0
            })
            .collect();
        for cell in 0..self.heights.len() {
            let (x, y) = self.kilometres(cell);
            let craggy = smooth_step(-0.3, 0.6, fractal(SEED + 50, x / 9.0, y / 9.0, 3));
            let crags = ridged(SEED + 60, x / 1.3, y / 1.3, 4) - 0.45;
            self.heights[cell] +=
                mix_linear(15.0, 150.0, craggy) * smooth_step(0.1, 0.6, slopes[cell]) * crags;
        }
    }

    /// The samples of the scene, without the margin.
    fn scene(&self) -> impl Iterator<Item = f64> + '_ {
        (MARGIN..=MARGIN + CELLS).flat_map(move |row| {
            (MARGIN..=MARGIN + CELLS).map(move |column| self.heights[row * self.side + column])
        })
    }
}

/// Relative rate of uplift at a point in kilometres: a bent main range, a foreland in the south-east that hardly rises.
fn uplift(x: f64, y: f64) -> f64 {
    let (bent_x, bent_y) = (
        x + 6.0 * fractal(SEED + 1, x / 22.0, y / 22.0, 2),
        y + 6.0 * fractal(SEED + 5, x / 22.0, y / 22.0, 2),
    );
    let foreland = smooth_step(-10.0, 26.0, bent_y + 0.35 * (32.0 - bent_x));
    let ranges = ridged(SEED + 9, bent_x / 26.0, bent_y / 17.0, 3);
    0.12 + foreland * (0.25 + 0.9 * ranges)
}
