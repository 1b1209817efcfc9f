//! `scene:city`: a historic centre around a castle hill, as a block model.

use collapse_log::Mesh;
use glam::DVec2;

use super::building::{Building, Roof};
use super::height_field::HeightField;
pub(crate) use super::layout::MainStreet;
use super::layout::{District, Layout, Town, Use, warp};
use super::noise::{fractal, smooth_step};
use construction::progress::Progress;

const SEED: u64 = 0xc17f_0001;
/// With the relief, the diagonal of the bounding box is 2,970, that of Graz in Zach & Karner (2003).
const HALF_SIDE: f64 = 1048.5;
/// Cells of the ground along a side at scale 1.
const GROUND_CELLS: usize = 64;
const WARP: [f64; 2] = [55.0, 620.0];
/// The warp pushes the outermost houses over the rim of the ground unless they stop short of it.
const RIM: f64 = 40.0;

const RIVER: MainStreet =
    MainStreet { point: DVec2::new(-430.0, 0.0), direction: DVec2::new(-0.18, 1.0), half_width: 34.0 };
/// From the west over the river, along the foot of the castle hill, to the east.
pub(crate) const HIGH_STREET: MainStreet =
    MainStreet { point: DVec2::new(0.0, -215.0), direction: DVec2::new(1.0, 0.12), half_width: 9.0 };
/// From the south to the main square.
pub(crate) const LONG_LANE: MainStreet =
    MainStreet { point: DVec2::new(-130.0, 0.0), direction: DVec2::new(0.1, 1.0), half_width: 7.0 };
const EAST_AVENUE: MainStreet =
    MainStreet { point: DVec2::new(430.0, 0.0), direction: DVec2::new(0.22, 1.0), half_width: 12.0 };
const NORTH_AVENUE: MainStreet =
    MainStreet { point: DVec2::new(0.0, 480.0), direction: DVec2::new(1.0, -0.15), half_width: 12.0 };

/// Top of the castle hill, after the warp.
pub(crate) const CASTLE: DVec2 = DVec2::new(40.0, 110.0);
const MAIN_SQUARE: DVec2 = DVec2::new(-95.0, -262.0);
const CHURCHES: [DVec2; 11] = [
    DVec2::new(190.0, -270.0),
    DVec2::new(-260.0, -130.0),
    DVec2::new(-300.0, 330.0),
    DVec2::new(-620.0, -250.0),
    DVec2::new(-700.0, 420.0),
    DVec2::new(40.0, -620.0),
    DVec2::new(560.0, -480.0),
    DVec2::new(330.0, 180.0),
    DVec2::new(680.0, 330.0),
    DVec2::new(120.0, 700.0),
    DVec2::new(-470.0, 800.0),
];

/// The mesh: the ground, then every building.
pub(crate) fn mesh(scale: usize, progress: Progress) -> Mesh {
    let mut mesh = ground_field(GROUND_CELLS * scale).mesh();
    let buildings = layout().buildings;
    for (i, building) in buildings.iter().enumerate() {
        building.append(scale, &mut mesh);
        if i % 64 == 63 {
            progress(i as u64 + 1, buildings.len() as u64);
        }
    }
    progress(buildings.len() as u64, buildings.len() as u64);
    mesh
}

/// Ground and roofs.
pub(crate) fn surface(progress: Progress) -> HeightField {
    let mut field = ground_field(700);
    let buildings = layout().buildings;
    for (i, building) in buildings.iter().enumerate() {
        building.raise(&mut field, |_, _| DVec2::ZERO);
        progress(i as u64 + 1, buildings.len() as u64);
    }
    field
}

fn ground_field(cells: usize) -> HeightField {
    let spacing = 2.0 * HALF_SIDE / cells as f64;
    HeightField::from_fn(cells + 1, spacing, [-HALF_SIDE; 2], |column, row| {
        ground(DVec2::new(column as f64, row as f64) * spacing - HALF_SIDE)
    })
}

/// Where a point of the straight plan lies in the city.
pub(crate) fn place(p: DVec2) -> DVec2 {
    warp(SEED, WARP, p)
}

/// Height of the ground: a gentle valley, the river's bed, and the castle hill with a flat top and steep flanks.
pub(crate) fn ground(p: DVec2) -> f64 {
    let hills = 9.0 * fractal(SEED + 3, p.x / 900.0, p.y / 900.0, 2) + 0.008 * (p.x + 430.0).abs();
    let away = (p - CASTLE) / DVec2::new(150.0, 225.0);
    let ragged = away.length() * (1.0 + 0.16 * fractal(SEED + 6, p.x / 120.0, p.y / 120.0, 3));
    let castle_hill = 105.0 * smooth_step(1.1, 0.42, ragged);
    // Two steps of the inverse warp tell on which side of the straight plan's river a point lies.
    let straight = (0..3).fold(p, |q, _| p - (place(q) - q));
    let across = (straight - RIVER.point).perp_dot(RIVER.direction).abs() / RIVER.direction.length();
    hills + castle_hill - 6.0 * smooth_step(42.0, 24.0, across)
}

fn town<'a>(streets: &'a [MainStreet]) -> Town<'a> {
    Town {
        seed: SEED,
        half_side: HALF_SIDE - RIM,
        warp: WARP,
        main_streets: streets,
        district: &district,
        ground: &ground,
    }
}

fn layout() -> Layout {
    let streets = [RIVER, HIGH_STREET, LONG_LANE, EAST_AVENUE, NORTH_AVENUE];
    let town = town(&streets);
    let mut layout = town.layout();
    bridges(&mut layout);
    castle(&mut layout);
    layout
}

fn district(p: DVec2) -> District {
    let on_hill = ((place(p) - CASTLE) / DVec2::new(165.0, 240.0)).length() < 1.0;
    let near = |place: DVec2, radius: f64| p.distance(place) < radius;
    let park = near(DVec2::new(330.0, -60.0), 120.0) || near(DVec2::new(-640.0, 90.0), 80.0);
    let use_ = match () {
        () if on_hill || near(MAIN_SQUARE, 42.0) => Use::Open,
        () if park => Use::Park,
        () if CHURCHES.iter().any(|&church| near(church, 45.0)) => Use::Church,
        () => Use::Houses,
    };
    let (old_town, edge) = (p.distance(CASTLE + DVec2::new(-60.0, -230.0)), p.length());
    if old_town < 380.0 {
        District { quarter_area: 7_000.0, lot: [17.0, 12.0], storeys: [3.0, 5.0], closed: 1.0, use_ }
    } else if edge < 820.0 {
        District { quarter_area: 19_000.0, lot: [30.0, 14.0], storeys: [4.0, 5.0], closed: 1.0, use_ }
    } else {
        District { quarter_area: 22_000.0, lot: [45.0, 26.0], storeys: [2.0, 3.0], closed: 0.5, use_ }
    }
}

/// Solid bridges where the east-west streets cross the river.
fn bridges(layout: &mut Layout) {
    for street in [HIGH_STREET, NORTH_AVENUE] {
        let reach = (RIVER.point - street.point).perp_dot(RIVER.direction)
            / street.direction.perp_dot(RIVER.direction);
        let middle = street.point + street.direction * reach;
        let along = street.direction.normalize();
        let corner = |x: f64, y: f64| place(middle + along * x + along.perp() * y);
        let footprint = vec![corner(-48.0, -6.0), corner(48.0, -6.0), corner(48.0, 6.0), corner(-48.0, 6.0)];
        let level = ground(corner(-55.0, 0.0)).max(ground(corner(55.0, 0.0)));
        let roof = Roof::Pyramid { rise: 0.6 };
        layout.buildings.push(Building { footprint, base: level - 2.0, eave: level, storeys: 1, roof });
    }
}

/// Keep, clock tower and wings on top of the hill.
fn castle(layout: &mut Layout) {
    let top = ground(CASTLE);
    let mut add = |x: f64, y: f64, half: [f64; 2], storeys: u32, height: f64, roof: Roof| {
        let centre = CASTLE + DVec2::new(x, y);
        let corner = |i: f64, j: f64| centre + DVec2::new(i * half[0], j * half[1]);
        let footprint = vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
        let base = footprint.iter().map(|&p| ground(p)).fold(top, f64::min) - 1.5;
        layout.buildings.push(Building { footprint, base, eave: top + height, storeys, roof });
    };
    add(0.0, 20.0, [11.0, 11.0], 5, 22.0, Roof::Pyramid { rise: 8.0 });
    add(-6.0, -62.0, [5.0, 5.0], 7, 26.0, Roof::Pyramid { rise: 14.0 });
    add(34.0, -10.0, [6.0, 34.0], 3, 9.0, Roof::Ridged { rise: 5.0, hip: 0.1 });
    add(-34.0, 14.0, [6.0, 30.0], 3, 9.0, Roof::Ridged { rise: 5.0, hip: 0.1 });
    add(0.0, 62.0, [28.0, 6.0], 3, 10.0, Roof::Ridged { rise: 5.0, hip: 0.0 });
    add(14.0, -40.0, [4.0, 4.0], 4, 14.0, Roof::Pyramid { rise: 7.0 });
}
