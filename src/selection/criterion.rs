//! The refinement criterion: one canonical predicate that decides every flip, and its time bounds.
//!
//! Zach & Karner, Fast Event-Driven Refinement of Dynamic Levels of Detail, 2003, section 3:
//!
//! ```text
//! unfold(node) = inside or (visible and coarse)
//! ```
//!
//! For a view with eye `e`, direction `v` and cone half-angle `beta`, and a node with sphere `(c, r)` and error
//! `eps`, let `D = c - e`, `d = |D|`, `a = D.v`, `p = |D x v|`. Then
//!
//! * inside: `d < r`;
//! * coarse: `d <= R`, where `R = r + eps k` (screen error: the projection of `eps`, at the sphere's nearest point,
//!   is at least the tolerance) or `R = r k` (sphere size, the paper's: that of `r`, at the centre);
//! * visible: the sphere touches the cone. In the plane of `c` and the axis, the cone's edge is the ray
//!   `(cos beta, sin beta)` in coordinates `(a, p)`; the signed distance of the centre from its line is
//!   `f = p cos beta - a sin beta`, negative within. Visible iff `f <= r`. Where the foot of the perpendicular falls
//!   behind the apex, `a cos beta + p sin beta < 0`, the apex is the nearest point of the cone and `f` is `d`.
//!   This is the paper's `alpha - phi <= beta`, without trigonometry.
//!
//! Every test grows with the sphere and the error: if a node passes, so does any node whose sphere contains its
//! sphere and whose error is no less. Stored bounds leave more slack between parent and child than f64 can lose.
//!
//! The predicate below squares `d <= R` and `f <= r` away: it needs no root, and since IEEE 754 fixes the result of
//! every operation in it, all strategies, the oracle and every machine agree bit for bit.
//!
//! # Rounding
//!
//! Let `w = 2^-53`. Every component of `D` is the rounded difference of two numbers that are exact, so `D` is good to
//! `w d`, and `v` is of length 1 to within `45w`. With that `d^2` is good to `5w d^2`; `a` to `50w d`; a component of
//! `D x v` loses `w` of each of its two products and of their difference, all three together no more than `3w d`, and
//! `p` is good to `50w d` however near the axis the centre is. (`sqrt(d^2 - a^2)` is not: there the difference is
//! rounding, and its root `1e-8 d`.) `b = r + a sin beta` is good to `55w (d + r)`; squares and products with squares of
//! sine and cosine lose `5w` of what they are. So the predicate decides as an exact one would on lengths that differ
//! from these by less than `128w (d + r)`, or `128w (d + R)` for coarseness: about `1.5e-14` of them. `q = a cos beta +
//! p sin beta`, which says whether the apex is nearest, is as good, and where it is 0 both formulas for `f` give `d`, to
//! within `q^2 / d`. Below `1e-150` squares are lost, and with them lengths.
//!
//! The time bounds give up `SLACK (d + r)` or `SLACK (d + R)` and `1e-150`, which is 60,000 times what predicate and
//! bound lose together: neither is late by rounding.
//!
//! Nesting is what rounding might break: a child may be found to be in view that sticks out of its parent by less than
//! that. Construction leaves `2^-20 r` between the spheres of parents and children, so for `d + R` up to `10^7 r`
//! and more it can not.
//!
//! A [`View`] is finite, with `k` of at least 1, and so are [bounds](Bounds::is_sane): `R` is a number, at least `r`. It
//! may be infinite, and its square too, with which nothing is done but to compare. All else is finite, as squares of
//! lengths end at `10^302`.

use vertex_tree::Bounds;

use crate::motion::{Course, Speed};
use crate::view::View;

/// Half of the relative slack that construction leaves.
const ROOM: f64 = 1.0 / 2_097_152.0;

/// What "coarse" means: the second half of the refinement criterion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Criterion {
    /// The node's geometric error, seen from the eye at the nearest point of its sphere, exceeds the tolerance.
    #[default]
    ScreenError,
    /// The radius of the node's sphere, seen at its centre, exceeds the tolerance (Zach & Karner).
    SphereSize,
}

/// Whether whatever view wants `inner` must want `outer` too: the outer sphere contains the inner and has no less
/// error, with room for the rounding of the predicate.
#[must_use]
pub fn is_nested(inner: &Bounds, outer: &Bounds) -> bool {
    if inner == outer {
        return true;
    }
    let center = |bounds: &Bounds| glam::DVec3::from(bounds.center.map(f64::from));
    let room = f64::from(outer.radius) - f64::from(inner.radius) - center(inner).distance(center(outer));
    room >= f64::from(outer.radius) * ROOM && outer.eps >= inner.eps
}

/// Share of the lengths that a time bound gives up, so that rounding never makes it late, the predicate's included.
const SLACK: f64 = 1e-9;
/// A length that squaring loses.
const LOST: f64 = 1e-150;

/// `|D x v|^2`.
#[inline(always)]
fn squared_cross([dx, dy, dz]: [f64; 3], v: glam::DVec3) -> f64 {
    let (px, py, pz) = (dy * v.z - dz * v.y, dz * v.x - dx * v.z, dx * v.y - dy * v.x);
    px * px + py * py + pz * pz
}

impl Criterion {
    /// Within which distance of the centre the node is coarse, as `(R, dR/dk)`.
    #[inline(always)]
    fn reach(self, bounds: &Bounds, k: f64) -> (f64, f64) {
        let (r, eps) = (f64::from(bounds.radius), f64::from(bounds.eps));
        match self {
            Self::ScreenError => (r + eps * k, eps),
            Self::SphereSize => (r * k, r),
        }
    }

    /// Within which distance of the centre the node is coarse, in object units.
    #[must_use]
    pub fn reach_distance(self, bounds: &Bounds, k: f64) -> f64 {
        self.reach(bounds, k).0
    }

    /// Whether any of the views wants the node unfolded: the canonical predicate.
    #[inline]
    #[must_use]
    pub fn unfold(self, views: &[View], bounds: &Bounds) -> bool {
        // One view is the rule, and worth a test without a loop around it.
        match views {
            [view] => self.unfold_for(view, bounds),
            _ => views.iter().any(|view| self.unfold_for(view, bounds)),
        }
    }

    /// Whether one view wants the node unfolded.
    #[inline(always)]
    #[must_use]
    pub fn unfold_for(self, view: &View, bounds: &Bounds) -> bool {
        let eye = view.eye();
        let dx = f64::from(bounds.center[0]) - eye.x;
        let dy = f64::from(bounds.center[1]) - eye.y;
        let dz = f64::from(bounds.center[2]) - eye.z;
        let r = f64::from(bounds.radius);
        let d2 = dx * dx + dy * dy + dz * dz;
        let (reach, _) = self.reach(bounds, view.k());
        // R >= r, so a node that is not coarse is not inside either.
        let coarse = d2 <= reach * reach;
        if !coarse {
            return false;
        }
        if d2 < r * r {
            return true;
        }
        let v = view.direction();
        let a = dx * v.x + dy * v.y + dz * v.z;
        let p2 = squared_cross([dx, dy, dz], v);
        let (sin, cos) = (view.sin_beta(), view.cos_beta());
        let behind_apex = a < 0.0 && p2 * (sin * sin) < a * a * (cos * cos);
        if behind_apex {
            return d2 <= r * r;
        }
        // f <= r, with the root on one side: p cos beta <= r + a sin beta.
        let bound = r + a * sin;
        bound >= 0.0 && p2 * (cos * cos) <= bound * bound
    }

    /// Whether any of the views wants each of two nodes unfolded: what [`unfold`](Self::unfold) says of them, bit for bit,
    /// by the same operations side by side, so that a compiler can make vector instructions of them.
    #[inline]
    #[must_use]
    pub fn unfold_both(self, views: &[View], bounds: [&Bounds; 2]) -> [bool; 2] {
        match views {
            [view] => self.unfold_both_for(view, bounds),
            _ => bounds.map(|bounds| self.unfold(views, bounds)),
        }
    }

    #[inline(always)]
    fn unfold_both_for(self, view: &View, bounds: [&Bounds; 2]) -> [bool; 2] {
        let both = |f: &dyn Fn(usize) -> f64| [f(0), f(1)];
        let (eye, v) = (view.eye(), view.direction());
        let dx = both(&|i| f64::from(bounds[i].center[0]) - eye.x);
        let dy = both(&|i| f64::from(bounds[i].center[1]) - eye.y);
        let dz = both(&|i| f64::from(bounds[i].center[2]) - eye.z);
        let r = both(&|i| f64::from(bounds[i].radius));
        let reach = both(&|i| self.reach(bounds[i], view.k()).0);
        let d2 = both(&|i| dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i]);
        let (reach2, r2) = (both(&|i| reach[i] * reach[i]), both(&|i| r[i] * r[i]));
        let a = both(&|i| dx[i] * v.x + dy[i] * v.y + dz[i] * v.z);
        let a2 = both(&|i| a[i] * a[i]);
        let p2 = both(&|i| squared_cross([dx[i], dy[i], dz[i]], v));
        let (sin, cos) = (view.sin_beta(), view.cos_beta());
        let (sin2, cos2) = (sin * sin, cos * cos);
        let bound = both(&|i| r[i] + a[i] * sin);
        let bound2 = both(&|i| bound[i] * bound[i]);
        let p2_cos2 = both(&|i| p2[i] * cos2);
        [0, 1].map(|i| {
            let behind_apex = (a[i] < 0.0) & (p2[i] * sin2 < a2[i] * cos2);
            let seen =
                if behind_apex { d2[i] <= r2[i] } else { (bound[i] >= 0.0) & (p2_cos2[i] <= bound2[i]) };
            (d2[i] <= reach2[i]) & ((d2[i] < r2[i]) | seen)
        })
    }

    /// How large the error of a node is in the view that wants it most, in terms of the tolerance: at least 1 where one
    /// wants it, infinite where an eye is in the sphere. For a node that no view wants, below 1, and 0 where it is out of
    /// view. By screen error, a parent is never less urgent than its children.
    #[must_use]
    pub fn urgency(self, views: &[View], bounds: &Bounds) -> f64 {
        let urgency = |view: &View| {
            let s =
                Situation::new(self, view, &Course::from(Speed { rho: 0.0, omega: 0.0, kappa: 0.0 }), bounds);
            let (error, distance) = match self {
                Self::ScreenError => (s.reach - s.r, s.d - s.r),
                Self::SphereSize => (s.reach, s.d),
            };
            match (s.d < s.r, s.gap <= 0.0) {
                (true, _) => f64::INFINITY,
                (_, true) => error / distance.max(f64::MIN_POSITIVE),
                (_, false) => 0.0,
            }
        };
        views.iter().map(urgency).fold(0.0, f64::max)
    }

    /// For a folded node, how many frames on a course must pass before any view can want it unfolded; 0 if that can not
    /// be said. Never late.
    ///
    /// In one frame on the course the eye moves by at most `rho` along the heading `h` and by at most `stray` in any
    /// direction, the direction turns by at most `omega` and `k` changes by at most `kappa`.
    ///
    /// *Visible.* `f`, the signed distance from a convex cone, is 1-Lipschitz in the eye's position. Turning the cone
    /// about the eye by `delta` is turning the centre about it, which moves it by at most `d delta`. Any motion ends where
    /// a turn at the old eye followed by a translation ends, so after `t` frames `f` has shrunk by at most
    /// `t (rho + stray + omega d)`, with today's `d`.
    ///
    /// *Coarse.* Let `u = D / d` today and `s` be how far the eye has moved along `u`. Then the distance is at least
    /// `d - s` from then on, wherever the eye is, and after `t` frames `s <= t (rho max(0, h.u) + stray)`. In the same
    /// time `R` has grown by at most `t kappa dR/dk`.
    ///
    /// Unfolding needs both to reach their marks: the later one counts. Entering the sphere (the paper's `t_i`) is
    /// implied, as it means being visible, and `R >= r`.
    #[inline]
    #[must_use]
    pub fn earliest_unfold(self, views: &[View], course: &Course, bounds: &Bounds) -> f64 {
        views.iter().map(|view| self.earliest_unfold_for(view, course, bounds)).fold(f64::INFINITY, f64::min)
    }

    #[inline(always)]
    fn earliest_unfold_for(self, view: &View, course: &Course, bounds: &Bounds) -> f64 {
        let s = Situation::new(self, view, course, bounds);
        let sideways = course.rho + course.stray + course.omega * s.d;
        let visible = course.frames(s.gap - s.slack, sideways);
        let nearer = course.rho * s.ahead.max(0.0) + course.stray + course.kappa * s.reach_slope;
        let coarse = course.frames(s.d - s.reach - s.reach_slack, nearer);
        visible.max(coarse)
    }

    /// For an active node, how many frames on a course must pass before no view wants it unfolded any more; 0 if
    /// that can not be said. Never late. The dual of [`earliest_unfold`](Self::earliest_unfold), which the paper
    /// leaves to the reader: a view lets go when the eye is outside the sphere *and* the node is invisible *or* no
    /// longer coarse, and the last view counts.
    ///
    /// *No longer coarse.* With `s` as there and `p` how far the eye has moved across `u`, the distance is now
    /// `sqrt((d - s)^2 + p^2)`. If `s < 0` that is at most `d + |s| + p^2 / 2d`; if `0 <= s <= 2d`, at most
    /// `d + p^2 / 2d`; if `s > 2d`, at most `d + l` where `l` is how far the eye has moved at all, and
    /// `l <= l^2 / 2d`. So after `t` frames it has grown by at most `b t + c t^2`, with
    /// `b = rho max(0, -h.u) + stray + kappa dR/dk` and `c = (rho + stray)^2 / 2d`: the slack `w = R - d` lasts for
    /// `t = 2w / (b + sqrt(b^2 + 4cw))`, and for no less than `w / (rho + stray + kappa dR/dk)`.
    #[inline]
    #[must_use]
    pub fn earliest_fold(self, views: &[View], course: &Course, bounds: &Bounds) -> f64 {
        views.iter().map(|view| self.earliest_fold_for(view, course, bounds)).fold(0.0, f64::max)
    }

    #[inline(always)]
    fn earliest_fold_for(self, view: &View, course: &Course, bounds: &Bounds) -> f64 {
        let s = Situation::new(self, view, course, bounds);
        let any = course.rho + course.stray;
        let outside = course.frames(s.r - s.d - s.slack, any);
        let invisible = course.frames(-s.gap - s.slack, any + course.omega * s.d);
        let slack = s.reach - s.d - s.reach_slack;
        let steered = course.kappa * s.reach_slope;
        let farther = course.rho * (-s.ahead).max(0.0) + course.stray + steered;
        // 4 c w, where the root would not be lost in b.
        let bending = 2.0 * any * any * slack.max(0.0) / s.d.max(f64::MIN_POSITIVE);
        let bent = 0.5 * (farther + (farther * farther + bending).sqrt());
        let fine = course.frames(slack, bent.min(any + steered));
        outside.max(invisible.min(fine))
    }
}

/// Where a node stands in a view, in object units.
struct Situation {
    /// Distance of the centre from the eye.
    d: f64,
    /// Radius of the sphere.
    r: f64,
    /// `h.u`: the cosine of the angle between the course's heading and the centre.
    ahead: f64,
    /// `f - r`: how far the sphere is from the cone, negative where it reaches into it.
    gap: f64,
    /// Distance within which the node is coarse, and how fast that grows with `k`.
    reach: f64,
    reach_slope: f64,
    /// More than rounding can have changed a difference of the lengths above, and one with `reach`.
    slack: f64,
    reach_slack: f64,
}

impl Situation {
    #[inline(always)]
    fn new(criterion: Criterion, view: &View, course: &Course, bounds: &Bounds) -> Self {
        let (eye, v) = (view.eye(), view.direction());
        let dx = f64::from(bounds.center[0]) - eye.x;
        let dy = f64::from(bounds.center[1]) - eye.y;
        let dz = f64::from(bounds.center[2]) - eye.z;
        let r = f64::from(bounds.radius);
        let d = (dx * dx + dy * dy + dz * dz).sqrt();
        let a = dx * v.x + dy * v.y + dz * v.z;
        let p = squared_cross([dx, dy, dz], v).sqrt();
        let (sin, cos) = (view.sin_beta(), view.cos_beta());
        let f = if a * cos + p * sin < 0.0 { d } else { p * cos - a * sin };
        let (reach, reach_slope) = criterion.reach(bounds, view.k());
        let along = dx * course.heading.x + dy * course.heading.y + dz * course.heading.z;
        let ahead = if d > 0.0 { along / d } else { 0.0 };
        let (slack, reach_slack) = (SLACK * (d + r) + LOST, SLACK * (d + reach) + LOST);
        Self { d, r, ahead, gap: f - r, reach, reach_slope, slack, reach_slack }
    }
}

#[cfg(test)]
mod tests;
