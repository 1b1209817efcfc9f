//! The normal-cone test (DeCoro & Pajarola 2002, section 4.3 and Xia & Varshney 1996): what is seen only from behind need
//! not be refined. And its time bounds.
//!
//! A node has a sphere `(c, r)` that holds all triangles below it, and a cone that holds all their normals: an axis `n` and
//! a half-angle `alpha` below 90 degrees, of which the sine is stored. It is *back-facing* for an eye `e` if every normal in
//! the cone points away from the eye at every point of the sphere:
//!
//! ```text
//! m.(e - x) < 0   for all m in the cone, |m| = 1, and all x with |x - c| <= r
//! ```
//!
//! The largest value over `x` is `m.(e - c) + r`. With `D = e - c`, `d = |D|` and `phi` the angle between `D` and the axis,
//! the largest over `m` is
//!
//! ```text
//! g(e) = r + d cos(phi - alpha)   where phi > alpha,   r + d elsewhere;        back-facing iff g < 0
//! ```
//!
//! as the normal nearest to `D` lies in the plane of `D` and `n`. With `q = D.n = d cos(phi)` and `h = |D x n| =
//! d sin(phi)`, the first is `r + q cos(alpha) + h sin(alpha)`, which is positive too where `phi <= alpha`: the sign needs no
//! distinction of cases, and no trigonometry.
//!
//! *Monotone.* `g` grows with the sphere and with the cone, so if a node is back-facing, every node within it is: what is
//! wanted stays closed upwards along all along which spheres and cones are nested.
//!
//! *Time bounds.* `e -> m.(e - c) + r` changes by at most `|e' - e|`, and so does the largest of any number of such
//! functions: `g` is 1-Lipschitz in the eye's position, and nothing else that moves changes it, neither direction nor
//! tolerance. So a back-facing node stays so for at least `-g / (rho + stray)` frames on a course, and one that is not
//! stays as it is for at least `g / (rho + stray)`. A node unfolds for a view when it is wanted by the criterion and not
//! back-facing, so no earlier than the later of the two bounds, and folds no earlier than the earlier of the two.

use std::cell::RefCell;

use glam::DVec3;
use vertex_tree::{Bounds, NormalCone};

use crate::criterion::Criterion;
use crate::front::Slot;
use crate::motion::Course;
use crate::view::View;

/// Share of the lengths that a time bound gives up, so that rounding never makes it late.
const SLACK: f64 = 1e-9;

/// Axis, cosine and sine; `None` for a cone that says nothing.
#[inline]
fn parts(cone: &NormalCone) -> Option<(DVec3, f64, f64)> {
    let axis = DVec3::from(cone.axis.map(f64::from));
    let sine = f64::from(cone.sine);
    let length = axis.length();
    // Neither a sine nor an axis that is not a number passes.
    let says = (0.0..1.0).contains(&sine) && length > 0.5;
    says.then(|| (axis / length, (1.0 - sine * sine).sqrt(), sine))
}

/// Whether a node is seen from behind, wherever in its sphere and its cone its triangles may lie: the canonical predicate.
#[must_use]
pub fn is_back_facing(eye: DVec3, bounds: &Bounds, cone: &NormalCone) -> bool {
    let Some((axis, cosine, sine)) = parts(cone) else { return false };
    let from = eye - DVec3::from(bounds.center.map(f64::from));
    // r + q cos(alpha) + h sin(alpha) < 0, with the root on one side.
    let behind = -from.dot(axis) * cosine - f64::from(bounds.radius);
    behind > 0.0 && from.cross(axis).length_squared() * (sine * sine) < behind * behind
}

/// `g`, and more than rounding can have changed it; `None` where nothing can make the node back-facing.
fn distance(eye: DVec3, bounds: &Bounds, cone: &NormalCone) -> Option<(f64, f64)> {
    let (axis, cosine, sine) = parts(cone)?;
    let from = eye - DVec3::from(bounds.center.map(f64::from));
    let (r, d) = (f64::from(bounds.radius), from.length());
    let (q, h) = (from.dot(axis), from.cross(axis).length());
    // Within the cone: cos(phi) >= cos(alpha).
    let nearest = if q >= d * cosine { d } else { q * cosine + h * sine };
    Some((r + nearest, SLACK * (d + r)))
}

/// Whether any of the views wants the node unfolded that is not behind it.
#[must_use]
pub fn unfold(criterion: Criterion, views: &[View], bounds: &Bounds, cone: &NormalCone) -> bool {
    views.iter().any(|view| criterion.unfold_for(view, bounds) && !is_back_facing(view.eye, bounds, cone))
}

/// [`Criterion::earliest_unfold`] with the normal-cone test.
#[must_use]
pub fn earliest_unfold(
    criterion: Criterion,
    views: &[View],
    course: &Course,
    bounds: &Bounds,
    cone: &NormalCone,
) -> f64 {
    let earliest = |view: &View| {
        let wanted = criterion.earliest_unfold(std::slice::from_ref(view), course, bounds);
        match distance(view.eye, bounds, cone) {
            Some((g, slack)) => wanted.max(course.frames(-g - slack, course.rho + course.stray)),
            None => wanted,
        }
    };
    views.iter().map(earliest).fold(f64::INFINITY, f64::min)
}

/// [`Criterion::earliest_fold`] with the normal-cone test.
#[must_use]
pub fn earliest_fold(
    criterion: Criterion,
    views: &[View],
    course: &Course,
    bounds: &Bounds,
    cone: &NormalCone,
) -> f64 {
    let earliest = |view: &View| {
        let unwanted = criterion.earliest_fold(std::slice::from_ref(view), course, bounds);
        match distance(view.eye, bounds, cone) {
            Some((g, slack)) => unwanted.min(course.frames(g - slack, course.rho + course.stray)),
            None => unwanted,
        }
    };
    views.iter().map(earliest).fold(0.0, f64::max)
}

/// The cones of the nodes in play, by slot. Only a test of them asks for one, so they lie apart from what every frame reads,
/// and where there are none nothing is kept.
#[derive(Debug, Default)]
pub(crate) struct Cones(RefCell<Vec<NormalCone>>);

impl Cones {
    /// The cone of the node that comes into play in a slot.
    pub fn set(&self, slot: Slot, cone: NormalCone) {
        let mut cones = self.0.borrow_mut();
        if cones.len() <= slot.index() {
            cones.resize(slot.index() + 1, NormalCone::NONE);
        }
        cones[slot.index()] = cone;
    }

    /// The cone of the node in a slot; none for roots.
    pub fn of(&self, slot: Slot) -> NormalCone {
        self.0.borrow().get(slot.index()).copied().unwrap_or(NormalCone::NONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0_f64)
            .prop_map(DVec3::from)
            .prop_filter("a direction", |v| (0.01..1.0).contains(&v.length_squared()))
    }

    fn cone_of(axis: DVec3, sine: f64) -> NormalCone {
        NormalCone { axis: axis.normalize().as_vec3().to_array(), sine: sine as f32 }
    }

    /// A normal of the cone, at some angle up to the half-angle and some turn about the axis.
    fn normal(axis: DVec3, sine: f64, share: f64, turn: f64) -> DVec3 {
        let side = axis.any_orthonormal_vector();
        let side = glam::DQuat::from_axis_angle(axis, turn) * side;
        let angle = share * sine.asin();
        axis * angle.cos() + side * angle.sin()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(3000))]

        /// The definition: where a node is back-facing, each point with each normal is; and where it is not, the worst
        /// point with the worst normal is not.
        #[test]
        fn back_facing_is_what_it_says(
            axis in vector(), eye in vector(), scale in prop_oneof![Just(1.0), Just(1e-3), Just(1e4)],
            radius in 0.0..1.5_f64, sine in prop_oneof![0.0..0.999, Just(0.0)],
            samples in prop::array::uniform8((0.0..1.0_f64, 0.0..6.3_f64, vector())),
        ) {
            let axis = axis.normalize();
            let center = DVec3::new(0.3, -0.7, 0.1) * scale;
            let eye = center + eye * 4.0 * scale;
            let bounds = Bounds {
                center: center.as_vec3().to_array(),
                radius: (radius * scale) as f32,
                eps: 0.0,
            };
            let cone = cone_of(axis, sine);
            let (center, radius) = (DVec3::from(bounds.center.map(f64::from)), f64::from(bounds.radius));
            let back = is_back_facing(eye, &bounds, &cone);
            let (g, _) = distance(eye, &bounds, &cone).unwrap();
            let room = 1e-5 * scale;
            if g.abs() > room {
                prop_assert_eq!(back, g < 0.0);
            }
            let mut most = f64::MIN;
            for (share, turn, at) in samples {
                let m = normal(axis, sine, share, turn);
                let x = center + at.normalize() * radius;
                most = most.max(m.dot(eye - x));
            }
            prop_assert!(most <= g + room, "a point and a normal with {most}, more than {g}");
            // The worst of all.
            let from = eye - center;
            let side = (from - from.dot(axis) * axis).normalize_or(axis.any_orthonormal_vector());
            let angle = sine.asin().min(from.dot(side).atan2(from.dot(axis)));
            let m = axis * angle.cos() + side * angle.sin();
            let worst = m.dot(eye - (center - m * radius));
            prop_assert!((worst - g).abs() <= room, "{worst} is not {g}");
        }

        /// On no motion that a course allows does a node change before its time.
        #[test]
        fn bounds_never_miss(
            eye in vector(), aim in vector(), beta in 0.2..1.4_f64, k in 1.0..400.0_f64, axis in vector(),
            radius in 0.001..0.8_f64, eps in 0.0..0.02_f64, sine in 0.0..0.999_f64,
            rho in 0.0..0.1_f64, stray in 0.0001..0.05_f64, omega in 0.0..0.05_f64, kappa in 0.0..1.0_f64,
            heading in vector(),
            steps in prop::collection::vec((vector(), vector(), 0.0..1.0_f64, -1.0..1.0_f64), 1..40),
            sphere_size in any::<bool>(),
        ) {
            let criterion = if sphere_size { Criterion::SphereSize } else { Criterion::ScreenError };
            let heading = heading.normalize();
            let course = Course { heading, rho, stray, omega, kappa };
            let bounds = Bounds { center: [0.1, 0.2, -0.1], radius: radius as f32, eps: eps as f32 };
            let cone = cone_of(axis, sine);
            let direction = (DVec3::new(0.1, 0.2, -0.1) - eye * 3.0 + aim * 0.5).normalize_or(DVec3::X);
            let mut view = View { eye: eye * 3.0, direction, cos_beta: beta.cos(), sin_beta: beta.sin(), k };
            let wanted = unfold(criterion, &[view], &bounds, &cone);
            let first = if wanted {
                earliest_fold(criterion, &[view], &course, &bounds, &cone)
            } else {
                earliest_unfold(criterion, &[view], &course, &bounds, &cone)
            };
            for (frame, (astray, about, forward, steered)) in (1..).zip(steps) {
                view.eye += heading * rho * forward + astray.clamp_length_max(1.0) * stray;
                let turn = glam::DQuat::from_axis_angle(about.normalize(), omega * forward);
                view.direction = (turn * view.direction).normalize();
                view.k = (view.k + kappa * steered).max(1.0);
                if f64::from(frame) < first {
                    let now = unfold(criterion, &[view], &bounds, &cone);
                    prop_assert_eq!(now, wanted, "frame {} of {}", frame, first);
                }
            }
        }
    }

    #[test]
    fn what_says_nothing_is_never_back_facing() {
        let bounds = Bounds { center: [0.0; 3], radius: 0.1, eps: 0.1 };
        let eye = DVec3::new(0.0, 0.0, -5.0);
        assert!(is_back_facing(eye, &bounds, &NormalCone { axis: [0.0, 0.0, 1.0], sine: 0.5 }));
        for (axis, sine) in
            [([0.0, 0.0, 1.0], 1.0), ([0.0; 3], 0.0), ([f32::NAN; 3], 0.0), ([0.0, 0.0, 1.0], f32::NAN)]
        {
            assert!(!is_back_facing(eye, &bounds, &NormalCone { axis, sine }), "{axis:?}, {sine}");
        }
        assert!(!is_back_facing(eye, &bounds, &NormalCone::NONE));
        let inside = DVec3::new(0.0, 0.0, -0.05);
        assert!(!is_back_facing(inside, &bounds, &NormalCone { axis: [0.0, 0.0, 1.0], sine: 0.0 }));
    }
}
