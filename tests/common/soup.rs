//! Soups: small meshes with whatever can be wrong with one, the same for the same seed.
//!
//! A soup has a kind, which says what its triangles join, and 4 to 40 vertices. Each kind comes in its own shape and crumpled,
//! on a small integer grid or not, at any scale and far from the origin, with windings turned, triangles doubled and doubled
//! turned over.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use foldfront::Mesh;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// What the triangles of a soup join.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Three vertices at random.
    Random,
    /// A sheet of squares.
    Grid,
    /// Around one vertex, closed or not.
    Fan,
    /// Pages at one edge.
    Book,
    /// A grid joined at its ends both ways: a pinched one where it is small.
    Torus,
    /// Each with two corners of the one before.
    Strip,
    /// Strips that come back to where they began, and meet themselves there.
    Loop,
    /// Few triangles, many times.
    Repeated,
    /// Random, most vertices at one place.
    Coincident,
    /// Closed: tetrahedra and bipyramids.
    Closed,
    /// Two fans that touch at a vertex or at an edge.
    Touching,
    /// A grid on a line, or with the corners of each triangle on one.
    Flat,
}

impl Kind {
    pub const ALL: [Self; 12] = [
        Self::Random,
        Self::Grid,
        Self::Fan,
        Self::Book,
        Self::Torus,
        Self::Strip,
        Self::Loop,
        Self::Repeated,
        Self::Coincident,
        Self::Closed,
        Self::Touching,
        Self::Flat,
    ];
}

/// A small mesh, and how it came about.
#[derive(Clone, Debug)]
pub struct Soup {
    pub kind: Kind,
    pub mesh: Mesh,
}

/// Lengths that an edge is about as long as.
const SCALES: [f64; 9] = [1e-30, 1e-20, 1e-10, 1e-3, 1.0, 1.0, 1e10, 1e20, 1e30];
/// How far from the origin, in extents.
const OFFSETS: [f64; 5] = [0.0, 0.0, 0.0, 1e3, 1e5];
/// Odds that a triangle is turned.
const TURNED: [f64; 4] = [0.0, 0.125, 0.25, 0.5];
/// About the side of the box that vertices lie in, before the scale.
const SIDE: f64 = 4.0;

/// The soup of a seed.
pub fn soup(seed: u64) -> Soup {
    let random = &mut Pcg64::seed_from_u64(seed);
    let kind = *Kind::ALL.choose(random).unwrap();
    let count = random.random_range(4..=40);
    let mut triangles = triangles(kind, count, random);
    let positions = positions(kind, count, random);

    let turned = *TURNED.choose(random).unwrap();
    for t in &mut triangles {
        if random.random_bool(turned) {
            t.swap(1, 2);
        }
    }
    let doubled = *[0.0, 0.0, 0.1, 0.5].choose(random).unwrap();
    for i in 0..triangles.len() {
        let [a, b, c] = triangles[i];
        if random.random_bool(doubled) {
            triangles.push(*[[a, b, c], [b, c, a], [b, a, c]].choose(random).unwrap());
        }
    }
    Soup { kind, mesh: Mesh { positions, triangles, ..Mesh::default() } }
}

fn triangles(kind: Kind, count: u32, random: &mut Pcg64) -> Vec<[u32; 3]> {
    let any = |random: &mut Pcg64| [(); 3].map(|()| random.random_range(0..count));
    let side = count.isqrt();
    match kind {
        Kind::Random | Kind::Coincident => (0..2 * count).map(|_| any(random)).collect(),
        Kind::Grid | Kind::Flat => squares(side, side - 1, |x, y| y * side + x),
        Kind::Torus => squares(side, side, |x, y| y % side * side + x % side),
        Kind::Fan => fan(0, 1..count, random.random()),
        Kind::Book => (2..count).map(|page| [0, 1, page]).collect(),
        Kind::Strip => (2..count).map(|v| [v - 2, v - 1, v]).collect(),
        Kind::Loop => {
            (0..count).map(|v| [v, v + 1, v + 2 + random.random_range(0..3)].map(|v| v % count)).collect()
        }
        Kind::Repeated => {
            let few: Vec<_> = (0..1 + count / 8).map(|_| any(random)).collect();
            (0..count).map(|_| *few.choose(random).unwrap()).collect()
        }
        Kind::Closed => {
            let (mut all, mut next) = (Vec::new(), 0);
            while next + 4 <= count {
                let ring = random.random_range(2..7).min(count - next - 2);
                let rim = next + 2..next + 2 + ring;
                // Of a ring of two, both triangles show both sides of one.
                all.extend(fan(next, rim.clone(), true));
                all.extend(fan(next + 1, rim, true).into_iter().map(|[a, b, c]| [a, c, b]));
                next += 2 + ring;
            }
            all
        }
        Kind::Touching => {
            let middle = count / 2;
            let shared = random.random_range(1..=2);
            let mut all = fan(0, 1..middle + 1, false);
            all.extend(fan(count - 1, middle + 1 - shared..count - 1, random.random()));
            all
        }
    }
}

/// Two triangles for each square of a grid with `side` vertices a row, `squares` squares either way.
fn squares(side: u32, squares: u32, vertex: impl Fn(u32, u32) -> u32) -> Vec<[u32; 3]> {
    let cells = (0..squares * squares).map(|i| (i % squares, i / squares));
    debug_assert!(squares <= side);
    cells
        .flat_map(|(x, y)| {
            let [a, b] = [vertex(x, y), vertex(x + 1, y)];
            let [c, d] = [vertex(x, y + 1), vertex(x + 1, y + 1)];
            [[a, b, d], [a, d, c]]
        })
        .collect()
}

fn fan(hub: u32, rim: std::ops::Range<u32>, closed: bool) -> Vec<[u32; 3]> {
    let mut all: Vec<_> = rim.clone().zip(rim.clone().skip(1)).map(|(a, b)| [hub, a, b]).collect();
    if closed && rim.len() > 1 {
        all.push([hub, rim.end - 1, rim.start]);
    }
    all
}

fn positions(kind: Kind, count: u32, random: &mut Pcg64) -> Vec<[f32; 3]> {
    let (scale, offset) = (*SCALES.choose(random).unwrap(), SIDE * *OFFSETS.choose(random).unwrap());
    let (crumpled, whole, plane) = (random.random(), random.random(), random.random_ratio(1, 3));
    let thrown = |random: &mut Pcg64| [(); 3].map(|()| random.random_range(0.0..SIDE));
    let side = f64::from(count.isqrt());
    let turn = |v: u32, of: f64| std::f64::consts::TAU * f64::from(v) / of;
    let round = |v: u32, height: f64| {
        [2.0 + 2.0 * turn(v, count.into()).cos(), 2.0 + 2.0 * turn(v, count.into()).sin(), height]
    };
    let common = thrown(random);
    let line = [thrown(random), thrown(random)];
    let mut all = Vec::new();
    for v in 0..count {
        let (x, y) = (f64::from(v % count.isqrt()), f64::from(v / count.isqrt()));
        let anywhere = thrown(random);
        let mut p = match kind {
            Kind::Coincident if random.random_ratio(3, 4) => common,
            Kind::Flat => {
                let at = if crumpled { random.random() } else { f64::from(v) / f64::from(count) };
                std::array::from_fn(|axis| line[0][axis] + at * (line[1][axis] - line[0][axis]))
            }
            _ if crumpled => anywhere,
            Kind::Grid => [x, y, (0.9 * x).sin() * (0.7 * y).cos()].map(|c| c * SIDE / side),
            Kind::Torus => {
                let (around, tube) = (turn(v % count.isqrt(), side), turn(v / count.isqrt(), side));
                let radius = 1.3 + 0.6 * tube.cos();
                [2.0 + radius * around.cos(), 2.0 + radius * around.sin(), 0.6 * tube.sin()]
            }
            Kind::Fan | Kind::Touching | Kind::Loop => round(v, if v == 0 { 1.0 } else { 0.0 }),
            Kind::Strip => [0.2 * f64::from(v), f64::from(v % 2), 0.0],
            Kind::Book if v < 2 => [0.0, 0.0, SIDE * f64::from(v)],
            _ => anywhere,
        };
        if plane {
            p[2] = 0.0;
        }
        if whole {
            p = p.map(f64::floor);
        }
        all.push(p.map(|c| ((c + offset) * scale) as f32));
    }
    all
}
