//! Trajectories as they are recorded: of a drone, a car, a hand-held camera and a flight over a screen's terrain, made up.

use std::fmt::Write;

use super::{direction, seeded};
use glam::{DMat3, DQuat, DVec3};
use rand::RngExt;
use rand_pcg::Pcg64;

/// A smooth curve along a random walk: in -1..1, with a new point every so many seconds.
struct Wander {
    points: Vec<DVec3>,
    pace: f64,
}

impl Wander {
    fn new(seconds: usize, pace: f64, random: &mut Pcg64) -> Self {
        let points = (seconds as f64 / pace) as usize + 4;
        Self { points: (0..points).map(|_| direction(random) * random.random::<f64>()).collect(), pace }
    }

    /// A uniform cubic B-spline.
    fn at(&self, time: f64) -> DVec3 {
        let i = (time / self.pace) as usize;
        let (t, [a, b, c, d]) = (time / self.pace - i as f64, [0, 1, 2, 3].map(|k| self.points[i + k]));
        let half = |near: DVec3, far: DVec3, t: f64| {
            (3.0 * t * t * t - 6.0 * t * t + 4.0) * near + (1.0 - t) * (1.0 - t) * (1.0 - t) * far
        };
        (half(b, a, t) + half(c, d, 1.0 - t)) / 6.0
    }
}

/// One sample: seconds, place, where the camera looks, and what is up, both of about unit length.
struct Sample(f64, DVec3, DVec3, DVec3);

/// So many seconds at a rate: somewhere along a curve, looking along another, both with this pace.
fn samples(
    seconds: usize,
    [rate, pace]: [f64; 2],
    random: &mut Pcg64,
    at: fn(f64, DVec3, DVec3) -> [DVec3; 2],
) -> Vec<Sample> {
    let [place, aim] = [0; 2].map(|_| Wander::new(seconds, pace, random));
    let count = (seconds as f64 * rate) as usize;
    let times = (0..count).map(|n| n as f64 / rate);
    let sample = |time: f64| {
        let [eye, forward] = at(time, place.at(time), aim.at(time));
        Sample(time, eye, forward.normalize(), DVec3::Z)
    };
    times.map(sample).collect()
}

/// `t x y z qx qy qz qw` for a body whose axes are columns made of right, up and forward.
fn poses(comment: &str, samples: &[Sample], body: fn(DVec3, DVec3, DVec3) -> DMat3) -> String {
    let mut text = format!("# {comment}\n# t x y z qx qy qz qw\n");
    for Sample(time, eye, forward, up) in samples {
        let right = forward.cross(*up).normalize();
        let q = DQuat::from_mat3(&body(right, right.cross(*forward), *forward));
        let [x, y, z] = eye.to_array();
        writeln!(text, "{time:.6} {x:.6} {y:.6} {z:.6} {:.7} {:.7} {:.7} {:.7}", q.x, q.y, q.z, q.w).unwrap();
    }
    text
}

/// Through a hall, 200 times a second, quick and with turns: x up and z forward.
pub fn drone(seconds: usize) -> String {
    let samples = samples(seconds, [200.0, 4.0], &mut seeded(31), |_, place, aim| {
        [6.0 * place, aim.with_z(0.3 * aim.z)]
    });
    poses("EuRoC MAV, body (IMU) pose", &samples, |right, up, forward| DMat3::from_cols(up, right, forward))
}

/// Along streets, ten times a second, at 10 m/s, always further; z forward, and down is y in its world.
pub fn car(seconds: usize) -> String {
    let mut samples = samples(seconds, [10.0, 2.0], &mut seeded(32), |time, place, _| {
        [DVec3::new(10.0 * time, 40.0 * place.y, 0.3 * place.z), DVec3::X]
    });
    for n in 1..samples.len() {
        samples[n - 1].2 = (samples[n].1 - samples[n - 1].1).normalize();
    }
    let down = |p: DVec3| DVec3::new(-p.y, -p.z, p.x);
    samples.iter_mut().for_each(|Sample(_, eye, forward, up)| {
        [*eye, *forward, *up] = [*eye, *forward, *up].map(down);
    });
    poses("KITTI: y is down", &samples, optical)
}

/// Around something, 60 times a second, with a hand that shakes: right, down and forward.
pub fn hand_held(seconds: usize) -> String {
    let samples = samples(seconds, [60.0, 4.0], &mut seeded(33), |_, place, aim| {
        let eye = 2.0 * place + DVec3::new(0.0, 0.0, 1.5);
        [eye, -eye.normalize() + 0.2 * aim]
    });
    poses("hand-held camera; optical (x right, y down, z forward)", &samples, optical)
}

fn optical(right: DVec3, up: DVec3, forward: DVec3) -> DMat3 {
    DMat3::from_cols(right, -up, forward)
}

/// Over a terrain of width 1, in Hoppe's format: a frame a line, x forward, y left, z up.
pub fn flight(seconds: usize) -> String {
    let samples = samples(seconds, [30.0, 8.0], &mut seeded(34), |_, place, aim| {
        let middle = DVec3::new(0.5, 0.25, 0.0);
        let eye = middle + DVec3::new(0.5 * place.x, 0.25 * place.y, 0.15 + 0.05 * place.z);
        [eye, (middle - eye + 0.2 * aim).with_z(-0.15)]
    });
    let mut text = String::new();
    for Sample(_, eye, forward, up) in samples {
        let left = up.cross(forward).normalize();
        let rows = [forward, left, forward.cross(left), eye].map(|v| format!("{} {} {}", v.x, v.y, v.z));
        writeln!(text, "F 0  {}  0.502897024\nf 0 0 0", rows.join("  ")).unwrap();
    }
    text
}
