//! Motions that go straight for a node's mark and end just before its bound, by the odometer: there the answer must still be
//! what it was, and just behind the bound it should not be, or the motion was no adversary.

use std::f64::consts::PI;

use crate::common::{direction, seeded};
use foldfront::Bounds;
use foldfront::selection::criterion::Criterion;
use foldfront::selection::motion::{Course, Motion, Odometer};
use foldfront::selection::view::View;
use glam::{DQuat, DVec3};
use rand::RngExt;
use rand_pcg::Pcg64;

/// What a camera does in a frame.
#[derive(Clone, Copy, Debug)]
struct Step {
    moved: DVec3,
    axis: DVec3,
    angle: f64,
    steered: f64,
}

impl Step {
    /// The view after so many of these, first turned and then moved. `None` for more than half a turn, which leads back.
    fn times(&self, view: &View, times: f64) -> Option<View> {
        if self.angle * times > PI {
            return None;
        }
        let direction = DQuat::from_axis_angle(self.axis, self.angle * times) * view.direction();
        let view = view.with_eye(view.eye() + self.moved * times).ok()?;
        view.with_direction(direction).ok()?.with_k((view.k() + self.steered * times).max(1.0)).ok()
    }
}

/// A node in a view, and the ways that lead to its marks.
struct Case {
    criterion: Criterion,
    view: View,
    bounds: Bounds,
    /// Directions of the eye: at the centre, and at the nearest line of the cone across it.
    to_center: DVec3,
    inwards: DVec3,
    /// Turns about this take the axis of the cone to the centre.
    axis: DVec3,
    distance: f64,
}

fn between(random: &mut Pcg64, low: f64, high: f64) -> f64 {
    (low.ln() + (high / low).ln() * random.random::<f64>()).exp()
}

impl Case {
    fn random(random: &mut Pcg64) -> Self {
        let scale = [1e-35, 1e-20, 1.0, 1.0, 1e3, 1e30][random.random_range(0..6)];
        let center = (direction(random) * scale * random.random::<f64>()).to_array().map(|x| x as f32);
        let distance = scale * between(random, 1e-3, 1e3);
        let to_center = direction(random);
        let eye = DVec3::from(center.map(f64::from)) - to_center * distance;
        // What it comes to with the eye and the centre as they are rounded.
        let to_center = DVec3::from(center.map(f64::from)) - eye;
        let (distance, to_center) = (to_center.length(), to_center.normalize());
        let side = to_center.any_orthonormal_vector();
        let side = (DQuat::from_axis_angle(to_center, random.random_range(0.0..6.3)) * side).normalize();

        let beta =
            [1e-8, between(random, 1e-8, 1.57), between(random, 0.1, 1.57), 1.57][random.random_range(0..4)];
        // How far the centre is from the axis: on it, within the cone, near its line, anywhere.
        let alpha = match random.random_range(0..6) {
            0 => 0.0,
            1 => beta * random.random::<f64>(),
            2 => beta * (1.0 + between(random, 1e-6, 1.0)),
            3 => beta + between(random, 1e-9, 0.1),
            4 => random.random_range(0.0..4e-8),
            _ => random.random_range(0.0..PI),
        };
        let direction = (to_center * alpha.cos() + side * alpha.sin()).normalize();
        let line = distance * (alpha - beta).sin();
        // The sphere: a point, near the cone from either side, anything.
        let near = 1.0 + [-1.0, 1.0][random.random_range(0..2)] * between(random, 1e-6, 1.0);
        let radius = match random.random_range(0..4) {
            0 => 0.0,
            1 => distance * between(random, 1e-9, 1.0),
            2 => (line * near).max(0.0),
            _ => distance * near,
        };
        let k = [1.0, between(random, 1.0, 1e3), between(random, 1.0, 1e12)][random.random_range(0..3)];
        let eps = match random.random_range(0..3) {
            0 => distance / k * 3.0,
            _ => ((distance - radius) / k
                * (1.0 + [-1.0, 1.0][random.random_range(0..2)] * between(random, 1e-6, 1.0)))
            .max(0.0),
        };
        let axis = direction.cross(to_center).normalize_or(side);
        let radial = (to_center - direction * to_center.dot(direction)).normalize_or(side);
        let criterion =
            if random.random_ratio(1, 4) { Criterion::SphereSize } else { Criterion::ScreenError };
        Self {
            criterion,
            view: View::from_parts(eye, direction, beta.cos(), beta.sin(), k).unwrap(),
            bounds: Bounds { center, radius: radius as f32, eps: eps as f32 },
            to_center,
            inwards: radial * beta.cos() - direction * beta.sin(),
            axis,
            distance,
        }
    }

    fn course(&self, random: &mut Pcg64) -> Course {
        let rate = |random: &mut Pcg64| {
            if random.random_ratio(1, 3) { 0.0 } else { between(random, 1e-4, 1.0) }
        };
        let heading = match random.random_range(0..6) {
            0 => DVec3::ZERO,
            1 => self.to_center,
            2 => -self.to_center,
            3 => self.inwards,
            4 => -self.inwards,
            _ => direction(random),
        };
        let rho = if heading == DVec3::ZERO { 0.0 } else { rate(random) * self.distance };
        let (stray, omega) = (rate(random) * self.distance, rate(random));
        Course { heading, rho, stray, omega, kappa: rate(random) * self.view.k() }
    }

    /// The worst that a camera on the course can do, and what is as fast.
    fn steps(&self, course: &Course) -> Vec<Step> {
        let mut steps = Vec::new();
        for way in [self.to_center, -self.to_center, self.inwards, -self.inwards, DVec3::ZERO] {
            for along in [0.0, 1.0] {
                for turn in [0.0_f64, 1.0, -1.0] {
                    for steer in [0.0, 1.0, -1.0] {
                        steps.push(Step {
                            moved: way * course.stray + along * course.heading * course.rho,
                            axis: if turn < 0.0 { -self.axis } else { self.axis },
                            angle: turn.abs() * course.omega,
                            steered: steer * course.kappa,
                        });
                    }
                }
            }
        }
        steps
    }

    fn unfold(&self, view: &View) -> bool {
        self.criterion.unfold(std::slice::from_ref(view), &self.bounds)
    }

    /// How far the clock gets by so many steps.
    fn frames(&self, course: &Course, step: &Step, times: f64) -> Option<f64> {
        let after = step.times(&self.view, times)?;
        match Odometer::default().advance(course, &[self.view], &[after]) {
            Motion::Frames(frames) => Some(frames),
            Motion::Rest | Motion::Unbounded => None,
        }
    }
}

#[test]
fn no_motion_gets_to_a_mark_before_its_bound() {
    let mut random = seeded(41);
    let (mut tried, mut reached, mut near_axis) = (0_u64, 0_u64, 0_u64);
    for case in 0..150_000 {
        let node = Case::random(&mut random);
        let course = node.course(&mut random);
        let views = [node.view];
        let wanted = node.unfold(&node.view);
        let bound = if wanted {
            node.criterion.earliest_fold(&views, &course, &node.bounds)
        } else {
            node.criterion.earliest_unfold(&views, &course, &node.bounds)
        };
        if !(bound > 0.0 && bound < 1e8) {
            continue;
        }
        let mut was_reached = false;
        for step in node.steps(&course) {
            // As many steps as end just before the bound.
            let mut times = bound;
            for _ in 0..3 {
                let Some(frames) = node.frames(&course, &step, times) else { break };
                times *= bound / frames * (1.0 - 1e-9);
            }
            let Some(frames) = node.frames(&course, &step, times).filter(|&frames| frames < bound) else {
                continue;
            };
            let Some(after) = step.times(&node.view, times) else { continue };
            tried += 1;
            assert_eq!(
                node.unfold(&after),
                wanted,
                "case {case}: {:?} in {:?} on {course:?} flips at {frames} of {bound} by {step:?}",
                node.bounds,
                node.view
            );
            let beyond = step.times(&node.view, times * (1.0 + 1e-3));
            was_reached |= beyond.is_some_and(|beyond| node.unfold(&beyond) != wanted);
        }
        reached += u64::from(was_reached);
        near_axis += u64::from(was_reached && node.view.sin_beta() < 1e-6);
    }
    eprintln!("{tried} motions, {reached} bounds reached, {near_axis} of them at narrow cones");
    assert!(tried > 500_000 && reached > 5_000 && near_axis > 500, "{tried} {reached} {near_axis}");
}

/// `p` of a centre on the axis is 0 and near it what it is, whatever the direction: the square root of the difference of two
/// squares is off by 1e-8 of the distance there, which is ten times what a bound gives up.
#[test]
fn a_node_near_the_axis_is_where_it_is() {
    let mut random = seeded(42);
    for _ in 0..20_000 {
        let to_center = direction(&mut random);
        let side = to_center.any_orthonormal_vector();
        let distance = random.random_range(1.0..2.0);
        let beta = 1e-8_f64;
        let alpha: f64 = random.random_range(0.0..3e-8);
        let direction = (to_center * alpha.cos() + side * alpha.sin()).normalize();
        let view = View::from_parts(-to_center * distance, direction, beta.cos(), beta.sin(), 10.0).unwrap();
        let bounds = Bounds { center: [0.0; 3], radius: 0.0, eps: 1.0 };
        let criterion = Criterion::ScreenError;
        let off = alpha - beta;
        if off.abs() > 1e-13 {
            assert_eq!(criterion.unfold(&[view], &bounds), off < 0.0, "{alpha}");
        }
        let course = Course { heading: DVec3::ZERO, rho: 0.0, stray: 1.0, omega: 0.0, kappa: 0.0 };
        let frames = criterion.earliest_unfold(&[view], &course, &bounds);
        let expected = (distance * off - 1e-9 * distance).max(0.0);
        assert!((frames - expected).abs() < 1e-14, "{alpha}: {frames}, not {expected}");
    }
}
