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
use crate::in_play::Slot;
use crate::motion::Course;
use crate::view::View;

/// Share of the lengths that a time bound gives up, so that rounding never makes it late, the predicate's included.
const SLACK: f64 = 1e-9;
/// A length that squaring loses.
const LOST: f64 = 1e-150;

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

/// `g`, in object units, and more than rounding can have changed it; `None` where no eye sees the node from behind, as there
/// is no cone.
#[must_use]
pub fn signed_distance(eye: DVec3, bounds: &Bounds, cone: &NormalCone) -> Option<(f64, f64)> {
    let (axis, cosine, sine) = parts(cone)?;
    let from = eye - DVec3::from(bounds.center.map(f64::from));
    let (r, d) = (f64::from(bounds.radius), from.length());
    let (q, h) = (from.dot(axis), from.cross(axis).length());
    // Within the cone: cos(phi) >= cos(alpha).
    let nearest = if q >= d * cosine { d } else { q * cosine + h * sine };
    Some((r + nearest, SLACK * (d + r) + LOST))
}

/// Whether any of the views wants the node unfolded that is not behind it.
#[must_use]
pub fn unfold(criterion: Criterion, views: &[View], bounds: &Bounds, cone: &NormalCone) -> bool {
    views.iter().any(|view| criterion.unfold_for(view, bounds) && !is_back_facing(view.eye(), bounds, cone))
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
        match signed_distance(view.eye(), bounds, cone) {
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
        match signed_distance(view.eye(), bounds, cone) {
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
