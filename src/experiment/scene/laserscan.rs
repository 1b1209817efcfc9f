//! `scene:laserscan`: a part of a town as an airborne laser scanner sees it.
//!
//! One height a sample, as a gridded elevation model has: roofs, trees as ragged blobs that some pulses pass, parked
//! cars, facades that slant over one sample because a grid can not stand upright, and noise of the ranging.

use glam::DVec2;

use super::height_field::HeightField;
use super::layout::{District, Layout, MainStreet, Town, Use};
use super::noise::{Dice, fractal, white};
use construction::progress::Progress;

const SEED: u64 = 0x5ca9_0001;
/// Cells along a side at scale 1: 600 x 600 x 2 = 720,000 triangles, the count of the DEM in Zach & Karner (2003).
const CELLS: usize = 600;
/// Metres between samples at scale 1: with the relief, the bounding box has the diagonal 1,032.
const SPACING: f64 = 1.2124;
/// Standard deviation of a height, in metres.
const RANGING_NOISE: f64 = 0.03;

pub(crate) const MAIN_STREETS: [MainStreet; 2] = [
    MainStreet { point: DVec2::new(-30.0, 0.0), direction: DVec2::new(0.15, 1.0), half_width: 11.0 },
    MainStreet { point: DVec2::new(0.0, 60.0), direction: DVec2::new(1.0, -0.2), half_width: 9.0 },
];
pub(crate) const PARK: DVec2 = DVec2::new(150.0, -130.0);
pub(crate) const CHURCH: DVec2 = DVec2::new(-130.0, 150.0);

/// Something small that stands on the ground, an ellipse or a box in plan.
struct Object {
    centre: DVec2,
    /// Half the size along and across `along`.
    half: DVec2,
    along: DVec2,
    height: f64,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Tree,
    Car,
}

/// Heights at `scale` times the samples a side of the same town.
pub(crate) fn heights(scale: usize, progress: Progress) -> HeightField {
    let layout = town().layout();
    let (spacing, side) = (SPACING / scale as f64, CELLS * scale + 1);
    let origin = [-0.5 * CELLS as f64 * SPACING; 2];
    let at = |column: usize, row: usize| {
        DVec2::new(origin[0] + column as f64 * spacing, origin[1] + row as f64 * spacing)
    };
    let mut field = HeightField::from_fn(side, spacing, origin, |column, row| ground(at(column, row)));
    let objects = objects(&layout);
    let work = (layout.buildings.len() + objects.len() + side) as u64;
    let mut done = 0;
    let mut step = || {
        done += 1;
        if done % 64 == 0 || done == work {
            progress(done, work);
        }
    };
    for object in &objects {
        stand(&mut field, object);
        step();
    }
    for building in &layout.buildings {
        building.raise(&mut field, beside);
        step();
    }
    HeightField::from_fn(side, spacing, origin, |column, row| {
        if column == 0 {
            step();
        }
        let (x, y) = (column as i64, row as i64);
        // The sum of three uniform variables in -1..1 has variance 1: close enough to a normal one.
        let noise: f64 = (0..3).map(|salt| white(SEED + 90 + salt, x, y)).sum();
        field.sample(column, row).z + RANGING_NOISE * noise
    })
}

/// Every sample is measured a little beside its place, which frays the eaves.
fn beside(column: usize, row: usize) -> DVec2 {
    let (x, y) = (column as i64, row as i64);
    0.2 * DVec2::new(white(SEED + 80, x, y), white(SEED + 81, x, y))
}

fn stand(field: &mut HeightField, object: &Object) {
    let reach = object.half.max_element() * 1.2;
    let level = ground(object.centre);
    for row in field.span(1, object.centre.y - reach, object.centre.y + reach) {
        for column in field.span(0, object.centre.x - reach, object.centre.x + reach) {
            let (x, y) = (column as i64, row as i64);
            let offset = field.sample(column, row).truncate() - object.centre;
            let local = DVec2::new(offset.dot(object.along), offset.dot(object.along.perp())) / object.half;
            let height = match object.kind {
                Kind::Car if local.abs().max_element() < 1.0 => {
                    object.height * if local.x.abs() < 0.5 { 1.0 } else { 0.65 }
                }
                Kind::Tree if local.length() < 1.0 + 0.2 * white(SEED + 82, x, y) => {
                    let crown = (1.0 - 0.75 * local.length_squared()).max(0.05).sqrt();
                    // One pulse in eight passes the leaves and returns from inside the crown.
                    let passes = white(SEED + 83, x, y) < -0.75;
                    object.height * crown * if passes { 0.35 } else { 1.0 } + 0.5 * white(SEED + 84, x, y)
                }
                _ => continue,
            };
            field.raise_to(column, row, level + height);
        }
    }
}

pub(crate) fn ground(p: DVec2) -> f64 {
    7.0 * fractal(SEED + 3, p.x / 420.0, p.y / 420.0, 2) + 0.012 * p.x + 345.0
}

fn town() -> Town<'static> {
    Town {
        seed: SEED,
        half_side: 400.0,
        warp: [26.0, 330.0],
        main_streets: &MAIN_STREETS,
        district: &district,
        ground: &ground,
    }
}

/// Where a point of the straight plan lies in the town.
pub(crate) fn place(p: DVec2) -> DVec2 {
    town().warp(p)
}

fn district(p: DVec2) -> District {
    let use_ = match () {
        () if p.distance(PARK) < 75.0 => Use::Park,
        () if p.distance(CHURCH) < 62.0 => Use::Church,
        () => Use::Houses,
    };
    if p.x - 0.4 * p.y < 60.0 {
        District { quarter_area: 9_000.0, lot: [17.0, 12.5], storeys: [3.0, 5.0], closed: 1.0, use_ }
    } else {
        District { quarter_area: 9_000.0, lot: [28.0, 22.0], storeys: [1.0, 2.0], closed: 0.6, use_ }
    }
}

/// Trees in gardens and parks and along some kerbs, cars along the others.
fn objects(layout: &Layout) -> Vec<Object> {
    let mut dice = Dice::new(SEED + 1);
    let mut objects = Vec::new();
    for (outline, is_park) in &layout.gardens {
        plant(outline, if *is_park { 90.0 } else { 130.0 }, &mut dice, &mut objects);
    }
    for &[from, to] in &layout.kerbs {
        let along = (to - from).normalize_or(DVec2::X);
        let (length, avenue) = (from.distance(to), dice.chance(0.25));
        let mut at = dice.between(4.0, 10.0);
        while at < length - 4.0 {
            let kerb = from + along * at - along.perp() * 2.0;
            if avenue {
                let radius = dice.between(2.2, 3.4);
                let height = radius * dice.between(2.4, 3.2);
                objects.push(Object {
                    centre: kerb,
                    half: DVec2::splat(radius),
                    along,
                    height,
                    kind: Kind::Tree,
                });
                at += dice.between(9.0, 13.0);
            } else {
                let half = DVec2::new(dice.between(2.0, 2.5), 0.9);
                if dice.chance(0.6) {
                    objects.push(Object { centre: kerb, half, along, height: 1.5, kind: Kind::Car });
                }
                at += dice.between(5.4, 6.5);
            }
        }
    }
    objects
}

/// About one tree for each `area` square metres of a convex polygon.
fn plant(outline: &[DVec2], area: f64, dice: &mut Dice, objects: &mut Vec<Object>) {
    let (low, high) =
        outline.iter().fold((DVec2::MAX, DVec2::MIN), |(low, high), &p| (low.min(p), high.max(p)));
    let size = high - low;
    let inside = |p: DVec2| {
        (0..outline.len()).all(|i| {
            let (a, b) = (outline[i], outline[(i + 1) % outline.len()]);
            (b - a).perp_dot(p - a) > 2.0 * a.distance(b)
        })
    };
    for _ in 0..(size.x * size.y / area).max(0.0) as usize {
        let centre = DVec2::new(dice.between(low.x, high.x), dice.between(low.y, high.y));
        let radius = dice.between(2.5, 6.0);
        let half = DVec2::new(radius, radius * dice.between(0.75, 1.0));
        let height = radius * dice.between(1.8, 3.0);
        if inside(centre) {
            objects.push(Object { centre, half, along: DVec2::X, height, kind: Kind::Tree });
        }
    }
}
