#![expect(clippy::disallowed_methods, reason = "random views")]

use super::*;
use crate::view::{Camera, ViewError};
use glam::{DQuat, DVec3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vertex_tree::Bounds;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    /// Wherever the filter is certain the predicate agrees, near the marks above all.
    #[test]
    fn is_never_certain_of_the_opposite(
        eye in prop::array::uniform3(prop_oneof![-10.0..10.0, -1e6..1e6, -1e-3..1e-3]),
        aim in prop::array::uniform3(-1.0..1.0_f64),
        beta in prop_oneof![0.05..1.5_f64, Just(1e-8), 1e-6..1e-3, 1.5..1.57],
        k in prop_oneof![Just(1.0), 1.0..2000.0, Just(1e30), Just(1e40), Just(1e300), Just(f64::MAX)],
        scale in prop_oneof![
            Just(1.0), Just(1e-25), Just(1e-15), Just(1e-42), Just(1e4), Just(1.8e19), Just(1e25), Just(1e37),
        ],
        sphere_size in any::<bool>(),
        heading in prop::array::uniform3(-1.0..1.0_f64),
        rho in prop_oneof![Just(0.0), Just(1e-50), 0.01..10.0],
        stray in prop_oneof![Just(0.0), Just(1e-50), 0.001..10.0],
        omega in prop_oneof![Just(0.0), 1e-6..0.1],
        kappa in prop_oneof![Just(0.0), 0.1..10.0],
        seeds in prop::array::uniform16((any::<u32>(), any::<u32>(), any::<u32>(), any::<u32>())),
    ) {
        let criterion = if sphere_size { Criterion::SphereSize } else { Criterion::ScreenError };
        let eye = DVec3::from(eye) * scale;
        let direction = DVec3::from(aim).normalize_or(DVec3::X);
        let view = View::from_parts(eye, direction, beta.cos(), beta.sin(), k).unwrap();
        let heading = DVec3::from(heading).normalize_or_zero();
        let course = Course { heading, rho, stray, omega, kappa };
        let mut block = Block::EMPTY;
        let mut all = Vec::new();
        for (lane, &(s0, s1, s2, s3)) in seeds.iter().enumerate() {
            let unit = |s: u32| f64::from(s) / f64::from(u32::MAX);
            // About the direction at an angle near beta, or anywhere.
            let side = direction.any_orthonormal_vector();
            let side = DQuat::from_axis_angle(direction, unit(s0) * 6.3) * side;
            let angle = match s1 % 4 {
                0 | 2 => beta * (1.0 + (unit(s2) - 0.5) * 1e-5),
                1 => unit(s2) * 3.2,
                // On the axis, and near it.
                _ => [0.0, unit(s2) * 1e-6, std::f64::consts::PI][s2 as usize % 3],
            };
            let distance = scale * unit(s3) * [1e-3, 1.0, 100.0, 1e5][s0 as usize % 4];
            let center = eye + (direction * angle.cos() + side * angle.sin()) * distance;
            let radius = distance * unit(s1) * [0.0, 1e-6, 1.0, 2.0][s1 as usize / 4 % 4];
            // On the mark of the screen error, give or take a few times the precision.
            let near = (distance - radius).max(0.0) / k * (1.0 + (unit(s0) - 0.5) * 1e-6);
            let eps = if s2 % 2 == 0 { near } else { near * unit(s3) * 2.0 };
            let limit = |x: f64| (x as f32).clamp(-1e38, 1e38);
            let bounds = Bounds {
                center: center.to_array().map(limit),
                radius: limit(radius),
                eps: limit(eps),
            };
            block.set(lane, &bounds, 0);
            all.push(bounds);
        }
        let lenses = Lenses::new(criterion, &[view]).unwrap();
        let certainly_wanted = certainly::<true>(&block, lenses.as_slice());
        let certainly_unwanted = certainly::<false>(&block, lenses.as_slice());
        for (lane, bounds) in all.iter().enumerate() {
            let wanted = criterion.unfold(&[view], bounds);
            prop_assert!(certainly_wanted[lane] == 0 || wanted, "{bounds:?}");
            prop_assert!(certainly_unwanted[lane] == 0 || !wanted, "{bounds:?}");
            // No time bound may be later than the one in f64, which leaves next to nothing to rounding, nor say
            // that a node that should change need not.
            for fold in [false, true] {
                block.tag[lane] = u32::from(fold);
                let filtered = f64::from(earliest(&block, lenses.as_slice(), &Rates::new(&course))[lane]);
                let exact = if fold {
                    criterion.earliest_fold(&[view], &course, bounds)
                } else {
                    criterion.earliest_unfold(&[view], &course, bounds)
                };
                prop_assert!(filtered <= exact, "{bounds:?}, fold {fold}: {filtered} > {exact}");
            }
        }
    }
}

/// What says whether a node is wanted says the same of it in whatever form: one at a time, two at a time, by several
/// views, certainly so in single precision, and by the time bounds, which allow no change of what has to change now.
#[track_caller]
fn assert_one_meaning(criterion: Criterion, view: &View, nodes: &[Bounds]) {
    let course = Course { heading: DVec3::X, rho: 1.0, stray: 0.5, omega: 0.1, kappa: 2.0 };
    let one = std::slice::from_ref(view);
    let wanted: Vec<bool> = nodes.iter().map(|node| criterion.unfold(one, node)).collect();
    for (i, a) in nodes.iter().enumerate() {
        assert_eq!(criterion.unfold_for(view, a), wanted[i], "{view:?}, {a:?}");
        assert_eq!(criterion.unfold(&[*view, *view], a), wanted[i], "{view:?}, {a:?}");
        for (j, b) in nodes.iter().enumerate() {
            assert_eq!(criterion.unfold_both(one, [a, b]), [wanted[i], wanted[j]], "{view:?}, {a:?}, {b:?}");
        }
        let bounds = [criterion.earliest_unfold(one, &course, a), criterion.earliest_fold(one, &course, a)];
        assert!(bounds[usize::from(!wanted[i])] == 0.0, "{view:?}, {a:?}: {bounds:?}");
        assert!(bounds.iter().all(|&frames| frames >= 0.0), "{view:?}, {a:?}: {bounds:?}");
    }
    let lenses = Lenses::new(criterion, one).unwrap();
    for (at, chunk) in nodes.chunks(LANES).enumerate() {
        let mut block = Block::EMPTY;
        chunk.iter().enumerate().for_each(|(lane, node)| block.set(lane, node, 0));
        let certainly_wanted = certainly::<true>(&block, lenses.as_slice());
        let certainly_unwanted = certainly::<false>(&block, lenses.as_slice());
        for (lane, node) in chunk.iter().enumerate() {
            let wanted = wanted[at * LANES + lane];
            assert!(certainly_wanted[lane] == 0 || wanted, "{view:?}, {node:?}");
            assert!(certainly_unwanted[lane] == 0 || !wanted, "{view:?}, {node:?}");
            block.tag[lane] = u32::from(!wanted);
            let frames = earliest(&block, lenses.as_slice(), &Rates::new(&course))[lane];
            assert!(frames == 0.0, "{view:?}, {node:?}: {frames}");
        }
    }
}

/// Flat ground at the finest tolerances that there are, where `R` is infinite, or `r` plus 0 times as much as a number can
/// be; and everything else that is at the end of what numbers can be.
#[test]
fn extreme_values_have_one_meaning() {
    let lengths = [0.0, 1e-45, 1e-38, 1e-20, 0.5, 1e19, 1e38];
    let mut nodes = Vec::new();
    for center in [[0.0; 3], [1.0, 2.0, 3.0], [1e-45, 0.0, 0.0], [-1e38, 1e38, 1e38], [0.0, 0.0, -5.0]] {
        for radius in lengths {
            nodes.extend(lengths.map(|eps| Bounds { center, radius, eps }));
        }
    }
    let far = View::FARTHEST;
    let eyes =
        [[0.0; 3], [1.0, 2.0, 3.0], [1e-45, 0.0, 0.0], [0.0, 0.0, 1e-200], [far, -far, far], [0.0, 0.0, 9.0]];
    let cones = [[1.0, 0.0], [1.0, 1e-300], [1.0, 1e-8], [0.8, 0.6], [1e-8, 1.0], [1e-300, 1.0], [0.0, 1.0]];
    for eye in eyes.map(DVec3::from) {
        for direction in [DVec3::NEG_Z, DVec3::X, DVec3::new(0.6, 0.0, 0.8)] {
            for [cos_beta, sin_beta] in cones {
                for k in [1.0, 1e10, 1e38, 1e39, 1e43, 1e300, f64::MAX] {
                    let view = View::from_parts(eye, direction, cos_beta, sin_beta, k).unwrap();
                    assert_one_meaning(Criterion::ScreenError, &view, &nodes);
                    assert_one_meaning(Criterion::SphereSize, &view, &nodes);
                }
            }
        }
    }
}

/// Where the predicate once met infinity times 0 there is no view any more.
#[test]
fn no_view_makes_a_reach_that_is_no_number() {
    let camera = Camera::new(DVec3::Z, DQuat::IDENTITY, 1.0, 1.5).unwrap();
    assert_eq!(View::new(&camera, 0.0), Err(ViewError::Tolerance { theta: 0.0 }));
    assert_eq!(View::new(&camera, 1e-320), Err(ViewError::TooFine { theta: 1e-320, fov_y: 1.0 }));
    let finest = View::new(&camera, 1.02e-308).unwrap();
    for k in [finest.k(), finest.coarser(1e-3).unwrap().k()] {
        for bounds in [[0.0, 0.0], [0.5, 0.0], [0.0, 1e-45], [1e38, 1e38]] {
            let bounds = Bounds { center: [0.0; 3], radius: bounds[0], eps: bounds[1] };
            for criterion in [Criterion::ScreenError, Criterion::SphereSize] {
                assert!(criterion.reach_distance(&bounds, k) >= f64::from(bounds.radius), "{bounds:?}, {k}");
            }
        }
    }
}

/// Nodes about a view, at all angles and distances, some of them behind it.
fn around(view: &View, random: &mut Pcg64Mcg) -> [Bounds; LANES] {
    std::array::from_fn(|_| {
        let side = loop {
            let v = DVec3::from([0; 3].map(|_| random.random_range(-1.0..1.0)));
            if (0.01..1.0).contains(&v.length_squared()) {
                break v.normalize();
            }
        };
        let distance = [1.0, 10.0, 100.0][random.random_range(0..3)] * random.random_range(0.1..1.0);
        Bounds {
            center: (view.eye() + side * distance).as_vec3().to_array(),
            radius: [0.01, 0.3, 5.0][random.random_range(0..3)] * random.random_range(0.1..1.0),
            eps: [0.0, 0.03, 1.0][random.random_range(0..3)] * random.random_range(0.1..1.0_f32),
        }
    })
}

fn random_view(random: &mut Pcg64Mcg) -> View {
    let mut unit = || random.random_range(-1.0..1.0_f64);
    let (eye, aim) = (DVec3::new(unit(), unit(), unit()) * 3.0, DVec3::new(unit(), unit(), unit()));
    let beta = 0.75 + 0.7 * unit();
    View::from_parts(eye, aim.normalize_or(DVec3::X), beta.cos(), beta.sin(), 20.0 + 15.0 * unit()).unwrap()
}

/// A node's lengths in a view: from the eye, to the border of coarseness, and of the sphere from the cone.
fn lengths(criterion: Criterion, view: &View, node: &Bounds) -> [f64; 4] {
    let to_center = DVec3::from(node.center.map(f64::from)) - view.eye();
    let along = to_center.dot(view.direction());
    let across = (to_center - along * view.direction()).length();
    let line = across * view.cos_beta() - along * view.sin_beta();
    let is_behind = along * view.cos_beta() + across * view.sin_beta() < 0.0;
    let gap = if is_behind { to_center.length() } else { line } - f64::from(node.radius);
    [to_center.length(), criterion.reach_distance(node, view.k()), gap, along]
}

/// A filter that is never certain would never be wrong. Out of a band of a few millionths it is certain, of every node that some
/// view wants but for those beside the eye, and of every node that none does but for those that are behind all cones and near
/// the apex.
#[test]
fn is_certain_of_what_is_clear() {
    let mut random = Pcg64Mcg::seed_from_u64(7);
    let mut counts = [0; 3];
    for trial in 0..4_000 {
        let views: Vec<View> = (0..[1, 1, 2, 3][trial % 4]).map(|_| random_view(&mut random)).collect();
        let criterion = [Criterion::ScreenError, Criterion::SphereSize][trial / 4 % 2];
        let nodes = around(&views[0], &mut random);
        let mut block = Block::EMPTY;
        nodes.iter().enumerate().for_each(|(lane, node)| block.set(lane, node, 0));
        let lenses = Lenses::new(criterion, &views).unwrap();
        let wanted = certainly::<true>(&block, lenses.as_slice());
        let unwanted = certainly::<false>(&block, lenses.as_slice());
        for (lane, node) in nodes.iter().enumerate() {
            let r = f64::from(node.radius);
            // Of each view whether it clearly wants the node, and whether it clearly does not.
            let clear = views.iter().map(|view| {
                let [d, reach, gap, along] = lengths(criterion, view, node);
                let band = 2e-5 * (d + r + view.eye().length());
                let line_gap =
                    gap.min((d * d - along * along).sqrt() * view.cos_beta() - along * view.sin_beta() - r);
                let wants = d + band + 1e-5 * reach < reach && (d + band < r || along > band && gap < -band);
                let wants_not = d > reach + band + 1e-5 * reach || line_gap > band;
                (wants, wants_not)
            });
            let (wants, wants_not): (Vec<bool>, Vec<bool>) = clear.unzip();
            if wants.contains(&true) {
                assert_eq!((wanted[lane], unwanted[lane]), (1, 0), "{views:?} {node:?}");
                counts[0] += 1;
            } else if !wants_not.contains(&false) {
                assert_eq!((wanted[lane], unwanted[lane]), (0, 1), "{views:?} {node:?}");
                counts[1] += 1;
            } else {
                counts[2] += 1;
            }
        }
    }
    assert!(counts[0] > 2_000 && counts[1] > 2_000 && counts[2] < 10_000, "{counts:?}");
}

/// A bound of 0 would never be late. The filter's bounds are as late as those in double precision, but for the band and, of nodes
/// that are about to be fine while the camera passes by, for the estimate of a root.
#[test]
fn bounds_are_as_late_as_in_double_precision() {
    let mut random = Pcg64Mcg::seed_from_u64(8);
    let mut counts = [0; 2];
    for trial in 0..6_000 {
        let views: Vec<View> = (0..[1, 1, 2][trial % 3]).map(|_| random_view(&mut random)).collect();
        let criterion = [Criterion::ScreenError, Criterion::SphereSize][trial / 3 % 2];
        let nodes = around(&views[0], &mut random);
        // One of the speeds, or all of them.
        let mut speed = |which: usize, most: f64| {
            if [which, 4, 5].contains(&(trial / 6 % 6)) { most * random.random_range(0.1..1.0) } else { 0.0 }
        };
        let (rho, stray, omega, kappa) = (speed(0, 0.5), speed(1, 0.5), speed(2, 0.05), speed(3, 2.0));
        // Straight at or away from a node, or anywhere.
        let straight = (DVec3::from(nodes[0].center.map(f64::from)) - views[0].eye()).normalize();
        let heading = [straight, -straight, views[0].direction()][trial / 36 % 3];
        let course = Course { heading, rho, stray, omega, kappa };
        let lenses = Lenses::new(criterion, &views).unwrap();
        let mut block = Block::EMPTY;
        for fold in [false, true] {
            nodes.iter().enumerate().for_each(|(lane, node)| block.set(lane, node, 6 + u32::from(fold)));
            let filtered = earliest(&block, lenses.as_slice(), &Rates::new(&course));
            for (lane, node) in nodes.iter().enumerate() {
                let exact = if fold {
                    criterion.earliest_fold(&views, &course, node)
                } else {
                    criterion.earliest_unfold(&views, &course, node)
                };
                let filtered = f64::from(filtered[lane]);
                assert!(filtered <= exact, "{views:?} {course:?} {node:?}: {filtered}, {exact}");
                // Near a mark the band is all that there is.
                let near = views.iter().any(|view| {
                    let [d, reach, gap, along] = lengths(criterion, view, node);
                    let across = (d * d - along * along).max(0.0).sqrt();
                    let apex = along * view.cos_beta() + across * view.sin_beta();
                    let marks = [gap, d - reach, d - f64::from(node.radius), apex];
                    let size = d + reach + f64::from(node.radius) + view.eye().length();
                    marks.iter().any(|mark| mark.abs() < 0.003 * size)
                });
                if near {
                    continue;
                }
                // The root of a sum of squares and the sum: no more than a quarter apart, and the same where one is nothing.
                let share = if fold && rho > 0.0 { 0.79 } else { 0.98 };
                let exact = exact.min(1e30);
                assert!(
                    filtered >= share * exact,
                    "fold {fold} {views:?} {course:?} {node:?}: {filtered}, {exact}"
                );
                counts[usize::from(fold)] += u32::from(exact > 0.0);
            }
        }
    }
    assert!(counts.iter().all(|&count| count > 10_000), "{counts:?}");
}

/// Of nodes to fold while the camera passes by, where nothing else is in the way: from a distance of 8 the eye moves across, until it is
/// `R` away.
#[test]
fn a_node_that_is_passed_folds_when_it_has_got_far_enough() {
    let view = View::from_parts(DVec3::ZERO, DVec3::X, 0.1_f64, 0.99_f64.sqrt(), 10.0).unwrap();
    for room in [0.1, 0.2, 0.4_f32] {
        let node = Bounds { center: [8.0, 0.0, 0.0], radius: 0.5, eps: (7.5 + room) / 10.0 };
        let course = Course { heading: DVec3::Y, rho: 0.01, stray: 0.0, omega: 0.0, kappa: 0.0 };
        let mut block = Block::EMPTY;
        block.set(5, &node, 1);
        let lenses = Lenses::new(Criterion::ScreenError, &[view]).unwrap();
        let frames = f64::from(earliest(&block, lenses.as_slice(), &Rates::new(&course))[5]);
        let reach = 8.0 + f64::from(room);
        let there = (reach * reach - 64.0).sqrt() / 0.01;
        assert!((0.96..=1.0).contains(&(frames / there)), "{frames} of {there}");
    }
}

#[test]
fn what_is_doubtful_is_looked_at() {
    let mut certain = [1; LANES];
    assert_eq!(doubtful(&certain, 16), 0);
    certain[3] = 0;
    certain[9] = 0;
    let lanes = |used: usize| {
        let mut lanes = Vec::new();
        for_each_bit(doubtful(&certain, used), |lane| lanes.push(lane));
        lanes
    };
    assert_eq!((lanes(16), lanes(10), lanes(9), lanes(3)), (vec![3, 9], vec![3, 9], vec![3], vec![]));
}

#[test]
fn more_views_than_the_filter_takes() {
    let views = [View::from_parts(DVec3::X, DVec3::X, 0.8, 0.6, 10.0).unwrap(); MOST_VIEWS + 1];
    for count in 0..=MOST_VIEWS {
        let lenses = Lenses::new(Criterion::ScreenError, &views[..count]);
        assert_eq!(lenses.map(|lenses| lenses.as_slice().len()), Some(count));
    }
    assert!(Lenses::new(Criterion::ScreenError, &views).is_none());
}
