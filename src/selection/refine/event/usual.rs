//! What a camera usually does in a frame in which it does it.
//!
//! A clock needs to know how movement and turning compare: which of them makes more nodes due, and how much of one it should
//! allow for while the camera does the other. What the camera has done is as good a guess as what somebody declares, and in the
//! right units.

use crate::motion::{Speed, Travel};
use glam::DVec3;

/// Weight of a new frame.
const NEWS: f64 = 1.0 / 8.0;

/// A frame counts as at most so many times what is usual, and at least as one part in so many: after a jump or a slip of the
/// hand means are soon right again.
const MOST: f64 = 16.0;

/// Means over those frames in which there was some of it, newer ones counting more; 0 before the first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Usual {
    moved: f64,
    turned: f64,
    steered: f64,
}

impl Usual {
    /// Learns of a frame. Whether it was like those before, and not a jump.
    pub fn learn(&mut self, travel: &Travel) -> bool {
        let mut is_usual = true;
        let moved = travel.moves().map(DVec3::length).fold(0.0, f64::max);
        for (mean, now) in
            [(&mut self.moved, moved), (&mut self.turned, travel.turned), (&mut self.steered, travel.steered)]
        {
            if *mean == 0.0 {
                *mean = now;
            } else if now > 0.0 {
                is_usual &= now <= *mean * MOST;
                *mean += (now.clamp(*mean / MOST, *mean * MOST) - *mean) * NEWS;
            }
        }
        is_usual
    }

    pub fn speed(&self) -> Speed {
        Speed { rho: self.moved, omega: self.turned, kappa: self.steered }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::view::View;

    fn after(usual: &mut Usual, moved: f64, turned: f64, k: f64) -> bool {
        let view = |x: f64, angle: f64, k: f64| {
            let direction = DVec3::new(libm::cos(angle), libm::sin(angle), 0.0);
            View::from_parts(DVec3::new(x, 0.0, 0.0), direction, 0.8, 0.6, k).unwrap()
        };
        let (before, after) = ([view(0.0, 0.0, 10.0)], [view(moved, turned, 10.0 + k)]);
        usual.learn(&Travel::between(&before, &after).unwrap())
    }

    fn assert_about(found: f64, expected: f64) {
        assert!((found - expected).abs() <= 1e-6 * expected, "{found}, not {expected}");
    }

    #[test]
    fn what_is_usual_is_what_was_last() {
        let mut usual = Usual::default();
        assert_eq!(usual.speed(), Speed { rho: 0.0, omega: 0.0, kappa: 0.0 });
        assert!(after(&mut usual, 2.0, 0.0, 0.0) && after(&mut usual, 0.0, 0.1, 0.0));
        assert!(after(&mut usual, 0.0, 0.0, 0.5));
        let Speed { rho, omega, kappa } = usual.speed();
        assert_about(rho, 2.0);
        assert_about(omega, 0.1);
        assert_about(kappa, 0.5);
        // What does not happen in a frame is not the less usual when it does.
        (0..100).for_each(|_| _ = after(&mut usual, 4.0, 0.0, 0.0));
        assert_about(usual.speed().rho, 4.0);
        assert_about(usual.speed().omega, 0.1);
    }

    #[test]
    fn a_jump_is_told_and_soon_forgotten() {
        let mut usual = Usual::default();
        (0..10).for_each(|_| assert!(after(&mut usual, 1.0, 0.01, 0.0)));
        assert!(!after(&mut usual, 1e6, 0.01, 0.0));
        assert!(usual.speed().rho < 3.0, "{}", usual.speed().rho);
        assert!(!after(&mut usual, 1.0, 1.0, 0.0));
        assert!((0..20).all(|_| after(&mut usual, 1.0, 0.01, 0.0)));
        assert!(usual.speed().rho < 1.2 && usual.speed().omega < 0.012, "{:?}", usual.speed());
        // What goes on is no jump for long, however much faster it is.
        let jumps = (0..100).take_while(|_| !after(&mut usual, 1e6, 0.01, 0.0)).count();
        assert!((5..20).contains(&jumps), "{jumps} jumps");
    }
}
