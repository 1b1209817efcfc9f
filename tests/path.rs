//! Walkthroughs: files, the recorded paths, and trajectories brought to meshes.

use std::path::Path as FilePath;

use foldfront::path::{Path, PathError, Pose, generate, recorded};
use foldfront::scene::{Scene, SceneKind};
use glam::{DQuat, DVec3};
use proptest::prelude::*;

const GOOD: &str = "# name walk\n# units m\n# fov 60\n# aspect 1.5\n0 1 2 3 0 0 0 1\n0.5 1 2 4 0 0 0.6 0.8\n";

fn parse(text: &str) -> Result<Path, PathError> {
    Path::parse(FilePath::new("dir/test.path"), text)
}

#[test]
fn a_path_is_read() {
    let path = parse(GOOD).unwrap();
    assert_eq!((path.name.as_str(), path.units.as_str(), path.aspect), ("walk", "m", 1.5));
    assert_eq!(path.fov_y, 60f64.to_radians());
    assert_eq!(path.frames[1].position, DVec3::new(1.0, 2.0, 4.0));
    assert_eq!(path.camera(1).orientation, DQuat::from_xyzw(0.0, 0.0, 0.6, 0.8));
    assert_eq!(parse("# fov 1.25 rad\n#aspect 2\n0 0 0 0 0 0 0 2").unwrap().fov_y, 1.25);
    assert_eq!(parse("# fov 60\n#aspect 2\n0 0 0 0 0 0 0 2").unwrap().frames[0].orientation, DQuat::IDENTITY);
    assert_eq!(parse("# fov 60\n#aspect 2\n0 0 0 0 0 0 0 2").unwrap().name, "test");
}

#[test]
fn errors_name_file_line_and_value() {
    let cases = [
        ("", "dir/test.path: there is no header line `# fov ...`"),
        ("# fov 60\n0 1 2 3 0 0 0 1", "dir/test.path: there is no header line `# aspect ...`"),
        ("# fov 60\n# aspect 1\n", "dir/test.path: there are no frames"),
        ("# fov 180", "dir/test.path:1: fov \"180\" is not above 0 and below 180 degrees"),
        ("\n# fov nan", "dir/test.path:2: fov \"nan\" is not above 0 and below 180 degrees"),
        ("# aspect inf", "dir/test.path:1: aspect \"inf\" is not a finite number above 0"),
        ("0 1 2 3 0 0 1", "dir/test.path:1: a frame has 8 columns, t x y z qx qy qz qw, not 7"),
        ("0 1 2 3 0 0 1 0 0", "dir/test.path:1: a frame has 8 columns, t x y z qx qy qz qw, not 9"),
        ("0 1 2 x 0 0 0 1", "dir/test.path:1: \"x\" is not a finite number"),
        ("0 1 NaN 3 0 0 0 1", "dir/test.path:1: \"NaN\" is not a finite number"),
        ("0 1 2 1e999 0 0 0 1", "dir/test.path:1: \"1e999\" is not a finite number"),
        ("0 1 2 3 0 0 0 0", "dir/test.path:1: the quaternion [0.0, 0.0, 0.0, 0.0] is no rotation"),
        ("0 1 2 3 0 0 0 1e200", "dir/test.path:1: the quaternion [0.0, 0.0, 0.0, 1e200] is no rotation"),
        ("1 1 2 3 0 0 0 1\n1 1 2 3 0 0 0 1", "dir/test.path:2: the time 1 is not after 1"),
    ];
    for (text, message) in cases {
        assert_eq!(parse(text).unwrap_err().to_string(), message, "{text:?}");
    }
    let missing = Path::read(FilePath::new("no/such.path")).unwrap_err();
    assert!(matches!(missing, PathError::Read { .. }) && missing.to_string().starts_with("no/such.path: "));
}

proptest! {
    #[test]
    fn what_was_written_is_read_to_the_bit(
        fov_y in 0.01..3.14,
        aspect in 0.1..10.0,
        rows in prop::collection::vec((0.001..1.0, prop::array::uniform3(-1e9..1e9), prop::array::uniform4(-1.0..1.0)), 1..20),
    ) {
        let mut time = 0.0;
        let frames = rows.into_iter().map(|(step, position, rotation)| {
            time += step;
            let orientation = DQuat::from_array(rotation).normalize();
            Pose { time, position: position.into(), orientation }
        });
        let path = Path { name: "a b".into(), units: "km".into(), fov_y, aspect, frames: frames.collect() };
        prop_assert_eq!(parse(&path.to_text()).unwrap(), path);
    }

    #[test]
    fn no_text_panics(text in "[-0-9 .e#fovnaspectr\\n]{0,200}") {
        let _ = parse(&text);
    }
}

#[test]
fn a_path_survives_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("walk.path");
    let path = parse(GOOD).unwrap();
    path.write(&file).unwrap();
    assert_eq!(Path::read(&file).unwrap(), path);
    assert!(matches!(path.write(&folder.path().join("no/walk.path")), Err(PathError::Write { .. })));
}

#[test]
fn generated_paths_are_the_recorded_ones_byte_for_byte() {
    for kind in SceneKind::ALL {
        for (path, recorded) in generate(kind, &mut |_, _| ()).iter().zip(recorded(kind).unwrap()) {
            assert!(*path == recorded, "{} is not what is recorded", path.name);
            let file = FilePath::new(env!("CARGO_MANIFEST_DIR")).join(format!("paths/{}.path", path.name));
            assert!(std::fs::read_to_string(file).unwrap() == path.to_text(), "{}", path.name);
        }
    }
}

#[test]
fn recorded_paths_move_as_they_should() {
    // The speeds of Zach & Karner (2003), Table 1.
    for (kind, rho) in SceneKind::ALL.into_iter().zip([1.0, 50.0, 1.0]) {
        let [calm, wild] = recorded(kind).unwrap().map(|path| path.summary());
        assert!((600..=900).contains(&calm.frames) && (600..=900).contains(&wild.frames));
        assert!((calm.motion[1].rho / rho - 1.0).abs() < 0.01, "{kind:?}: {calm:?}");
        assert!(calm.motion[2].omega <= 0.02 && calm.teleports == 0, "{kind:?}: {calm:?}");
        assert!(wild.motion[1].rho > 3.0 * rho && wild.motion[1].omega > 0.06, "{kind:?}: {wild:?}");
        assert!(wild.stops >= 3 && wild.teleports == 1, "{kind:?}: {wild:?}");
        let pans =
            recorded(kind).unwrap()[1].steps().filter(|step| (0.9e-5..1.1e-5).contains(&step.omega)).count();
        assert!(pans >= 60, "{kind:?}: only {pans} steps of slow panning");
    }
}

#[test]
fn recorded_cameras_stay_above_the_surface() {
    for kind in SceneKind::ALL {
        let surface = Scene::new(kind).surface(&mut |_, _| ());
        let low = if kind == SceneKind::Alps { 100.0 } else { 1.5 };
        for path in recorded(kind).unwrap() {
            for (frame, Pose { position: p, .. }) in path.frames.iter().enumerate() {
                let ground = surface.highest(p.x, p.y, surface.spacing() / 2.0);
                assert!(p.z > ground + low, "{} frame {frame}: {} above {ground}", path.name, p.z);
            }
        }
    }
}
