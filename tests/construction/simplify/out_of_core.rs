//! Construction within little memory: the same result as in memory, whatever the memory, or else nothing at all.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use foldfront::Mesh;
use foldfront::collapse_log::LogError;
use foldfront::construction::mesh_io::{MeshIoError, Receiver};
use foldfront::construction::simplify::{LEAST_MEMORY, Limits, OutOfCoreError, build_within};
use foldfront::container::Georeference;
use foldfront::experiment::scene::SceneKind;

use super::{difficult, flat_grid};
use crate::common::{meshes, seeded};
use crate::hierarchy::options;
use crate::within;
use crate::within::{assert_same, limits, names, send};

/// A town, about its own middle: where that is in the world is not sent.
fn town() -> Mesh {
    Mesh { georeference: Georeference::default(), ..meshes::part_of(SceneKind::City, 0.35) }
}

#[test]
fn difficult_meshes_are_the_same_within_little_memory() {
    for (name, mesh) in difficult() {
        println!("{name}");
        assert_same(&mesh, false, LEAST_MEMORY);
        for merge in [false, true] {
            assert_same(&mesh, merge, 1 << 30);
        }
    }
}

#[test]
fn the_result_does_not_depend_on_the_memory() {
    within::the_memory_does_not_matter(&meshes::scan(20, &mut seeded(1)));
}

#[test]
fn the_result_does_not_depend_on_the_number_of_threads() {
    within::threads_do_not_matter(&meshes::with_handles(2, 20), 1 << 20, 20);
}

/// Stars that vanish as a whole, and edges that are long for blocks as small as these.
#[test]
fn a_town_does_not_depend_on_the_number_of_threads() {
    within::threads_do_not_matter(&town(), 1 << 20, 10);
}

#[test]
fn components_are_merged_as_in_memory_where_there_is_enough() {
    within::components_are_merged_as_in_memory(&town());
}

#[test]
fn components_are_merged_within_little_memory() {
    within::components_are_merged_late(&town(), 2 << 20);
}

#[test]
fn a_scan_with_memory_for_a_twentieth() {
    within::a_twentieth_is_enough(&meshes::scan(30, &mut seeded(2)));
}

#[test]
fn mountains_with_memory_for_a_twentieth() {
    within::a_twentieth_is_enough(&meshes::ground(220, 10, &mut seeded(3)));
}

/// Wherever it is stopped, it ends with an error; what was there before is still there, and nothing else.
#[test]
fn nothing_is_left_of_an_interrupted_construction() {
    let mesh = flat_grid(150, 1.0);
    let steps = |stop_at: u32| {
        let folder = tempfile::tempdir().unwrap();
        let (file, stop) = (folder.path().join("log"), AtomicBool::new(false));
        std::fs::write(&file, "written earlier").unwrap();
        let limits = limits(LEAST_MEMORY, folder.path(), &stop);
        let mut steps = 0;
        let progress = &mut |_, _| {
            steps += 1;
            stop.store(steps >= stop_at, Ordering::Relaxed);
        };
        let outcome = build_within(|r, _| send(&mesh, r), &file, &options(false), &limits, progress);
        assert_eq!(names(folder.path()), ["log"]);
        if outcome.is_err() {
            assert!(matches!(outcome, Err(OutOfCoreError::Interrupted)), "{outcome:?}");
            assert_eq!(std::fs::read(&file).unwrap(), b"written earlier");
        }
        (steps, outcome.is_ok())
    };
    let (all, finished) = steps(u32::MAX);
    assert!(finished && all > 30, "{all}");
    for stop_at in (1..all).step_by(all as usize / 20) {
        assert!(!steps(stop_at).1, "stopped at step {stop_at} of {all}");
    }
}

#[test]
fn failures_are_named() {
    let (folder, stop) = (tempfile::tempdir().unwrap(), AtomicBool::new(false));
    let mesh = flat_grid(10, 1.0);
    let run = |temporary: &Path, file: &str, wrong: bool| {
        let limits = limits(1 << 20, temporary, &stop);
        let read = |receiver: &mut dyn Receiver, _: &mut dyn FnMut(u64, u64)| {
            send(&mesh, receiver)?;
            if wrong { Err(MeshIoError::NoInput) } else { Ok(()) }
        };
        let file = folder.path().join(file);
        build_within(read, &file, &options(false), &limits, &mut |_, _| ()).unwrap_err()
    };
    let missing = folder.path().join("missing");
    let error = run(&missing, "log", false);
    assert!(matches!(error, OutOfCoreError::Temporary { .. }), "{error:?}");
    assert!(error.to_string().contains("missing"), "{error}");
    let full = Limits { expected_triangles: 1 << 50, ..limits(1 << 20, folder.path(), &stop) };
    let read = |_: &mut dyn Receiver, _: &mut dyn FnMut(u64, u64)| panic!("read, though there is no room");
    let error = build_within(read, &missing, &options(false), &full, &mut |_, _| ()).unwrap_err();
    assert!(matches!(error, OutOfCoreError::Room { triangles: 0x4_0000_0000_0000, .. }), "{error:?}");
    let error = run(folder.path(), "nowhere/log", false);
    assert!(matches!(error, OutOfCoreError::Log(_)), "{error:?}");
    let error = run(folder.path(), "log", true);
    assert!(matches!(error, OutOfCoreError::Input(MeshIoError::NoInput)), "{error:?}");
    let limits = limits(1 << 20, folder.path(), &stop);
    for (position, triangle) in [([0.0; 3], [0, 1, 101]), ([0.0, f32::NAN, 0.0], [0, 1, 2])] {
        let read = |receiver: &mut dyn Receiver, _: &mut dyn FnMut(u64, u64)| {
            send(&mesh, receiver)?;
            receiver
                .position(position.map(f64::from))
                .and_then(|()| receiver.triangle(triangle))
                .map_err(MeshIoError::Receiver)
        };
        let outcome = build_within(read, &missing, &options(false), &limits, &mut |_, _| ());
        match outcome {
            Err(OutOfCoreError::Mesh(LogError::BadPosition { vertex: 100, .. })) => {
                assert!(position[1].is_nan());
            }
            Err(OutOfCoreError::Mesh(LogError::CornerOutOfRange { vertex, vertices, .. })) => {
                assert_eq!((vertex, vertices), (101, 101));
            }
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(names(folder.path()), <[&str; 0]>::default());
}
