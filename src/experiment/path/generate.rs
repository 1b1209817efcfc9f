//! The recorded walkthroughs of the built-in scenes, and the scripts that made them.
//!
//! Each scene has a calm path, at about the speed that Zach & Karner (2003, Table 1) declare for it and always below
//! their 0.02 radians a frame, and a wild one, which stops, pans slowly, turns its head and speeds well beyond that,
//! and teleports once.

use std::f64::consts::PI;

use glam::{DVec2, DVec3};

use super::director::{Director, Waypoint, catmull_rom};
use super::error::PathError;
use super::walkthrough::Path;
use crate::experiment::scene::{HeightField, Scene, SceneKind, city, laserscan};
use construction::progress::Progress;

/// Degrees to turn the head by.
const DEGREE: f64 = PI / 180.0;
/// Radians a frame, a little below what the paper declares: rounding must not exceed it.
const CALM_TURN: f64 = 0.0195;

/// The recorded walkthroughs of a scene, calm and wild, as they are kept in `paths/`.
pub fn recorded(kind: SceneKind) -> Result<[Path; 2], PathError> {
    let read = |name: &str, text: &str| Path::parse(std::path::Path::new(name), text);
    macro_rules! pair {
        ($calm:literal, $wild:literal) => {
            Ok([
                read($calm, include_str!(concat!("../../../paths/", $calm)))?,
                read($wild, include_str!(concat!("../../../paths/", $wild)))?,
            ])
        };
    }
    match kind {
        SceneKind::City => pair!("city-calm.path", "city-wild.path"),
        SceneKind::Alps => pair!("alps-calm.path", "alps-wild.path"),
        SceneKind::Laserscan => pair!("laserscan-calm.path", "laserscan-wild.path"),
    }
}

/// Makes the walkthroughs of a scene, calm and wild, from its scripts: the recorded ones to the bit, on any platform.
#[must_use]
pub fn generate(kind: SceneKind, progress: Progress) -> [Path; 2] {
    let surface = Scene::new(kind).surface(progress);
    let [calm, wild] = match kind {
        SceneKind::City => city_paths(&surface),
        SceneKind::Alps => alps_paths(&surface),
        SceneKind::Laserscan => laserscan_paths(&surface),
    };
    [calm.finish(format!("{}-calm", kind.name()), "m"), wild.finish(format!("{}-wild", kind.name()), "m")]
}

/// Places that a wild walkthrough visits.
struct Wild<'a> {
    start: &'a [Waypoint],
    fast: &'a [Waypoint],
    /// Where the teleport leads, and the way from there.
    elsewhere: &'a [Waypoint],
    /// Units a frame that a calm camera moves.
    speed: f64,
}

fn wild(places: &Wild) -> Director {
    let mut director = Director::new(places.start[0], 0.06);
    director.stop(30);
    director.travel(&places.start[1..], places.speed);
    director.stop(45);
    director.turn(100.0 * DEGREE, 25);
    director.stop(15);
    director.turn(-170.0 * DEGREE, 30);
    director.pan(1e-5, 60);
    director.turn(70.0 * DEGREE, 40);
    director.travel(places.fast, 6.0 * places.speed);
    director.stop(20);
    director.teleport(places.elsewhere[0]);
    director.stop(30);
    director.pan(-1e-5, 40);
    director.turn(-180.0 * DEGREE, 35);
    director.turn(180.0 * DEGREE, 60);
    director.travel(&places.elsewhere[1..], 2.0 * places.speed);
    director.stop(40);
    director
}

/// Along the high street at the height of a bus, up over the roofs and around the castle hill.
fn city_paths(surface: &HeightField) -> [Director; 2] {
    let street = |street: &city::MainStreet, along: f64, eye: f64| {
        let p = city::place(street.point + street.direction * along);
        p.extend(surface.height(p.x, p.y) + eye)
    };
    let high = |along: f64, eye: f64| street(&city::HIGH_STREET, along, eye);
    let lane = |along: f64, eye: f64| street(&city::LONG_LANE, along, eye);
    let castle = city::CASTLE.extend(city::ground(city::CASTLE) + 8.0);
    let around = |x: f64, y: f64, above: f64| castle + DVec3::new(x, y, above);
    let ahead = |along: f64| Waypoint { position: high(along, 3.0), target: high(along + 55.0, 4.0) };

    let mut calm = Director::new(ahead(-400.0), CALM_TURN);
    let walk = (-19..=-8).map(|i| ahead(20.0 * f64::from(i)));
    let old_town = castle + DVec3::new(-230.0, -330.0, -90.0);
    let climb = [
        Waypoint { position: high(-110.0, 12.0), target: castle },
        Waypoint { position: high(-50.0, 40.0), target: castle },
        Waypoint { position: around(60.0, -280.0, -50.0), target: castle },
        Waypoint { position: around(190.0, -150.0, -25.0), target: castle.midpoint(old_town) },
        Waypoint { position: around(220.0, -50.0, 10.0), target: old_town },
    ];
    calm.travel(&walk.chain(climb).collect::<Vec<_>>(), 1.0);

    let north = |along: f64| Waypoint { position: lane(along, 2.5), target: lane(along + 60.0, 5.0) };
    let far = DVec3::new(-600.0, -900.0, 0.0);
    let wild = wild(&Wild {
        start: &(-30..=-24).map(|i| north(20.0 * f64::from(i))).collect::<Vec<_>>(),
        fast: &(-23..=-16).map(|i| north(20.0 * f64::from(i))).collect::<Vec<_>>(),
        elsewhere: &[
            Waypoint { position: around(70.0, 60.0, 12.0), target: castle },
            Waypoint { position: around(0.0, -120.0, 20.0), target: far },
            Waypoint { position: around(-80.0, -260.0, -30.0), target: far },
            Waypoint { position: around(-150.0, -330.0, -60.0), target: far },
        ],
        speed: 1.0,
    });
    [calm, wild]
}

/// Through the valleys and over the passes, with a look from high above in the middle.
fn alps_paths(surface: &HeightField) -> [Director; 2] {
    let flight = |places: &[[f64; 3]]| -> Vec<Waypoint> {
        let positions = terrain_following(surface, places, 900.0);
        // Look as far ahead as the next 5 km, a little down.
        let ahead = |i: usize| positions[(i + 5).min(positions.len() - 1)];
        let last = positions[positions.len() - 1];
        let beyond = last - positions[positions.len() - 2];
        (0..positions.len())
            .map(|i| {
                let overshoot = (i + 5).saturating_sub(positions.len() - 1) as f64;
                let target = ahead(i) + beyond * overshoot - DVec3::Z * 350.0;
                Waypoint { position: positions[i], target }
            })
            .collect()
    };
    let calm_route = flight(&[
        [-14_000.0, -19_000.0, 250.0],
        [-12_000.0, -14_000.0, 150.0],
        [-6_000.0, -8_500.0, 400.0],
        [-1_500.0, -3_000.0, 2_200.0],
        [3_000.0, 4_500.0, 1_200.0],
        [1_000.0, 11_000.0, 150.0],
    ]);
    let mut calm = Director::new(calm_route[0], CALM_TURN);
    calm.travel(&calm_route[1..], 50.0);

    let start = flight(&[[20_000.0, -19_000.0, 200.0], [17_000.0, -14_000.0, 150.0]]);
    let fast =
        flight(&[[17_000.0, -13_000.0, 150.0], [12_000.0, -4_000.0, 500.0], [3_000.0, 1_000.0, 700.0]]);
    let elsewhere =
        flight(&[[-19_000.0, 17_000.0, 100.0], [-13_000.0, 13_000.0, 200.0], [-9_000.0, 12_000.0, 900.0]]);
    let wild = wild(&Wild { start: &start, fast: &fast, elsewhere: &elsewhere, speed: 50.0 });
    [calm, wild]
}

/// A spline through places (x, y, height above the highest ground around), cut in steps of about `step`.
fn terrain_following(surface: &HeightField, places: &[[f64; 3]], step: f64) -> Vec<DVec3> {
    let place = |i: usize| DVec3::from_array(places[i.clamp(1, places.len()) - 1]);
    let mut positions = Vec::new();
    for i in 1..places.len() {
        let steps = (place(i).truncate().distance(place(i + 1).truncate()) / step).ceil().max(1.0);
        // The last place of all belongs to the last piece.
        let end = if i + 1 == places.len() { steps as usize + 1 } else { steps as usize };
        for j in 0..end {
            let p = catmull_rom(place(i - 1), place(i), place(i + 1), place(i + 2), j as f64 / steps);
            positions.push(DVec3::new(p.x, p.y, surface.highest(p.x, p.y, 1.1 * step) + p.z.max(50.0)));
        }
    }
    positions
}

/// Over the roofs with the church in view, down into the main street and along it.
fn laserscan_paths(surface: &HeightField) -> [Director; 2] {
    let street = |index: usize, along: f64, eye: f64| {
        let street = &laserscan::MAIN_STREETS[index];
        let p = laserscan::place(street.point + street.direction * along);
        p.extend(surface.highest(p.x, p.y, 3.0) + eye)
    };
    let over = |p: DVec2, above: f64| p.extend(surface.highest(p.x, p.y, 25.0) + above);
    let church = over(laserscan::place(laserscan::CHURCH), -20.0);
    let park = laserscan::place(laserscan::PARK).extend(surface.height(laserscan::PARK.x, laserscan::PARK.y));
    let roofs = |x: f64, y: f64, above: f64, target: DVec3| Waypoint {
        position: over(DVec2::new(x, y), above),
        target,
    };
    let ahead = |index: usize, along: f64| Waypoint {
        position: street(index, along, 3.0),
        target: street(index, along + 50.0, 3.0),
    };

    let start = roofs(245.0, -220.0, 30.0, park);
    let mut calm = Director::new(start, CALM_TURN);
    let mut route = vec![
        roofs(190.0, -170.0, 12.0, park + DVec3::new(-40.0, 60.0, 0.0)),
        roofs(110.0, -160.0, 15.0, street(0, -60.0, 3.0)),
        roofs(40.0, -190.0, 14.0, street(0, -50.0, 3.0)),
        Waypoint { position: street(0, -170.0, 14.0), target: street(0, -50.0, 4.0) },
    ];
    route.extend((-7..=4).map(|i| ahead(0, 20.0 * f64::from(i))));
    route.extend([
        Waypoint { position: street(0, 100.0, 14.0), target: church },
        roofs(-60.0, 190.0, 30.0, church),
        roofs(-120.0, 230.0, 50.0, church),
    ]);
    calm.travel(&route, 1.0);

    let wild = wild(&Wild {
        start: &(-14..=-9).map(|i| ahead(1, 20.0 * f64::from(i))).collect::<Vec<_>>(),
        fast: &(-8..=4).map(|i| ahead(1, 20.0 * f64::from(i))).collect::<Vec<_>>(),
        elsewhere: &[
            roofs(200.0, 280.0, 30.0, church),
            roofs(120.0, 200.0, 15.0, church),
            roofs(20.0, 180.0, 15.0, church),
            roofs(-60.0, 120.0, 25.0, church),
        ],
        speed: 1.0,
    });
    [calm, wild]
}
