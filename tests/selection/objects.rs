//! Several objects in one scene: placements, scene files, and a hundred objects under one budget.

#![expect(clippy::disallowed_methods, reason = "random shapes and motions, or figures to compare with")]

use std::path::Path;
use std::sync::Arc;

use crate::common::graph_cut::{self, GraphCut};
use crate::common::{bumpy_grid, data, direction, random_step, random_view, seeded};
use foldfront::experiment::stored_scene::{SceneFileError, read_scene};
use foldfront::in_memory::{InMemoryHierarchy, InMemoryTree};
use foldfront::selection::criterion::Criterion;
use foldfront::selection::engine::Settings;
use foldfront::selection::objects::{Objects, Placement, PlacementError};
use foldfront::selection::refine::Strategy;
use foldfront::selection::view::View;
use foldfront::testing::oracle::Oracle;
use foldfront::vertex_tree::NullSink;
use glam::{DQuat, DVec3};
use mt_partition::{BuildOptions, CacheMode, Memory, MtTree, Reader};
use rand::RngExt;
use rand_pcg::Pcg64;

fn random_placement(random: &mut Pcg64, spread: f64) -> Placement {
    let axis = direction(random);
    Placement {
        scale: random.random_range(0.2..2.2),
        rotation: DQuat::from_axis_angle(axis, random.random_range(0.0..6.0)),
        translation: spread * direction(random) * random.random::<f64>(),
    }
}

fn rows(placement: &Placement) -> [f64; 12] {
    let [x, y, z] = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| placement.place(axis) - placement.translation);
    let t = placement.translation;
    [x.x, y.x, z.x, t.x, x.y, y.y, z.y, t.y, x.z, y.z, z.z, t.z]
}

#[test]
fn a_placement_is_what_its_matrix_says() {
    let mut random = seeded(1);
    for _ in 0..1000 {
        let placement = random_placement(&mut random, 100.0);
        let read = Placement::from_rows(rows(&placement)).unwrap();
        let point = direction(&mut random);
        assert!(read.place(point).distance(placement.place(point)) < 1e-9, "{placement:?}, {read:?}");
        // What is seen of the object in the scene is what is seen of it in its own space.
        let view = random_view(&mut random);
        let own = placement.view(&view).unwrap();
        let (there, here) = (placement.place(point) - view.eye(), point - own.eye());
        assert!((there.length() - placement.scale * here.length()).abs() < 1e-9);
        assert!(
            (there.normalize().dot(view.direction()) - here.normalize().dot(own.direction())).abs() < 1e-9
        );
        assert_eq!((own.cos_beta(), own.k()), (view.cos_beta(), view.k()));
    }
}

/// Anybody may make a placement: one that leaves an eye nowhere is an error, of the object that has it.
#[test]
fn a_view_that_is_none_of_an_object_is_refused() {
    let mut random = seeded(2);
    let view = random_view(&mut random);
    let good = random_placement(&mut random, 5.0);
    for wrong in [
        Placement { scale: 0.0, ..good },
        Placement { scale: 1e-160, ..good },
        Placement { scale: f64::NAN, ..good },
        Placement { translation: DVec3::splat(1e151), ..good },
        Placement { rotation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..good },
    ] {
        assert!(wrong.view(&view).is_err(), "{wrong:?}");
    }
    assert!(good.view(&view).is_ok());
}

#[test]
fn other_matrices_are_refused() {
    let refused = |change: fn(&mut [f64; 12])| {
        let mut rows = [2.0, 0.0, 0.0, 5.0, 0.0, 2.0, 0.0, 6.0, 0.0, 0.0, 2.0, 7.0];
        assert!(Placement::from_rows(rows).is_ok());
        change(&mut rows);
        Placement::from_rows(rows).unwrap_err()
    };
    assert_eq!(
        refused(|m| m[3] = f64::NAN).to_string(),
        "number 4 of the matrix is NaN, which is not finite"
    );
    assert!(matches!(refused(|m| m[0] = 0.0), PlacementError::Flat { .. }));
    assert!(matches!(refused(|m| m[0] = -2.0), PlacementError::Mirrored { .. }));
    assert!(matches!(refused(|m| m[0] = 2.1), PlacementError::Stretched { .. }));
    assert!(matches!(refused(|m| m[1] = 0.1), PlacementError::Stretched { .. }));
}

#[test]
fn scene_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("some.scene");
    let read = |text: &str| {
        std::fs::write(&path, text).unwrap();
        read_scene(&path)
    };
    let unit = "1 0 0 0 0 1 0 0 0 0 1";
    let objects = read(&format!("# two\n\n a.mt {unit} 0\n  my  dragon.mt\t{unit} 9 \n")).unwrap();
    assert_eq!(objects[0], (folder.path().join("a.mt"), Placement::IDENTITY));
    assert_eq!(objects[1].0, folder.path().join("my  dragon.mt"));
    assert_eq!(objects[1].1.translation, DVec3::new(0.0, 0.0, 9.0));
    // Byte order marks are no part of a name, nor of a comment.
    let marked =
        read(&format!("\u{feff}a.mt {unit} 0\n\u{feff}# two files, joined\nb.mt {unit} 0\n")).unwrap();
    let names: Vec<_> = marked.iter().map(|(name, _)| name.strip_prefix(folder.path()).unwrap()).collect();
    assert_eq!(names, [Path::new("a.mt"), Path::new("b.mt")]);
    let message = |text: &str| read(text).unwrap_err().to_string();
    assert!(message(&format!("# a\na.mt {unit}\n")).contains("line 2: 12 words"));
    assert!(
        message(&format!("a.mt {unit} 0\nb.mt {unit} zero\n")).contains("line 2: \"zero\" is not a number")
    );
    assert!(message("\n\na.mt 1 0 0 0 0 1 0 0 0 0 3 0\n").contains("line 3: the matrix stretches"));
    assert!(matches!(read("# nothing\n"), Err(SceneFileError::Empty { .. })));
    assert!(matches!(read_scene(&folder.path().join("none")), Err(SceneFileError::Io { .. })));
}

/// The views as an object sees them.
fn own_views(placement: &Placement, views: &[View]) -> Vec<View> {
    views.iter().map(|view| placement.view(view).unwrap()).collect()
}

/// A hundred objects of three kinds under one budget with one reader, far from the origin of the scene: every front is
/// where brute force says after every rest, and the budget holds in every frame.
#[test]
fn a_hundred_objects_share_a_budget() {
    let mut random = seeded(5);
    let files: Vec<_> = [12, 20, 28]
        .into_iter()
        .map(|side| {
            let log = data::log(bumpy_grid(side, &mut random));
            graph_cut::file(&log, &BuildOptions { patch: 4.0, partition: 50, ..BuildOptions::default() })
        })
        .collect();
    let mut cuts: Vec<GraphCut> = files.iter().map(|file| GraphCut::new(file)).collect();
    let memory = Memory::new(100_000);
    let reader = Reader::new().unwrap();
    let home = DVec3::new(5000.0, -3000.0, 1000.0);
    let mut parts = Vec::new();
    for i in 0..100 {
        let mut placement = random_placement(&mut random, 15.0);
        placement.translation += home;
        let settings = mt_partition::Settings {
            cache: CacheMode::PCc,
            memory: memory.clone(),
            reader: Some(reader.clone()),
            ..Default::default()
        };
        parts.push((MtTree::new(files[i % 3].clone(), settings).unwrap(), NullSink, placement));
    }
    let mut scene = Objects::new(parts, Settings { rho: 0.05, ..Settings::default() }).unwrap();
    let mut view = random_view(&mut random).with_k(40.0).unwrap();
    let mut changes = 0;
    for round in 0..12 {
        let mut views = [view];
        for _ in 0..10 {
            random_step(&mut view, &mut random);
            views = [view.with_eye(home + 4.0 * view.eye()).unwrap()];
            let report = scene.advance(&views).unwrap();
            changes += report.unfolds + report.folds;
            assert!(memory.used() <= memory.limit());
        }
        for frame in 0.. {
            let report = scene.advance(&views).unwrap();
            changes += report.unfolds + report.folds;
            assert!(memory.used() <= memory.limit());
            if report.misses == 0 {
                break;
            }
            assert!(frame < 5000, "round {round}: some front never arrives");
            scene.settle().unwrap();
        }
        for (i, object) in scene.objects().iter().enumerate() {
            let cut = &mut cuts[i % 3];
            cut.find(Criterion::ScreenError, &own_views(object.placement(), &views));
            assert_eq!(cut.difference(object.engine()), None, "round {round}, object {i}");
        }
    }
    assert!(changes > 1000, "{changes}");
    let nodes: u64 = scene.objects().iter().map(|object| object.engine().tree().node_bytes()).sum();
    assert_eq!(nodes, memory.used(), "what is used is what the objects hold");
}

/// Any backend, every strategy: the fronts of the objects are those of the oracle in every frame, and the same for all.
#[test]
fn every_strategy_shows_the_same() {
    let mut random = seeded(6);
    let log = data::log(bumpy_grid(24, &mut random));
    let hierarchy = Arc::new(InMemoryHierarchy::new(&log).unwrap());
    let placements: Vec<Placement> = (0..12).map(|_| random_placement(&mut random, 6.0)).collect();
    let mut scenes: Vec<_> = [Strategy::TopDown, Strategy::Front, Strategy::Event]
        .into_iter()
        .map(|strategy| {
            let parts = placements.iter().map(|&p| (InMemoryTree::new(hierarchy.clone()), NullSink, p));
            Objects::new(parts, Settings { strategy, rho: 0.05, ..Settings::default() }).unwrap()
        })
        .collect();
    let mut oracle = Oracle::new(&log).unwrap();
    let mut view = random_view(&mut random).with_k(150.0).unwrap();
    for frame in 0..400 {
        random_step(&mut view, &mut random);
        let views = [view.with_eye(2.0 * view.eye()).unwrap()];
        let hashes: Vec<u64> = scenes.iter_mut().map(|s| s.advance(&views).unwrap().cut_hash).collect();
        assert!(hashes.iter().all(|&hash| hash == hashes[0]), "frame {frame}");
        for object in scenes[frame % 3].objects() {
            assert_eq!(oracle.compare(object.engine()), None, "frame {frame}");
        }
    }
}
