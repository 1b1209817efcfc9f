//! Views along a random walk around a sphere: slow, fast, turning, at rest, elsewhere altogether, several at once, none.

use glam::{DQuat, DVec3};
use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;
use selection::view::View;

/// A walk; the same seed gives the same one.
#[derive(Clone, Debug)]
pub struct Walk {
    random: Pcg64,
    center: DVec3,
    radius: f64,
    at: [View; 2],
    views: Vec<View>,
    frame: u32,
}

impl Walk {
    /// Frames after which every kind of motion has come at least once.
    pub const FRAMES: u32 = 600;

    /// Around a sphere of such a centre and radius. The tolerance is a thousandth of the distance.
    #[must_use]
    pub fn new(center: [f64; 3], radius: f64, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let (center, radius) = (DVec3::from(center), radius.max(f64::MIN_POSITIVE));
        let at = [0, 1].map(|_| anywhere(center, radius, &mut random));
        Self { random, center, radius, at, views: Vec::new(), frame: 0 }
    }

    /// The largest steps of what is no jump: in units and radians a frame.
    #[must_use]
    pub fn speed(&self) -> [f64; 2] {
        [0.01 * self.radius, 0.01]
    }

    /// The views of the next frame: mostly one.
    pub fn next_views(&mut self) -> &[View] {
        self.frame += 1;
        for view in &mut self.at {
            *view = step(*view, self.center, self.radius, &mut self.random);
        }
        self.views.clear();
        match self.frame % 100 {
            // Nobody looks.
            50 => {}
            70..80 => self.views.extend(self.at),
            _ => self.views.push(self.at[0]),
        }
        &self.views
    }
}

/// Any direction, each as likely as the others.
#[must_use]
pub fn direction(random: &mut impl Rng) -> DVec3 {
    loop {
        let v = DVec3::from([0; 3].map(|_| random.random_range(-1.0..1.0)));
        if (0.01..1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// A view from somewhere around a sphere or within it, roughly towards its middle. The tolerance is a thousandth of the distance.
#[must_use]
pub fn anywhere(center: DVec3, radius: f64, random: &mut impl Rng) -> View {
    let eye = center + direction(random) * radius * random.random_range(0.3..4.0);
    let ahead = center + direction(random) * 0.7 * radius - eye;
    // Half the angle of the cone that holds the pyramid of view: its tangent is 1.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    View::from_parts(eye, ahead.normalize(), half, half, 1000.0).expect("a view")
}

/// One frame of a walk around a sphere: mostly slow, sometimes at rest, fast, turning, or elsewhere altogether, with the same
/// tolerance.
#[must_use]
pub fn step(view: View, center: DVec3, radius: f64, random: &mut impl Rng) -> View {
    let moved = |view: View, by: DVec3| view.with_eye(view.eye() + by).expect("an eye");
    match random.random_range(0..40) {
        0 => anywhere(center, radius, random).with_k(view.k()).expect("a tolerance"),
        1..=5 => view,
        6..=8 => turned(view, 0.4 * random.random::<f64>(), random),
        9..=10 => moved(view, direction(random) * 0.5 * radius * random.random::<f64>()),
        _ => {
            let ahead = (view.direction() + direction(random)) * 0.005 * radius * random.random::<f64>();
            let mut view = turned(moved(view, ahead), 0.01 * random.random::<f64>(), random);
            if (view.eye() - center).length() > 4.0 * radius {
                view = view.with_eye(center + (view.eye() - center) * 0.9).expect("an eye");
            }
            view
        }
    }
}

/// A view turned by so many radians about a random axis.
#[expect(clippy::disallowed_methods, reason = "a random motion: it need not be the same on every platform")]
#[must_use]
pub fn turned(view: View, angle: f64, random: &mut impl Rng) -> View {
    let axis = view.direction().any_orthogonal_vector().normalize();
    let axis = DQuat::from_axis_angle(view.direction(), random.random_range(0.0..6.0)) * axis;
    let direction = DQuat::from_axis_angle(axis, angle) * view.direction();
    view.with_direction(direction.normalize()).expect("a direction")
}
