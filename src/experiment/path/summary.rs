//! How a walkthrough moves: speeds, turns, stops and teleports.

use glam::DVec3;

use super::walkthrough::Path;

/// The motion from one frame to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Distance the eye moves in a frame, in object units.
    pub rho: f64,
    /// Angle the viewing direction turns in a frame, in radians. Rolling about it does not count.
    pub omega: f64,
}

/// What `path info` says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// How many frames there are.
    pub frames: usize,
    /// From the first frame to the last.
    pub seconds: f64,
    /// Distance travelled, without teleports, in object units.
    pub length: f64,
    /// Motion of a frame: the median, the 99th percentile and the largest, each of speed and rotation on its own.
    pub motion: [Motion; 3],
    /// Runs of at least [`Summary::STOP`] steps with neither motion nor rotation.
    pub stops: usize,
    /// Steps longer than [`Summary::TELEPORT`] times the median step of a moving eye.
    pub teleports: usize,
}

impl Summary {
    /// Steps at rest, at least, of a stop.
    pub const STOP: usize = 6;
    /// Times the median step of the moving eye from which a step is a teleport.
    pub const TELEPORT: f64 = 25.0;
}

impl Path {
    /// The motion of each step; one fewer than there are frames.
    pub fn steps(&self) -> impl Iterator<Item = Motion> + '_ {
        (1..self.frames.len()).map(|frame| {
            let (before, after) = (&self.frames[frame - 1], &self.frames[frame]);
            Motion {
                rho: before.position.distance(after.position),
                omega: angle(before.direction(), after.direction()),
            }
        })
    }

    /// The nearest-rank percentile, `percent` in 0..=100, of the distance and of the angle of all steps, each on its
    /// own: the smallest value that so many percent of the steps do not exceed. Steps at rest count, as zeros. A path
    /// of a single frame has no motion.
    #[must_use]
    pub fn motion_percentile(&self, percent: f64) -> Motion {
        self.motion_percentiles([percent])[0]
    }

    /// How the path moves.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let steps: Vec<Motion> = self.steps().collect();
        let mut moving: Vec<f64> = steps.iter().map(|step| step.rho).filter(|&rho| rho > 0.0).collect();
        moving.sort_by(f64::total_cmp);
        let teleport =
            moving.get(moving.len() / 2).map_or(f64::INFINITY, |median| median * Summary::TELEPORT);
        let at_rest = |step: &Motion| step.rho == 0.0 && step.omega == 0.0;
        let time = |frame: Option<&super::walkthrough::Pose>| frame.map_or(0.0, |frame| frame.time);
        Summary {
            frames: self.frames.len(),
            seconds: time(self.frames.last()) - time(self.frames.first()),
            // Not `sum`, which is -0 of nothing.
            length: moving.iter().filter(|&&rho| rho <= teleport).fold(0.0, |length, rho| length + rho),
            motion: self.motion_percentiles([50.0, 99.0, 100.0]),
            stops: steps
                .chunk_by(|a, b| at_rest(a) == at_rest(b))
                .filter(|run| run.len() >= Summary::STOP && at_rest(&run[0]))
                .count(),
            teleports: steps.iter().filter(|step| step.rho > teleport).count(),
        }
    }

    fn motion_percentiles<const N: usize>(&self, percents: [f64; N]) -> [Motion; N] {
        let (mut rhos, mut omegas): (Vec<f64>, Vec<f64>) =
            self.steps().map(|step| (step.rho, step.omega)).unzip();
        rhos.sort_by(f64::total_cmp);
        omegas.sort_by(f64::total_cmp);
        percents.map(|percent| {
            let rank = (rhos.len() as f64 * percent / 100.0).ceil() as usize;
            let at = |sorted: &[f64]| {
                let index = rank.clamp(1, sorted.len().max(1)) - 1;
                sorted.get(index).copied().unwrap_or(0.0)
            };
            Motion { rho: at(&rhos), omega: at(&omegas) }
        })
    }
}

/// Angle between unit vectors, exact down to the smallest pans: for an angle a, |u - v| = 2 sin(a/2) and
/// |u + v| = 2 cos(a/2). The arc cosine of u.v would be 0 for all turns below 1e-8.
fn angle(u: DVec3, v: DVec3) -> f64 {
    2.0 * libm::atan2((u - v).length(), (u + v).length())
}

#[cfg(test)]
#[expect(clippy::disallowed_methods, reason = "random motion")]
mod tests {
    use glam::DQuat;

    use super::super::walkthrough::Pose;
    use super::*;

    /// A path along x by the given steps, each also a turn about y by the given angles.
    fn path(steps: &[(f64, f64)]) -> Path {
        let (mut x, mut heading) = (0.0, 0.0);
        let mut frames = vec![Pose { time: 0.0, position: DVec3::ZERO, orientation: DQuat::IDENTITY }];
        for (i, (forward, turn)) in steps.iter().enumerate() {
            x += forward;
            heading += turn;
            frames.push(Pose {
                time: (i + 1) as f64,
                position: DVec3::new(x, 0.0, 0.0),
                orientation: DQuat::from_rotation_y(heading),
            });
        }
        Path { name: "test".to_owned(), units: "m".to_owned(), fov_y: 1.0, aspect: 1.5, frames }
    }

    #[test]
    fn percentiles_are_nearest_rank_and_count_rest() {
        let path = path(&[(0.0, 0.0), (0.0, 0.1), (3.0, 0.0), (1.0, 0.0)]);
        let at = |percent| path.motion_percentile(percent);
        assert_eq!([0.0, 25.0, 50.0, 75.0, 100.0].map(|p| at(p).rho), [0.0, 0.0, 0.0, 1.0, 3.0]);
        assert_eq!(at(75.0).omega, 0.0);
        assert!((at(75.1).omega - 0.1).abs() < 1e-15);
    }

    #[test]
    fn slow_pans_are_not_lost() {
        let omega = path(&[(0.0, 1e-10)]).motion_percentile(50.0).omega;
        assert!((omega - 1e-10).abs() < 1e-15, "{omega}");
    }

    #[test]
    fn a_single_frame_has_no_motion() {
        assert_eq!(path(&[]).motion_percentile(99.0), Motion::default());
        let summary = path(&[]).summary();
        assert_eq!((summary.frames, summary.length.to_string()), (1, "0".to_owned()));
    }

    #[test]
    fn stops_and_teleports_are_counted() {
        let mut steps = vec![(1.0, 0.01); 10];
        steps.extend([(0.0, 0.0); 6]);
        steps.extend([(1.0, 0.0); 5]);
        steps.extend([(0.0, 0.0); 5]); // Too short for a stop.
        steps.extend([(100.0, 0.0), (2.0, 0.0)]);
        let summary = path(&steps).summary();
        assert_eq!((summary.stops, summary.teleports), (1, 1));
        assert_eq!((summary.length, summary.seconds, summary.frames), (17.0, 28.0, 29));
    }
}
