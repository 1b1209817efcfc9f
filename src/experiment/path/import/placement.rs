//! Places a resampled trajectory over, on or around a mesh.

use std::f64::consts::PI;

use collapse_log::Mesh;
use glam::{DQuat, DVec2, DVec3};

use super::axes::{QUARTER, look};
use super::envelope::Envelope;
use super::options::{Mode, Up};
use super::trajectory::Sample;
use crate::experiment::path::Pose;

/// A mesh flatter than this part of its shorter side is terrain, and has z up if it is flat in z.
const FLAT: f64 = 0.25;
/// Parts of the mesh's diagonal: clearance over terrain, height of a walker's eyes, height of a flight over terrain.
const CLEARANCE: f64 = 0.004;
const EYE: f64 = 0.001;
const CEILING: f64 = 0.06;

/// The mesh, seen with z up.
pub(super) struct Ground {
    low: DVec3,
    high: DVec3,
    /// From z up to the mesh's own axes.
    to_mesh: DQuat,
    /// Of the mesh in the world.
    origin: DVec3,
    envelope: Envelope,
}

impl Ground {
    pub fn new(mesh: &Mesh, up: Option<Up>) -> Self {
        let (low, high) = mesh.bounding_box().unwrap_or_default();
        let [low, high] = [low, high].map(|p| DVec3::from_array(p.map(f64::from)));
        let up = up_of(mesh, up);
        let turned = |p: DVec3| match up {
            Up::Z => p,
            Up::Y => DVec3::new(p.x, -p.z, p.y),
        };
        let corner =
            |&v: &u32| mesh.positions.get(v as usize).map(|p| turned(DVec3::from_array(p.map(f64::from))));
        let triangles =
            mesh.triangles.iter().filter_map(|[a, b, c]| Some([corner(a)?, corner(b)?, corner(c)?]));
        let (a, b) = (turned(low), turned(high));
        let (low, high) = (a.min(b), a.max(b));
        Self {
            low,
            high,
            to_mesh: to_mesh(mesh, Some(up)),
            origin: mesh.georeference.origin.into(),
            envelope: Envelope::new(low, high, triangles),
        }
    }

    fn size(&self) -> DVec3 {
        self.high - self.low
    }

    fn is_terrain(&self) -> bool {
        let size = self.size();
        size.z < FLAT * size.x.min(size.y)
    }

    /// Radius of the sphere through the corners of the bounding box.
    fn radius(&self) -> f64 {
        0.5 * self.size().length()
    }

    /// Height that a flight at (x, y) must not go below.
    ///
    /// Over an object of bounding radius R it is a dome, 1.15 R (1 - (d / 2.5 R)^2)^2 above the middle at distance d
    /// from the axis. That is above the sphere, sqrt(R^2 - d^2), for every d < R, and unlike it nowhere steep.
    fn floor(&self, p: DVec2) -> f64 {
        if self.is_terrain() {
            return self.envelope.height(p);
        }
        let (middle, radius) = (self.low.midpoint(self.high), self.radius());
        let away = (1.0 - (p - middle.truncate()).length_squared() / (6.25 * radius * radius)).max(0.0);
        middle.z + 1.15 * radius * away * away
    }
}

/// Which axis of a mesh points up, if nobody says it.
fn up_of(mesh: &Mesh, up: Option<Up>) -> Up {
    let (low, high) = mesh.bounding_box().unwrap_or_default();
    let size = DVec3::from_array(high.map(f64::from)) - DVec3::from_array(low.map(f64::from));
    up.unwrap_or(if size.z < FLAT * size.x.min(size.y) { Up::Z } else { Up::Y })
}

/// From z up to the axes of a mesh.
pub(super) fn to_mesh(mesh: &Mesh, up: Option<Up>) -> DQuat {
    match up_of(mesh, up) {
        Up::Y => QUARTER.conjugate(),
        Up::Z => DQuat::IDENTITY,
    }
}

/// Frames from samples at a steady rate, in world coordinates. Positions are rounded to below a ten-millionth of the mesh's diagonal, times
/// and quaternions like those of recorded paths.
pub(super) fn place(samples: &[Sample], ground: &Ground, mode: Mode, rate: f64) -> Vec<Pose> {
    let positions = match mode {
        Mode::Fly => over(samples, ground, rate),
        Mode::Walk => along(samples, ground, rate),
        Mode::Orbit => around(samples, ground),
    };
    let orientations = match mode {
        Mode::Orbit => watching(samples, &positions, ground.low.midpoint(ground.high), rate),
        Mode::Fly | Mode::Walk if samples.iter().all(|sample| sample.orientation.is_some()) => {
            samples.iter().filter_map(|sample| sample.orientation).collect()
        }
        Mode::Fly => ahead(&positions, rate, 0.15),
        Mode::Walk => ahead(&positions, rate, 0.0),
    };
    let mut unit = 1.0;
    while unit * 1e-7 * ground.size().length() < 1.0 && unit < 1e15 {
        unit *= 10.0;
    }
    // Rounded about the mesh, so that the path of a mesh elsewhere is the same path there.
    let rounded = |p: DVec3| DVec3::from((ground.to_mesh * p).to_array().map(|x| round(x, unit)));
    let positions = positions.into_iter().map(|p| ground.origin + rounded(p));
    let times = samples.iter().map(|sample| sample.time);
    let orientations = orientations.into_iter().map(|orientation| ground.to_mesh * orientation);
    frames(times.zip(positions).zip(orientations))
}

/// Frames of times, positions and orientations, with times and quaternions rounded like those of recorded paths.
pub(super) fn frames(samples: impl Iterator<Item = ((f64, DVec3), DQuat)>) -> Vec<Pose> {
    let mut last = DQuat::IDENTITY;
    let pose = |((time, position), orientation): ((f64, DVec3), DQuat)| {
        let orientation = orientation.normalize();
        last = if last.dot(orientation) < 0.0 { -orientation } else { orientation };
        let orientation = DQuat::from_array(last.to_array().map(|x| round(x, 1e9)));
        Pose { time: round(time, 1e6), position, orientation }
    };
    samples.map(pose).collect()
}

/// Adding 0 turns -0 into 0.
fn round(x: f64, unit: f64) -> f64 {
    (x * unit).round() / unit + 0.0
}

/// The box of the trajectory.
fn bounds(samples: &[Sample]) -> (DVec3, DVec3) {
    samples
        .iter()
        .fold((DVec3::MAX, DVec3::MIN), |(low, high), s| (low.min(s.position), high.max(s.position)))
}

/// The factor that makes a box of the size `from` as large as `to` without distorting it; 1 if it has no size.
fn fitting(from: DVec2, to: DVec2) -> f64 {
    let factor = |from: f64, to: f64| if from > 0.0 { to / from } else { f64::INFINITY };
    let factor = factor(from.x, to.x).min(factor(from.y, to.y));
    if factor.is_finite() { factor } else { 1.0 }
}

/// `fly`: the box of the trajectory, scaled to nine tenths of a terrain or twice the bounding sphere of an object,
/// with its heights on top of the floor.
fn over(samples: &[Sample], ground: &Ground, rate: f64) -> Vec<DVec3> {
    let (low, high) = bounds(samples);
    let (size, diagonal) = ((high - low).truncate(), ground.size().length());
    let (room, ceiling) = if ground.is_terrain() {
        (0.9 * ground.size().truncate(), CEILING * diagonal)
    } else {
        (DVec2::splat(4.0 * ground.radius()), 0.5 * ground.radius())
    };
    let scale = fitting(size, room);
    let height = high.z - low.z;
    let vertical = if height > 0.0 { scale.min(ceiling / height) } else { 0.0 };
    let above = |sample: &Sample| CLEARANCE * diagonal + vertical * (sample.position.z - low.z);
    let points = spread(samples, ground, scale);
    let floor = smooth_floor(points.iter().map(|&p| ground.floor(p)), rate);
    let place = |((sample, p), floor): ((&Sample, DVec2), f64)| p.extend(floor + above(sample));
    samples.iter().zip(points).zip(floor).map(place).collect()
}

/// `walk`: the box of the trajectory, scaled to six tenths of the mesh, at eye height above the surface. Of the
/// recorded heights the quick part stays, up to half the eye height.
fn along(samples: &[Sample], ground: &Ground, rate: f64) -> Vec<DVec3> {
    let (low, high) = bounds(samples);
    let scale = fitting((high - low).truncate(), 0.6 * ground.size().truncate());
    let eye = EYE * ground.size().length();
    let heights: Vec<f64> = samples.iter().map(|sample| sample.position.z).collect();
    let steady = moving_average(&heights, rate as usize);
    let bounce =
        heights.iter().zip(steady).map(|(z, steady)| (scale * (z - steady)).clamp(-0.5 * eye, 0.5 * eye));
    let points = spread(samples, ground, scale);
    let floor = smooth_floor(points.iter().map(|&p| ground.envelope.height(p)), rate);
    points.iter().zip(floor).zip(bounce).map(|((p, floor), bounce)| p.extend(floor + eye + bounce)).collect()
}

/// The trajectory in plan, scaled about the middle of its box and moved to the middle of the mesh.
fn spread(samples: &[Sample], ground: &Ground, scale: f64) -> Vec<DVec2> {
    let (low, high) = bounds(samples);
    let (from, to) = (low.midpoint(high).truncate(), ground.low.midpoint(ground.high).truncate());
    samples.iter().map(|sample| to + scale * (sample.position.truncate() - from)).collect()
}

/// Heights that a camera can follow: nowhere below the given ones, without their steps. The mean over a window of the
/// largest over as wide a window is no less than the height in the middle, since each of those windows contains it.
fn smooth_floor(heights: impl Iterator<Item = f64>, rate: f64) -> Vec<f64> {
    let heights: Vec<f64> = heights.collect();
    let half = (0.5 * rate) as usize;
    // Indices of heights that may still become the largest of a window, falling.
    let mut falling = std::collections::VecDeque::new();
    let mut largest = Vec::with_capacity(heights.len());
    for i in 0..heights.len() + half {
        if let Some(&height) = heights.get(i) {
            while falling.back().is_some_and(|&j: &usize| heights[j] <= height) {
                falling.pop_back();
            }
            falling.push_back(i);
        }
        if i >= half {
            while falling.front().is_some_and(|&j| j + 2 * half < i) {
                falling.pop_front();
            }
            largest.push(falling.front().map_or(0.0, |&j| heights[j]));
        }
    }
    // The running sums behind the mean round.
    moving_average(&largest, half).into_iter().zip(heights).map(|(mean, height)| mean.max(height)).collect()
}

/// `orbit`: the longer horizontal side of the box becomes the azimuth, once around; its height the elevation, 8 to 48
/// degrees; the shorter side the distance, 1.4 to 2.4 bounding radii.
fn around(samples: &[Sample], ground: &Ground) -> Vec<DVec3> {
    let (low, high) = bounds(samples);
    let size = high - low;
    let part = |x: f64, size: f64| if size > 0.0 { x / size } else { 0.5 };
    let place = |sample: &Sample| {
        let offset = sample.position - low;
        let [mut azimuth, mut distance] = [part(offset.x, size.x), part(offset.y, size.y)];
        if size.y > size.x {
            std::mem::swap(&mut azimuth, &mut distance);
        }
        let (azimuth, elevation) = (2.0 * PI * azimuth, (8.0 + 40.0 * part(offset.z, size.z)).to_radians());
        let ((sin, cos), (up, level)) = (libm::sincos(azimuth), libm::sincos(elevation));
        let away = DVec3::new(cos * level, sin * level, up);
        ground.low.midpoint(ground.high) + (1.4 + distance) * ground.radius() * away
    };
    samples.iter().map(place).collect()
}

/// Looks at a point, with the quick part of the recorded rotation on top.
#[expect(
    clippy::disallowed_methods,
    reason = "an imported path is written to a file, which is what is replayed"
)]
fn watching(samples: &[Sample], positions: &[DVec3], middle: DVec3, rate: f64) -> Vec<DQuat> {
    const LARGEST: f64 = 8.0 * PI / 180.0;
    let shake = shaking(samples, rate);
    let watch = |(i, &position): (usize, &DVec3)| {
        let shake = shake.get(i).copied().unwrap_or(DQuat::IDENTITY);
        let angle = shake.angle_between(DQuat::IDENTITY);
        let part = if angle > LARGEST { LARGEST / angle } else { 1.0 };
        look(middle - position, DVec3::Z) * DQuat::IDENTITY.slerp(shake, part)
    };
    positions.iter().enumerate().map(watch).collect()
}

/// In camera space, the rotation from the mean of a second to each recorded orientation; nothing if none is recorded.
fn shaking(samples: &[Sample], rate: f64) -> Vec<DQuat> {
    let mut recorded: Vec<DQuat> = samples.iter().filter_map(|sample| sample.orientation).collect();
    for i in 1..recorded.len() {
        if recorded[i - 1].dot(recorded[i]) < 0.0 {
            recorded[i] = -recorded[i];
        }
    }
    let mean = |component: usize| {
        let values: Vec<f64> = recorded.iter().map(|q| q.to_array()[component]).collect();
        moving_average(&values, (0.5 * rate) as usize)
    };
    let [x, y, z, w] = [mean(0), mean(1), mean(2), mean(3)];
    let steady = |i: usize| {
        let mean = DQuat::from_xyzw(x[i], y[i], z[i], w[i]);
        if mean.length_squared() > 1e-6 { mean.normalize() } else { recorded[i] }
    };
    (0..recorded.len()).map(|i| steady(i).inverse() * recorded[i]).collect()
}

/// Mean over up to `half` values before and after each.
fn moving_average(values: &[f64], half: usize) -> Vec<f64> {
    // Sums of differences to the first value: small numbers lose less.
    let first = values.first().copied().unwrap_or(0.0);
    let mut sums = vec![0.0];
    for value in values {
        sums.push(sums[sums.len() - 1] + (value - first));
    }
    let mean = |i: usize| {
        let (from, to) = (i.saturating_sub(half), (i + half + 1).min(values.len()));
        first + (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..values.len()).map(mean).collect()
}

/// Orientation from motion, for recordings of positions: along the way from two seconds before to four after, without
/// banking, `down` (a slope) below it. Climbs and dives steeper than a third are not followed. Where the camera hardly
/// moves it keeps its direction.
pub(super) fn ahead(positions: &[DVec3], rate: f64, down: f64) -> Vec<DQuat> {
    let (before, after) = ((2.0 * rate) as usize, (4.0 * rate).ceil() as usize);
    let chord =
        |i: usize| positions[(i + after).min(positions.len() - 1)] - positions[i.saturating_sub(before)];
    let usual =
        (0..positions.len()).map(|i| chord(i).truncate().length()).sum::<f64>() / positions.len() as f64;
    let moves = |chord: &DVec3| chord.truncate().length() > 1e-3 * usual;
    let start = (0..positions.len()).map(chord).find(moves).unwrap_or(DVec3::X);
    let mut gaze = start.normalize_or(DVec3::X);
    let mut orient = |i: usize| {
        let chord = chord(i);
        let level = chord.truncate().length();
        // The old direction weighs as much as a tenth of the usual chord, so that noise at rest does not turn it.
        let sought = chord.truncate().extend(chord.z.clamp(-level / 3.0, level / 3.0));
        let sought = (0.1 * usual * gaze + sought).normalize_or(gaze);
        // Half a second behind, and never faster than about 2 radians a second.
        gaze = gaze.lerp(sought, (2.0 / rate).min(1.0)).normalize_or(gaze);
        look(gaze - DVec3::Z * (down * gaze.truncate().length()), DVec3::Z)
    };
    (0..positions.len()).map(&mut orient).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_floor_is_nowhere_below_and_has_no_steps() {
        let heights: Vec<f64> =
            (0..200).map(|i| if (80..83).contains(&i) { 10.0 } else { f64::from(i % 7) / 7.0 }).collect();
        let floor = smooth_floor(heights.iter().copied(), 20.0);
        assert_eq!(floor.len(), heights.len());
        assert!(floor.iter().zip(&heights).all(|(floor, height)| floor >= height));
        assert!(floor.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.6));
        assert!(floor[40] < 1.0 && floor[120] < 1.0 && floor[81] >= 10.0);
    }
}
