//! What is scanned and what waits: by how fast the camera is.

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vertex_tree::Bounds;

use crate::criterion::Criterion;
use crate::in_play::{Kind, Slot};
use crate::motion::{Motion, Odometer, Speed, Travel};
use crate::refine::event::EventDriven;
use crate::refine::front::FrontScan;
use crate::refine::{Flips, Frame, Watch};
use crate::view::View;

const NODES: u32 = 2_000;

/// A camera over folded nodes that it does not want, some nearer to their mark than others.
struct Flight {
    event: EventDriven,
    views: [View; 1],
}

impl Flight {
    /// Over nodes that are all so many times as large and as far away.
    fn new(scale: f32) -> Self {
        let view = View::from_parts(DVec3::ZERO, DVec3::X, 0.6, 0.8, 100.0).unwrap();
        let mut flight = Self { event: EventDriven::new(), views: [view] };
        let mut random = Pcg64Mcg::seed_from_u64(1);
        for slot in 1..=NODES {
            // An error of 1 is seen from 100 away; these are 1 to 1000 further off, most of them little.
            let further = 1000.0 / random.random_range(1.0_f32..1000.0);
            let center = [scale * (101.0 + further), 0.0, 0.0];
            let bounds = Bounds { center, radius: scale, eps: scale };
            let frame = Flight::frame(&flight.views, &flight.views);
            flight.event.watch(&frame, Slot(slot), Kind::Unfold, bounds);
        }
        flight
    }

    fn frame<'a>(before: &'a [View], after: &'a [View]) -> Frame<'a> {
        let speed = Speed { rho: 1.0, omega: 1.0, kappa: 1.0 };
        let travel = Travel::between(before, after);
        let motion = Odometer::default().advance_by(&speed.into(), travel.as_ref());
        Frame {
            criterion: Criterion::ScreenError,
            views: after,
            speed,
            motion,
            travel,
            looks_ahead: false,
            cones: None,
        }
    }

    /// To and fro over a stretch, so many frames, by so much each. Returns how many nodes were tested in a frame.
    fn fly(&mut self, frames: u32, step: f64) -> f64 {
        let mut tests = 0;
        for number in 0..frames {
            let sign = if number % 20 < 10 { 1.0 } else { -1.0 };
            let next = [self.views[0].with_eye(self.views[0].eye() + DVec3::Y * sign * step).unwrap()];
            let frame = Self::frame(&self.views, &next);
            let mut flips = Flips::default();
            self.event.find(&frame, &mut flips);
            assert!(flips.unfold.is_empty() && flips.fold.is_empty() && frame.motion != Motion::Rest);
            tests += flips.tests + self.event.settle(&frame);
            self.views = next;
        }
        self.event.assert_well_formed();
        let mut watched = 0;
        self.event.for_each_watched(&mut |_, _, _| watched += 1);
        assert_eq!(watched, NODES, "each is watched once");
        tests as f64 / f64::from(frames)
    }

    fn scanned(&self) -> usize {
        self.event.near().map_or(0, FrontScan::len)
    }
}

#[test]
fn a_fast_camera_has_its_nodes_scanned_and_a_slow_one_has_them_wait() {
    let mut flight = Flight::new(1.0);
    assert_eq!(flight.scanned(), 0, "before anything has moved, all of them wait");
    flight.fly(200, 10.0);
    let fast = flight.scanned();
    assert!(fast > NODES as usize * 3 / 4, "{fast} are scanned");
    // A thousandth as fast.
    flight.fly(200, 0.01);
    let slow = flight.scanned();
    assert!(slow < NODES as usize / 10, "{slow} are scanned");
    let tests = flight.fly(200, 0.01);
    assert!(tests < f64::from(NODES) / 8.0, "{tests} tests a frame");
    flight.fly(200, 10.0);
    assert!(flight.scanned() > NODES as usize * 3 / 4, "{} are scanned", flight.scanned());
}

#[test]
fn it_matters_little_in_what_units_a_scene_is() {
    let scaled = |scale: f32| Flight::new(scale).fly(300, 0.5 * f64::from(scale));
    let usual = scaled(1.0);
    for scale in [1e-6, 1e-3, 1e3, 1e6] {
        let tests = scaled(scale);
        assert!(tests < 2.0 * usual, "{tests} tests a frame at a scale of {scale}, {usual} at 1");
    }
}

#[test]
fn what_is_unwatched_is_gone_wherever_it_was() {
    let mut flight = Flight::new(1.0);
    flight.fly(100, 1.0);
    let scanned = flight.scanned();
    assert!((100..NODES as usize).contains(&scanned), "{scanned} are scanned");
    for slot in (1..=NODES).filter(|slot| slot % 2 == 0) {
        flight.event.unwatch(Slot(slot));
    }
    let mut watched = Vec::new();
    flight.event.for_each_watched(&mut |slot, _, _| watched.push(slot.0));
    watched.sort_unstable();
    assert_eq!(watched, (1..=NODES).filter(|slot| slot % 2 == 1).collect::<Vec<_>>());
}
