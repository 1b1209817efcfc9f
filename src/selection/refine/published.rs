//! Event-driven refinement as published (Zach & Karner 2003, sections 3 and 4, Figures 4 to 7), for comparison.
//!
//! Kept as printed: integer frames, a circular buffer of lists of nodes, fixed `rho` and `omega`, a frame counter
//! that skips ahead when the camera is faster. Three things had to be mended or chosen:
//!
//! * The printed `t_r = ceil((alpha + phi - sqrt(2) fov/2) / omega)` has a sign slip: the sphere's edge is seen at
//!   `alpha - phi`. As printed the visibility of a sphere would be predicted too late by its whole angular size.
//! * Figure 4 tests `r / tan(fov) / d`, the text `r / (tan(fov/2) d)`: the text's is used, and the cone that the
//!   rest of this crate uses.
//! * The dual formulation for folding is not printed. Here: outside the sphere after `(r - d) / rho` frames,
//!   invisible after `(beta + phi - alpha) / omega`, too small after `(R - d) / rho`; the earliest fold is the
//!   maximum of the first and of the minimum of the others.
//!
//! How it is computed is up to us, and it is not to be slower than its authors would have had it. As printed, what the test has in
//! common with the times is computed once for all of them, the distance above all. What Figure 4 computes in every test, an arc sine
//! and an arc cosine, is needed by `t_r` alone, and only where that decides: not for a node in view that is too far to be coarse,
//! nor where the next frame is the answer. There `alpha - beta` is one arc tangent. The test itself is the crate's own, without
//! trigonometry. Rounding up comes last, which changes nothing: it is monotone, like the minimum and the maximum.
//!
//! What remains is the published scheme's own error: moving the eye changes `alpha` and `phi` too, which `t_r`
//! ignores, so nodes come into view or leave it before their event is due. A node is then wrong until it is. Nor does it
//! know of a tolerance that changes, as under a budget.

use glam::DVec3;
use vertex_tree::Bounds;

use super::frame::{Flips, Frame};
use super::watch::Watch;
use crate::front::Front;
use crate::in_play::{Kind, Slot};
use crate::view::View;

/// Frames that the circular buffer spans. Later events wait in its last list, and are inserted again from there.
const HORIZON: u64 = 4096;

#[derive(Clone, Copy)]
struct Entry {
    slot: Slot,
    kind: Kind,
    ticket: u32,
}

pub(crate) struct Published {
    lists: Vec<Vec<Entry>>,
    frame: u64,
    tickets: Vec<u32>,
    due: Vec<Entry>,
    /// Nodes that have come to be watched in this frame, and were tested for that.
    fresh: u64,
}

impl Default for Published {
    fn default() -> Self {
        Self {
            lists: vec![Vec::new(); HORIZON as usize],
            frame: 0,
            tickets: Vec::new(),
            due: Vec::new(),
            fresh: 0,
        }
    }
}

impl Published {
    pub fn find(&mut self, frame: &Frame, before: &[View], front: &Front, flips: &mut Flips) {
        let first = self.frame + 1;
        self.frame += frames_passed(frame, before);
        self.due.clear();
        for at in first..=self.frame.min(first + HORIZON - 1) {
            self.due.append(&mut self.lists[(at % HORIZON) as usize]);
        }
        let mut due = std::mem::take(&mut self.due);
        due.retain(|e| self.tickets[e.slot.index()] == e.ticket);
        flips.tests += due.len() as u64;
        for entry in &due {
            let bounds = front.bounds(entry.slot);
            if frame.unfold(entry.slot, &bounds) == (entry.kind == Kind::Unfold) {
                match entry.kind {
                    Kind::Unfold => flips.unfold.push(entry.slot),
                    Kind::Fold => flips.fold.push(entry.slot),
                }
            } else {
                self.insert(frames_until(frame, entry.kind, &bounds), *entry);
            }
        }
        self.due = due;
    }

    /// How many nodes have been tested as they came to be watched.
    pub fn settle(&mut self) -> u64 {
        std::mem::take(&mut self.fresh)
    }

    pub fn for_each_watched(&self, front: &Front, f: &mut impl FnMut(Slot, Kind, &Bounds)) {
        let valid = |entry: &&Entry| self.tickets[entry.slot.index()] == entry.ticket;
        let entries = self.lists.iter().flatten().filter(valid);
        entries.for_each(|entry| f(entry.slot, entry.kind, &front.bounds(entry.slot)));
    }

    fn ticket(&mut self, slot: Slot) -> &mut u32 {
        if self.tickets.len() <= slot.index() {
            self.tickets.resize(slot.index() + 1, 0);
        }
        &mut self.tickets[slot.index()]
    }

    fn insert(&mut self, frames: f64, entry: Entry) {
        // At least 1, as in Figure 7; `as` saturates.
        let ahead = (frames as u64).clamp(1, HORIZON - 1);
        self.lists[((self.frame + ahead) % HORIZON) as usize].push(entry);
    }
}

impl Watch for Published {
    fn watch(&mut self, frame: &Frame, slot: Slot, kind: Kind, bounds: Bounds) {
        let ticket = *self.ticket(slot);
        self.fresh += 1;
        self.insert(frames_until(frame, kind, &bounds), Entry { slot, kind, ticket });
    }

    fn unwatch(&mut self, slot: Slot) {
        let ticket = self.ticket(slot);
        *ticket = ticket.wrapping_add(1);
    }

    fn refused(&mut self, slot: Slot, kind: Kind, _: Bounds) {
        let ticket = *self.ticket(slot);
        self.insert(1.0, Entry { slot, kind, ticket });
    }
}

/// "Rapid Movements": the frame number is incremented by as many frames as the motion would have taken at full speed.
fn frames_passed(frame: &Frame, before: &[View]) -> u64 {
    let mut frames = 1.0_f64;
    if before.len() != frame.views.len() {
        return HORIZON;
    }
    for (b, a) in before.iter().zip(frame.views) {
        let moved = a.eye().distance(b.eye()) / frame.speed.rho;
        let turned = libm::acos(a.direction().dot(b.direction()).clamp(-1.0, 1.0)) / frame.speed.omega;
        for ratio in [moved, turned] {
            if ratio > frames {
                frames = ratio.ceil();
            }
        }
    }
    (frames as u64).min(HORIZON)
}

/// After how many frames a node may have to change, rounded up; below 1 it is as good as 1.
fn frames_until(frame: &Frame, kind: Kind, bounds: &Bounds) -> f64 {
    let time = match frame.views {
        // The rule, and worth no loop.
        [view] => Sight::new(frame, view, bounds).frames(frame, view, kind),
        views => {
            let times = views.iter().map(|view| Sight::new(frame, view, bounds).frames(frame, view, kind));
            match kind {
                Kind::Unfold => times.fold(f64::INFINITY, f64::min),
                Kind::Fold => times.fold(0.0, f64::max),
            }
        }
    };
    time.ceil()
}

/// What the test and both times have in common: "we cache some values calculated inside unfoldTest (like the distance of the
/// bounding sphere to the eye position)".
#[derive(Clone, Copy)]
struct Sight {
    distance: f64,
    /// Of the centre, along the direction of view and across.
    along: f64,
    across: f64,
    radius: f64,
    /// Within which distance the node is coarse: no less than the radius.
    reach: f64,
}

impl Sight {
    #[inline(always)]
    fn new(frame: &Frame, view: &View, bounds: &Bounds) -> Self {
        let to_center = DVec3::from(bounds.center.map(f64::from)) - view.eye();
        let (square, along) = (to_center.length_squared(), view.direction().dot(to_center));
        Self {
            distance: square.sqrt(),
            along,
            across: (square - along * along).max(0.0).sqrt(),
            radius: bounds.radius.into(),
            reach: frame.criterion.reach_distance(bounds, view.k()),
        }
    }

    /// Frames to what the text calls `t`, by its full speeds. Angles are only computed where they decide.
    #[inline(always)]
    fn frames(&self, frame: &Frame, view: &View, kind: Kind) -> f64 {
        let Self { distance, along, across, radius, reach } = *self;
        let (rho, omega) = (frame.speed.rho, frame.speed.omega);
        // Sine and cosine of alpha - beta, times the distance.
        let sine = across * view.cos_beta() - along * view.sin_beta();
        let cosine = along * view.cos_beta() + across * view.sin_beta();
        match kind {
            Kind::Unfold => {
                let (inside, coarse) = ((distance - radius) / rho, (distance - reach) / rho);
                // Entered in the next frame; or in view, so that t_r is past.
                if inside <= 1.0 {
                    return inside;
                }
                if cosine >= 0.0 && sine <= radius {
                    return coarse;
                }
                inside.min(coarse.max((libm::atan2(sine, cosine) - self.phi()) / omega))
            }
            Kind::Fold => {
                let (outside, fine) = ((radius - distance) / rho, (reach - distance) / rho);
                // Fine in the next frame, and no later outside.
                if fine <= 1.0 {
                    return fine;
                }
                outside.max(fine.min((self.phi() - libm::atan2(sine, cosine)) / omega))
            }
        }
    }

    /// "The spherical size of the bounding sphere."
    fn phi(&self) -> f64 {
        libm::asin((self.radius / self.distance).min(1.0))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::criterion::Criterion;
    use crate::motion::{Motion, Speed};
    use crate::view::Camera;

    /// At the origin, looking along x, with a cone of half-angle `beta`.
    fn view(theta: f64) -> View {
        let camera = Camera::look_at(DVec3::ZERO, DVec3::X, DVec3::Z, 1.0, 1.0).unwrap();
        View::new(&camera, theta).unwrap()
    }

    /// A sphere at a distance, at an angle from the x axis.
    fn sphere(distance: f64, angle: f64, radius: f64, eps: f64) -> Bounds {
        let center = DVec3::new(distance * libm::cos(angle), distance * libm::sin(angle), 0.0);
        Bounds { center: center.as_vec3().to_array(), radius: radius as f32, eps: eps as f32 }
    }

    fn until(views: &[View], kind: Kind, bounds: &Bounds, rho: f64, omega: f64) -> f64 {
        let speed = Speed { rho, omega, kappa: 0.0 };
        let criterion = Criterion::ScreenError;
        let frame = Frame {
            criterion,
            views,
            speed,
            motion: Motion::Rest,
            travel: None,
            looks_ahead: false,
            cones: None,
        };
        frames_until(&frame, kind, bounds)
    }

    /// Each of the three times of Figure 4 decides where it should: the first of `t_i` and the later of `t_r` and `t_m`.
    #[test]
    fn a_node_unfolds_when_it_is_entered_or_both_seen_and_coarse() {
        let view = view(0.01);
        let beta = libm::atan2(view.sin_beta(), view.cos_beta());
        let unfold = |bounds: &Bounds, rho, omega| until(&[view], Kind::Unfold, bounds, rho, omega);
        // Coarse already, and to the side: until the cone's edge has turned to the sphere's, which is nearer than its centre.
        let aside = sphere(10.0, 2.0, 2.0, 100.0);
        let phi = libm::asin(0.2);
        assert_eq!(unfold(&aside, 0.001, 0.003), ((2.0 - phi - beta) / 0.003).ceil());
        // In view already, and too far to be coarse.
        let ahead = sphere(50.0, 0.1, 2.0, 0.1);
        let reach = Criterion::ScreenError.reach_distance(&ahead, view.k());
        assert!(reach < 40.0);
        assert_eq!(unfold(&ahead, 0.25, 0.001), ((50.0 - reach) / 0.25).ceil());
        // Both: the later one.
        let both = sphere(50.0, 2.0, 2.0, 0.1);
        let turn = ((2.0 - libm::asin(0.04) - beta) / 0.01).ceil();
        let come = ((50.0 - reach) / 0.125).ceil();
        assert!(come > turn + 50.0);
        assert_eq!(unfold(&both, 0.125, 0.01), come);
        assert_eq!(unfold(&both, 0.3, 0.01), turn);
        // Behind, where no turning brings it into view for long: until the sphere is entered.
        let behind = sphere(10.0, PI, 4.0, 100.0);
        assert_eq!(unfold(&behind, 0.5, 1e-6), 12.0);
    }

    /// The dual: once it is left, and then the first of out of view and fine.
    #[test]
    fn a_node_folds_when_it_is_left_and_unseen_or_fine() {
        let view = view(0.01);
        let beta = libm::atan2(view.sin_beta(), view.cos_beta());
        let fold = |bounds: &Bounds, rho, omega| until(&[view], Kind::Fold, bounds, rho, omega);
        // Near, and near the edge of the view: until the sphere's far edge has left it.
        let edge = sphere(10.0, 0.3, 2.0, 100.0);
        assert_eq!(fold(&edge, 0.001, 0.003), ((beta + libm::asin(0.2) - 0.3) / 0.003).ceil());
        // About to be fine.
        let far = sphere(30.0, 0.1, 2.0, 0.25);
        let reach = Criterion::ScreenError.reach_distance(&far, view.k());
        assert!(reach > 35.0 && reach < 60.0, "{reach}");
        assert_eq!(fold(&far, 0.25, 1e-6), ((reach - 30.0) / 0.25).ceil());
        // Inside of it, though it is behind and out of view at once: not before it is left.
        let around = sphere(1.0, PI, 4.0, 100.0);
        assert_eq!(fold(&around, 0.25, 1.0), 12.0);
        // Outside of it, and out of view at once.
        assert_eq!(fold(&sphere(10.0, beta + 0.2, 2.0, 100.0), 0.001, 0.1), 1.0);
    }

    /// What is left out where it does not decide is not missed: the formulas as they stand, over all sorts of spheres.
    #[test]
    fn times_are_those_of_the_formulas() {
        let view = view(0.01);
        let beta = libm::atan2(view.sin_beta(), view.cos_beta());
        let (rho, omega) = (0.25, 0.02);
        let mut decided = [0; 6];
        for case in 0..40_000_u32 {
            // Steps that have nothing to do with each other: all combinations come up.
            let part = |step: f64| (f64::from(case) * step).fract();
            let (distance, angle) = (0.5 + 60.0 * part(0.618_033_988_7), 0.01 + 3.1 * part(0.414_213_562_3));
            let bounds = sphere(distance, angle, 8.0 * part(0.732_050_807_5), 0.2 * part(0.236_067_977_4));
            let center = DVec3::from(bounds.center.map(f64::from));
            let (d, r) = (center.length(), f64::from(bounds.radius));
            let reach = Criterion::ScreenError.reach_distance(&bounds, view.k());
            let (phi, alpha) = (libm::asin((r / d).min(1.0)), libm::acos(center.x / d));
            let times = [(d - r) / rho, (alpha - phi - beta) / omega, (d - reach) / rho];
            for kind in [Kind::Unfold, Kind::Fold] {
                let [inside, visible, coarse] = times.map(|t| if kind == Kind::Unfold { t } else { -t });
                let t = match kind {
                    Kind::Unfold => inside.min(visible.max(coarse)),
                    Kind::Fold => inside.max(visible.min(coarse)),
                };
                let got = until(&[view], kind, &bounds, rho, omega).max(1.0);
                assert!(
                    got == t.ceil().max(1.0) || (t - t.round()).abs() < 1e-6,
                    "{kind:?}, {bounds:?}: {got}, {t}"
                );
                let which = [inside, visible, coarse].iter().position(|&x| x == t).unwrap_or(0);
                decided[which + if kind == Kind::Fold { 3 } else { 0 }] += u32::from(t > 1.0);
            }
        }
        assert!(decided.iter().all(|&count| count > 100), "{decided:?}");
    }

    #[test]
    fn the_first_view_unfolds_and_the_last_folds() {
        let (near, far) = (view(0.01), view(0.02));
        let bounds = sphere(100.0, 0.1, 2.0, 0.1);
        let each = |kind| [near, far].map(|view| until(&[view], kind, &bounds, 0.25, 0.001));
        let [a, b] = each(Kind::Unfold);
        assert!(a < b);
        assert_eq!(until(&[near, far], Kind::Unfold, &bounds, 0.25, 0.001), a);
        let bounds = sphere(10.0, 0.1, 2.0, 0.4);
        let [a, b] = [near, far].map(|view| until(&[view], Kind::Fold, &bounds, 0.25, 1e-6));
        assert!(a > b);
        assert_eq!(until(&[near, far], Kind::Fold, &bounds, 0.25, 1e-6), a);
    }

    /// "Rapid Movements": by whichever of moving and turning takes longer, whole frames, at least one.
    #[test]
    fn frames_pass_as_at_full_speed() {
        let speed = Speed { rho: 0.5, omega: 0.125, kappa: 0.0 };
        let at = |x: f64| view(0.01).with_eye(DVec3::new(0.0, x, 0.0)).unwrap();
        let turned = |angle: f64| {
            view(0.01).with_direction(DVec3::new(libm::cos(angle), libm::sin(angle), 0.0)).unwrap()
        };
        let passed = |before: &[View], views: &[View]| {
            let criterion = Criterion::ScreenError;
            frames_passed(
                &Frame {
                    criterion,
                    views,
                    speed,
                    motion: Motion::Rest,
                    travel: None,
                    looks_ahead: false,
                    cones: None,
                },
                before,
            )
        };
        let one = |after: View| passed(&[at(0.0)], &[after]);
        assert_eq!([at(0.0), at(0.4), at(0.5), at(0.6), at(3.0), at(-3.1)].map(one), [1, 1, 1, 2, 6, 7]);
        assert_eq!([0.1, 0.2, 1.0, -1.01].map(|angle| one(turned(angle))), [1, 2, 8, 9]);
        assert_eq!(one(turned(1.0).with_eye(DVec3::new(2.0, 0.0, 0.0)).unwrap()), 8);
        assert_eq!(one(turned(0.2).with_eye(DVec3::new(2.0, 0.0, 0.0)).unwrap()), 4);
        assert_eq!(passed(&[at(0.0), at(1.0), at(0.0)], &[at(0.0), at(3.0), at(0.6)]), 4);
        // No more than the buffer spans, and all of it where views come or go.
        assert_eq!(one(at(1e9)), HORIZON);
        assert_eq!(passed(&[at(0.0)], &[at(0.0), at(0.0)]), HORIZON);
        assert_eq!(passed(&[], &[]), 1);
    }

    /// Slots that a buffer lets come up when the frame counter moves on by so much.
    struct Buffer {
        published: Published,
        front: Front,
        x: f64,
    }

    impl Buffer {
        fn go(&mut self, steps: f64) -> Vec<u32> {
            let at = |x: f64| [view(0.01).with_eye(DVec3::new(x, 0.0, 0.0)).unwrap()];
            let (before, after) = (at(self.x), at(self.x + steps));
            self.x += steps;
            let speed = Speed { rho: 1.0, omega: 1.0, kappa: 0.0 };
            let frame = Frame {
                criterion: Criterion::ScreenError,
                views: &after,
                speed,
                motion: Motion::Rest,
                travel: None,
                looks_ahead: false,
                cones: None,
            };
            let mut flips = Flips { tests: 3, ..Flips::default() };
            self.published.find(&frame, &before, &self.front, &mut flips);
            assert!(flips.fold.is_empty());
            assert_eq!(flips.tests, 3 + flips.unfold.len() as u64);
            let mut slots: Vec<u32> = flips.unfold.iter().map(|slot| slot.0).collect();
            slots.sort_unstable();
            slots
        }

        fn insert(&mut self, frames: f64, slot: u32) {
            let ticket = *self.published.ticket(Slot(slot));
            self.published.insert(frames, Entry { slot: Slot(slot), kind: Kind::Unfold, ticket });
        }
    }

    /// One root, in which the eye is from `x = -1e6` to `1e6`: it must unfold whenever it is tested. Its slot is 2.
    struct Everywhere;

    impl vertex_tree::Hierarchy for Everywhere {
        const IS_TREE: bool = true;

        fn node_limit(&self) -> u32 {
            1
        }

        fn displayed(&self) -> u64 {
            0
        }

        fn roots(&self) -> &[vertex_tree::NodeId] {
            &[vertex_tree::NodeId(0)]
        }

        fn bounds(&self, _: vertex_tree::NodeId) -> Bounds {
            Bounds { center: [0.0; 3], radius: 1e6, eps: 1.0 }
        }

        fn children(&self, _: vertex_tree::NodeId) -> impl Iterator<Item = vertex_tree::NodeId> {
            std::iter::empty()
        }

        fn parents(&self, _: vertex_tree::NodeId) -> impl Iterator<Item = vertex_tree::NodeId> {
            std::iter::empty()
        }
    }

    fn buffer() -> Buffer {
        Buffer { published: Published::default(), front: Front::new(&Everywhere), x: 0.0 }
    }

    #[test]
    fn an_entry_comes_up_in_its_frame() {
        let mut buffer = buffer();
        for round in 0..3 {
            for (ahead, early) in [(3.0, 2.0), (10.0, 9.0), (4095.0, 4094.0)] {
                buffer.insert(ahead, 2);
                assert_eq!(buffer.go(early), [], "round {round}: {ahead} frames ahead");
                assert_eq!(buffer.go(0.0), [2], "a frame at rest is a frame too");
                assert_eq!(buffer.go(5.0), []);
            }
            // At least one, and no more than the buffer spans.
            for (ahead, last) in [(0.0, 0.0), (-3.0, 0.0), (1e12, 4094.0), (f64::INFINITY, 4094.0)] {
                buffer.insert(ahead, 2);
                if last > 0.0 {
                    assert_eq!(buffer.go(last), []);
                }
                assert_eq!(buffer.go(1.0), [2], "round {round}: {ahead} frames ahead");
            }
            // Two in one frame that was passed over, and everything after a leap.
            buffer.insert(4.0, 2);
            buffer.insert(5.0, 2);
            assert_eq!(buffer.go(20.0), [2, 2]);
            [1.0, 100.0, 4000.0].iter().for_each(|&ahead| buffer.insert(ahead, 2));
            assert_eq!(buffer.go(5000.0), [2, 2, 2]);
        }
    }

    #[test]
    fn an_entry_that_is_not_watched_any_more_does_not_come_up() {
        let mut buffer = buffer();
        let views = [view(0.01)];
        let speed = Speed { rho: 1.0, omega: 1.0, kappa: 0.0 };
        let criterion = Criterion::ScreenError;
        let frame = Frame {
            criterion,
            views: &views,
            speed,
            motion: Motion::Rest,
            travel: None,
            looks_ahead: false,
            cones: None,
        };
        let bounds = buffer.front.bounds(Slot(2));
        let watched = |buffer: &Buffer| {
            let mut watched = Vec::new();
            buffer
                .published
                .for_each_watched(&buffer.front, &mut |slot, kind, _| watched.push((slot.0, kind)));
            watched
        };
        buffer.published.watch(&frame, Slot(2), Kind::Unfold, bounds);
        assert_eq!(watched(&buffer), [(2, Kind::Unfold)]);
        assert_eq!((buffer.published.settle(), buffer.published.settle()), (1, 0));
        buffer.published.unwatch(Slot(2));
        assert_eq!(watched(&buffer), []);
        assert_eq!(buffer.go(0.0), []);
        // What is refused is due in the next frame.
        buffer.published.refused(Slot(2), Kind::Unfold, bounds);
        assert_eq!(watched(&buffer), [(2, Kind::Unfold)]);
        assert_eq!((buffer.published.settle(), buffer.go(0.0)), (0, vec![2]));
        assert_eq!(buffer.go(0.0), []);
    }
}
