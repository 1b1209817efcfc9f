//! A million frames.

use foldfront::selection::engine::Settings;
use foldfront::selection::view::View;
use glam::{DQuat, DVec3};

use super::follow::{Party, look, scaled_log};
use crate::common::{direction, seeded};
use rand::RngExt;

const FRAMES: u64 = 1_000_000;

/// The event queue's clocks run on through all of them. A drifting camera, with stops, spurts and turns of the head; brute
/// force looks at every frame of the first thousands, of every tenth thousand, and at every 97th of the rest.
#[test]
fn a_million_frames() {
    let mut random = seeded(47);
    let log = scaled_log(1.0, false, &mut random);
    let mut party = Party::new(&log, Settings { rho: 0.003, omega: 0.005, ..Settings::default() });
    party.only_events();
    let mut view = look(1.0, 1.0, 0.02, &mut random);
    let (mut heading, mut turn, mut pace) = (direction(&mut random), DQuat::IDENTITY, 1.0);
    for frame in 0..FRAMES {
        if random.random_ratio(1, 50) {
            heading = (heading + 0.7 * direction(&mut random) - 0.2 * view.eye()).normalize();
            turn = DQuat::from_axis_angle(direction(&mut random), random.random_range(0.0..0.004));
            pace = [0.0, 1e-9, 1e-3, 0.3, 1.0, 1.0, 5.0][random.random_range(0..7)];
        }
        view = moved(view, heading * 0.003 * pace, if pace > 0.0 { turn } else { DQuat::IDENTITY });
        if random.random_range(0..20_000) == 0 {
            view = look(1.0, 1.0, 0.02, &mut random);
        }
        let is_checked = frame < 5000 || frame / 1000 % 10 == 0 || frame % 97 == 0;
        party.advance(&[view], is_checked);
    }
    assert_eq!(party.frames, FRAMES);
    assert!(party.changes > 50_000, "{} changes", party.changes);
}

fn moved(view: View, by: DVec3, turn: DQuat) -> View {
    let view = view.with_eye(view.eye() + by).unwrap();
    view.with_direction((turn * view.direction()).normalize()).unwrap()
}
