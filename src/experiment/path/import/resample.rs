//! Samples of a recorded trajectory at a steady rate.

use std::path::Path as FilePath;

use glam::{DQuat, DVec3};

use super::error::ImportError;
use super::options::most_frames;
use super::trajectory::Sample;

/// Seconds between samples from which they have a gap between them, if also so many times the median.
const GAP: f64 = 0.5;
const GAP_STEPS: f64 = 5.0;

/// One sample each 1 / `rate` seconds, from time 0. `samples` has at least two.
pub(super) fn at_rate(file: &FilePath, samples: &[Sample], rate: f64) -> Result<Vec<Sample>, ImportError> {
    let start = samples[0].time;
    let seconds = samples[samples.len() - 1].time - start;
    let frames = (seconds * rate * (1.0 + 1e-12)).floor() + 1.0;
    let most = most_frames(samples.len());
    if frames.is_nan() || frames > most as f64 {
        return Err(ImportError::TooLong { file: file.to_owned(), seconds, rate, most });
    }
    let mut steps: Vec<f64> = samples.windows(2).map(|pair| pair[1].time - pair[0].time).collect();
    steps.sort_by(f64::total_cmp);
    let curve = Curve { samples, gap: GAP.max(GAP_STEPS * steps[steps.len() / 2]) };
    let mut after = 1;
    let frame = |frame: usize| {
        let time = frame as f64 / rate;
        while after + 1 < samples.len() && samples[after].time - start < time {
            after += 1;
        }
        let (position, orientation) = curve.between(after - 1, start + time);
        Sample { time, position, orientation }
    };
    Ok((0..frames as usize).map(frame).collect())
}

struct Curve<'a> {
    samples: &'a [Sample],
    /// Seconds.
    gap: f64,
}

impl Curve<'_> {
    /// Position and orientation at a time between sample `i` and the next.
    #[expect(
        clippy::disallowed_methods,
        reason = "an imported path is written to a file, which is what is replayed"
    )]
    fn between(&self, i: usize, time: f64) -> (DVec3, Option<DQuat>) {
        let (a, b) = (&self.samples[i], &self.samples[i + 1]);
        let step = b.time - a.time;
        let mut t = ((time - a.time) / step).clamp(0.0, 1.0);
        let position = if step > self.gap {
            let moving = (2.0 * t - 1.0).max(0.0);
            t = moving * moving * (3.0 - 2.0 * moving);
            a.position.lerp(b.position, t)
        } else {
            // Cubic Hermite: Catmull-Rom for samples that are not evenly spaced in time.
            let (u, v) = (self.velocity(i) * step, self.velocity(i + 1) * step);
            let chord = b.position - a.position;
            a.position + t * (u + t * (3.0 * chord - 2.0 * u - v + t * (u + v - 2.0 * chord)))
        };
        (position, a.orientation.zip(b.orientation).map(|(a, b)| a.slerp(b, t).normalize()))
    }

    /// Velocity at a sample: the chord of its neighbours. At the ends that of the only chord; beside a gap 0, since the
    /// camera rests there.
    fn velocity(&self, i: usize) -> DVec3 {
        let before = &self.samples[i.saturating_sub(1)];
        let (here, after) = (&self.samples[i], &self.samples[(i + 1).min(self.samples.len() - 1)]);
        if here.time - before.time > self.gap || after.time - here.time > self.gap {
            return DVec3::ZERO;
        }
        (after.position - before.position) / (after.time - before.time)
    }
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "angles to compare with")]
mod tests {
    use super::*;

    fn sample(time: f64, x: f64) -> Sample {
        Sample {
            time,
            position: DVec3::new(x, 0.0, 0.0),
            orientation: Some(DQuat::from_rotation_z(x / 10.0)),
        }
    }

    fn resampled(samples: &[Sample], rate: f64) -> Vec<Sample> {
        at_rate(FilePath::new("test"), samples, rate).unwrap()
    }

    #[test]
    fn steady_motion_stays_steady() {
        let samples: Vec<Sample> = [0.0, 0.1, 0.25, 0.3, 0.4].map(|t| sample(5.0 + t, 3.0 * t)).to_vec();
        let frames = resampled(&samples, 50.0);
        assert_eq!(frames.len(), 21);
        for (i, frame) in frames.iter().enumerate() {
            let time = i as f64 / 50.0;
            assert_eq!(frame.time, time);
            assert!((frame.position.x - 3.0 * time).abs() < 1e-12);
            assert!(frame.orientation.unwrap().angle_between(DQuat::from_rotation_z(0.3 * time)) < 1e-7);
        }
    }

    #[test]
    fn a_gap_becomes_a_stop_and_then_a_smooth_move() {
        let mut samples: Vec<Sample> =
            (0..=10).map(|i| sample(f64::from(i) / 10.0, 0.1 * f64::from(i))).collect();
        samples.extend((0..=10).map(|i| sample(3.0 + f64::from(i) / 10.0, 9.0 + 0.1 * f64::from(i))));
        let frames = resampled(&samples, 100.0);
        assert!(frames[100..=200].iter().all(|frame| frame.position.x == 1.0));
        assert!((frames[300].position.x - 9.0).abs() < 1e-9);
        let steps: Vec<f64> = frames.windows(2).map(|pair| pair[1].position.x - pair[0].position.x).collect();
        // 8 units in a second, easing, are 1.5 times 0.08 a frame at most.
        assert!(steps.iter().all(|&step| (-1e-12..=0.121).contains(&step)));
    }

    #[test]
    fn a_jump_between_ordinary_samples_stays() {
        let samples: Vec<Sample> =
            (0..100).map(|i| sample(f64::from(i) / 200.0, if i < 50 { 0.0 } else { 0.14 })).collect();
        let frames = resampled(&samples, 60.0);
        let largest =
            frames.windows(2).map(|pair| pair[1].position.x - pair[0].position.x).fold(0.0, f64::max);
        assert!(largest > 0.12);
    }
}
