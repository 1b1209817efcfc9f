use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::*;

/// In any view, and however near its axis, the predicate says what the lengths say that its bounds go by, but within a
/// trillionth of a mark.
#[test]
fn squares_and_lengths_decide_alike() {
    let mut random = Pcg64Mcg::seed_from_u64(17);
    let mut seen = [0; 2];
    for trial in 0..300_000 {
        let mut unit = || random.random_range(-1.0..1.0_f64);
        let direction = DVec3::new(unit(), unit(), unit()).normalize();
        let across = direction.cross(DVec3::new(unit(), unit(), unit())).normalize();
        let tan = [1e-6_f64, 0.1, 0.126, 1.0, 7.9, 8.1, 1e6][trial % 7];
        let (cos, sin) = (1.0 / (1.0 + tan * tan).sqrt(), tan / (1.0 + tan * tan).sqrt());
        let eye = DVec3::new(unit(), unit(), unit()) * [0.0, 1.0, 1e3][trial / 7 % 3];
        let view = View::from_parts(eye, direction, cos, sin, 1e9).unwrap();
        // At the axis, about a sixteenth off it, at the cone's edge, anywhere.
        let off = [1e-9, 1e-3, 0.0625, tan, 2.0 * unit().abs()][trial / 21 % 5] * (1.0 + 1e-6 * unit());
        let ahead = unit();
        let center = eye + direction * ahead + across * off * ahead;
        let bounds = Bounds {
            center: center.as_vec3().to_array(),
            radius: (ahead * [0.0, 1e-7, 0.01, 0.9][trial / 105 % 4]).abs() as f32,
            eps: 1.0,
        };
        let course = Course::from(Speed { rho: 0.0, omega: 0.0, kappa: 0.0 });
        let s = Situation::new(Criterion::ScreenError, &view, &course, &bounds);
        if s.gap.abs().min((s.d - s.r).abs()) > 1e-12 * (s.d + s.r) {
            let wanted = s.d < s.r || s.gap <= 0.0;
            assert_eq!(Criterion::ScreenError.unfold(&[view], &bounds), wanted, "{view:?} {bounds:?}");
            seen[usize::from(wanted)] += 1;
        }
    }
    assert!(seen.iter().all(|&count| count > 50_000), "{seen:?}");
}
