//! Scripts a camera frame by frame: travel along a spline, stop, turn the head, pan, be somewhere else.
//!
//! Bit-identical on every platform, like the scenes: `+ - * /`, `sqrt` and rounding only.

use glam::{DMat3, DQuat, DVec3};

use super::walkthrough::{Path, Pose};

pub(super) const FRAMES_PER_SECOND: f64 = 60.0;

/// Part of the time of a travel that it accelerates, and as much that it brakes; see [`eased`].
const RAMP: f64 = 1.0 / 11.0;
/// Speed in between, in terms of the mean speed.
const PEAK: f64 = 1.1;

/// A place on a route and what to look at when there.
#[derive(Clone, Copy)]
pub(super) struct Waypoint {
    pub position: DVec3,
    pub target: DVec3,
}

pub(super) struct Director {
    poses: Vec<Pose>,
    position: DVec3,
    gaze: DVec3,
    /// The most that the gaze turns in a frame while travelling, in radians.
    turn_limit: f64,
}

impl Director {
    pub fn new(start: Waypoint, turn_limit: f64) -> Self {
        let mut director = Self { poses: Vec::new(), position: DVec3::ZERO, gaze: DVec3::X, turn_limit };
        director.teleport(start);
        director
    }

    /// The next frame is elsewhere.
    pub fn teleport(&mut self, to: Waypoint) {
        self.position = to.position;
        self.gaze = (to.target - to.position).normalize_or(DVec3::X);
        self.record();
    }

    pub fn stop(&mut self, frames: usize) {
        for _ in 0..frames {
            self.record();
        }
    }

    /// Travels from the current place through the waypoints at `speed` a frame, easing in and out. The route and the point looked at follow Catmull-Rom splines, the former by arc length.
    pub fn travel(&mut self, route: &[Waypoint], speed: f64) {
        let Some(first) = route.first() else { return };
        let distance = (first.target - first.position).length();
        let start = Waypoint { position: self.position, target: self.position + self.gaze * distance };
        let knots: Vec<Waypoint> = std::iter::once(start).chain(route.iter().copied()).collect();
        let line = Polyline::new(&knots);
        let frames = (line.length() * PEAK / speed).ceil().max(1.0);
        for frame in 1..=frames as usize {
            let Waypoint { position, target } = line.at(line.length() * eased(frame as f64 / frames));
            self.position = position;
            self.turn_towards((target - position).normalize_or(self.gaze));
            self.record();
        }
    }

    /// Turns the head about the vertical by an angle in radians, counter-clockwise from above, easing in and out.
    pub fn turn(&mut self, angle: f64, frames: usize) {
        self.turn_by(angle, frames, |t| t * t * (3.0 - 2.0 * t));
    }

    /// Turns the head about the vertical at a constant rate in radians a frame.
    pub fn pan(&mut self, rate: f64, frames: usize) {
        self.turn_by(rate * frames as f64, frames, |t| t);
    }

    pub fn finish(self, name: String, units: &str) -> Path {
        Path {
            name,
            units: units.to_owned(),
            fov_y: 60f64.to_radians(),
            aspect: 16.0 / 9.0,
            frames: self.poses,
        }
    }

    fn turn_by(&mut self, angle: f64, frames: usize, progress: impl Fn(f64) -> f64) {
        let start = self.gaze;
        for frame in 1..=frames {
            let (sin, cos) = sin_cos(angle * progress(frame as f64 / frames as f64));
            self.gaze = DVec3::new(start.x * cos - start.y * sin, start.x * sin + start.y * cos, start.z);
            self.record();
        }
    }

    fn turn_towards(&mut self, wanted: DVec3) {
        // The chord between unit vectors is shorter than the angle, by less than a thousandth for small ones.
        let chord = (wanted - self.gaze).length();
        let part = if chord > self.turn_limit { self.turn_limit / chord } else { 1.0 };
        self.gaze = self.gaze.lerp(wanted, part).normalize_or(wanted);
    }

    /// Records a frame, rounded to what a path file shows: microseconds, millimetres, 1e-9 of a quaternion.
    fn record(&mut self) {
        let round = |x: f64, unit: f64| (x * unit).round() / unit;
        let right = self.gaze.cross(DVec3::Z).normalize_or(DVec3::X);
        let axes = DMat3::from_cols(right, right.cross(self.gaze), -self.gaze);
        let mut orientation = DQuat::from_mat3(&axes).normalize();
        if self.poses.last().is_some_and(|last| last.orientation.dot(orientation) < 0.0) {
            orientation = -orientation;
        }
        // Adding 0 turns -0 into 0.
        self.poses.push(Pose {
            time: round(self.poses.len() as f64 / FRAMES_PER_SECOND, 1e6),
            position: self.position.to_array().map(|x| round(x, 1e3) + 0.0).into(),
            orientation: DQuat::from_array(orientation.to_array().map(|x| round(x, 1e9) + 0.0)),
        });
    }
}

/// A spline through waypoints, sampled densely, with the arc length up to each sample.
struct Polyline(Vec<(f64, Waypoint)>);

impl Polyline {
    fn new(knots: &[Waypoint]) -> Self {
        const STEPS: usize = 64;
        let knot = |i: usize| knots[i.clamp(1, knots.len()) - 1];
        let mut samples: Vec<(f64, Waypoint)> = vec![(0.0, knots[0])];
        for i in 1..knots.len() {
            let [a, b, c, d] = [knot(i - 1), knot(i), knot(i + 1), knot(i + 2)];
            for step in 1..=STEPS {
                let t = step as f64 / STEPS as f64;
                let position = catmull_rom(a.position, b.position, c.position, d.position, t);
                let target = catmull_rom(a.target, b.target, c.target, d.target, t);
                let (length, last) = samples[samples.len() - 1];
                samples.push((length + last.position.distance(position), Waypoint { position, target }));
            }
        }
        Self(samples)
    }

    fn length(&self) -> f64 {
        self.0[self.0.len() - 1].0
    }

    fn at(&self, length: f64) -> Waypoint {
        let after = self.0.partition_point(|sample| sample.0 < length).clamp(1, self.0.len() - 1);
        let ((from, a), (to, b)) = (self.0[after - 1], self.0[after]);
        let t = if to > from { ((length - from) / (to - from)).clamp(0.0, 1.0) } else { 1.0 };
        Waypoint { position: a.position.lerp(b.position, t), target: a.target.lerp(b.target, t) }
    }
}

/// From 0 to 1 at constant speed but for the time r at each end, where speed rises and falls linearly. The way is
/// v r / 2 + v (1 - 2r) + v r / 2 = v (1 - r), so v = 1 / (1 - r) = 1.1 for r = 1/11.
fn eased(t: f64) -> f64 {
    if t < RAMP {
        PEAK * t * t / (2.0 * RAMP)
    } else if t > 1.0 - RAMP {
        1.0 - PEAK * (1.0 - t) * (1.0 - t) / (2.0 * RAMP)
    } else {
        PEAK * (t - 0.5 * RAMP)
    }
}

/// Uniform Catmull-Rom spline from `b` at 0 to `c` at 1.
pub(super) fn catmull_rom(a: DVec3, b: DVec3, c: DVec3, d: DVec3, t: f64) -> DVec3 {
    let (from, to) = (0.5 * (c - a), 0.5 * (d - b));
    b + t * (from + t * (3.0 * (c - b) - 2.0 * from - to + t * (2.0 * (b - c) + from + to)))
}

/// Sine and cosine of an angle within +-2 pi, from their series at a 32nd of it and five doublings.
fn sin_cos(angle: f64) -> (f64, f64) {
    let x = angle / 32.0;
    let square = x * x;
    let mut sin =
        x * (1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0))));
    let mut cos = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)));
    for _ in 0..5 {
        (sin, cos) = (2.0 * sin * cos, cos * cos - sin * sin);
    }
    (sin, cos)
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "the platform's own, to compare with")]
mod tests {
    use super::*;

    #[test]
    fn sine_and_cosine() {
        for i in -60..=60 {
            let angle = f64::from(i) / 10.0;
            let (sin, cos) = sin_cos(angle);
            assert!((sin - angle.sin()).abs() < 1e-11 && (cos - angle.cos()).abs() < 1e-11, "{angle}");
        }
    }

    #[test]
    fn easing_is_continuous_and_complete() {
        assert_eq!(eased(0.0), 0.0);
        assert_eq!(eased(1.0), 1.0);
        let steps: Vec<f64> =
            (0..1000).map(|i| eased(f64::from(i + 1) / 1000.0) - eased(f64::from(i) / 1000.0)).collect();
        assert!(steps.iter().all(|&step| step > 0.0 && step < 1.11e-3));
        assert!(steps.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 2e-5));
    }
}
