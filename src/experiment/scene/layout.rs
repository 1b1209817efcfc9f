//! The plan of a town: quarters along bent streets, each built up along its edges around a courtyard.
//!
//! A square is split by its main streets, then again and again by jittered lines until quarters have the size that
//! their district wants; a smooth warp of the finished plan bends the streets. Recursive splitting follows the idea
//! of Parish & Müller (2001), "Procedural modeling of cities", and Vanegas et al. (2012), "Procedural generation of
//! parcels in urban modeling"; lots along the edges are cut between a quarter's outline and its inset.

use glam::DVec2;

use super::building::{Building, Roof};
use super::noise::{Dice, fractal};

/// A straight street (before the warp) through the whole town.
pub(crate) struct MainStreet {
    pub point: DVec2,
    /// Along the street; need not be of unit length.
    pub direction: DVec2,
    pub half_width: f64,
}

/// What kind of quarter a place has.
pub(crate) struct District {
    /// Quarters are split while they are larger, in square metres.
    pub quarter_area: f64,
    /// Metres along the street of a usual lot, and from the street to the courtyard.
    pub lot: [f64; 2],
    /// Range of storeys.
    pub storeys: [f64; 2],
    /// Part of each lot's length that is built on: 1 closes the row, less leaves detached houses.
    pub closed: f64,
    pub use_: Use,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Use {
    Houses,
    /// Trees, no buildings.
    Park,
    /// Nothing at all: squares, the river, cliffs.
    Open,
    Church,
}

/// The town to plan.
pub(crate) struct Town<'a> {
    pub seed: u64,
    /// The town is the square of this half side around the origin.
    pub half_side: f64,
    /// Metres by which the warp moves things at most, and the size of its bends.
    pub warp: [f64; 2],
    pub main_streets: &'a [MainStreet],
    /// District at a point of the plan before the warp.
    pub district: &'a dyn Fn(DVec2) -> District,
    /// Height of the ground at a point after the warp.
    pub ground: &'a dyn Fn(DVec2) -> f64,
}

/// The planned town, after the warp.
#[derive(Default)]
pub(crate) struct Layout {
    pub buildings: Vec<Building>,
    /// Outlines of courtyards and parks, counter-clockwise; the flag says park.
    pub gardens: Vec<(Vec<DVec2>, bool)>,
    /// Kerbs, with the street to the right of each.
    pub kerbs: Vec<[DVec2; 2]>,
}

/// A convex polygon, counter-clockwise. Edge i starts at corner i and belongs to a street.
type Quarter = Vec<Edge>;

#[derive(Clone, Copy)]
struct Edge {
    start: DVec2,
    half_width: f64,
}

const STOREY: f64 = 3.3;

impl Town<'_> {
    /// Where a point of the straight plan lies in the town.
    pub(crate) fn warp(&self, p: DVec2) -> DVec2 {
        warp(self.seed, self.warp, p)
    }

    pub(crate) fn layout(&self) -> Layout {
        let mut layout = Layout::default();
        let mut dice = Dice::new(self.seed);
        let s = self.half_side;
        let corner = |x, y| Edge { start: DVec2::new(x, y), half_width: 0.0 };
        let mut open = vec![vec![corner(-s, -s), corner(s, -s), corner(s, s), corner(-s, s)]];
        for street in self.main_streets {
            let left = street.direction.perp();
            open = open
                .iter()
                .flat_map(|quarter| {
                    [left, -left].map(|inward| clip(quarter, street.point, inward, street.half_width))
                })
                .filter(|quarter| quarter.len() >= 3)
                .collect();
        }
        while let Some(quarter) = open.pop() {
            let (centre, area) = centre_and_area(&quarter);
            let district = (self.district)(centre);
            if area > district.quarter_area * dice.between(0.7, 1.3) {
                let half_width = if area > 6.0 * district.quarter_area { 7.0 } else { 4.5 };
                open.extend(split(&quarter, centre, half_width, &mut dice));
                continue;
            }
            let outline = inset(&quarter, |edge| edge.half_width);
            if outline.len() < 3 || centre_and_area(&outline).1 < 120.0 {
                continue;
            }
            self.kerb(&outline, &mut layout);
            match district.use_ {
                Use::Open => {}
                Use::Park => layout.gardens.push((self.warped(&outline), true)),
                Use::Church => self.church(&outline, &mut dice, &mut layout),
                Use::Houses => {
                    let depth = district.lot[1];
                    let court = inset(&outline, |_| depth);
                    if court.len() == outline.len() {
                        self.row(&outline, &court, &district, 1.0, &mut dice, &mut layout);
                        self.courtyard(&court, &district, &mut dice, &mut layout);
                    } else if area > 900.0 {
                        // Too narrow for houses on both sides: an alley cuts it, and the parts are tried again.
                        open.extend(split(&quarter, centre, 2.0, &mut dice));
                    } else {
                        let footprint: Vec<DVec2> = outline.iter().map(|edge| edge.start).collect();
                        let rise = if dice.chance(0.5) { 0.0 } else { 4.0 };
                        self.build(
                            &footprint,
                            &district,
                            Roof::Pyramid { rise },
                            1.0,
                            &mut dice,
                            &mut layout,
                        );
                    }
                }
            }
        }
        layout
    }

    fn warped(&self, outline: &[Edge]) -> Vec<DVec2> {
        outline.iter().map(|edge| self.warp(edge.start)).collect()
    }

    fn kerb(&self, outline: &[Edge], layout: &mut Layout) {
        let corners = self.warped(outline);
        layout.kerbs.extend((0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]));
    }

    /// Lots between a quarter's outline and its inset: quadrilaterals that mitre at the corners.
    fn row(
        &self,
        outline: &[Edge],
        court: &[Edge],
        district: &District,
        built: f64,
        dice: &mut Dice,
        layout: &mut Layout,
    ) {
        for i in 0..outline.len() {
            let next = (i + 1) % outline.len();
            let (front, back) =
                ([outline[i].start, outline[next].start], [court[i].start, court[next].start]);
            let length = front[0].distance(front[1]);
            let lots = (length / (district.lot[0] * dice.between(0.85, 1.2)) + 0.5).floor().max(1.0);
            let mut from = 0.0;
            for lot in 1..=lots as u32 {
                let jitter = if f64::from(lot) < lots { dice.between(-0.22, 0.22) } else { 0.0 };
                let to = (f64::from(lot) + jitter) / lots;
                let along = |side: [DVec2; 2], t: f64| side[0].lerp(side[1], t);
                let quad = [along(front, from), along(front, to), along(back, to), along(back, from)];
                from = to;
                if dice.chance(built) {
                    self.lot(quad, district, built, dice, layout);
                }
            }
        }
    }

    fn lot(
        &self,
        mut quad: [DVec2; 4],
        district: &District,
        built: f64,
        dice: &mut Dice,
        layout: &mut Layout,
    ) {
        let detached = district.closed < 1.0;
        if detached {
            let middle = (quad[0] + quad[1] + quad[2] + quad[3]) / 4.0;
            let [along, across] = [district.closed * dice.between(0.8, 1.1), dice.between(0.62, 0.8)];
            let front = (quad[1] - quad[0] + quad[2] - quad[3]).normalize_or(DVec2::X);
            quad = quad.map(|corner| {
                let offset = corner - middle;
                middle
                    + front * (offset.dot(front) * along)
                    + front.perp() * (offset.dot(front.perp()) * across)
            });
        }
        let depth = 0.5 * (quad[0].distance(quad[3]) + quad[1].distance(quad[2]));
        let rise = depth * dice.between(0.28, 0.48);
        let roof = match dice.unit() {
            x if detached && x < 0.2 => Roof::Pyramid { rise: 0.8 * rise },
            x if detached && x < 0.6 => Roof::Ridged { rise, hip: dice.between(0.15, 0.4) },
            x if x < 0.78 => Roof::Ridged { rise, hip: 0.0 },
            x if x < 0.9 => Roof::Ridged { rise, hip: dice.between(0.1, 0.3) },
            _ => Roof::Pyramid { rise: 0.0 },
        };
        self.build(&quad, district, roof, if built < 1.0 { 0.5 } else { 1.0 }, dice, layout);
    }

    /// Lower wings and sheds behind the houses, where there is room.
    fn courtyard(&self, court: &[Edge], district: &District, dice: &mut Dice, layout: &mut Layout) {
        let area = centre_and_area(court).1;
        let inner = inset(court, |_| 8.0);
        if district.closed == 1.0 && area > 1200.0 && inner.len() == court.len() {
            self.row(court, &inner, district, 0.22, dice, layout);
            layout.gardens.push((self.warped(&inner), false));
        } else {
            layout.gardens.push((self.warped(court), false));
        }
    }

    fn build(
        &self,
        footprint: &[DVec2],
        district: &District,
        roof: Roof,
        height: f64,
        dice: &mut Dice,
        layout: &mut Layout,
    ) {
        let storeys =
            (dice.between(district.storeys[0], district.storeys[1] + 1.0) * height).floor().max(1.0);
        let eave = storeys * STOREY + dice.between(-0.3, 0.9);
        self.place(footprint, storeys as u32, eave, roof, layout);
    }

    /// Warps a footprint and stands a building on it, unless it is degenerate or the ground too steep.
    pub(crate) fn place(
        &self,
        footprint: &[DVec2],
        storeys: u32,
        eave: f64,
        roof: Roof,
        layout: &mut Layout,
    ) {
        let footprint: Vec<DVec2> = footprint.iter().map(|&p| self.warp(p)).collect();
        let levels = footprint.iter().map(|&p| (self.ground)(p));
        let (low, high) = levels.fold((f64::MAX, f64::MIN), |(low, high), h| (low.min(h), high.max(h)));
        let building = Building { base: low - 1.5, eave: high + eave, storeys, footprint, roof };
        if high - low < 7.0 && building.is_sound() {
            layout.buildings.push(building);
        }
    }

    /// Nave, choir and tower in the middle of a quarter, along its longest edge.
    fn church(&self, outline: &[Edge], dice: &mut Dice, layout: &mut Layout) {
        let (centre, area) = centre_and_area(outline);
        let size = (area.sqrt() / 75.0).clamp(0.45, 1.2);
        let along = longest_edge(outline).normalize_or(DVec2::X);
        let box_at = |x: f64, half_x: f64, half_y: f64| {
            [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(i, j)| centre + along * (size * (x + i * half_x)) + along.perp() * (size * j * half_y))
        };
        let (eave, tower) = (16.0 * size, dice.between(42.0, 55.0) * size);
        self.place(&box_at(0.0, 20.0, 8.0), 3, eave, Roof::Ridged { rise: 11.0 * size, hip: 0.0 }, layout);
        self.place(&box_at(22.0, 5.0, 5.5), 2, 0.8 * eave, Roof::Pyramid { rise: 7.0 * size }, layout);
        self.place(&box_at(-21.5, 4.5, 4.5), 8, tower, Roof::Pyramid { rise: 22.0 * size }, layout);
        layout.gardens.push((self.warped(&inset(outline, |_| 1.0)), true));
    }
}

/// Moves a point by two smooth fields of noise.
pub(crate) fn warp(seed: u64, [strength, size]: [f64; 2], p: DVec2) -> DVec2 {
    let bend = |salt| fractal(seed + salt, p.x / size + 0.5, p.y / size + 0.5, 2);
    p + strength * DVec2::new(bend(71), bend(77))
}

/// The part of a convex polygon to the `inward` side of a line; the cut becomes an edge on a street of that width.
fn clip(quarter: &[Edge], point: DVec2, inward: DVec2, half_width: f64) -> Quarter {
    let side = |edge: &Edge| (edge.start - point).dot(inward);
    let mut kept = Quarter::with_capacity(quarter.len() + 1);
    for (i, edge) in quarter.iter().enumerate() {
        let next = &quarter[(i + 1) % quarter.len()];
        let (a, b) = (side(edge), side(next));
        if a >= 0.0 {
            kept.push(*edge);
        }
        if (a >= 0.0) != (b >= 0.0) {
            let start = edge.start.lerp(next.start, a / (a - b));
            // Leaving the half plane the cut begins; entering it the edge goes on.
            kept.push(Edge { start, half_width: if a >= 0.0 { half_width } else { edge.half_width } });
        }
    }
    kept
}

/// Moves every edge inwards. Edges may vanish.
fn inset(quarter: &[Edge], distance: impl Fn(&Edge) -> f64) -> Quarter {
    let mut kept = quarter.to_vec();
    for (i, edge) in quarter.iter().enumerate() {
        let along = quarter[(i + 1) % quarter.len()].start - edge.start;
        let inward = along.perp().normalize_or_zero();
        kept = clip(&kept, edge.start + inward * distance(edge), inward, edge.half_width);
    }
    kept
}

fn split(quarter: &[Edge], centre: DVec2, half_width: f64, dice: &mut Dice) -> [Quarter; 2] {
    let longest = longest_edge(quarter);
    let across = longest.perp() + longest * dice.between(-0.22, 0.22);
    let point = centre + longest * dice.between(-0.12, 0.12);
    [across.perp(), -across.perp()].map(|inward| clip(quarter, point, inward, half_width))
}

fn longest_edge(quarter: &[Edge]) -> DVec2 {
    let edges = (0..quarter.len()).map(|i| quarter[(i + 1) % quarter.len()].start - quarter[i].start);
    edges.fold(
        DVec2::ZERO,
        |longest, edge| {
            if edge.length_squared() > longest.length_squared() { edge } else { longest }
        },
    )
}

fn centre_and_area(quarter: &[Edge]) -> (DVec2, f64) {
    let corners: Vec<DVec2> = quarter.iter().map(|edge| edge.start).collect();
    let area: f64 = (0..corners.len()).map(|i| corners[i].perp_dot(corners[(i + 1) % corners.len()])).sum();
    (corners.iter().sum::<DVec2>() / corners.len().max(1) as f64, 0.5 * area)
}
